"""Fields, dumps and times against tshark, those of the header against its Lua dissector."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from dissectors.netvar import HEADER
from nvscope.report.packets.records import SeparatedFields, separation
from nvscope.report.packets.text import Text
from nvscope.view.lines.netvar_line import Moment
from tests.report.packets.written import INTERFACES, MOMENTS, PEERS, PUBLIC, ROOT, fields, written_of

DISSECTOR = ROOT / "tests" / "benchmarks" / "dissector.lua"

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")


def tshark(path: Path, *options: str) -> str:
    command = ["tshark", "-n", "-o", "ip.defragment:FALSE", "-X", f"lua_script:{DISSECTOR}", "-r", str(path), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@needs_tshark
@pytest.mark.parametrize("path", [PEERS, INTERFACES, PUBLIC], ids=lambda path: path.name)
def test_generic_fields_are_those_of_tshark(path: Path) -> None:
    names = [
        "frame.number", "frame.time_epoch", "frame.time_relative", "frame.time_delta", "frame.len", "frame.cap_len",
        "ip.src", "ip.dst", "udp.srcport", "udp.dstport", "udp.length", "udp.payload",
    ]  # fmt: skip
    asked = [*names, "ipv6.src", "ipv6.dst"]
    # Without the second dissector, udp.payload is there for all datagrams.
    theirs = {}
    for line in tshark(path, "-T", "fields", *(part for name in asked for part in ("-e", name))).splitlines():
        cells = line.split("\t")
        cells[6], cells[7] = cells[6] or cells[12], cells[7] or cells[13]
        theirs[cells[0]] = cells[:12]
    ours = [line.split("\t") for line in written_of(SeparatedFields(fields(*names), separation([])), path).splitlines()]
    assert len(ours) > 10
    assert ours == [theirs[line[0]] for line in ours]


@needs_tshark
@pytest.mark.parametrize("path", [PEERS, INTERFACES, PUBLIC], ids=lambda path: path.name)
def test_header_fields_are_those_of_the_lua_dissector(path: Path) -> None:
    names = ["frame.number", *(f"nv.{entry.name}" for entry in HEADER), "nv.data"]
    theirs = [
        line.split("\t")
        for line in tshark(
            path,
            "-Y",
            "nv and not (ip.flags.mf == 1 or ip.frag_offset > 0)",
            "-T",
            "fields",
            *(part for name in names for part in ("-e", name)),
        ).splitlines()
    ]
    ours = [line.split("\t") for line in written_of(SeparatedFields(fields(*names), separation([])), path).splitlines()]
    complete = [line for line in ours if line[names.index("nv.checksum")]]
    assert complete == theirs
    assert len(theirs) > 10


@needs_tshark
def test_a_dump_is_that_of_tshark() -> None:
    def dumps(text: str) -> list[str]:
        return [line for line in text.splitlines() if re.match(r"[0-9a-f]{4}  ", line)]

    theirs = dumps(tshark(PUBLIC, "-x"))
    assert dumps(written_of(Text(dumps=True), PUBLIC)) == theirs
    assert dumps(written_of(Text(trees=True, dumps=True), PUBLIC)) == theirs
    assert len(theirs) > 50


@needs_tshark
@pytest.mark.parametrize("moment", MOMENTS)
def test_times_are_told_as_by_tshark(moment: Moment, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "America/St_Johns")
    time.tzset()
    try:
        # What is d here, since the telegram shown before, is dd there.
        theirs = tshark(
            PEERS, "-Y", "udp", "-t", "dd" if moment == "d" else moment, "-T", "fields", "-e", "_ws.col.Time"
        )
        ours = written_of(Text(moment=moment), PEERS)
    finally:
        monkeypatch.undo()
        time.tzset()
    pattern = re.compile(r" *\d+ +((?:[\d-]{10} )?-?[\d:.]+)  ")
    told = [match[1] for match in map(pattern.match, ours.splitlines()) if match]
    assert told == [line[: len(line) - 3] for line in theirs.splitlines()]
    assert len(told) == 862
