"""``nvscope sdo read`` and ``write``: asked of a controller on this machine, and of partners that are none."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from nvscope.cli.help import EXAMPLES
from tests.plc.parameter.peers import LOCAL, WAIT_S, Served, bound, peer, running, served, unused_port
from tests.plc.parameter.wire import BUSY, INDEX, READ, READ_REPLY, WRITE, WRITE_REPLY, heard, said
from tests.program import COMMAND
from tests.program_here import run_text

TABLE = """
"0x2000:1" = { name = "rSetpoint", type = "REAL", value = 12.5 }
"0x2001:0" = { type = "UINT", value = [1, 2, 3] }
"0x2002:0" = { type = "STRING(20)", value = "a\\u001b[31mb", access = "ro" }
"0x2003:0" = { type = "TIME", value = "T#1s500ms", busy = 2 }
"0x2004:0" = { type = "INT", value = -7, stuck = true }
"0x2005:0" = { type = "BOOL", access = "wo" }
"0x2006:0" = { type = "INT", silent = true }
"0x2007:0" = { type = "INT", fault = "ODErrorReplyCPUStopped" }
"0x2008:0" = { type = "INT", duplicate = true, delay = "20ms" }
"0x2009:0" = { type = "INT", wrong_counter = true }
"""
PROJECT = """
[nodes]
"127.0.0.1" = { name = "press" }
[parameters]
"press/0x2000:1" = { name = "rSetpoint", type = "REAL" }
"0x2001:0" = { name = "aLimits", type = "UINT" }
"0x2002:0" = { name = "sRecipe", type = "STRING(20)" }
"10.0.0.1/0x2003:0" = { name = "tElsewhere", type = "TIME" }
"0x3000:0" = { name = "twice" }
"0x3000:1" = { name = "twice" }
"""


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, TABLE) as one:
        yield one


@pytest.fixture
def here(tmp_path: Path) -> Path:
    (tmp_path / "nvscope.toml").write_text(PROJECT, encoding="utf-8")
    return tmp_path


LONG = "--timeout", "20s"


def sdo(verb: str, *words: str, port: int, timeout: str = "20s") -> subprocess.CompletedProcess[str]:
    own = () if "--timeout" in words else ("--timeout", timeout)
    return run_text("sdo", verb, LOCAL, *words, "--port", str(port), *own, environment={"COLUMNS": "200"})


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("0x2000 1 --type REAL", "0x2000:1 = 12.5   REAL, 4 bytes 00 00 48 41, after "),
        ("8192 0x1 --type real", "0x2000:1 = 12.5   REAL"),
        ("0x2000:1 --type REAL", "0x2000:1 = 12.5   REAL"),
        ("16#2000 1", "0x2000:1 = 00 00 48 41   4 bytes, after "),
        ("0x2001 0 --items 3", "0x2001:0 = 01 00 02 00 03 00   6 bytes, 3 elements, after "),
        ("0x2002 0 --type STRING(20)", "0x2002:0 = 'a\\x1b[31mb'   STRING(20), 21 bytes 61 1b 5b 33 31 6d 62 00 …, "),
        ("0x2003 0 --type TIME", "0x2003:0 = T#1s500ms   TIME"),
        ("0x2008 0 --type INT", "0x2008:0 = 0   INT"),
    ],
)
def test_a_value_is_read(controller: Served, words: str, told: str) -> None:
    done = sdo("read", *words.split(), port=controller.port)
    assert (done.returncode, done.stdout[: len(told)]) == (0, told), done.stderr
    assert done.stdout.count("\n") == 1


def test_the_elements_of_an_array_are_read(controller: Served) -> None:
    done = sdo("read", "0x2001", "0", "--type", "UINT", "--items", "3", port=controller.port)
    first, *elements = done.stdout.splitlines()
    assert first.startswith("0x2001:0   3 × UINT, 6 bytes 01 00 02 00 03 00, after ")
    assert elements == ["  [0] = 1", "  [1] = 2", "  [2] = 3"]


def test_busy_is_told_and_passes(controller: Served) -> None:
    done = sdo("read", "0x2003", "0", "--type", "TIME", port=controller.port, timeout="1s")
    assert done.stderr == "nvscope: ODReadRequest was sent 3 times: 2 times it was busy.\n"


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ("0x2007 0 --timeout 20s", 1, "0x2007:0 is not read: ODErrorReplyCPUStopped\n  check its run/stop switch"),
        ("0x3000 0 --timeout 20s", 1, "0x3000:0 is not read: ODErrorReplyIdx\n  check the Index"),
        ("0x2000 9 --timeout 20s", 1, "0x2000:9 is not read: ODErrorReplyIdx"),
        ("0x2005 0 --timeout 20s", 1, "0x2005:0 is not read: ODErrorReplyAccess"),
        ("0x2001 0 --timeout 20s", 1, "0x2001:0 is not read: ODErrorReplyItems"),
        ("0x2006 0 --timeout 20ms", 3, "0x2006:0: no answer\n  check whether its program runs"),
        (
            "0x2009 0 --timeout 1s",
            3,
            "no answer; what came was no answer: 1 with another Index, SubIndex or Counter\n"
            "  it answers, and not to this request: ",
        ),
        (
            "0x2000 1 --type UINT --timeout 20s",
            3,
            "0x2000:1 has 4 bytes in 1 element there, which is no UINT\n  name its type",
        ),
    ],
)
def test_what_is_not_read_is_told(controller: Served, words: str, code: int, told: str) -> None:
    done = sdo("read", *words.split(), port=controller.port)
    assert (done.returncode, told in done.stderr) == (code, True), done.stderr
    assert done.stderr.startswith(f"nvscope: {LOCAL}:{controller.port}: ")
    assert done.stdout.startswith("0x2000:1 = 00 00 48 41" if "UINT" in words else "")
    assert bool(done.stdout) == ("UINT" in words)


def test_busy_to_the_end_is_told() -> None:
    with peer(lambda came, _: [said(BUSY, *heard(came)[1:4])]) as one:
        done = sdo("read", "0x2000", "1", port=one.port, timeout="500ms")
    assert (done.returncode, done.stdout) == (3, "")
    assert "0x2000:1 is not read: ODStateBusy until the end, asked " in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell")
def test_nobody_there_is_told_at_once() -> None:
    done = sdo("read", "0x2000", "1", port=unused_port())
    assert (done.returncode, done.stdout) == (5, "")
    assert "0x2000:1 is not read: port unreachable\n  nothing listens on that port there: check" in done.stderr


@pytest.mark.parametrize(
    "payload", [b"garbage", bytes(60_000), said(0, 7, data=bytes(256)), said(READ_REPLY, counter=1)]
)
def test_what_is_no_answer_is_told(payload: bytes) -> None:
    with peer(lambda came, _: [payload, payload]) as one:
        done = sdo("read", "0x2000", "1", port=one.port, timeout="1s")
    assert (done.returncode, "no answer; what came was no answer: 2 " in done.stderr) == (3, True), done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="all of 127.0.0.0/8 is this machine")
def test_somebody_else_who_answers_is_told() -> None:
    with bound("127.0.0.9") as other, peer(lambda came, _: [said(READ_REPLY, *heard(came)[1:4])], other) as one:
        done = sdo("read", "0x2000", "1", port=one.port, timeout="50ms")
    assert done.returncode == 3
    assert (
        "1 from another address (127.0.0.9)\n  another node answered: perhaps the controller has several" in done.stderr
    )


def test_names_and_types_come_from_the_project(controller: Served, here: Path) -> None:
    words = "--port", str(controller.port)
    done = run_text("sdo", "read", "Press", "RSETPOINT", *words, cwd=here)
    assert done.stdout.startswith("rSetpoint (0x2000:1) = 12.5   REAL, "), done.stderr
    done = run_text("sdo", "read", "press", "0x2000", "1", *words, cwd=here)
    assert done.stdout.startswith("rSetpoint (0x2000:1) = 12.5   REAL, "), done.stderr
    done = run_text("sdo", "write", "press", "aLimits", "4", "5", "6", "--yes", *words, cwd=here)
    assert done.stdout.startswith("aLimits (0x2001:0): [1, 2, 3] → [4, 5, 6]   UINT, "), done.stderr


@pytest.mark.parametrize(
    ("verb", "words", "told"),
    [
        ("read", "press rSetpiont", "no parameter of 127.0.0.1 is called 'rSetpiont'\n  The nearest known"),
        ("read", "press tElsewhere", "no parameter of 127.0.0.1 is called"),
        ("read", "press twice", "several parameters are called 'twice'\n  name one of them: 0x3000 0, 0x3000 1"),
        ("read", "nobody rSetpoint", "nobody: expected an IP address"),
        ("read", "press 0x2000", "expected INDEX and SUBINDEX from 0 to 65535"),
        ("read", "press 0x12000 1", "expected INDEX and SUBINDEX from 0 to 65535"),
        ("read", "press 0x2000 65536", "expected INDEX and SUBINDEX"),
        ("read", "press 0x2000 1 2", "2 is too much"),
        ("read", "press 0x2000 1 --type POINTER", "--type POINTER: no type"),
        ("read", "press 0x2000 1 --timeout 0s", "--timeout 0s: must be more than 0"),
        ("read", "press 0x2000 1 --timeout 1h", "--timeout 1h: no more than ten minutes"),
        ("read", "press 0x2000 1 --retries 101", "--retries"),
        ("read", "press 0x2000 1 --port 0", "--port"),
        ("read", "192.0.2.1 0x2000 1", "192.0.2.1 is neither this machine nor in a private network"),
        ("read", "239.1.1.1 0x2000 1 --allow-network", "239.1.1.1 is no node"),
        ("write", "press rSetpoint --yes", "a value is missing"),
        ("write", "press 0x4000 1 7 --yes", "the type of the parameter is not known"),
        ("write", "press rSetpoint seven --yes", "'seven' is no REAL"),
        ("write", "press 0x4000 1 70000 --type UINT --yes", "70000 is out of the range of UINT: 0 to 65535"),
        ("write", "press sRecipe aaaaaaaaaaaaaaaaaaaaa --yes", "21 characters, a STRING(20) has room for 20"),
        ("write", "press rSetpoint 7 --yse", "--yse is no option"),
        ("write", "press rSetpoint 7", "nobody can be asked: there is no terminal"),
        ("write", "192.0.2.1 rSetpoint 7 --type REAL --yes", "no parameter of 192.0.2.1 is called"),
        ("write", "192.0.2.1 0x2000 1 7 --type REAL --yes", "is neither this machine nor in a private network"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_told_before_anything_is_sent(here: Path, verb: str, words: str, told: str) -> None:
    done = run_text("sdo", verb, *words.split(), cwd=here)
    assert (done.returncode, done.stdout, told in done.stderr) == (2, "", True), done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("0x2000 1 -13.25 --type REAL", "0x2000:1: 12.5 → -13.25   REAL, "),
        ("0x2001:0 4 0x5 65535 --type UINT", "0x2001:0: [1, 2, 3] → [4, 5, 65535]   UINT, "),
        ("0x2003 0 T#2s --type TIME", "0x2003:0: T#1s500ms → T#2s   TIME, "),
        ("0x2008 0 -1 --type INT", "0x2008:0: 0 → -1   INT, "),
    ],
)
def test_a_value_is_written_and_read_back(controller: Served, words: str, told: str) -> None:
    done = sdo("write", *words.split(), "--yes", port=controller.port)
    assert (done.returncode, done.stdout[: len(told)]) == (0, told), done.stderr
    assert done.stdout.endswith(" to write, read back\n")
    assert [one.request.service for one in controller.handled][-3:] == [READ, WRITE, READ]
    assert controller.handled[-1].before == controller.handled[-2].request.data


@pytest.mark.parametrize(
    ("words", "code", "told", "sent"),
    [
        ("0x2002 0 abc --type STRING(20)", 1, "0x2002:0 is not written: ODErrorReplyAccess", [READ, WRITE]),
        ("0x2007 0 1 --type INT", 1, "0x2007:0 is not read: ODErrorReplyCPUStopped", [READ]),
        ("0x2000 1 7 --type UINT", 3, "which is no UINT of 2 bytes in 1 element; nothing was written", [READ]),
        ("0x2001 0 7 8 --type UINT", 1, "0x2001:0 is not read: ODErrorReplyItems", [READ]),
        ("0x2006 0 7 --type INT --timeout 20ms", 3, "0x2006:0: no answer; nothing was written", [READ]),
    ],
)
def test_what_is_not_written_is_told(controller: Served, words: str, code: int, told: str, sent: list[int]) -> None:
    done = sdo("write", *words.split(), "--yes", port=controller.port)
    assert (done.returncode, done.stdout, told in done.stderr) == (code, "", True), done.stderr
    assert [one.request.service for one in controller.handled] == sent


def test_what_is_read_back_otherwise_is_told_loudly(controller: Served) -> None:
    done = sdo("write", "0x2004", "0", "8", "--type", "INT", "--yes", port=controller.port)
    assert done.returncode == 1
    told = "✗ 0x2004:0: -7 → 8 was written and confirmed, but -7 is what it holds   INT, "
    assert done.stdout.startswith(told)
    assert "0x2004:0 does not hold what was written" in done.stderr


def test_what_is_behind_the_end_of_a_text_is_not_compared() -> None:
    def answering(came: bytes, number: int) -> list[bytes]:
        asked = heard(came)
        if asked.service == WRITE:
            return [said(WRITE_REPLY, *asked[1:5])]
        return [said(READ_REPLY, *asked[1:5], b"before" if number == 0 else b"ab\0ore")]

    with peer(answering) as one:
        done = sdo("write", "1", "2", "ab", "--type", "STRING(5)", "--yes", port=one.port)
    assert (done.returncode, done.stdout[:25]) == (0, "0x0001:2: 'before' → 'ab'"), done.stderr


def test_what_can_only_be_written_is(controller: Served) -> None:
    done = sdo("write", "0x2005", "0", "TRUE", "--type", "BOOL", "--yes", port=controller.port)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("0x2005:0: not to be read → TRUE   BOOL, ")
    assert done.stdout.endswith(", not read back\n")


def test_a_write_that_is_not_confirmed_may_have_been_done_or_not() -> None:
    with peer(
        lambda came, _: [said(READ_REPLY, *heard(came)[1:5], b"\1\0")] if heard(came).service == READ else []
    ) as one:
        done = sdo("write", "0x2000", "1", "7", "--type", "UINT", "--yes", port=one.port, timeout="1s")
    assert (done.returncode, done.stdout) == (3, "")
    assert "0x2000:1: no answer; whether it was written is not known" in done.stderr


def test_what_cannot_be_read_back_is_told() -> None:
    def answering(came: bytes, number: int) -> list[bytes]:
        asked = heard(came)
        if asked.service == WRITE:
            return [said(WRITE_REPLY, *asked[1:5])]
        return [said(READ_REPLY, *asked[1:5], b"\1\0")] if number == 0 else []

    with peer(answering) as one:
        done = sdo("write", "0x2000", "1", "7", "--type", "UINT", "--yes", port=one.port, timeout="1s")
    assert (done.returncode, "not read back" in done.stdout) == (3, True)
    assert "0x2000:1 was written and confirmed, but could not be read back (silent)" in done.stderr


@pytest.mark.parametrize(("answer", "code", "written"), [("y", 0, True), ("n", 1, False), ("", 1, False)])
def test_a_person_is_asked(controller: Served, answer: str, code: int, written: bool) -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    words = "sdo", "write", LOCAL, "0x2000", "1", "7", "--type", "REAL", "--port", str(controller.port), *LONG
    with subprocess.Popen([*COMMAND, *words], stdin=theirs, stderr=theirs, stdout=subprocess.PIPE, text=True) as asking:
        os.close(theirs)
        shown = b""
        try:
            while b"[y/N]" not in shown:
                shown += os.read(ours, 1_000)
            asked_before = [one.request.service for one in controller.handled]
            os.write(ours, f"{answer}\n".encode())
            out, _ = asking.communicate(timeout=20)
        finally:
            asking.kill()
            os.close(ours)
    assert asked_before == [READ]
    assert f"0x2000:1 of {LOCAL}:{controller.port} is 12.5. Write 7? [y/N] " in " ".join(shown.decode().split()) + " "
    assert (asking.returncode, out[:18] == "0x2000:1: 12.5 → 7") == (code, written)
    assert (WRITE in [one.request.service for one in controller.handled]) == written


def test_a_write_that_is_broken_off_may_have_been_done() -> None:
    asking: list[subprocess.Popen[str]] = []

    def answering(came: bytes, _: int) -> list[bytes]:
        asked = heard(came)
        if asked.service == READ:
            return [said(READ_REPLY, *asked[1:5], bytes(4))]
        asking[0].send_signal(signal.SIGINT)
        return []

    with peer(answering) as one:
        words = "sdo", "write", LOCAL, "0x2000", "1", "7", "--type", "REAL", "--yes", "--port", str(one.port), *LONG
        asking.append(subprocess.Popen([*COMMAND, *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        told = asking[0].communicate(timeout=WAIT_S)
    assert (asking[0].returncode, *told) == (130, "", "nvscope: broken off: it may have been written.\n")


def test_programs_get_all_of_it_as_json(controller: Served, here: Path) -> None:
    words = "--json", "--yes", "--port", str(controller.port)
    done = run_text("sdo", "write", "press", "rSetpoint", "0.5", *words, cwd=here)
    told: dict[str, Any] = json.loads(done.stdout)
    assert {key: told[key] for key in ("verb", "outcome", "partner", "partner_name", "index", "name", "type")} == {
        "verb": "write", "outcome": "written", "partner": LOCAL, "partner_name": "press", "index": 0x2000,
        "name": "rSetpoint", "type": "REAL",
    }  # fmt: skip
    assert told["before"] == {
        "items": 1,
        "bytes": "00004841",
        "elements": [{"name": None, "value": 12.5, "text": "12.5"}],
    }
    assert told["value"] == told["wanted"] == {
        "items": 1, "bytes": "0000003f", "elements": [{"name": None, "value": 0.5, "text": "0.5"}],
    }  # fmt: skip
    requests = [(one["request"], one["answer"]) for one in told["exchanges"]]
    assert requests == [
        ("ODReadRequest", "ODReadRequestReply"), ("ODWriteRequest", "ODWriteRequestReply"),
        ("ODReadRequest", "ODReadRequestReply"),
    ]  # fmt: skip
    done = run_text("sdo", "read", LOCAL, "0x3000", "7", "--json", "--port", str(controller.port), cwd=here)
    told = json.loads(done.stdout)
    assert (done.returncode, told["outcome"], told["value"]) == (1, "refused", None)
    assert told["exchanges"][0]["answer"] == "ODErrorReplyIdx"


def test_an_answer_cannot_write_to_the_terminal() -> None:
    text = "\x1b]0;owned\x07\r\n\u202e".encode("utf-16-le")
    with peer(lambda came, _: [said(READ_REPLY, *heard(came)[1:5], text.ljust(82, b"\0"))]) as one:
        done = sdo("read", "1", "2", "--type", "WSTRING(40)", port=one.port)
    assert done.returncode == 0
    assert all(character.isprintable() for character in done.stdout.removesuffix("\n"))


EXAMPLE_LINES = [line for verb in ("sdo read", "sdo write") for line, _ in EXAMPLES[verb]]


@pytest.mark.parametrize("line", EXAMPLE_LINES)
def test_the_examples_of_the_help_do_what_they_say(tmp_path: Path, line: str) -> None:
    """They do when a controller on this machine is asked, and nobody is to be asked before it is written."""
    words = line.replace("192.168.1.20", LOCAL).split()[1:]
    (tmp_path / "nvscope.toml").write_text(PROJECT, encoding="utf-8")
    with served(tmp_path, TABLE) as one:
        yes = ["--yes"] if words[1] == "write" and "--yes" not in words else []
        done = run_text(*words, *yes, *LONG, "--port", str(one.port), cwd=tmp_path)
    assert (done.returncode, bool(done.stdout)) == (0, True), done.stderr


@pytest.mark.parametrize("kind", [(), ("--type", "BOOL")])
def test_a_partner_that_sends_too_much_does_not_fill_the_terminal(kind: tuple[str, ...]) -> None:
    with peer(lambda came, _: [said(READ_REPLY, *heard(came)[1:4], 60_000, bytes(60_000))]) as one:
        done = sdo("read", "1", "2", *kind, port=one.port)
        whole = sdo("read", "1", "2", *kind, "--json", port=one.port)
    assert (done.returncode, len(done.stdout) < 100_000) == (0, True)
    assert ("and 55904 more elements, which --json has" if kind else "00 …   60000 bytes, ") in done.stdout
    assert len(json.loads(whole.stdout)["value"]["bytes"]) == 120_000


def test_the_helper_that_runs_partners_tells_what_they_raise() -> None:
    def fails(is_stopped: object) -> None:
        raise KeyError("x")

    with pytest.raises(KeyError), running(fails):
        pass


def test_the_error_index_is_that_of_the_document() -> None:
    with peer(lambda came, _: [said(INDEX, *heard(came)[1:4])]) as one:
        assert "ODErrorReplyIdx" in sdo("read", "1", "2", port=one.port).stderr
