"""Compare ``nvscope report`` on an interface with other ways to receive, on the same traffic, in one run.

    python tests/benchmarks/live.py                                   dumpcap and nvscope in turn, four plants
    python tests/benchmarks/live.py --kind cyclic --others            and tshark and Scapy
    python tests/benchmarks/live.py --rate 50000 --udp                a plain socket at 50 000 telegrams a second

Prints tables, asserts nothing about time. What the columns mean is in README.md beside this file. Needs Linux, root.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from live_cable import End, cable
from live_consumers import DUMPCAP, NVSCOPE, NVSCOPE_UDP, OTHERS, Consumer, Received
from live_flood import flood
from machine import machine
from measurement import MemorySampler, usual_environment
from run import generate
from tables import MIB
from tool import HERE, python

KINDS = ("cyclic", "events", "many", "large")
MOST_TELEGRAMS = {"large": 1_000_000}
"""1 400 bytes each: a file that fits into the page cache beside the others."""

SETTLE_S = 0.7
MOST_S = 120
MEMORY_RATE, MEMORY_S = 20_000, 60
SENDING_CORE, RECEIVING_CORE = 0, 1


@dataclass(frozen=True)
class Turn:
    """One program that received what one sender sent."""

    received: Received
    sent: int
    sending_s: float
    cpu_s: float
    user_s: float

    @property
    def us_each(self) -> float:
        """Processor time for each that was received."""
        return self.cpu_s / max(self.received.count, 1) * 1e6


@dataclass
class Row:
    """What came of one program, by number of the turn; ``idle_s`` is the time it takes where nothing is sent.

    A turn that somebody broke off is left out; ``note`` says why.
    """

    consumer: Consumer
    turns: dict[int, Turn] = field(default_factory=dict)
    idle_s: list[float] = field(default_factory=list)
    note: str = ""


def _until_open(end: End, consumer: Consumer) -> None:
    until = time.monotonic() + 20
    while time.monotonic() < until:
        if end.listens() if consumer.is_socket else end.rings():
            time.sleep(0.3)
            return
        time.sleep(0.05)
    raise TimeoutError(f"{consumer.name} opened nothing")


def turn(
    consumer: Consumer,
    ends: tuple[End, End],
    file: Path,
    truth: dict[str, Any],
    rate: int,
    *,
    idle_s: float | None = None,
    samples: list[tuple[float, int]] | None = None,
) -> Turn:
    """Let one program receive all that a sender sends; or nothing at all for a while. ``samples`` take its memory."""
    sender, receiver = ends
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as said:
        words = ["taskset", "-c", str(RECEIVING_CORE), *consumer.command(receiver.device)]
        watching = subprocess.Popen(
            receiver.words(*words), stdin=subprocess.DEVNULL, stdout=out, stderr=said, env=usual_environment()
        )
        sampler = MemorySampler(watching.pid, samples)
        try:
            _until_open(receiver, consumer)
            sampler.start()
            told: dict[str, Any] = {"sent": 0, "seconds": idle_s}
            if idle_s is None:
                # Pinned to a core of its own, as on a wire: the kernel copies into rings in the sender's time.
                command = [
                    "taskset", "-c", str(SENDING_CORE),
                    *python(str(HERE / "live_sender.py"), sender.device, str(file), "--rate", str(rate)),
                ]  # fmt: skip
                done = subprocess.run(
                    sender.words(*command), capture_output=True, text=True, check=True, timeout=MOST_S
                )
                told = json.loads(done.stdout)
            else:
                time.sleep(idle_s)
            sampler.stop()
            time.sleep(SETTLE_S)
            watching.send_signal(signal.SIGINT)
            _, status, usage = os.wait4(watching.pid, 0)
            watching.returncode = os.waitstatus_to_exitcode(status)
        finally:
            if watching.returncode is None:
                watching.kill()
                watching.wait()
        out.seek(0)
        said.seek(0)
        received = consumer.read(out.read(), said.read())
    sent = consumer.counts(truth) if told["sent"] else 0
    return Turn(received, sent, told["seconds"], usage.ru_utime + usage.ru_stime, usage.ru_utime)


def compare(
    consumers: Sequence[Consumer], ends: tuple[End, End], file: Path, truth: dict[str, Any], rate: int, runs: int
) -> list[Row]:
    rows = [Row(one, note=one.missing or "") for one in consumers]
    for number in range(runs + 1):
        for row in rows:
            if not row.consumer.missing:
                try:
                    one = turn(row.consumer, ends, file, truth, rate)
                except (OSError, ValueError, TimeoutError, subprocess.SubprocessError) as error:
                    row.note = f"a turn is left out: {error}"[:200]
                    continue
                if number:  # the first is to warm up
                    row.turns[number] = one
    for row in rows:
        if row.turns:
            idle_s = statistics.median(one.sending_s for one in row.turns.values())
            row.idle_s = [turn(row.consumer, ends, file, truth, rate, idle_s=idle_s).cpu_s for _ in range(min(runs, 3))]
    return rows


def _spread(values: Sequence[float], form: str = ".2f") -> str:
    middle = statistics.median(values)
    return f"{middle:{form}} ({min(values):{form}}–{max(values):{form}})"


def print_rows(rows: list[Row]) -> None:
    heads = (("k sent/s", 10), ("sent", 11), ("received", 11), ("missing", 9), ("dropped", 9))
    heads += (("µs cpu each", 22), ("/ dumpcap", 22), ("idle cpu s", 12))
    print(" " * 28 + "".join(f"{name:>{width}}" for name, width in heads))
    base = next((row for row in rows if row.consumer is DUMPCAP and row.turns), None)
    for row in rows:
        if not row.turns:
            print(f"{row.consumer.name:28}{row.note}")
            continue
        turns = list(row.turns.values())
        ratio = "–"
        if base is not None:
            ratio = _spread(
                [row.turns[at].us_each / base.turns[at].us_each for at in row.turns.keys() & base.turns.keys()] or [0.0]
            )
        missing = [one.sent - one.received.count for one in turns]
        dropped = [one.received.dropped for one in turns]
        known = [one for one in dropped if one is not None]
        rate = statistics.median(one.sent / one.sending_s for one in turns) / 1000
        print(
            f"{row.consumer.name:28}{rate:>10.0f}{turns[0].sent:>11,}"
            f"{statistics.median(one.received.count for one in turns):>11,.0f}{max(missing):>9,}"
            f"{max(known) if known else '–':>9}{_spread([one.us_each for one in turns]):>22}{ratio:>22}"
            f"{statistics.median(row.idle_s) if row.idle_s else 0:>12.2f}"
        )
        for note in (turns[-1].received.notes, row.note):
            if note:
                print(f"{'':28}{note}")


def print_memory(consumer: Consumer, ends: tuple[End, End], file: Path, truth: dict[str, Any], what: str) -> None:
    samples: list[tuple[float, int]] = []
    one = turn(consumer, ends, file, truth, MEMORY_RATE, samples=samples)
    half = samples[len(samples) // 2 :]
    seconds, mib = [at for at, _ in half], [held / MIB for _, held in half]
    slope = statistics.linear_regression(seconds, mib).slope * 60
    print(
        f"{what:28}{one.received.count:>11,} received, {one.sent - one.received.count:,} missing, "
        f"{one.sending_s:.0f} s; "
        f"anon MB {mib[0]:.1f} at half time, {mib[-1]:.1f} at the end, {slope:+.2f} a minute; {one.received.notes}"
    )


def _end(number: int, frame: object) -> None:
    raise SystemExit(128 + number)  # so that namespaces go


def main() -> None:
    signal.signal(signal.SIGTERM, _end)
    parser = argparse.ArgumentParser(description="Compare nvscope on an interface with other ways to receive.")
    parser.add_argument("--telegrams", type=int, default=2_000_000)
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--runs", type=int, default=5, help="turns of each program after one to warm up")
    parser.add_argument("--rate", type=int, default=0, help="frames a second; 0: as fast as the sender can")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--others", action="store_true", help="tshark and Scapy too")
    parser.add_argument("--udp", action="store_true", help="nvscope's plain socket in place of interfaces")
    parser.add_argument("--memory", action="store_true", help="how memory grows at 20 000 a second, also under a flood")
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    arguments = parser.parse_args()
    consumers = [NVSCOPE_UDP] if arguments.udp else [DUMPCAP, NVSCOPE, *(OTHERS if arguments.others else ())]
    print(machine())
    if arguments.memory:
        with cable() as ends:
            count = MEMORY_RATE * MEMORY_S
            for kind in ("steady", *arguments.kind, None):
                file, truth = (
                    generate(arguments.dir, count, arguments.seed, kind) if kind else flood(arguments.dir, count)
                )
                print_memory(NVSCOPE, ends, file, truth, kind or "100 000 made-up senders")
        return
    for kind in arguments.kind:
        count = min(arguments.telegrams, MOST_TELEGRAMS.get(kind, arguments.telegrams))
        file, truth = generate(arguments.dir, count, arguments.seed, kind)
        with cable() as ends:
            rows = compare(consumers, ends, file, truth, arguments.rate, arguments.runs)
        print(f"\n{kind}: {truth['telegrams']:,} telegrams, {truth['lists']} lists, {truth['streams']} streams")
        print_rows(rows)


if __name__ == "__main__":
    main()
