"""``nvscope visu serve`` with lists: what a client reads while somebody sends them."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.capture.live.network import cable, needs_namespaces
from tests.capture.live.test_ring import wait_for_ring
from tests.capture.mcap.recordings import Packet, write
from tests.oracle.builders import data_frame, telegram
from tests.plc.parameter.peers import LOCAL, WAIT_S, unused_port
from tests.program import COMMAND
from tests.program_here import run_text

GVL = """<GVL><Declarations>VAR_GLOBAL
nSpeed : INT; xRun : BOOL; sName : STRING(7); CurrentPassword : STRING(3); END_VAR</Declarations>
<NetvarSettings Protocol="UDP"><ListIdentifier>7</ListIdentifier><Pack>True</Pack>
<ProtocolSettings><ProtocolSetting Name="Port" Value="{port}" /></ProtocolSettings></NetvarSettings></GVL>
"""
NAMES = "nSpeed", "xRun", "sName", "CurrentPassword"


def axis(speed: int, counter: int = 1) -> bytes:
    """Return a telegram of the list."""
    data = speed.to_bytes(2, "little", signed=True) + b"\1" + b"press\0\0\0" + b"abc\0"
    return telegram(list_id=7, items=4, counter=counter, data=data)


class Serving:
    """Lists that are served by a process of its own."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        assert process.stderr is not None
        self.first = process.stderr.readline().rstrip("\n")
        while not self.first.endswith("Ctrl-C ends."):
            assert self.first, process.stderr.read()
            self.before, self.first = self.first, process.stderr.readline().rstrip("\n")
        self.url = re.sub(r".* at (http://\S+); Ctrl-C ends\.$", r"\1", self.first)

    def read(self, *names: str) -> tuple[int, Mapping[str, str | None]]:
        """Return the exit code of a read, and the values that came; None where there was none."""
        done = run_text("visu", "read", self.url, *names, "--json", "--timeout", "20s")
        rows = json.loads(done.stdout)["variables"]
        return done.returncode, {row["name"]: row["value"] and row["value"]["text"] for row in rows}

    def end(self) -> tuple[int, str, str]:
        """End it; return exit code, lines and what was said."""
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, out, err


@contextmanager
def serving(*words: str | Path) -> Iterator[Serving]:
    command = [*COMMAND, "visu", "serve", *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield Serving(process)
        finally:
            process.kill()


def definition(folder: Path, port: int = 1202) -> Path:
    path = folder / "axis.gvl"
    path.write_text(GVL.format(port=port), encoding="utf-8")
    return path


def _packet(time_ns: int, speed: int) -> Packet:
    frame = data_frame(time_ns, "10.0.0.1", "10.0.0.255", axis(speed))
    return Packet(frame.data, frame.original, time_ns)


def wait_for(one: Serving, name: str, value: str) -> None:
    """Wait until a variable has a value."""
    until_s = time.monotonic() + WAIT_S
    while one.read(name)[1][name] != value:
        assert time.monotonic() < until_s


def test_a_client_reads_what_a_sender_sent_last_and_cannot_write_it(tmp_path: Path) -> None:
    port = unused_port()
    source = f"udp://{LOCAL}:{port}"
    with (
        serving(source, definition(tmp_path, port)) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        assert one.first.startswith(f"nvscope: {source}: 4 variables of 1 list at http://127.0.0.1:")
        assert one.read(*NAMES) == (3, dict.fromkeys(NAMES))
        for counter, speed in enumerate((100, -5), 1):
            sender.sendto(axis(speed, counter), (LOCAL, port))
            wait_for(one, "nSpeed", str(speed))
        assert one.read(*NAMES) == (
            0, {"nSpeed": "-5", "xRun": "TRUE", "sName": "'press'", "CurrentPassword": None}
        )  # fmt: skip
        done = run_text("visu", "write", one.url, "nSpeed", "7", "--yes", "--timeout", "20s")
        assert (done.returncode, "nSpeed is not written: the controller refuses it" in done.stderr) == (1, True), (
            done.stderr
        )
        assert one.read("nSpeed") == (0, {"nSpeed": "-5"})
        code, lines, told = one.end()
    assert code == 0
    assert re.search(r"  read  nSpeed = \?\?\?, xRun = \?\?\?, sName = \?\?\?, CurrentPassword = ", lines)
    assert "  write nSpeed := 7  ✗ refused\n" in lines
    assert "  read  nSpeed = -5, xRun = TRUE, sName = 'press', CurrentPassword = (hidden)\n" in lines
    assert re.search(r"^nvscope: \d+ requests, ", told)


def test_a_capture_is_played_its_last_values_stay_and_where_it_was_cut_is_told(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    write(path, [_packet(1, 3), _packet(200_000_000, 4)])
    path.write_bytes(path.read_bytes()[:-20])
    with serving(path, definition(tmp_path)) as one:
        wait_for(one, "nSpeed", "4")
        assert one.process.poll() is None
        code, _, told = one.end()
    assert (code, "x.mcap, offset " in told) == (3, True)


SENDER = """
import socket, sys
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
for text in sys.argv[2:]:
    out.sendto(bytes.fromhex(text), (sys.argv[1], 1202))
"""


@needs_namespaces
def test_lists_on_an_interface_are_served_on_a_low_port_until_it_goes(tmp_path: Path) -> None:
    with cable() as (plant, panel):
        words = "visu", "serve", "-i", panel.device, str(definition(tmp_path)), "--bind", panel.address, "--port", "80"
        one = Serving(panel.nvscope(*words))
        assert one.first == (
            f"nvscope: {panel.device}: 4 variables of 1 list at http://{panel.address}/plc/webvisu.htm; Ctrl-C ends."
        )
        wait_for_ring(panel)
        plant.python(SENDER, "10.77.0.255", *(axis(speed, speed).hex() for speed in (1, 2, 3)))
        until_s, told = time.monotonic() + WAIT_S, ""
        while not told.startswith("nSpeed = 3 "):
            assert time.monotonic() < until_s, told
            told, _ = plant.nvscope("visu", "read", one.url, "nSpeed").communicate(timeout=WAIT_S)
        panel.ip("link", "delete", panel.device)
        _, said = one.process.communicate(timeout=WAIT_S)
    assert (one.process.returncode, "the interface is gone" in said) == (5, True), said


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("t.toml", "udp://127.0.0.1:0"), 2, "t.toml is a table, and udp://127.0.0.1:0 would be listened to"),
        (("t.toml", "-i", "lo"), 2, "t.toml is a table, and lo would be listened to"),
        (("t.toml", "--gvl", "axis.gvl", "-f", "udp"), 2, "--gvl, -f: for lists that are listened to"),
        (("udp://127.0.0.1:1202",), 2, "no definition is given"),
        (("axis.gvl",), 2, "no capture is given, only definitions"),
        (("none0", "axis.gvl"), 4, "no file and no interface has this name"),
        (("udp://127.0.0.1:1202", "types.st"), 2, "the definition files declare types, but no list"),
        (("udp://127.0.0.1:x", "axis.gvl"), 2, "udp://127.0.0.1:x"),
        (("udp://192.0.2.1:1202", "axis.gvl"), 5, "192.0.2.1"),
        (("udp://127.0.0.1:1202", "axis.gvl", "--for", "soon"), 2, "--for"),
    ],
)
def test_what_cannot_be_listened_to_is_told(tmp_path: Path, words: Sequence[str], code: int, told: str) -> None:
    definition(tmp_path)
    (tmp_path / "t.toml").write_text('[variables]\n"a".type = "INT"\n', encoding="utf-8")
    (tmp_path / "types.st").write_text("TYPE a : STRUCT b : INT; END_STRUCT END_TYPE\n", encoding="utf-8")
    done = run_text("visu", "serve", *words, cwd=tmp_path)
    assert (done.returncode, done.stdout, told in done.stderr) == (code, "", True), done.stderr


def test_stdin_is_listened_to_as_it_comes(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    write(path, [_packet(1, 3)])
    done = run_text("visu", "serve", "-", definition(tmp_path), stdin=path.read_bytes())
    assert (done.returncode, done.stdout) == (0, "")
    assert "nvscope: -: 4 variables of 1 list at http://127.0.0.1:" in done.stderr
