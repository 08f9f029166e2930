"""Measure WebVisu: requests and replies of 100 variables, cut at random into segments, beside tshark's HTTP dissector.

    python tests/benchmarks/pages.py                              100 000 requests of 20 clients that stay connected
    python tests/benchmarks/pages.py --requests 1000000
    python tests/benchmarks/pages.py --kind short                 a connection for each request
    python tests/benchmarks/pages.py --one-core                   both on one core: nvscope would take two

tshark prints the bodies, nvscope reports. 1 % of the segments are there twice, 0.1 % are missing. Prints a table,
asserts nothing about time. What the columns mean is in README.md beside this file.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

from machine import machine
from measurement import Run, measure
from pairs import print_pairs
from tool import nvscope_path

VARIABLES, CLIENTS, PORT = 100, 20, 8080
TWICE, MISSING, LARGEST = 0.01, 0.001, 1400
SERVER = 0x0A000AFF
FIN, SYN, PSH_ACK, ACK = 1, 2, 0x18, 0x10
_HEAD = b"POST /plc/webvisu.htm HTTP/1.1\r\nHost: 10.0.10.255\r\nContent-Type: application/x-www-form-urlencoded\r\n"
_REPLY = b"HTTP/1.1 200 OK\r\nServer: WAGO_Webs\r\nPragma: no-cache\r\nContent-Type: text/html\r\n"


class Writer:
    """Writes segments as frames of a capture with nanoseconds, 2 µs apart."""

    def __init__(self, path: Path, chance: random.Random) -> None:
        self._file, self._chance = path.open("wb"), chance
        self._file.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 262144, 1))
        self.now_ns = 1_700_000_000_000_000_000

    def frame(self, ends: tuple[int, int, int, int], numbers: tuple[int, int], flags: int, data: bytes = b"") -> None:
        self.now_ns += 2000
        source, destination, source_port, port = ends
        tcp = struct.pack(">HHIIBBHHH", source_port, port, *(one % 2**32 for one in numbers), 0x50, flags, 8192, 0, 0)
        size = 20 + len(tcp) + len(data)
        ip = struct.pack(">BBHHHBBHII", 0x45, 0, size, 0, 0x4000, 64, 6, 0, source, destination)
        packet = b"\2\0\0\0\0\1\2\0\0\0\0\2\x08\0" + ip + tcp + data
        self._file.write(struct.pack("<IIII", *divmod(self.now_ns, 10**9), len(packet), len(packet)) + packet)

    def segments(self, ends: tuple[int, int, int, int], numbers: tuple[int, int], data: bytes) -> None:
        """Write data in segments of random lengths, some of which are there twice or missing."""
        at = 0
        while at < len(data):
            part = data[at : at + self._chance.randint(1, LARGEST)]
            for _ in range(2 if self._chance.random() < TWICE else 1):
                if self._chance.random() > MISSING:
                    self.frame(ends, (numbers[0] + at, numbers[1]), PSH_ACK, part)
            at += len(part)

    def close(self) -> None:
        self._file.close()


def replies(chance: random.Random) -> Iterator[bytes]:
    """Yield replies in which a value changes now and then."""
    values = ["0"] * VARIABLES
    while True:
        values[chance.randrange(VARIABLES)] = str(chance.randrange(1000))
        body = f"|{'|'.join(values)}|".encode()
        yield _REPLY + b"Content-Length: %d\r\n\r\n" % len(body) + body


def generate(path: Path, requests: int, *, short: bool) -> None:
    """Write the capture; ``short``: each request has a connection of its own."""
    chance = random.Random(1)
    writer, answers = Writer(path, chance), replies(chance)
    body = f"|0|{VARIABLES}{''.join(f'|{one}|4|{146 + 2 * one}|2|1' for one in range(VARIABLES))}|".encode()
    request = _HEAD + b"Content-Length: %d\r\n\r\n" % len(body) + body
    numbers = [[chance.getrandbits(32), chance.getrandbits(32)] for _ in range(CLIENTS)]
    for place in range(requests):
        own = numbers[place % CLIENTS]
        port = 10_000 + place // CLIENTS % 50_000 if short else 40_000
        up = (0x0A000001 + place % CLIENTS, SERVER, port, PORT)
        down = (up[1], up[0], up[3], up[2])
        if short:
            own[:] = chance.getrandbits(32), chance.getrandbits(32)
            writer.frame(up, (own[0] - 1, 0), SYN)
            writer.frame(down, (own[1] - 1, own[0]), SYN | ACK)
        writer.segments(up, (own[0], own[1]), request)
        own[0] += len(request)
        answer = next(answers)
        writer.segments(down, (own[1], own[0]), answer)
        own[1] += len(answer)
        if short:
            writer.frame(down, (own[1], own[0]), FIN | ACK)
            writer.frame(up, (own[0], own[1] + 1), FIN | ACK)
        writer.now_ns += 100_000
    writer.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--requests", type=int, default=100_000)
    parser.add_argument("--kind", choices=("kept", "short"), default="kept")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--one-core", action="store_true")
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    told = parser.parse_args()
    print(machine())
    told.dir.mkdir(exist_ok=True)
    path = told.dir / f"pages-{told.kind}-{told.requests}.pcap"
    if not path.exists():
        generate(path, told.requests, short=told.kind == "short")
    core = max(os.sched_getaffinity(0)) if told.one_core else None
    ours = [str(nvscope_path()), "report", "--json", "-q", str(path)]
    theirs = ["tshark", "-n", "-r", str(path), "-d", f"tcp.port=={PORT},http", "-Y", "http", "-T", "fields"]
    theirs += ["-e", "frame.number", "-e", "http.file_data"]
    if shutil.which("tshark") is None:
        raise SystemExit("tshark is not installed")
    pairs: list[tuple[Run, Run]] = []
    for _ in range(told.runs + 1):
        pairs.append((measure(ours, core), measure(theirs, core)))
    counted = pairs[1:]
    print(f"\n{told.requests} requests and replies, connections {told.kind}\n")
    print_pairs("tshark", counted, told.requests)


if __name__ == "__main__":
    main()
