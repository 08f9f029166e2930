"""A recorder that is killed at any moment has lost the last second at most."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from nvscope.capture.open import open_source
from tests.oracle.builders import telegram
from tests.program import COMMAND, run_text

RATE = 2000
SECOND_NS = 1_000_000_000
OPENED_S = 15


def _port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def _send(port: int, ended: threading.Event, sent: list[int]) -> None:
    """Send telegrams with rising numbers until told to end; note when each was sent."""
    payload = telegram(list_id=7, data=bytes(40))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        begin_ns = time.time_ns()
        while not ended.is_set():
            number = len(sent)
            while time.time_ns() < begin_ns + number * SECOND_NS // RATE:
                time.sleep(0.0005)
            for one in range(number, number + 20):
                out.sendto(payload[:-4] + one.to_bytes(4, "little"), ("127.0.0.1", port))
                sent.append(time.time_ns())


def _taken(port: int, sent: list[int]) -> int:
    """Wait until a recorder has taken all that had come for it; return how many telegrams had been sent before."""
    until_s = time.monotonic() + OPENED_S
    count = len(sent)
    while time.monotonic() < until_s:
        told = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
        waiting = [words[4].split(":")[1] for words in told if words[1].endswith(f":{port:04X}")]
        if waiting and not any(int(one, 16) for one in waiting):
            return count
        time.sleep(0.0002)
    raise TimeoutError("the recorder takes nothing")


@pytest.mark.skipif(sys.platform != "linux", reason="kills a process, and reads /proc")
@pytest.mark.parametrize("seed", range(2))
def test_all_but_the_last_second_is_there(seed: int, tmp_path: Path) -> None:
    port, path = _port(), tmp_path / "x.mcap"
    recorder = subprocess.Popen(
        [*COMMAND, "record", f"udp://127.0.0.1:{port}", "-w", str(path)], stderr=subprocess.DEVNULL
    )
    try:
        until_s = time.monotonic() + OPENED_S
        while not path.exists() and time.monotonic() < until_s:
            time.sleep(0.02)
        time.sleep(0.3)
        ended, sent = threading.Event(), list[int]()
        sender = threading.Thread(target=_send, args=(port, ended, sent))
        sender.start()
        chance = random.Random(seed or time.time_ns())
        time.sleep(chance.uniform(0.1, 1.5))
        least = _taken(port, sent)
        time.sleep(1)
        # However little of the processors the recorder gets, it has run after that second.
        _taken(port, sent)
        time.sleep(chance.uniform(0, 0.2))
        recorder.send_signal(signal.SIGKILL)
    finally:
        recorder.kill()
        recorder.wait()
        ended.set()
        sender.join()
    source = open_source([str(path)])
    found = [
        int.from_bytes(batch.packet(row)[-4:], "little") for batch in source for row in range(len(batch))
    ]  # fmt: skip
    assert found == list(range(len(found)))
    assert len(found) >= least > 0
    assert source.infos[0].truncation is not None
    told = run_text("report", path)
    assert told.returncode == 3
    assert "cut short" in told.stderr
    done = run_text("recover", path, "-w", tmp_path / "whole.mcap")
    assert done.returncode == 0, done.stderr
    assert f"nvscope: {len(found)} frames " in done.stderr.replace("\u202f", "")
    told = run_text("report", tmp_path / "whole.mcap")
    assert (told.returncode, told.stderr) == (0, "")
    os.remove(path)
