"""``nvscope visu read``, ``write`` and ``list``: asked of a served controller, and of servers that are none."""

from __future__ import annotations

import json
import os
import shlex
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from nvscope.cli.help import EXAMPLES
from nvscope.plc.visu.http_request import HttpRequest
from tests.plc.parameter.peers import LOCAL, WAIT_S
from tests.plc.visu.peers import Served, peer, replied, served, unused_port
from tests.program import COMMAND
from tests.program_here import run_text

TABLE = """
"PLC_PRG.rSpeed" = { address = "4,100,4,REAL", value = 12.5 }
"PLC_PRG.xRun" = { address = "4,104,1,BOOL", value = true }
"PLC_PRG.sText" = { address = "4,106,6,STRING", value = "a\\u009bb" }
"PLC_PRG.sOther" = { address = "4,112,6,STRING", value = "a|b" }
"PLC_PRG.tRamp" = { address = "4,118,4,TIME", value = "T#1s500ms", access = "ro" }
"PLC_PRG.nStuck" = { address = "4,122,2,INT", value = -7, stuck = true }
"PLC_PRG.nMore" = { address = "4,124,2,INT", surplus = 2 }
"PLC_PRG.nBad" = { address = "4,126,2,INT", status = 503 }
"PLC_PRG.nWo" = { address = "4,128,2,INT", access = "wo" }
"PLC_PRG.nDrop" = { address = "4,130,2,INT", drop = true }
"PLC_PRG.nSilent" = { address = "4,132,2,INT", silent = true }
".OUT0" = { address = "2,48,0,BOOL" }
".CurrentPassword" = { address = "4,481,41,STRING", value = "geheim" }
"""
READ, WRITE = False, True
MOVED = b"HTTP/1.0 302 Found\r\nLocation: /login\r\n\r\n"


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, TABLE) as one:
        yield one


def visu(verb: str, url: str, *words: str, timeout: str = "20s") -> subprocess.CompletedProcess[str]:
    own = () if "--timeout" in words else ("--timeout", timeout)
    return run_text("visu", verb, url, *words, *own, environment={"COLUMNS": "200"})


def posted(one: Served) -> list[bool]:
    """Return of each request whether it wrote."""
    return [handled.writes for handled in one.posted]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("plc_prg.RSPEED", "PLC_PRG.rSpeed = 12.5   REAL, after "),
        ("4,100,4,6", "4,100,4,6 = 12.5   REAL, after "),
        ("4,100,4,real", "4,100,4,6 = 12.5   REAL, after "),
        ("out0", ".OUT0 = FALSE   BOOL, after "),
        ("PLC_PRG.sText", "PLC_PRG.sText = 'a\\x9bb'   STRING(5), after "),
        ("4,106,6,8", "PLC_PRG.sText = 'a\\x9bb'   STRING(5), after "),
        ("PLC_PRG.sOther", "PLC_PRG.sOther = 'a|b'   STRING(5), after "),
        ("PLC_PRG.tRamp", "PLC_PRG.tRamp = T#1s500ms   TIME, after "),
    ],
)
def test_a_value_is_read(controller: Served, name: str, told: str) -> None:
    done = visu("read", controller.url, name)
    assert (done.returncode, done.stdout[: len(told)], done.stderr) == (0, told, "")


def test_several_are_a_table_and_the_page_is_found(controller: Served) -> None:
    done = visu("read", f"{LOCAL}:{controller.port}", "PLC_PRG.rSpeed", ".OUT0", "PLC_PRG.sText")
    assert (done.returncode, done.stderr) == (0, "")
    assert [line.split() for line in done.stdout.splitlines()] == [
        ["variable", "value", "type", "address"],
        ["PLC_PRG.rSpeed", "12.5", "REAL", "4,100,4,6"],
        [".OUT0", "FALSE", "BOOL", "2,48,0,0"],
        ["PLC_PRG.sText", "'a\\x9bb'", "STRING(5)", "4,106,6,8"],
    ]


def test_more_than_a_request_may_ask_for_are_several_requests(tmp_path: Path) -> None:
    rows = "\n".join(f'"v{number}" = {{ type = "INT", value = {number} }}' for number in range(450))
    with served(tmp_path, rows) as one:
        done = visu("read", one.url, *(f"v{number}" for number in range(450)), "--json")
        assert [len(handled.touched) for handled in one.posted] == [200, 200, 50]
    assert [row["value"]["value"] for row in json.loads(done.stdout)["variables"]] == list(range(450))


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ("PLC_PRG.nMore", 3, "3 values for 1 variable: what belongs to which is not certain"),
        ("PLC_PRG.sText PLC_PRG.sOther", 3, "3 values for 2 variables: a text has a | in it"),
        ("PLC_PRG.nBad", 1, "PLC_PRG.nBad is not read: HTTP status 503"),
        ("PLC_PRG.nWo", 3, "the controller cannot read PLC_PRG.nWo (???)"),
        ("PLC_PRG.nDrop", 3, "PLC_PRG.nDrop is not read: the connection ended before the answer"),
        ("PLC_PRG.nSilent --timeout 300ms", 3, "PLC_PRG.nSilent is not read: no answer in time"),
    ],
)
def test_what_is_not_read_is_told(controller: Served, words: str, code: int, told: str) -> None:
    done = visu("read", controller.url, *words.split())
    assert (done.returncode, told in done.stderr) == (code, True), done.stderr
    assert done.stderr.startswith(f"nvscope: {LOCAL}:{controller.port}: ")


def test_a_value_that_is_none_of_its_type_is_told() -> None:
    with peer(replied(b"|\x1b[31mred|7|")) as one:
        done = visu("read", one.url, "4,0,2,1", "4,2,2,1")
        as_json = visu("read", one.url, "4,0,2,1", "4,2,2,1", "--json")
    assert (done.returncode, as_json.returncode) == (3, 3)
    assert r"the controller answers '\x1b[31mred' for 4,0,2,1, which is no INT" in " ".join(done.stderr.split())
    assert json.loads(as_json.stdout)["outcome"] == "misfit"


def test_passwords_are_hidden_unless_somebody_wants_them(controller: Served) -> None:
    done = visu("read", controller.url, ".CurrentPassword")
    assert (done.returncode, "geheim" in done.stdout + done.stderr) == (0, False)
    assert done.stdout.startswith(".CurrentPassword = (hidden)   STRING(40)")
    # Under another type, the same bytes are no less secret; and a text without a name may be one.
    for place in ("4,481,4,5", "4,480,2,3", "4,999,41,8"):
        found = visu("read", controller.url, place, ".OUT0", "PLC_PRG.sText")
        assert "geheim" not in found.stdout + found.stderr
    done = visu("read", controller.url, ".CurrentPassword", "--show-secrets")
    assert ("'geheim'" in done.stdout, "passwords are shown" in done.stderr) == (True, True)
    done = visu("write", controller.url, ".CurrentPassword", "neues", "--yes")
    assert done.stdout.startswith(".CurrentPassword: (hidden) → (hidden)   STRING(40), ")
    done = visu("write", controller.url, ".CurrentPassword", "anderes", "--yes", "--json")
    assert (done.returncode, {"neues", "anderes"} & {*done.stdout.split('"')}) == (0, set())


def test_variables_are_listed(controller: Served) -> None:
    done = visu("list", controller.url)
    rows = [line.split() for line in done.stdout.splitlines()]
    assert (done.returncode, done.stderr, len(rows)) == (0, "", 14)
    assert rows[0] == ["variable", "type", "area", "offset", "size", "address"]
    assert ["PLC_PRG.rSpeed", "REAL", "global", "100", "4", "4,100,4,6"] in rows
    assert [".OUT0", "BOOL", "outputs", "48", "0", "2,48,0,0"] in rows
    assert posted(controller) == []


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("*.rspeed", ["PLC_PRG.rSpeed"]), ("OUT0 2,48,0,0 plc_prg.rSpeed", ["PLC_PRG.rSpeed", ".OUT0"]),
        ("PLC_PRG.nW?", ["PLC_PRG.nWo"]), ("4,100,4,REAL", ["PLC_PRG.rSpeed"]),
    ],
)  # fmt: skip
def test_some_variables_are_listed(controller: Served, words: str, found: list[str]) -> None:
    done = visu("list", controller.url, *words.split(), "--json")
    assert [one["name"] for one in json.loads(done.stdout)["variables"]] == found, done.stderr


@pytest.mark.parametrize(
    ("word", "told"),
    [("PLC_PRG.rSpede", "The nearest known one is"), ("x*", "is like 'x*'"), ("4,9,9,1", "is at '4,9,9,1'")],
)
def test_what_is_not_in_the_lists_is_told(controller: Served, word: str, told: str) -> None:
    done = visu("list", controller.url, ".OUT0", word)
    assert (done.returncode, done.stdout, told in done.stderr) == (2, "", True), done.stderr


def test_names_come_from_files_and_other_pages(controller: Served, tmp_path: Path) -> None:
    (tmp_path / "s.sym_xml").write_text(
        '<x><SymbolVarList><Var Type="REAL" RefId="4" Offset="100" Access="RW">mine</Var></SymbolVarList></x>'
    )
    done = visu("read", controller.url, "MINE", "--variables", str(tmp_path / "s.sym_xml"))
    assert (done.returncode, done.stdout[:11]) == (0, "mine = 12.5"), done.stderr
    assert [one.method for one in controller.controller.handled] == ["POST"]
    assert "no variable is called" in visu("read", controller.url, ".OUT0", "--page", "visu_ini.xml").stderr
    done = visu("list", controller.url, "--page", "none.xml")
    assert (done.returncode, "no variable list is beside the page: /plc/none.xml (404)" in done.stderr) == (1, True)


@pytest.mark.parametrize(
    ("verb", "words", "told"),
    [
        ("read", "URL PLC_PRG.rSpede", "The nearest known one is 'PLC_PRG.rSpeed'"),
        ("read", "URL 4,0,2,WHAT", "no type is called WHAT"),
        ("read", "https://127.0.0.1/ x", "this is TLS"),
        ("read", "192.0.2.1 x", "192.0.2.1 is neither this machine nor in a private network"),
        ("read", "URL x --timeout 1h", "no more than ten minutes"),
        ("read", "URL x --count 2", "--count is how many times"),
        ("read", "URL x --page ../a.xml", "expected the name of a file"),
        ("read", "URL x --variables none.xml", "none.xml: cannot be read"),
        ("write", "URL PLC_PRG.rSpeed seven --yes", "'seven' is no REAL: a number such as 12.5 or 1e-3\n  the type"),
        ("write", "URL PLC_PRG.sText a|b --yes", "a value cannot have '|' in it"),
        ("write", "URL PLC_PRG.sText abcdef --yes", "has room for 5"),
        ("write", "URL 4,0,1,2 256 --yes", "out of the range of BYTE"),
        ("write", "URL PLC_PRG.rSpeed 7", "nobody can be asked"),
        ("write", "URL PLC_PRG.rSpeed 7 --yse", "--yse"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_told(controller: Served, verb: str, words: str, told: str) -> None:
    done = run_text("visu", verb, *words.replace("URL", controller.url).split())
    assert (done.returncode, done.stdout, told in done.stderr) == (2, "", True), done.stderr
    assert posted(controller) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("PLC_PRG.rSpeed", "-7.25"), "PLC_PRG.rSpeed: 12.5 → -7.25   REAL, "),
        (("PLC_PRG.xRun", "FALSE"), "PLC_PRG.xRun: TRUE → FALSE   BOOL, "),
        (("PLC_PRG.sOther", "x y"), "PLC_PRG.sOther: 'a|b' → 'x y'   STRING(5), "),
        (("4,104,1,0", "0"), "4,104,1,0: TRUE → FALSE   BOOL, "),
    ],
)
def test_a_value_is_written_and_read_back(controller: Served, words: tuple[str, ...], told: str) -> None:
    done = visu("write", controller.url, *words, "--yes")
    assert (done.returncode, done.stdout[: len(told)]) == (0, told), done.stderr
    assert done.stdout.endswith(" to write, read back\n")
    assert posted(controller) == [READ, WRITE, READ]


@pytest.mark.parametrize(
    ("words", "code", "told", "sent"),
    [
        ("PLC_PRG.tRamp T#2s", 1, "PLC_PRG.tRamp is not written: the controller refuses it", [READ, WRITE]),
        ("PLC_PRG.nStuck 8", 1, "PLC_PRG.nStuck does not hold what was written", [READ, WRITE, READ]),
        ("PLC_PRG.nBad 8", 1, "PLC_PRG.nBad is not read: HTTP status 503; nothing was written", [READ]),
        ("PLC_PRG.nMore 8", 3, "not certain; nothing was written", [READ]),
        ("PLC_PRG.nDrop 8", 3, "the connection ended before the answer; nothing was written", [READ]),
    ],
)
def test_what_is_not_written_is_told(controller: Served, words: str, code: int, told: str, sent: list[bool]) -> None:
    done = visu("write", controller.url, *words.split(), "--yes")
    assert (done.returncode, told in done.stderr) == (code, True), done.stderr
    assert posted(controller) == sent


def test_what_can_only_be_written_is(controller: Served) -> None:
    done = visu("write", controller.url, "PLC_PRG.nWo", "8", "--yes")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("PLC_PRG.nWo: not to be read → 8   INT, ")


@pytest.mark.parametrize(
    ("answers", "code", "told"),
    [
        ([replied(b"|1|"), b""], 3, "whether it was written is not known"),
        ([replied(b"|1|"), replied(b"|0|"), b""], 3, "was written and confirmed, but could not be read back"),
        ([replied(b"|red|")], 3, "answers 'red' for 4,0,2,1, which is no INT; nothing was written"),
        ([replied(b"<html></html>")], 1, "what answers is no WebVisu of CoDeSys V2.3; nothing was written"),
        ([replied(b"|1|"), replied(b"OK")], 1, "is not written: the controller refuses it"),
        ([MOVED], 1, "is not read: HTTP status 302, which leads to /login; nothing was written"),
        ([replied(b"|1|"), MOVED], 1, "HTTP status 302, which leads to /login; whether it was written is not known"),
    ],
)
def test_servers_that_break_off_in_the_middle(answers: list[bytes], code: int, told: str) -> None:
    def answering(one: socket.socket, request: HttpRequest, number: int) -> None:
        one.sendall(answers[number])

    with peer(answering) as one:
        done = visu("write", one.url, "4,0,2,1", "5", "--yes")
        assert len(one.got) == len(answers)
    assert (done.returncode, told in done.stderr) == (code, True), done.stderr


@pytest.mark.parametrize(
    ("answer", "code", "told"),
    [
        (b"SSH-2.0-\x1b[31m\r\n", 3, "what answers is no HTTP"),
        (replied(b"|" * (1 << 20) + b"|"), 3, "more than 1048576 bytes came"),
        (b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 150 + b"\r\n|1|", 3, "is not read: more than 100 headers came"),
        (
            b"HTTP/1.0 302 \r\nLocation: http://192.0.2.1/\x1b]0;x\x07\r\n\r\n",
            1,
            "302, which leads to http://192.0.2.1/\\x1b]0;",
        ),
        (b"HTTP/1.0 401 \r\n\r\n", 1, "the server asks for a login"),
        (replied(b"|\x1b]0;owned\x07|"), 3, "which is no INT"),
    ],
)
def test_what_servers_say_cannot_write_to_the_terminal(answer: bytes, code: int, told: str) -> None:
    with peer(answer) as one:
        done = visu("read", one.url, "4,0,2,1")
    assert (done.returncode, told in done.stderr) == (code, True), done.stderr
    assert all(character.isprintable() or character == "\n" for character in done.stdout + done.stderr)


def test_nobody_there_and_no_page_are_told() -> None:
    done = visu("read", f"{LOCAL}:{unused_port()}", "x")
    assert (done.returncode, done.stdout, "connection refused" in done.stderr) == (5, "", True)
    with peer(replied(b"", "404 Not Found")) as one:
        done = visu("list", f"{LOCAL}:{one.port}")
        assert [request.target for request in one.got] == [
            "/plc/webvisu.htm", "/PLC/webvisu.htm", "/webvisu/webvisu.htm", "/webvisu.htm",
        ]  # fmt: skip
    assert (done.returncode, "no page is at the usual paths: /plc/webvisu.htm (404), " in done.stderr) == (1, True)


def test_nodes_have_the_names_of_the_project(controller: Served, tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text('[nodes]\n"127.0.0.1" = { name = "Press" }\n')
    done = run_text("visu", "read", f"press:{controller.port}", "PLC_PRG.nBad", cwd=tmp_path)
    assert done.stderr.startswith(f"nvscope: Press ({LOCAL}:{controller.port}): PLC_PRG.nBad is not read")


def test_it_reads_again_and_again(controller: Served) -> None:
    words = "PLC_PRG.rSpeed", "PLC_PRG.xRun", "--every", "1ms", "--count", "3"
    done = visu("read", controller.url, *words)
    assert [line.split("  ", 1)[1] for line in done.stdout.splitlines()] == [
        "PLC_PRG.rSpeed = 12.5, PLC_PRG.xRun = TRUE"
    ] * 3  # fmt: skip
    lines: list[dict[str, Any]] = list(
        map(json.loads, visu("read", controller.url, *words, "--json").stdout.splitlines())
    )
    assert [len(line["exchanges"]) for line in lines] == [4 - 1, 1, 1]
    assert sorted(line["at_ns"] for line in lines) == [line["at_ns"] for line in lines]


@pytest.mark.parametrize(("answer", "code", "written"), [("y", 0, True), ("n", 1, False), ("", 1, False)])
def test_a_person_is_asked(controller: Served, answer: str, code: int, written: bool) -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    words = "visu", "write", controller.url, "PLC_PRG.rSpeed", "7", "--timeout", "20s"
    with subprocess.Popen(
        [*COMMAND, *words], stdin=theirs, stderr=theirs, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "COLUMNS": "80"},
    ) as asking:  # fmt: skip
        os.close(theirs)
        shown = b""
        try:
            while b"[y/N]" not in shown:
                shown += os.read(ours, 1_000)
            asked_before = posted(controller)
            os.write(ours, f"{answer}\n".encode())
            out, _ = asking.communicate(timeout=WAIT_S)
        finally:
            asking.kill()
            os.close(ours)
    assert asked_before == [READ]
    question = f"PLC_PRG.rSpeed (4,100,4,6) of {LOCAL}:{controller.port} is 12.5. Write 7? [y/N]"
    assert question in " ".join(shown.decode().split())
    assert (asking.returncode, out[:24]) == (code, "PLC_PRG.rSpeed: 12.5 → 7" if written else ""), out
    assert (WRITE in posted(controller)) == written


def test_a_write_that_is_broken_off_may_have_been_done() -> None:
    asking: list[subprocess.Popen[str]] = []

    def answering(one: socket.socket, request: HttpRequest, number: int) -> None:
        if number == 0:
            one.sendall(replied(b"|1|"))
            return
        asking[0].send_signal(signal.SIGINT)
        one.recv(1)  # up to the end

    with peer(answering) as one:
        words = "visu", "write", one.url, "4,0,2,1", "7", "--yes", "--timeout", "20s"
        asking.append(subprocess.Popen([*COMMAND, *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        told = asking[0].communicate(timeout=WAIT_S)
    assert (asking[0].returncode, *told) == (130, "", "nvscope: broken off: it may have been written.\n")


@pytest.mark.parametrize(
    "line", [line for verb in ("visu list", "visu read", "visu write") for line, _ in EXAMPLES[verb]]
)
def test_the_examples_of_the_help_do_what_they_say(tmp_path: Path, line: str) -> None:
    """They do when a controller on this machine is asked, often, and nobody is to be asked before it is written."""
    with served(tmp_path, TABLE + '"PLC_PRG.sName" = { address = "4,146,81,8", value = "x" }') as one:
        text = line.replace("192.168.1.3:8080", "192.168.1.3").replace("192.168.1.3", f"{LOCAL}:{one.port}")
        words = shlex.split(text.replace("--every 1s", "--every 1ms"))[1:]
        yes = ["--yes"] if words[1] == "write" and "--yes" not in words else []
        done = run_text(*words, *yes, "--timeout", "20s", cwd=tmp_path)
    assert (done.returncode, bool(done.stdout)) == (0, True), done.stderr
