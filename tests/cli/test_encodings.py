"""Outputs in encodings that have no marks: nothing but what their readers expect, and JSON that stays JSON."""

from __future__ import annotations

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

from nvscope.cli.encodings import MARKS
from tests.laws import some
from tests.program import COMMAND, run

ROOT = Path(__file__).parents[2]
PLANT, PEERS = ROOT / "captures" / "plant.pcapng.gz", ROOT / "captures" / "peers"
PRESS = ROOT / "captures" / "can" / "press.log"

VERBS: dict[str, list[str]] = {
    "report": ["report", str(PLANT)],
    "report -v": ["report", str(PLANT), "-v"],
    "report --timing": ["report", str(PLANT), "--timing"],
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


STREAMS = ("report", "help", "error")
"""Verbs that write to stdout, to stdout by another way, and to stderr."""

PLAIN = {"COLUMNS": "100", "TZ": "UTC"}


@cache
def told_in(encoding: str, verb: str) -> subprocess.CompletedProcess[bytes]:
    return run(*VERBS[verb], environment=PLAIN, encoding=encoding)


def told_where(verb: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run a verb where the environment tells the interpreter at its start what encoding its streams have."""
    known = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT), **PLAIN, **environment}
    return subprocess.run([*COMMAND, *VERBS[verb]], capture_output=True, check=False, env=known, timeout=60)


@pytest.mark.parametrize(
    ("where", "verb"),
    some([*((where, verb) for where in ("ascii", "C") for verb in VERBS), *(("POSIX", verb) for verb in STREAMS)]),
)
def test_ascii_outputs_are_ascii_and_have_the_same_shape(where: str, verb: str) -> None:
    whole = told_in("utf-8", verb)
    if where == "ascii":
        plain = told_in("ascii", verb)
    else:
        plain = told_where(verb, **{"LC_ALL" if where == "C" else "LANG": where})
    assert plain.returncode == whole.returncode
    for told, marked in ((plain.stdout, whole.stdout), (plain.stderr, whole.stderr)):
        text = told.decode("ascii")
        assert "\\u" not in text
        # Every mark has a form of its own width: what stood below each other still does.
        expected = "".join(MARKS.get(character, character) for character in marked.decode())
        assert text == expected


@pytest.mark.parametrize("verb", VERBS)
def test_what_windows_can_write_it_writes(verb: str) -> None:
    whole, narrow = told_in("utf-8", verb), told_in("cp1252", verb)
    text = narrow.stdout.decode("cp1252")
    assert "\\u" not in text
    assert len(text) == len(whole.stdout.decode())
    assert not set("✗✓●→─") & set(text)


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "utf-8"])
def test_json_is_json_in_any_encoding(encoding: str, tmp_path: Path) -> None:
    shutil.copy(PEERS / "peers.pcap", tmp_path / "größe→😀.pcap")
    for words in (["report", "--json"], ["packets", "-T", "json", "-c", "3"], ["packets", "-T", "ndjson", "-c", "1"]):
        done = run(*words, tmp_path / "größe→😀.pcap", environment=PLAIN, encoding=encoding)
        assert done.returncode == 0, done.stderr
        told = done.stdout.decode("utf-8" if encoding == "utf-8" else "ascii")
        document = json.loads(told)
        if words[0] == "report" and encoding == "utf-8":
            assert "größe→😀" in document["capture"]["sources"][0]["path"]
        elif words[0] == "report":
            assert "größe" in document["capture"]["sources"][0]["path"]
            assert "😀" in document["capture"]["sources"][0]["path"]
