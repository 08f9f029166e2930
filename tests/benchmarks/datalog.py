"""Measure `nvscope datalog`: samples of a list of 100 variables into SQLite, beside a plain Python loop.

    python tests/benchmarks/datalog.py                              100 000 samples, every value of each
    python tests/benchmarks/datalog.py --samples 1000000
    python tests/benchmarks/datalog.py --kind changes               storeChangesOnly: five values change each time

Both write the same rows, in blocks of 1000, and this is checked. Prints a table, asserts nothing about time. What the
columns mean is in README.md beside this file.
"""

from __future__ import annotations

import argparse
import os
import random
import sqlite3
import struct
import sys
import tempfile
from pathlib import Path

from machine import machine
from measurement import Run, measure
from pairs import print_pairs
from tool import nvscope_path

VARIABLES, LIST_ID, CHANGING = 100, 7, 5
_START_NS, _INTERVAL_NS = 1_700_000_000_000_000_000, 1_000_000


def generate(path: Path, samples: int, kind: str) -> None:
    """Write the capture: a telegram each millisecond; of ``changes``, few of its values are others than before."""
    chance = random.Random(1)
    size = 20 + 2 * VARIABLES
    udp = struct.pack(">HHHH", 1202, 1202, 8 + size, 0)
    ip = struct.pack(">BBHHHBBHII", 0x45, 0, 28 + size, 0, 0x4000, 64, 17, 0, 0x0A000001, 0x0A0000FF)
    front = b"\xff" * 6 + b"\2\0\0\0\0\1\x08\0" + ip + udp
    values = [0] * VARIABLES
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 262144, 1))
        for sample in range(samples):
            if kind == "every":
                values = [chance.randrange(-30_000, 30_000) for _ in range(VARIABLES)]
            else:
                for place in chance.sample(range(VARIABLES), CHANGING):
                    values[place] += 1 if values[place] < 30_000 else -60_000
            telegram = struct.pack("<IIHHHHHBB", 0x33532D00, 0, LIST_ID, 0, VARIABLES, size, sample & 0xFFFF, 0, 0)
            packet = front + telegram + struct.pack(f"<{VARIABLES}h", *values)
            seconds, rest_ns = divmod(_START_NS + sample * _INTERVAL_NS, 10**9)
            file.write(struct.pack("<IIII", seconds, rest_ns, len(packet), len(packet)) + packet)


def definition(path: Path) -> None:
    """Write the definition of the list."""
    path.write_text(
        f"<GVL><Declarations><![CDATA[VAR_GLOBAL\n aValue : ARRAY [0..{VARIABLES - 1}] OF INT;\nEND_VAR]]>"
        "</Declarations>"
        f'<NetvarSettings Protocol="UDP"><ListIdentifier>{LIST_ID}</ListIdentifier><Pack>True</Pack>'
        "<Checksum>False</Checksum><Acknowledge>False</Acknowledge><CyclicTransmission>True</CyclicTransmission>"
        "<TransmissionOnChange>False</TransmissionOnChange><TransmissionOnEvent>False</TransmissionOnEvent>"
        '<Interval>T#1ms</Interval><ProtocolSettings><ProtocolSetting Name="Broadcast Adr." Value="255.255.255.255" />'
        '<ProtocolSetting Name="Port" Value="1202" /></ProtocolSettings></NetvarSettings></GVL>'
    )


def configuration(path: Path, kind: str) -> None:
    """Write the configuration of the session: a row in each cycle of the list."""
    variables = "".join(f'<Variable name="Arp.Plc.Eclr/aValue[{place}]"/>' for place in range(VARIABLES))
    path.write_text(
        '<DataLoggerConfigDocument><General name="benchmark" taskContext="values"/>'
        f'<Datasink dst="x.db" tsfmt="Iso8601" storeChangesOnly="{str(kind == "changes").lower()}"/>'
        f"<Variables>{variables}</Variables></DataLoggerConfigDocument>"
    )


def rows_of(path: Path) -> tuple[int, list[tuple[object, ...]]]:
    """Return how many rows a database has, and the last ones in the order of the names."""
    database = sqlite3.connect(path)
    (table,) = database.execute("SELECT name FROM sqlite_master").fetchone()
    names = [name for _, name, *_ in database.execute(f"PRAGMA table_info({table})")]
    order = ", ".join(f'"{name}"' for name in sorted(names))
    count = database.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
    return count, database.execute(f"SELECT {order} FROM {table} ORDER BY rowid DESC LIMIT 100").fetchall()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--kind", choices=("every", "changes"), default="every")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    told = parser.parse_args()
    print(machine())
    told.dir.mkdir(exist_ok=True)
    capture = told.dir / f"datalog-{told.kind}-{told.samples}.pcap"
    if not capture.exists():
        generate(capture, told.samples, told.kind)
    gvl, config = told.dir / "values.gvl", told.dir / "datalog.xml"
    definition(gvl)
    configuration(config, told.kind)
    mine, plain = told.dir / "nvscope.db", told.dir / "plain.db"
    core = max(os.sched_getaffinity(0))
    ours = [
        str(nvscope_path()),
        "datalog",
        str(capture),
        "--config",
        str(config),
        "--gvl",
        str(gvl),
        "-w",
        str(mine),
        "-q",
    ]
    script = Path(__file__).with_name("plain_datalog.py")
    theirs = [sys.executable, str(script), str(capture), str(plain), str(VARIABLES), told.kind]
    pairs: list[tuple[Run, Run]] = []
    for _ in range(told.runs + 1):
        for path in (mine, plain):
            path.unlink(missing_ok=True)
        pairs.append((measure(ours, core), measure(theirs, core)))
    if rows_of(mine) != rows_of(plain):
        raise SystemExit("both did not write the same rows")
    counted = pairs[1:]
    print(f"\n{told.samples} samples of {VARIABLES} variables, {told.kind}\n")
    print_pairs("plain loop", counted, told.samples)


if __name__ == "__main__":
    main()
