"""``nvscope sdo serve``: a process that answers, what it prints, and what a capture of it tells."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.capture.mcap.recordings import Packet, write
from tests.oracle.builders import data_frame
from tests.plc.parameter.peers import LOCAL, WAIT_S, bound, running, served
from tests.plc.parameter.wire import INDEX, READ, READ_REPLY, WRITE, WRITE_REPLY, heard, said
from tests.program import COMMAND
from tests.program_here import run_text

TABLE = """
[parameters]
"0x2000:1" = { name = "rSetpoint", type = "REAL", value = 12.5 }
"0x2001:0" = { name = "\\u001b[31mred", type = "WSTRING(20)", value = "\\u202ea" }
"0x2002:0" = { type = "INT", silent = true }
"0x2003:0" = { type = "INT", busy = 1, stuck = true, delay = "1ms" }
"""


class Serving:
    """A controller that is a process of its own."""

    def __init__(self, process: subprocess.Popen[bytes], first: str) -> None:
        self._process, self.first = process, first
        found = re.search(r" at \S+:(\d+); Ctrl-C ends\.$", first)
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
    words = [*COMMAND, "sdo", "serve", str(path), "--port", "0", *options]
    # Without buffers: behind the first line, all is left to who waits for the end.
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0) as process:
        try:
            assert process.stderr is not None
            yield Serving(process, process.stderr.readline().decode().rstrip("\n"))
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_answers_tells_and_ends_in_order(tmp_path: Path, number: int) -> None:
    with serving(tmp_path) as one, bound() as asking:

        def ask(payload: bytes) -> bytes:
            asking.sendto(payload, (LOCAL, one.port))
            return asking.recv(65_535)

        assert one.first.startswith(f"nvscope: {tmp_path}/t.toml: 4 parameters at 127.0.0.1:")
        assert ask(said(READ)) == said(READ_REPLY, data=b"\0\0\x48\x41")
        assert ask(said(WRITE, data=b"\0\0\0\x3f")) == said(WRITE_REPLY)
        for payload in (b"garbage", said(READ)[:9], said(READ, 0x2002, 0)):
            asking.sendto(payload, (LOCAL, one.port))
        assert heard(ask(said(READ, 0x2001, 0))).service == READ_REPLY
        assert heard(ask(said(WRITE, 0x3000, data=b"\1"))).service == INDEX
        assert heard(ask(said(READ, 0x2003, 0))).service == 100
        assert heard(ask(said(WRITE, 0x2003, 0, data=b"\1\0"))).service == WRITE_REPLY
        code, lines, summary = one.end(number)
        own = asking.getsockname()[1]
    assert code == 0
    assert [re.sub(r"^\d\d:\d\d:\d\d\.\d{3}  ", "", line) for line in lines] == [
        f"127.0.0.1:{own}  read  rSetpoint (0x2000:1)  12.5",
        f"127.0.0.1:{own}  write rSetpoint (0x2000:1)  12.5 → 0.5",
        f"127.0.0.1:{own}  read  0x2002:0  ! not answered",
        f"127.0.0.1:{own}  read  \\x1b[31mred (0x2001:0)  '\\u202ea'",
        f"127.0.0.1:{own}  write 0x3000:1  ✗ ODErrorReplyIdx 01",
        f"127.0.0.1:{own}  read  0x2003:0  ! ODStateBusy  1.0 ms later",
        f"127.0.0.1:{own}  write 0x2003:0  0 → 0  ! stuck: 1 was to be written  1.0 ms later",
    ]
    told = "7 requests, 4 answered, 1 refused, 1 busy, 1 not answered; ignored: 1 malformed, 1 no telegram"
    assert summary == f"nvscope: {told}.\n"


def test_it_ends_after_so_many_requests(tmp_path: Path) -> None:
    with serving(tmp_path, "--count", "2") as one, bound() as asking:
        for _ in range(2):
            asking.sendto(said(READ), (LOCAL, one.port))
        assert [heard(asking.recv(65_535)).service for _ in range(2)] == [READ_REPLY, READ_REPLY]
        code, lines, summary = one.ended()
    assert (code, len(lines), summary) == (0, 2, "nvscope: 2 requests, 2 answered.\n")


def test_it_ends_after_a_time(tmp_path: Path) -> None:
    with serving(tmp_path, "--for", "1ms") as one:
        assert one.ended() == (0, [], "nvscope: 0 requests.\n")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "a table is needed"),
        (("none.toml",), "none.toml: cannot be read"),
        (("t.toml", "--bind", "0.0.0.0"), "0.0.0.0 is every address of this machine"),
        (("t.toml", "--bind", "8.8.8.8"), "8.8.8.8 is not in a private network"),
        (("t.toml", "--bind", "plant"), "plant: expected an IP address"),
        (("t.toml", "--count", "0"), "--count"),
        (("t.toml", "--for", "soon"), "--for: 'soon' is no duration"),
        (("wrong.toml",), "wrong.toml, line 2, column 1: parameters.\"0x2000:1\".valeu: unknown key 'valeu'"),
    ],
)
def test_what_cannot_be_served_is_told(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    (tmp_path / "t.toml").write_text(TABLE, encoding="utf-8")
    (tmp_path / "wrong.toml").write_text('[parameters]\n"0x2000:1".valeu = 1\n', encoding="utf-8")
    done = run_text("sdo", "serve", *words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert told in done.stderr


def test_a_port_that_somebody_has_is_told(tmp_path: Path) -> None:
    (tmp_path / "t.toml").write_text(TABLE, encoding="utf-8")
    with bound() as other:
        port = str(other.getsockname()[1])
        done = run_text("sdo", "serve", "t.toml", "--port", port, cwd=tmp_path)
    assert (done.returncode, f"127.0.0.1:{port}: cannot be answered at" in done.stderr) == (5, True)


def test_all_keys_are_listed() -> None:
    told = run_text("sdo", "serve", "--keys").stdout
    assert "- `wrong_counter` (true or false, default `false`)" in told


class Tap:
    """What stands between two and hands on what they say to each other, and keeps it with its times."""

    def __init__(self, port: int) -> None:
        self._port, self._socket, self._lock = port, bound(), threading.Lock()
        self.port = int(self._socket.getsockname()[1])
        self.seen: list[tuple[int, bool, bytes]] = []

    def run(self, is_stopped: Callable[[], bool]) -> None:
        asking: tuple[str, int] | None = None
        with self._socket as own:
            own.settimeout(0.05)
            while not is_stopped():
                try:
                    payload, source = own.recvfrom(65_535)
                except TimeoutError:
                    continue
                is_answer = source == (LOCAL, self._port)
                asking = asking if is_answer else source
                self.seen.append((time.time_ns(), is_answer, payload))
                target = asking if is_answer else (LOCAL, self._port)
                assert target is not None
                own.sendto(payload, target)

    def capture(self, path: Path) -> Path:
        """Write it as if it had been on a network."""
        nodes = "192.168.1.5", "192.168.1.20"
        frames = [
            data_frame(time_ns, nodes[is_answer], nodes[not is_answer], payload)
            for time_ns, is_answer, payload in self.seen
        ]  # fmt: skip
        return write(path, [Packet(one.data, one.original, one.ts_ns, one.link) for one in frames])


def test_a_report_on_what_was_said_tells_what_happened(tmp_path: Path) -> None:
    table = """
    "0x2000:1" = { name = "rSetpoint", type = "REAL", value = 12.5 }
    "0x2001:0" = { type = "INT", fault = "ODErrorReplyAccess" }
    "0x2002:0" = { type = "INT", silent = true }
    "0x2003:0" = { type = "INT", busy = 2 }
    "0x2004:0" = { type = "INT", duplicate = true }
    """
    with served(tmp_path, table) as one:
        tap = Tap(one.port)
        with running(tap.run):
            for words, code in (
                ("read 0x2000 1", 0), ("write 0x2000 1 7.5 --type REAL --yes", 0), ("read 0x2001 0", 1),
                ("read 0x2002 0 --timeout 20ms", 3), ("read 0x2003 0", 0), ("read 0x2004 0", 0), ("read 0x9999 0", 1),
            ):  # fmt: skip
                verb, *rest = words.split()
                patient = () if "--timeout" in rest else ("--timeout", "1s")
                done = run_text("sdo", verb, LOCAL, *rest, *patient, "--port", str(tap.port))
                assert done.returncode == code, done.stderr
    path = tap.capture(tmp_path / "sdo.pcap")
    # However long this takes: what is open at the end is no timeout.
    (tmp_path / "nvscope.toml").write_text('[limits]\nparameter = "60s"\n', encoding="utf-8")
    done = run_text("report", path.name, "--json", cwd=tmp_path)
    (row,) = json.loads(done.stdout)["sdo"]
    del row["latency_ns"]
    # An answer that comes twice is a copy where that is soon enough, as of a mirror port.
    row["unexpected"] += row.pop("copies")
    assert row == {
        "requester": "192.168.1.5", "requester_name": None, "partner": "192.168.1.20", "partner_name": None,
        "port": 1202, "requests": 11, "replies": 8, "errors": {"ODErrorReplyAccess": 1, "ODErrorReplyIdx": 1},
        "busy": 2, "timeouts": 0, "retransmissions": 0, "unexpected": 1, "undeliverable": 0,
    }  # fmt: skip
    assert sum(one.result.value != "silent" for one in one.handled) == row["replies"] + row["busy"]


def test_a_report_on_what_was_said_to_nobody_tells_that(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mute:
        mute.bind((LOCAL, 0))
        port = int(mute.getsockname()[1])
        done = run_text("sdo", "read", LOCAL, "1", "2", "--timeout", "20ms", "--retries", "2", "--port", str(port))
        assert done.returncode == 3
        mute.settimeout(WAIT_S)
        asked = [mute.recv(65_535) for _ in range(3)]
    assert len(set(asked)) == 1
    frames = [data_frame(10**18 + at * 10**9, "10.0.0.1", "10.0.0.2", payload) for at, payload in enumerate(asked)]
    path = write(tmp_path / "x.pcap", [Packet(one.data, one.original, one.ts_ns, one.link) for one in frames])
    (row,) = json.loads(run_text("report", path, "--json").stdout)["sdo"]
    assert (row["requests"], row["replies"], row["timeouts"]) == (3, 0, 2)
