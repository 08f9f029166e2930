"""Rules on a live source: judged at its end, or as soon as one is broken; a warm-up counts from the first frame."""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.check.test_verdicts import PLANT, ruled
from tests.oracle.builders import telegram
from tests.program import COMMAND, run_text


def _port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def _judged(rules: Path, counters: Iterable[int], *options: str) -> tuple[int, str, int]:
    """Send telegrams of list 7 to what checks, twenty a second; return the code, what was told, how many were sent."""
    port, sent = _port(), 0
    with subprocess.Popen(
        [*COMMAND, "check", f"udp://127.0.0.1:{port}", "-d", f"udp.port=={port},nvl", "--rules", str(rules), *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as done, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:  # fmt: skip
        assert done.stderr is not None
        assert "a plain socket" in done.stderr.readline()
        for counter in counters:
            if done.poll() is not None:
                break
            out.sendto(telegram(list_id=7, counter=counter, data=bytes(4)), ("127.0.0.1", port))
            sent += 1
            time.sleep(0.05)
        told, said = done.communicate(timeout=60)
    return done.returncode, told + said, sent


def test_the_first_failure_ends_it(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "gap"', 'check = "eventually"\nexpr = "nv.index == 8"')
    counters = [*range(1, 10), *range(20, 2000)]
    code, told, sent = _judged(rules, counters, "--fast", "--for", "100s")
    assert (code, sent < len(counters)) == (1, True), told
    assert "worst 10 telegrams" in told


def test_what_is_kept_is_told_at_the_end(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "gap"', 'check = "loss"')
    code, told, _ = _judged(rules, range(1, 30), "--fast", "--for", "4s")
    assert (code, "● 2 rules passed" in told) == (0, True), told


def test_a_warm_up_counts_from_the_first_frame(tmp_path: Path) -> None:
    """What is lost at the beginning breaks nothing."""
    lossy = [1, 5, 9, *range(13, 60)]
    code, told, _ = _judged(ruled(tmp_path, 'check = "gap"', defaults='warmup = "1s"'), lossy, "--for", "5s")
    assert code == 0, told
    code, told, _ = _judged(ruled(tmp_path, 'check = "gap"'), lossy, "--for", "5s")
    assert code == 1, told


def test_files_have_an_end(tmp_path: Path) -> None:
    done = run_text("check", PLANT, "--rules", ruled(tmp_path, 'check = "gap"'), "--fast")
    assert (done.returncode, "--fast ends what is live" in done.stderr) == (2, True)


@pytest.mark.parametrize("warmup", ["0s", "2s"])
def test_stdin_is_judged_as_the_file_is(warmup: str, tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "loss"\nlist = 7', 'check = "cycle"\nlist = 9\ninterval = "400ms"',
                  'check = "coherence"\nlist = 7', defaults=f'warmup = "{warmup}"')  # fmt: skip
    done = subprocess.run(
        [*COMMAND, "check", "-", "--rules", str(rules), "--json"], stdin=PLANT.open("rb"), capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    of_file = run_text("check", PLANT, "--rules", rules, "--json")
    assert done.stdout.partition('"verdict"')[2] == of_file.stdout.partition('"verdict"')[2]
