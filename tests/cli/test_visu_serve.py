"""``nvscope visu serve``: a process that answers, what it prints, and what a capture of it tells."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.plc.parameter.peers import LOCAL, WAIT_S
from tests.plc.visu.peers import PAGE, asked, connected, everything, post, served
from tests.plc.visu.tap import tapped
from tests.program import COMMAND
from tests.program_here import run_text

TABLE = """
[variables]
"PLC_PRG.rSpeed" = { address = "4,0,4,6", value = 12.5 }
"PLC_PRG.s" = { address = "4,4,6,8", value = "\\u009ba" }
"PLC_PRG.n" = { address = "4,10,2,1", value = 1, stuck = true, delay = "1ms" }
"PLC_PRG.ro" = { address = "4,12,2,1", access = "ro" }
"PLC_PRG.drop" = { address = "4,14,2,1", drop = true }
"PLC_PRG.bad" = { address = "4,16,2,1", status = 503 }
".CurrentPassword" = { address = "4,20,41,8", value = "geheim" }
"""


class Serving:
    """A controller that is a process of its own."""

    def __init__(self, process: subprocess.Popen[bytes], first: str) -> None:
        self._process, self.first = process, first
        found = re.search(r" at http://127\.0\.0\.1:(\d+)/plc/webvisu\.htm; Ctrl-C ends\.$", first)
        assert found, first
        self.port = int(found[1])

    def end(self, number: int = signal.SIGINT) -> tuple[int, list[str], str]:
        """Return exit code, lines and summary."""
        self._process.send_signal(number)
        return self.ended()

    def ended(self) -> tuple[int, list[str], str]:
        out, err = self._process.communicate(timeout=WAIT_S)
        return self._process.returncode, out.decode().splitlines(), err.decode()


@contextmanager
def serving(folder: Path, *options: str, table: str = TABLE) -> Iterator[Serving]:
    path = folder / "t.toml"
    path.write_text(table, encoding="utf-8")
    words = [*COMMAND, "visu", "serve", str(path), *options]
    # Without buffers: behind the first line, all is left to who waits for the end.
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0) as process:
        try:
            assert process.stderr is not None
            yield Serving(process, process.stderr.readline().decode().rstrip("\n"))
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_answers_tells_and_ends_in_order(tmp_path: Path, number: int) -> None:
    bodies = (
        b"|0|2|0|4|0|4|6|1|4|4|6|8|", b"|1|1|0|4|0|4|6|0.5|", b"|1|1|0|4|10|2|1|9|", b"|1|1|0|4|12|2|1|9|",
        b"|0|1|0|4|14|2|1|", b"|0|1|0|4|16|2|1|", b"|0|1|0|4|20|41|8|", b"|1|1|0|4|20|41|8|neues|",
        b"|0|9|0|4|99|2|1|", b"|0|0|", b"|1|2|0|4|20|41|8|neues|", b"|1|1|0|4|0|4|6|0.5|7|",
        b"|0|",
    )  # fmt: skip
    with serving(tmp_path) as one:
        assert one.first.startswith(f"nvscope: {tmp_path}/t.toml: 7 variables at ")
        for body in bodies:
            asked(one.port, post(body))
        asked(one.port, b"GET /plc/WRITEPI?ADR=MX1%1b&VALUE=geheim HTTP/1.1\r\n\r\n")
        asked(one.port, b"GET /plc/webvisu.htm?ReadPI?FORMAT=%d HTTP/1.1\r\n\r\n")
        asked(one.port, b"GET /\x1b[31m HTTP/1.1\r\n\r\n")
        asked(one.port, b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n")
        asked(one.port, b"\x1b[2Jx\r\n")
        with connected(one.port) as idle:
            idle.sendall(b"POST")
            code, lines, summary = one.end(number)
    assert code == 0
    assert [re.sub(r"^\d\d:\d\d:\d\d\.\d{3}  127\.0\.0\.1:\d+  ", "", line) for line in lines] == [
        "read  PLC_PRG.rSpeed = 12.5, PLC_PRG.s = '\\x9ba'",
        "write PLC_PRG.rSpeed  12.5 → 0.5",
        "write PLC_PRG.n  1 → 1  ! stuck: 9 was to be written  1.0 ms later",
        "write PLC_PRG.ro := 9  ✗ refused",
        "read  PLC_PRG.drop  ! connection ended",
        "read  PLC_PRG.bad  ✗ 503 refused",
        "read  .CurrentPassword = (hidden)",
        "write .CurrentPassword  (hidden) → (hidden)",
        "read  4,99,2,1 = ???  ! declares 9",
        f"POST {PAGE}  ✗ 400 malformed: it asks for no variable",
        f"POST {PAGE}  ✗ 400 malformed: it declares 2 variables and has 1",
        f"POST {PAGE}  ✗ 400 malformed: it has 1 field more than its variables",
        f"POST {PAGE}  ✗ 400 malformed: no request of a WebVisu page",
        "GET /plc/WRITEPI  ✗ 400 malformed: MX1\\x1b is no address such as MW230",
        "GET /plc/webvisu.htm?ReadPI  ✗ 400 malformed: it names no address (ADR)",
        "GET /\\x1b[31m  ✗ 404 not found",
        "GET /plc/visu_ini.xml  200",
        "✗ 400 malformed: no request",
    ]
    told = "18 requests, 6 answered, 1 for files, 2 refused, 1 not found, 7 malformed, 1 dropped"
    assert summary == f"nvscope: {told}.\n"


def test_it_ends_after_so_many_requests_or_a_time(tmp_path: Path) -> None:
    with serving(tmp_path, "--count", "2") as one:
        assert asked(one.port, post(b"|0|1|0|4|0|4|6|")).endswith(b"|12.5|")
        assert asked(one.port, post(b"|0|1|0|4|10|2|1|")).endswith(b"|1|")
        code, lines, summary = one.ended()
    assert (code, len(lines), summary) == (0, 2, "nvscope: 2 requests, 2 answered.\n")
    with serving(tmp_path, "--for", "1ms") as one:
        assert one.ended() == (0, [], "nvscope: 0 requests.\n")


def test_an_answer_that_waits_is_not_waited_for_at_the_end(tmp_path: Path) -> None:
    table = '[variables]\n"a" = { address = "4,0,2,1", delay = "60s" }\n'
    with serving(tmp_path, table=table) as one, connected(one.port) as waiting:
        waiting.sendall(post(b"|0|1|0|4|0|2|1|"))
        asked(one.port, b"GET / HTTP/1.1\r\n\r\n")
        code, _, _ = one.end()
        assert (code, everything(waiting)) == (0, b"")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "a table is needed"),
        (("none.toml",), "none.toml: cannot be read"),
        (("t.toml", "--bind", "0.0.0.0"), "0.0.0.0 is every address of this machine"),
        (("t.toml", "--bind", "8.8.8.8"), "8.8.8.8 is not in a private network"),
        (("t.toml", "--bind", "plant"), "plant: expected an IP address"),
        (("t.toml", "--count", "0"), "--count"),
        (("wrong.toml",), "unknown key 'valeu'"),
    ],
)
def test_what_cannot_be_served_is_told(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    (tmp_path / "t.toml").write_text(TABLE, encoding="utf-8")
    (tmp_path / "wrong.toml").write_text('[variables]\n"a".valeu = 1\n', encoding="utf-8")
    done = run_text("visu", "serve", *words, cwd=tmp_path)
    assert (done.returncode, done.stdout, told in done.stderr) == (2, "", True), done.stderr


def test_a_port_that_somebody_has_is_told(tmp_path: Path) -> None:
    (tmp_path / "t.toml").write_text(TABLE, encoding="utf-8")
    with socket.create_server((LOCAL, 0)) as other:
        port = str(other.getsockname()[1])
        done = run_text("visu", "serve", "t.toml", "--port", port, cwd=tmp_path)
    assert (done.returncode, f"127.0.0.1:{port}: cannot be answered at" in done.stderr) == (5, True)


def test_all_keys_are_listed() -> None:
    assert "- `stuck` (true or false, default `false`)" in run_text("visu", "serve", "--keys").stdout


@pytest.mark.parametrize("head", ["", "chunked = true\ngzip = true", 'http = "1.0"\ncontent_length = false'])
def test_a_report_on_what_was_said_tells_what_happened(tmp_path: Path, head: str) -> None:
    variables = TABLE.partition("[variables]")[2] + '"PLC_PRG.more" = { address = "4,70,2,1", surplus = 1 }\n'
    with served(tmp_path, variables, head) as one, tapped(one.port) as tap:
        url = f"http://{LOCAL}:{tap.port}{PAGE}"
        for words, code in (
            ("read URL PLC_PRG.rSpeed PLC_PRG.s", 0), ("write URL PLC_PRG.rSpeed 7.5 --yes", 0),
            ("write URL PLC_PRG.ro 5 --yes", 1), ("read URL PLC_PRG.drop", 3), ("read URL PLC_PRG.bad", 1),
            ("read URL PLC_PRG.more", 3), ("read URL .CurrentPassword", 0),
        ):  # fmt: skip
            done = run_text("visu", *words.replace("URL", url).split(), "--timeout", "20s")
            assert done.returncode == code, done.stderr
    path = tap.capture(tmp_path / "visu.pcap")
    report = json.loads(run_text("report", path, "--json").stdout)
    (row,) = report["visu"]
    for unsteady in ("latency_ns", "polling_ns"):
        del row[unsteady]
    assert row == {
        "client": "192.168.1.5", "client_name": None, "server": "192.168.1.20", "server_name": None, "port": 80,
        "connections": 10, "reads": 8, "writes": 2, "entries": 11, "variables": 7, "replies": 9, "refused": 1,
        "unanswered": 1, "cut": 0, "gap_bytes": 0, "miscounted": 1, "ambiguous": 0, "other_bytes": 0,
    }  # fmt: skip
    assert len(one.posted) == row["reads"] + row["writes"]
    found = {(finding["code"], finding["variable"].rpartition("/")[2]) for finding in report["findings"]}
    assert {("NV801", "PLC_PRG.rSpeed"), ("NV801", "PLC_PRG.ro"), ("NV802", "PLC_PRG.ro")} <= found
    assert ("NV803", ".CurrentPassword") in found
    assert {"NV801", "NV802", "NV803", "NV804", "NV805"} <= {code for code, _ in found}


def test_a_report_on_what_older_pages_said_tells_what_they_read_and_wrote(tmp_path: Path) -> None:
    with served(tmp_path, '"n" = { address = "0,460,2,1", value = 5, access = "rw" }') as one, tapped(one.port) as tap:
        for target in (
            "READPI?ADR=MW230&FORMAT=%d",
            "WRITEPI?ADR1=MW230&VALUE1=6&FORMAT1=%d",
            "WRITEPI?ADR1=MB9&VALUE1=6",
        ):
            asked(tap.port, f"GET /plc/{target} HTTP/1.1\r\nHost: x\r\n\r\n".encode("ascii"))
    report = json.loads(run_text("report", tap.capture(tmp_path / "visu.pcap"), "--json").stdout)
    (row,) = report["visu"]
    assert (row["reads"], row["writes"], row["replies"], row["refused"], row["unanswered"]) == (1, 2, 3, 1, 0)
    assert [(write["variable"], write["new"], write["outcome"]) for write in report["visu_writes"]] == [
        ("MW230", "6", "confirmed"), ("MB9", "6", "refused"),
    ]  # fmt: skip
