"""``nvscope watch`` without a screen: what it prints while something happens, and that it is what a report says."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from tests.capture.live.network import cable, needs_namespaces, send
from tests.capture.live.test_ring import wait_for_ring
from tests.oracle.builders import data_frame, telegram
from tests.program import COMMAND, run_text
from tests.schemas.validation import mistakes_in

ROOT = Path(__file__).parents[2]
PLANT = str(ROOT / "captures" / "plant.pcapng.gz")


def lines_of(text: str) -> list[Any]:
    return [json.loads(line) for line in text.splitlines()]


def test_what_begins_and_ends_is_told_when_it_does() -> None:
    done = run_text("watch", PLANT, "--utc", environment={"COLUMNS": "120"})
    assert (done.returncode, done.stderr) == (0, "")
    told = [line.strip() for line in done.stdout.splitlines() if line[:9].startswith("00:00:") and line[8:9] == " "]
    titles = [line.partition(" ")[2] for line in told]
    silent = next(place for place, title in enumerate(titles) if "192.168.1.12 is silent since 00:00:23" in title)
    second = next(place for place, title in enumerate(titles) if "A further node sends list 7" in title)
    assert silent < second
    assert any(title.startswith("● Node 192.168.1.20 did not answer") and title.endswith(": over") for title in titles)
    assert done.stdout.count("4 lists") == 4  # a table every ten seconds, and at the end


def test_a_cause_that_turns_out_to_be_another_one_says_which(tmp_path: Path) -> None:
    scenario, capture = ROOT / "tests/scenarios/causes/node-power-cycle.toml", tmp_path / "x.pcap"
    assert run_text("simulate", scenario, "-w", capture).returncode == 0
    lines = lines_of(run_text("watch", capture, "--json").stdout)
    assert [mistake for line in lines for mistake in mistakes_in(line)] == []
    ended = [(cause["title"], cause["instead"]) for line in lines for cause in line["causes_ended"]]
    anew = "Node 10.0.0.1 started anew at 23.0 s"
    assert ended == [(anew, None), ("Node 10.0.0.1 is silent since 15.0 s (lists 1 and 2)", anew)]


def test_a_line_a_second_adds_up_to_the_report() -> None:
    lines = lines_of(run_text("watch", PLANT, "--json").stdout)
    report = json.loads(run_text("report", PLANT, "--json").stdout)
    last = lines[-1]
    assert [(one["key"], one["status"], one["telegrams"], one["lost"]) for one in last["lists"]] == [
        (one["key"], one["status"], one["diag"]["nSendCount"], one["counters"]["lost"]) for one in report["lists"]
    ]
    begun = [cause["kind"] for line in lines for cause in line["causes_new"]]
    ended = [cause["kind"] for line in lines for cause in line["causes_ended"]]
    for kind in {one["kind"] for one in report["causes"]}:
        still = sum(one["kind"] == kind and one["until_ns"] is None for one in report["causes"])
        assert begun.count(kind) - ended.count(kind) == still, kind


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--plain", "--json"], "exclude each other"),
        (["-Y", "nv.index == 7"], "-Y chooses what the screen shows"),
        (["--theme", "mono"], "--theme is of the screen"),
        (["--plain", "--theme", "mono"], "--theme is of the screen"),
        (["--every", "soon"], "--every"),
    ],
)
def test_what_cannot_be_is_told(words: list[str], what: str) -> None:
    done = run_text("watch", PLANT, *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert what in done.stderr


@needs_namespaces
@pytest.mark.skipif(which("tcpdump") is None, reason="needs tcpdump")
def test_what_is_watched_is_what_a_capture_of_the_same_time_tells(tmp_path: Path) -> None:
    capture = tmp_path / "same.pcap"
    with cable() as (press, engineer):
        dump = engineer.start(
            "tcpdump",
            "-i",
            engineer.device,
            "-s",
            "2048",
            "-B",
            "16384",
            "-U",
            "--immediate-mode",
            "-w",
            str(capture),
            "udp",
        )
        watching = engineer.nvscope("watch", "--json", engineer.device, "--for", "11s")
        wait_for_ring(engineer, 2)
        sending = press.start(*send("10.77.0.255", 100, 2, 20_000_000))
        out, said = watching.communicate(timeout=40)
        sending.wait(10)
        dump.terminate()
        dump.communicate(timeout=10)
    assert watching.returncode == 0, said
    lines = lines_of(out)
    assert 10 <= len(lines) <= 14
    report = json.loads(run_text("report", str(capture), "--json").stdout)
    assert [(one["key"], one["telegrams"], one["lost"]) for one in lines[-1]["lists"]] == [
        (one["key"], one["diag"]["nSendCount"], one["counters"]["lost"]) for one in report["lists"]
    ]
    assert lines[-1]["drops"] == 0
    # The sender has ended, as everybody who goes on watching can see.
    assert "node-silent" in {cause["kind"] for line in lines for cause in line["causes_new"]}


def in_a_terminal(slave: int) -> dict[str, Any]:
    """Return how a process is started that has a terminal of its own."""

    def own_terminal() -> None:
        os.setsid()
        fcntl.ioctl(slave, termios.TIOCSCTTY, 0)

    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    return {
        "stdout": slave, "stderr": slave, "preexec_fn": own_terminal, "env": {**os.environ, "TERM": "xterm-256color"},
    }  # fmt: skip


def test_a_dumb_terminal_gets_tables() -> None:
    master, slave = pty.openpty()
    how = in_a_terminal(slave)
    how["env"]["TERM"] = "dumb"
    watching = subprocess.Popen([*COMMAND, "watch", PLANT], stdin=slave, **how)
    try:
        shown, until = b"", time.monotonic() + 30
        while watching.poll() is None and time.monotonic() < until:
            if select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536)
        while select.select([master], [], [], 0.05)[0]:
            shown += os.read(master, 65536)
        assert watching.returncode == 0
        assert b"\x1b[?1049h" not in shown
        assert b"192.168.1.99" in shown
    finally:
        watching.kill()
        watching.wait()
        os.close(master)
        os.close(slave)


@pytest.mark.parametrize(("verb", "first"), [("watch", b"192.168.1.99"), ("replay", b"192.168.1.1")])
def test_a_screen_ends_with_its_terminal_though_nobody_sends_a_signal(verb: str, first: bytes) -> None:
    """Whom a terminal does not control, such as what a container was asked to run, hears of its end by no signal."""
    master, slave = pty.openpty()
    # It is not the terminal that controls the process.
    how = in_a_terminal(slave) | {"preexec_fn": os.setsid}
    shown, until = b"", time.monotonic() + 30
    with subprocess.Popen([*COMMAND, verb, PLANT], stdin=slave, **how) as screen:
        os.close(slave)
        try:
            while first not in shown and time.monotonic() < until:
                if select.select([master], [], [], 0.05)[0]:
                    shown += os.read(master, 65536)
            assert first in shown
            os.close(master)
            assert screen.wait(30) == 128 + signal.SIGHUP
        finally:
            screen.kill()


HANGS = """
import os, sys, time
from nvscope.cli.start import main
from nvscope.tui.app import WatchApp
def hang(self, scene):
    os.write(1, b"HANGS")
    while True:
        time.sleep(0.001)
WatchApp._show = hang
sys.argv[0] = "nvscope"
main()
"""


def test_a_screen_that_hangs_ends_all_the_same_and_leaves_the_terminal_whole() -> None:
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    words = [sys.executable, "-c", HANGS, "watch", PLANT]
    watching = subprocess.Popen(words, stdin=slave, **in_a_terminal(slave))
    try:
        shown, until = b"", time.monotonic() + 30
        while b"HANGS" not in shown and time.monotonic() < until:
            if select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536)
        watching.send_signal(signal.SIGHUP)
        while watching.poll() is None and time.monotonic() < until:
            if select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536)
        while select.select([master], [], [], 0.05)[0]:
            shown += os.read(master, 65536)
        assert watching.returncode == 128 + signal.SIGHUP
        assert b"\x1b[?1049h" in shown
        assert b"\x1b[?1049l" in shown
        assert termios.tcgetattr(slave) == before
    finally:
        watching.kill()
        watching.wait()
        os.close(master)
        os.close(slave)


def test_where_stdin_is_the_capture_keys_come_from_the_terminal() -> None:
    """``ssh switch tcpdump -w - | nvscope watch -`` is a screen, as in pagers; q ends it, and the terminal is whole."""
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    watching = subprocess.Popen([*COMMAND, "watch", "-"], stdin=subprocess.PIPE, **in_a_terminal(slave))
    assert watching.stdin
    try:
        watching.stdin.write(struct.pack("<IHHIIII", 0xA1B23C4D, 2, 4, 0, 0, 262144, 1))
        shown, until = b"", time.monotonic() + 30
        for counter in range(1000):
            frame = data_frame(
                counter * 50_000_000, "10.0.0.1", "255.255.255.255", telegram(list_id=7, counter=counter)
            )
            head = struct.pack("<IIII", *divmod(frame.ts_ns, 10**9), len(frame.data), len(frame.data))
            watching.stdin.write(head + frame.data)
            watching.stdin.flush()
            while select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536)
            if b"10.0.0.1" in shown or time.monotonic() > until:
                break
        assert b"\x1b[?1049h" in shown
        assert b"10.0.0.1" in shown
        os.write(master, b"q")
        while watching.poll() is None and time.monotonic() < until:
            if select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536)
        assert watching.returncode == 0
        assert b"\x1b[?1049l" in shown
        assert termios.tcgetattr(slave) == before
    finally:
        watching.kill()
        watching.wait()
        watching.stdin.close()
        os.close(master)
        os.close(slave)
