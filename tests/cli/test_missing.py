"""What is defined and was not captured, and files that are not there, as ``vars`` and ``packets`` tell them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.test_vars import CAPTURES, PEERS, nvscope
from tests.definition.test_lint import can, gvl

GENUINE = CAPTURES / "datalogger" / "genuine-5min.db"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("vars",), True),
        (("vars", "-Y", "nv.index == 1"), True),
        (("vars", "--history", "run"), True),
        (("vars", "--list", "batch"), False),
        (("vars", "--history", "run", "--list", "batch"), False),
        (("packets", "-V"), True),
        (("packets", "-V", "-c", "2"), False),  # what comes behind them was not read
    ],
)
def test_a_definition_that_matches_nothing_says_so(words: tuple[str, ...], told: bool, tmp_path: Path) -> None:
    for name, text in (("idle.gvl", gvl(ListIdentifier="99")), ("bus.gvl", can(ListIdentifier="512"))):
        (tmp_path / name).write_text(text, encoding="utf-8")
    files = (str(PEERS / "batch.gvl"), str(tmp_path / "idle.gvl"), str(tmp_path / "bus.gvl"))
    verb, *others = words
    done = nvscope(verb, str(PEERS / "peers.pcap"), *(word for file in files for word in ("--gvl", file)), *others)
    assert done.returncode == 0
    sentence = "nvscope: idle (udp/1202/99) is defined, but not one telegram of it was seen.\n"
    # Nobody captured a bus.
    assert done.stderr == (sentence if told else "")


@pytest.mark.parametrize("words", [("vars",), ("report", "--all")])
@pytest.mark.parametrize("beside", [False, True])
def test_who_logs_values_listens_to_no_list(words: tuple[str, ...], beside: bool, tmp_path: Path) -> None:
    (tmp_path / "idle.gvl").write_text(gvl(ListIdentifier="99"), encoding="utf-8")
    sources = [GENUINE, PEERS / "peers.pcap"] if beside else [GENUINE]
    done = nvscope(words[0], *map(str, sources), "--gvl", str(tmp_path / "idle.gvl"), *words[1:])
    told = done.stdout + done.stderr
    assert ("not one telegram of it was seen" in told) is beside
    assert ("was never seen" in told) is beside


@pytest.mark.parametrize("others", [(), ("--history", "x"), ("--at", "1s")])
def test_a_file_that_is_not_there_is_told_as_by_other_verbs(others: tuple[str, ...], tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    for missing in (str(tmp_path / "nix.gvl"), str(empty)):
        wanted = nvscope("report", str(PEERS / "peers.pcap"), missing)
        done = nvscope("vars", str(PEERS / "peers.pcap"), missing, *others)
        assert (done.returncode, done.stderr) == (wanted.returncode, wanted.stderr)
        assert missing in done.stderr
    assert "no definition is given" in nvscope("vars", str(PEERS / "peers.pcap"), *others).stderr
