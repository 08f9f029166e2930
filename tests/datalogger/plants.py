"""Plants on the wire for tests of the DataLogger: a scenario in a few lines, what it was made of, and its database."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from tests.program_here import run_text

START = "2024-01-01T00:00:"

NODE = """
title = "A list of one telegram"
duration = "{duration}"
seed = 3
wild = {wild}
[[node]]
name = "press"
address = "192.168.1.10"
counter = "{counter}"
"""
LIST = """
[[list]]
name = "{name}"
index = {index}
sender = "press"
bytes = [{sizes}]
interval = "50ms"
phase = "{phase}"
"""


def plant(*faults: str, lists: int = 1, telegrams: int = 1, counter: str = "stream", duration: str = "5s") -> str:
    """Return a scenario: lists of so many telegrams each, every 50 ms, and faults."""
    parts = [
        NODE.format(
            duration=duration, counter=counter, wild=str(any("[[capture_loss]]" in one for one in faults)).lower()
        )
    ]
    for number in range(lists):
        sizes = ", ".join(["4"] * telegrams)
        parts.append(LIST.format(name=f"list{number + 1}", index=number + 1, sizes=sizes, phase=f"{10 * number}ms"))
    return "".join([*parts, *faults])


def gvl(index: int, variables: Sequence[str], *, pack: bool = True, interval: str = "50ms") -> str:
    """Return the definition of a list whose variables are DWORDs."""
    lines = "\n".join(f" {name} : DWORD;" for name in variables)
    return (
        f'<GVL><Declarations><![CDATA[VAR_GLOBAL\n{lines}\nEND_VAR]]></Declarations><NetvarSettings Protocol="UDP">'
        f"<ListIdentifier>{index}</ListIdentifier><Pack>{pack}</Pack><Checksum>False</Checksum>"
        "<Acknowledge>False</Acknowledge><CyclicTransmission>True</CyclicTransmission>"
        "<TransmissionOnChange>False</TransmissionOnChange><TransmissionOnEvent>False</TransmissionOnEvent>"
        f'<Interval>T#{interval}</Interval><ProtocolSettings><ProtocolSetting Name="Broadcast Adr." '
        'Value="255.255.255.255" /><ProtocolSetting Name="Port" Value="1202" /></ProtocolSettings></NetvarSettings>'
        "</GVL>"
    )


def configuration(variables: Sequence[str], general: str = "", sink: str = "") -> str:
    """Return the configuration of a session; what is not said is as by default, but for times as texts."""
    names = "".join(f'<Variable name="{name}"/>' for name in variables)
    times = "" if "tsfmt" in sink else 'tsfmt="Iso8601"'
    return (
        f'<DataLoggerConfigDocument><General name="session" {general}/><Datasink dst="log.db" {times} {sink}/>'
        f"<Variables>{names}</Variables></DataLoggerConfigDocument>"
    )


def simulated(folder: Path, scenario: str, name: str = "plant.pcap") -> Path:
    """Write the capture of a scenario."""
    (folder / "plant.toml").write_text(scenario, encoding="utf-8")
    done = run_text("simulate", "plant.toml", "-w", name, "--force", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / name


def rows_of(path: Path) -> list[tuple[Any, ...]]:
    """Return the rows of the one table of a database, with their rowids; SQLite finds nothing wrong with it."""
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        ((table,),) = database.execute("SELECT name FROM sqlite_master").fetchall()
        return database.execute(f"SELECT rowid, * FROM {table} ORDER BY rowid").fetchall()
