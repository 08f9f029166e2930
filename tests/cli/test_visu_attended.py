"""``nvscope visu`` with a person in front of it: questions, Ctrl-C, and what a controller's own lists may say."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from nvscope.plc.visu.http_request import HttpRequest
from tests.cli.each_forked import CAUGHT
from tests.plc.parameter.peers import WAIT_S
from tests.plc.visu.peers import PAGE, Answering, Peer, peer, replied, served
from tests.program import COMMAND
from tests.program_here import run_text

ROOT = Path(__file__).parents[2]
TABLE = '"PLC_PRG.n" = { address = "4,0,2,1", value = 5 }\n"PLC_PRG.gone" = { address = "4,2,2,1", unreadable = true }'


@contextmanager
def on_a_terminal(*words: str) -> Iterator[tuple[subprocess.Popen[bytes], Callable[[str], str], int]]:
    """Run nvscope on a terminal; yield it, what waits for a text to be shown, and the person's end."""
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    shown = ""

    def until(text: str) -> str:
        nonlocal shown
        end_s = time.monotonic() + WAIT_S
        try:
            while text not in shown:
                ready, _, _ = select.select([ours], [], [], WAIT_S)
                assert ready, shown
                assert time.monotonic() < end_s, shown[-500:]
                shown += os.read(ours, 1_000).decode()
        except OSError:  # which is how a terminal ends
            assert not text, shown
        return shown.replace("\r\n", "\n")

    with subprocess.Popen(
        [*COMMAND, *words], stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True,
        env={**os.environ, "COLUMNS": "100"},
    ) as process:  # fmt: skip
        os.close(theirs)
        try:
            yield process, until, ours
            process.wait(WAIT_S)
        finally:
            process.kill()
            os.close(ours)


@pytest.mark.parametrize(("answer", "code"), [("\x04", 1), ("interrupt", 130)])
def test_who_leaves_the_question_is_told_on_a_line_of_its_own(tmp_path: Path, answer: str, code: int) -> None:
    with served(tmp_path, TABLE) as one:
        with on_a_terminal("visu", "write", one.url, "PLC_PRG.n", "6") as (process, until, person):
            until("[y/N] ")
            if answer == "interrupt":
                process.send_signal(signal.SIGINT)
            else:
                os.write(person, answer.encode())
            told = until("nothing was written.")
        assert re.search(r"is 5\. Write 6\? \[y/N\] +\nnvscope: nothing was written\.\s*\Z", told), told
        assert process.returncode == code
        assert [handled.writes for handled in one.posted] == [False]


def test_what_goes_on_is_said_once_and_again_when_it_changes(tmp_path: Path) -> None:
    def answering(connection: socket.socket, _: HttpRequest, number: int) -> None:
        connection.sendall(replied(b"|???|" if number in (1, 2, 3, 6) else b"|5|"))

    with peer(answering) as one:
        words = "visu", "read", one.url, "4,0,2,1", "--every", "1ms", "--count", "8", "--timeout", "20s"
        done = run_text(*words)
    assert [line.split(" = ")[1] for line in done.stdout.splitlines()] == [
        "5",
        "???",
        "???",
        "???",
        "5",
        "5",
        "???",
        "5",
    ]
    assert (done.returncode, done.stderr.count("cannot read 4,0,2,1 (???)")) == (3, 2)


def test_ctrl_c_ends_reading_again_and_again_without_a_word(tmp_path: Path) -> None:
    with (
        served(tmp_path, TABLE) as one,
        on_a_terminal("visu", "read", one.url, "PLC_PRG.n", "--every", "10ms", "--color", "never") as (
            process,
            until,
            _,
        ),
    ):
        until("PLC_PRG.n = 5\r\n")
        process.send_signal(signal.SIGINT)
        told = until("\x1b[K")
    assert process.returncode == 0
    *lines, end = told.splitlines()
    assert end.endswith("\x1b[K"), told
    assert {line.split("  ")[1] for line in lines if line} == {"PLC_PRG.n = 5"}


def test_nothing_is_sent_but_by_what_is_to_be_sent(tmp_path: Path) -> None:
    """Helps, mistakes and refusals are about a controller, and ask none."""
    (tmp_path / "t.toml").write_text(f"[variables]\n{TABLE}\n")
    (tmp_path / "plc_visu.xml").write_text(
        '<visualisation><variablelist><variable name="a">4,0,2,1</variable></variablelist></visualisation>'
    )
    told = [
        ("visu --help", 0), ("visu read --help", 0), ("help visu write", 0), ("visu serve --keys", 0),
        ("visu read 127.0.0.1", 2), ("visu read https://127.0.0.1 a", 2), ("visu read 127.0.0.1 a --timeout x", 2),
        ("visu read 127.0.0.1 b --variables plc_visu.xml", 2), ("visu read 127.0.0.1 a --page ../x.xml", 2),
        ("visu write 127.0.0.1 a 1", 2), ("visu write 127.0.0.1 4,0,2,INT 70000 --yes", 2),
        ("visu write 127.0.0.1 a --yes", 2), ("visu serve none.toml", 2), ("schema visu", 0),
        (f"report {ROOT}/captures/visu/panel.pcap", 0),
        ("visu read 127.0.0.1:9 4,0,2,1", CAUGHT),
    ]  # fmt: skip
    words = sys.executable, "-m", "tests.cli.each_forked", "--alone", json.dumps([words for words, _ in told])
    done = subprocess.run(
        words, cwd=tmp_path, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL, timeout=WAIT_S * 3,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert [(words, code) for (words, _), (code, _, _) in zip(told, json.loads(done.stdout), strict=True)] == told


LISTED = "<visualisation><time-stamp>{stamp}</time-stamp><variablelist>{rows}</variablelist></visualisation>"


def listing(content: bytes, system: bytes | None = None) -> Answering:
    """A controller with this list, whose variables are all 5, and with one of the system where that is given."""

    def answering(connection: socket.socket, request: HttpRequest, _: int) -> None:
        if request.method == "POST":
            connection.sendall(replied(b"|5" * request.body.count(b"|4|") + b"|"))
        elif request.target.endswith("plc_visu.xml"):
            connection.sendall(replied(content))
        elif request.target.endswith("visu_ini.xml") and system is not None:
            connection.sendall(replied(system))
        else:
            connection.sendall(replied(b"", "200 OK" if request.target == PAGE else "404 Not Found"))

    return answering


def named(*rows: tuple[str, str], stamp: str = "") -> bytes:
    text = "".join(f'<variable name="{name}">{place}</variable>' for name, place in rows)
    return b'<?xml version="1.0" encoding="ISO-8859-1"?>' + LISTED.format(rows=text, stamp=stamp).encode("iso-8859-1")


def asked(one: Peer, verb: str, *words: str) -> subprocess.CompletedProcess[str]:
    return run_text("visu", verb, one.url, *words, "--timeout", "20s", environment={"COLUMNS": "120"})


BOMB = b"""<?xml version="1.0"?><!DOCTYPE v [<!ENTITY a "aaaaaaaaaa">%s]><v>&z;</v>""" % b"".join(
    b'<!ENTITY %c "%s">' % (97 + number, b"&%c;" % (96 + number) * 10) for number in range(1, 26)
)
OUTSIDE = b"""<!DOCTYPE v [<!ENTITY x SYSTEM "file:///etc/passwd">]><visualisation><variablelist>
<variable name="&x;">4,0,2,1</variable></variablelist></visualisation>"""


UNREAD, NONE = "cannot be read: .+", "no variables"


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", UNREAD), (b"<html></html>", UNREAD), (b"\xff\xfe" * 100, UNREAD),
        (b"<visualisation><variablelist>", UNREAD), (BOMB, UNREAD), (OUTSIDE, UNREAD), (b"<a>" * 100_000, UNREAD),
        (named(("a", "4,0,2")), NONE), (named(("a", "4,0,2,x")), NONE), (named(("", "4,0,2,1")), NONE),
    ],
    ids=["nothing", "page", "binary", "cut", "bomb", "outside", "deep", "three numbers", "no numbers", "no name"],
)  # fmt: skip
def test_what_is_no_list_is_told(content: bytes, why: str) -> None:
    with peer(listing(content)) as one:
        done = asked(one, "list")
    told = rf"no variable list is beside the page: /plc/plc_visu.xml \({why}\), /plc/visu_ini.xml \(404\)\n"
    assert (done.returncode, done.stdout) == (1, "")
    assert re.search(told, done.stderr), done.stderr


def test_a_list_beside_others_that_cannot_be_read_is_told() -> None:
    with peer(listing(named(("PLC_PRG.a", "4,0,2,1")), b"<visu-ini-file>\n<\x1b")) as one:
        done = asked(one, "list")
    assert done.returncode == 0
    assert re.search(r"/plc/visu_ini.xml cannot be read: line 2: .*; names are missing, and nobody", done.stderr)
    assert "\x1b" not in done.stderr


def test_a_list_cannot_write_to_the_terminal() -> None:
    names = "&#155;31mred", "\x9b31m", "a&#10;b", "&#x202e;abc"
    rows = [(name, f"4,{2 * number},2,1") for number, name in enumerate(names)]
    with peer(listing(named(*rows, stamp="\x9b2J"))) as one:
        wholes = [asked(one, "list"), asked(one, "list", "--json"), asked(one, "read", "4,0,2,1", "red")]
    assert wholes[0].stdout.count("\n") == len(names) + 1
    for done in wholes:
        assert all(character.isprintable() or character == "\n" for character in done.stdout + done.stderr)


def test_a_name_of_several_variables_is_none_until_it_is_said_which() -> None:
    rows = ("PLC_PRG.a", "4,0,2,1"), ("plc_prg.A", "4,2,2,1"), ("PLC_PRG.b", "4,4,2,1"), ("plc_prg.B", "4,4,2,1")
    with peer(listing(named(*rows))) as one:
        done = asked(one, "read", "PLC_PRG.a")
        assert (done.returncode, done.stdout) == (2, "")
        assert "several variables are called 'PLC_PRG.a'\n  name one of them: 4,0,2,1, 4,2,2,1" in done.stderr
        done = asked(one, "write", "PLC_PRG.A", "7", "--yes")
        assert done.returncode == 2
        assert asked(one, "read", "PLC_PRG.b").stdout.startswith("PLC_PRG.b = 5   INT")  # the same twice is one
    assert [request.method for request in one.got].count("POST") == 1


def test_a_long_list_is_read_within_its_limits() -> None:
    """As much as a reply may have in bytes; what is printed for people ends somewhere, and --json has the rest."""
    rows = [(f"v{number}", f"4,{number},1,0") for number in range(23_000)]
    content = named(*rows)
    assert len(content) < 1 << 20
    with peer(listing(content)) as one:
        begun_s = time.monotonic()
        done = asked(one, "read", "V22999", "nowhere")
        assert (done.returncode, len(done.stderr) < 5_000) == (2, True)
        assert "no variable is called 'nowhere'" in done.stderr
        assert time.monotonic() - begun_s < WAIT_S


@pytest.mark.parametrize(
    ("words", "body", "reply", "values"),
    [
        # What is published, or accepted by clients of others: `captures/webvisu` of those who wrote the specification.
        ("4,572,4,5", "|0|1|0|4|572|4|5|", "|123|", ["123"]),
        ("2,48,0,0 2,29,0,0", "|0|2|0|2|48|0|0|1|2|29|0|0|", "|0|0|", ["FALSE", "FALSE"]),
        ("4,0,6,8 4,6,1,2 4,7,2,3", "|0|3|0|4|0|6|8|1|4|6|1|2|2|4|7|2|3|", "|a|b|5|1000|", ["'a|b'", "5", "1000"]),
        ("4,0,1,0 9,0,1,0", "|0|2|0|4|0|1|0|1|9|0|1|0|", "|1|???|", ["TRUE", None]),
        ("4,146,1,0 4,156,4,5 4,160,4,6", None, "|1|42|3.500000|", ["TRUE", "42", "3.5"]),
    ],
)  # fmt: skip
def test_published_exchanges_are_sent_and_understood(
    words: str, body: str | None, reply: str, values: list[str | None]
) -> None:
    with peer(replied(f"{reply}\r\n".encode())) as one:
        done = asked(one, "read", *words.split(), "--json", "--show-secrets", "--variables", "none.xml")
        assert done.returncode == 2  # nothing is asked before files are read
        done = asked(one, "read", *words.split(), "--json", "--show-secrets")
    posted = [request.body.decode() for request in one.got if request.method == "POST"]
    assert len(posted) == 1
    assert body in (None, posted[0])
    rows = json.loads(done.stdout)["variables"]
    assert [row["value"] and row["value"]["text"] for row in rows] == values
