"""Measure recordings: how fast they are written and read, how large they are, and how late replayed telegrams are.

    python tests/benchmarks/recording.py                                 two plants of a million telegrams
    python tests/benchmarks/recording.py --live --rate 100000            and recorded from a cable, which needs root

Prints tables, asserts nothing about time. What the columns mean is in README.md beside this file.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import zstandard
from live_cable import cable
from machine import machine
from mcap.writer import CompressionType, Writer
from measurement import usual_environment
from run import generate
from tool import HERE, nvscope_path, python

from nvscope.capture.open import open_source

KINDS = ("cyclic", "events", "many", "large")
LISTS, ELEMENTS = 5, 40
DEFINITION = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL
  w : ARRAY[0..9] OF WORD; r : ARRAY[0..9] OF REAL; b : ARRAY[0..19] OF BYTE;
END_VAR]]></Declarations>
  <NetvarSettings Protocol="UDP">
    <ListIdentifier>{number}</ListIdentifier>
    <Pack>True</Pack>
    <CyclicTransmission>True</CyclicTransmission>
    <Interval>T#10ms</Interval>
  </NetvarSettings>
</GVL>
"""
SCENARIO = 'title = "defined"\nduration = "{seconds}s"\nseed = 1\n'
NODE = """[[node]]
name = "n{number}"
address = "10.0.0.{number}"
[[list]]
name = "l{number}"
index = {number}
sender = "n{number}"
bytes = [80]
items = [40]
interval = "10ms"
jitter = "1ms"
"""


def nvscope(*words: str | Path) -> str:
    """Run nvscope, and return what it says on stderr."""
    command = [str(nvscope_path()), *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False,
                          env=usual_environment())  # fmt: skip
    return done.stderr


def seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def megabytes(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"


def spread(values: list[float], form: str = ".2f") -> str:
    return f"{statistics.median(values):{form}} ({min(values):{form}}–{max(values):{form}})"


def written_by_the_library(file: Path, target: Path) -> float:
    """Have the ``mcap`` library write a message a packet, and return how long that alone takes."""
    packets = [
        (time_ns, batch.packet(row)) for batch in open_source([str(file)]) for row, time_ns in enumerate(batch.ts_ns)
    ]
    times = [int(time_ns) for time_ns, _ in packets]
    begin = time.perf_counter()
    writer = Writer(str(target), compression=CompressionType.ZSTD)
    writer.start("", "benchmark")
    channel = writer.register_channel("/packets", "packet", writer.register_schema("packet", "", b""))
    for time_ns, (_, data) in zip(times, packets, strict=True):
        writer.add_message(channel, time_ns, data, time_ns)
    writer.finish()
    return time.perf_counter() - begin


def offline(folder: Path, kind: str, telegrams: int, runs: int, seed: int) -> None:
    """Print how fast packets are written and read, and what room they take."""
    file, truth = generate(folder, telegrams, seed, kind)
    recording, plain, packed = folder / "r.mcap", folder / "r.pcapng", folder / "r.pcapng.zst"
    writes, library, ratios, reads = [], [], [], []
    for _ in range(runs):
        writes.append(seconds(lambda: nvscope("record", file, "-w", recording, "--packets-only", "--force", "-q")))
        library.append(written_by_the_library(file, folder / "library.mcap"))
    for _ in range(runs):
        pcap = seconds(lambda: nvscope("report", "--json", file))
        reads.append(seconds(lambda: nvscope("report", "--json", recording)))
        ratios.append(reads[-1] / pcap)
    nvscope("convert", file, "-w", plain, "-q")
    with plain.open("rb") as source, packed.open("wb") as target:
        zstandard.ZstdCompressor(level=3).copy_stream(source, target)
    frames = truth["frames"]
    print(
        f"\n{kind}: {truth['telegrams']:,} telegrams, {truth['streams']} streams, {file.stat().st_size / 1e6:,.0f} MB"
    )
    for name, times in (("written by nvscope, whole process", writes), ("written by the library, that alone", library)):
        print(f"  {name:34}  {spread(times)} s, {frames / statistics.median(times):,.0f} a second")
    print(f"  report of it                        {spread(reads)} s, {spread(ratios)} of the pcap's")
    sizes = {"mcap": recording, "pcapng.zst": packed, "library": folder / "library.mcap"}
    print(
        "  size                                "
        + ", ".join(f"{name} {megabytes(path)}" for name, path in sizes.items())
    )
    for path in (recording, plain, packed, folder / "library.mcap"):
        path.unlink()


def defined(folder: Path, duration_s: int) -> tuple[Path, Path]:
    """Return a capture of lists that are defined, and the folder of their definitions."""
    definitions = folder / "definitions"
    definitions.mkdir(exist_ok=True)
    scenario, capture = folder / "defined.toml", folder / "defined.pcap"
    text = SCENARIO.format(seconds=duration_s)
    for number in range(1, LISTS + 1):
        (definitions / f"l{number}.gvl").write_text(DEFINITION.format(number=number))
        text += NODE.format(number=number)
    scenario.write_text(text)
    nvscope("simulate", scenario, "-w", capture, "--force")
    return capture, definitions


def with_topics(folder: Path, runs: int) -> None:
    """Print how fast variables are decoded and written beside the packets."""
    capture, definitions = defined(folder, 600)
    target, frames = folder / "t.mcap", LISTS * 60_000
    times = [
        seconds(lambda: nvscope("convert", capture, "--gvl", definitions, "-w", target, "-q")) for _ in range(runs)
    ]
    rate = frames / statistics.median(times)
    print(f"\n{frames:,} telegrams of {ELEMENTS} variables, with a JSON message each")
    print(f"  written, whole process              {spread(times)} s, {rate:,.0f} a second")
    print(f"  size                                mcap {megabytes(target)}, pcap {megabytes(capture)}")


def replayed(folder: Path, rate: int) -> None:
    """Print how late telegrams are."""
    capture, _ = defined(folder, 60)
    told = nvscope(
        "replay", capture, "--to", "udp://127.0.0.1:45999", "--rate", str(rate / (LISTS * 100)), "--until", "10s"
    )
    print(f"\nreplay at {rate:,} telegrams a second\n  {told.strip().partition(': ')[2]}")


def live(folder: Path, rate: int, telegrams: int, *, topics: bool) -> None:
    """Print whether anything is lost where packets are recorded from a cable on one core."""
    capture, definitions = defined(folder, telegrams // (LISTS * 100))
    with cable() as (sender, receiver):
        target = folder / "live.mcap"
        options = ["--gvl", str(definitions)] if topics else ["--packets-only"]
        command = [str(nvscope_path()), "record", "-i", receiver.device, "-w", str(target), "--force", *options]
        recorder = subprocess.Popen(
            receiver.words("taskset", "-c", "1", *command), stderr=subprocess.PIPE, text=True, env=usual_environment()
        )
        until_s = time.monotonic() + 20
        while not receiver.rings() and time.monotonic() < until_s:
            time.sleep(0.05)
        time.sleep(0.3)
        send = python(str(HERE / "live_sender.py"), sender.device, str(capture), "--rate", str(rate))
        done = subprocess.run(
            sender.words("taskset", "-c", "0", *send), capture_output=True, text=True, check=True, timeout=300
        )
        time.sleep(0.7)
        recorder.send_signal(signal.SIGINT)
        said = recorder.stderr.read() if recorder.stderr else ""
        _, _, usage = os.wait4(recorder.pid, 0)
        recorder.returncode = 0
    sent = json.loads(done.stdout)
    got = re.search(r"nvscope: ([\d\s]+) frames in", said)
    count = int(re.sub(r"\s", "", got[1])) if got else 0
    cpu = usage.ru_utime + usage.ru_stime
    what = "with topics, figures and log" if topics else "packets only"
    rates = f"{sent['sent'] / sent['seconds']:,.0f} a second, {cpu / sent['seconds'] * 100:.0f} % of a core"
    print(f"\nlive, {what}: {sent['sent']:,} sent, {count:,} recorded, {rates}")
    if "dropped" in said:
        print(f"  {said.strip()}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure recordings.")
    parser.add_argument("--telegrams", type=int, default=1_000_000)
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=["cyclic", "many"])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--live", action="store_true", help="record from a cable between two network namespaces, too")
    parser.add_argument("--rate", type=int, default=100_000, help="telegrams a second of --live, without topics")
    parser.add_argument("--topics-rate", type=int, default=30_000, help="telegrams a second of --live, with topics")
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    arguments = parser.parse_args()
    arguments.dir.mkdir(exist_ok=True)
    print(machine())
    for kind in arguments.kind:
        offline(arguments.dir, kind, arguments.telegrams, arguments.runs, arguments.seed)
    with_topics(arguments.dir, arguments.runs)
    replayed(arguments.dir, 10_000)
    if arguments.live:
        live(arguments.dir, arguments.rate, 1_000_000, topics=False)
        live(arguments.dir, arguments.topics_rate, 300_000, topics=True)


if __name__ == "__main__":
    main()
