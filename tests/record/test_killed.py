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

RATE = 20_000
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
        time.sleep(random.Random(seed or time.time_ns()).uniform(1.1, 2.5))
        killed_ns = time.time_ns()
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
    assert found
    assert len(found) >= sum(one <= killed_ns - SECOND_NS for one in sent)
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
