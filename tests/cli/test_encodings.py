"""Outputs in encodings that have no marks: nothing but what their readers expect, and JSON that stays JSON."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from nvscope.cli.encodings import MARKS
from tests.program import COMMAND

ROOT = Path(__file__).parents[2]
PLANT, PEERS = ROOT / "captures" / "plant.pcapng.gz", ROOT / "captures" / "peers"
PRESS = ROOT / "captures" / "can" / "press.log"

VERBS: dict[str, list[str]] = {
    "report": ["report", str(PLANT)],
    "report -v": ["report", str(PLANT), "-v"],
    "report of CAN": ["report", str(PRESS), "-v"],
    "report --md": ["report", str(PLANT), "--md"],
    "packets": ["packets", str(PLANT), "-c", "30"],
    "packets -V": ["packets", str(PLANT), "-c", "5", "-V"],
    "vars": ["vars", str(PEERS / "peers.pcap"), str(PEERS / "axis.gvl"), str(PEERS / "axis_types.st")],
    "history": ["vars", str(PEERS / "peers.pcap"), str(PEERS / "batch.gvl"), "--history", "speed"],
    "infer": ["vars", str(PEERS / "peers.pcap"), "--infer"],
    "layout": ["gvl", "layout", str(PEERS)],
    "explain": ["explain", "NV301"],
    "overview": ["explain"],
    "keys": ["keys"],
    "help": ["report", "--help"],
    "error": ["report", "missing.pcap"],
}


def run(words: list[str], **environment: str) -> subprocess.CompletedProcess[bytes]:
    plain = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT), "COLUMNS": "100", "TZ": "UTC"}
    return subprocess.run([*COMMAND, *words], capture_output=True, check=False, env=plain | environment, timeout=60)


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize(
    "environment", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C"}, {"LANG": "POSIX"}], ids=["ascii", "C", "POSIX"]
)
def test_ascii_outputs_are_ascii_and_have_the_same_shape(verb: str, environment: dict[str, str]) -> None:
    whole, plain = run(VERBS[verb], PYTHONIOENCODING="utf-8"), run(VERBS[verb], **environment)
    assert plain.returncode == whole.returncode
    for told, marked in ((plain.stdout, whole.stdout), (plain.stderr, whole.stderr)):
        text = told.decode("ascii")
        assert "\\u" not in text
        # Every mark has a form of its own width: what stood below each other still does.
        expected = "".join(MARKS.get(character, character) for character in marked.decode())
        assert text == expected


@pytest.mark.parametrize("verb", VERBS)
def test_what_windows_can_write_it_writes(verb: str) -> None:
    whole, narrow = run(VERBS[verb], PYTHONIOENCODING="utf-8"), run(VERBS[verb], PYTHONIOENCODING="cp1252")
    text = narrow.stdout.decode("cp1252")
    assert "\\u" not in text
    assert len(text) == len(whole.stdout.decode())
    assert not set("✗✓●→─") & set(text)


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "utf-8"])
def test_json_is_json_in_any_encoding(encoding: str, tmp_path: Path) -> None:
    shutil.copy(PEERS / "peers.pcap", tmp_path / "größe→😀.pcap")
    for words in (["report", "--json"], ["packets", "-T", "json", "-c", "3"], ["packets", "-T", "ndjson", "-c", "1"]):
        done = run([*words, str(tmp_path / "größe→😀.pcap")], PYTHONIOENCODING=encoding, PYTHONUTF8="1")
        assert done.returncode == 0, done.stderr
        told = done.stdout.decode("utf-8" if encoding == "utf-8" else "ascii")
        document = json.loads(told)
        if words[0] == "report" and encoding == "utf-8":
            assert "größe→😀" in document["capture"]["sources"][0]["path"]
        elif words[0] == "report":
            assert "größe" in document["capture"]["sources"][0]["path"]
            assert "😀" in document["capture"]["sources"][0]["path"]
