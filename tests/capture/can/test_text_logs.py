"""``.asc`` and ``.trc`` as the programs of their makers write them: lines, times, errors, and what is wrong in one."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dissectors.batch import Direction
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_sink, open_source
from tests.capture.can.logs import Frame, frames_of

DATE = "Sat Sep 30 10:06:13.191 PM 2017"
ASC = f"date {DATE}\nbase hex  timestamps absolute\nno internal events logged\n"
START_NS = 1_506_809_173_191_000_000
"""2017-09-30 22:06:13.191 UTC."""


@pytest.fixture
def zone(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[None]:
    """The local time zone for a test that asks for one."""
    monkeypatch.setenv("TZ", request.param)
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


utc = pytest.mark.parametrize("zone", ["UTC"], indirect=True)


def read(path: Path, text: str) -> tuple[CaptureFile, list[Frame]]:
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    source = CaptureFile(str(path))
    return source, frames_of(source)


def one(path: Path, text: str) -> Frame:
    source, found = read(path, text)
    assert source.infos[0].truncation is None
    (frame,) = found
    return frame


FAST = "0 0 2 4 01 02"


@utc
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("2.5 1  6F9   Rx   d 2 05 0C  Length = 240015 BitCount = 124 ID = 1785", (0x6F9, "", 2, b"\5\x0c", 0)),
        ("2.5 1  18EBFF00x  Tx   d 1 FF", (0x18EBFF00, "x", 1, b"\xff", 0)),
        ("2.5 1  100  Rx   r", (0x100, "r", 0, b"", 0)),
        ("2.5 1  100  Rx   r 8 Length = 1704000 BitCount = 145", (0x100, "r", 8, b"", 0)),
        ("2.5 1  100  Rx   r Length = 1704000 BitCount = 145", (0x100, "r", 0, b"", 0)),
        ("2.5 1  100  Rx   d c 1 2 3 4 5 6 7 8", (0x100, "", 8, bytes(range(1, 9)), 12)),
        ("2.5 1  100  Rx   d c 1 2 3 4 5 6 7 8 9 a b c", (0x100, "f", 12, bytes(range(1, 13)), 0)),
        ("2.5 1  100  Rx   d 0", (0x100, "", 0, b"", 0)),
        ("2.5 CANFD 1 Rx 300  NAME_1  1 0 2 2 01 02 1 2 3000 4 5 6 7 8", (0x300, "fb", 2, b"\1\2", 0)),
        ("2.5 CANFD 1 Rx 300x  0 1 9 12 " + "0a " * 12 + "1 2 1000 4 5 6 7 8", (0x300, "xfs", 12, b"\n" * 12, 0)),
        # A classic frame, a remote one and an empty one of CAN FD, as their flags say.
        ("2.5 CANFD 1 Rx 300  0 0 2 2 01 02 1 2 200000 4 5 6 7 8", (0x300, "", 2, b"\1\2", 0)),
        ("2.5 CANFD 1 Tx 50005x 0 1 5 0 140000 73 200050 7a60 46500250 460a0250 20011736 20010205",
         (0x50005, "xr", 5, b"", 0)),
        ("2.5 CANFD 1 Rx 300  0 0 0 0 1 2 1000 4 5 6 7 8", (0x300, "f", 0, b"", 0)),
        ("2.5 CANFD 1 Rx 300  0 0 5 0", (0x300, "r", 5, b"", 0)),
        ("2.5 1 ErrorFrame", (0, "e", 8, bytes(8), 0)),
        ("2.5 1 ErrorFrame ECC: 10100010", (8, "e", 8, bytes((0, 0, 4, 2, 0, 0, 0, 0)), 0)),
        (
            "2.5 1 ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 2c0 DLC = 0 Position = 5 Length = 11300",
            (8, "e", 8, bytes((0, 0, 4, 0, 0, 0, 0, 0)), 0),
        ),
        (
            "2.5 1 ErrorFrame Flags = 0x2 CodeExt = 0x0 Code = 0x81 ID = 2c0 DLC = 0 Position = 5 Length = 11300",
            (8, "e", 8, bytes((0, 0, 2, 0, 0, 0, 0, 0)), 0),
        ),
        (
            "2.5 CANFD 1 Tx ErrorFrame Not Acknowledge error, dominant error flag fffe c7 31ca Arb. 556 44 0 0 f 64 00",
            (0x20, "e", 8, bytes(8), 0),
        ),
        ("2.5 1 OverloadFrame", (8, "e", 8, bytes((0, 0, 0x20, 0, 0, 0, 0, 0)), 0)),
    ],
)  # fmt: skip
def test_lines_of_asc(tmp_path: Path, zone: None, line: str, expected: tuple[object, ...]) -> None:
    found = one(tmp_path / "a.asc", f"{ASC}   {line}\n")
    assert found == (START_NS + 2_500_000_000, "can1", *expected)


@pytest.mark.parametrize(
    "line",
    [
        "0.0 Start of measurement", "0.015991 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0",
        "1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%", "1.0 LIN 1 whatever", "1.0 SV: 3 0 1 ::a = 5",
        "1.0 1  123  TxRq  d 1 11", "1.0 CANFD 1 TxRq 300  0 0 1 1 11 1 2 1000 4 5 6 7 8", "// 1.0 1  123 Rx d 1 11",
        "End TriggerBlock", f"Begin TriggerBlock {DATE}", "previous log file: a.asc", "",
    ],
)  # fmt: skip
def test_lines_of_asc_that_are_no_frames(tmp_path: Path, line: str) -> None:
    _, found = read(tmp_path / "a.asc", f"{ASC}{line}\n1.0 1 123 Rx d 1 11\n")
    assert len(found) == 1
    assert one(tmp_path / "a.asc", f"{ASC}{line}\n1.0 1 123 Rx d 1 11\n").identifier == 0x123


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("what a crash left here", "neither a time nor a head"), ("\0" * 40, "characters that no log has"),
        ("0.5 1 \0\0\0\0", "characters that no log has"), ("0.5 1", "the line ends before a frame"),
        ("0.5 1  123", "no direction behind"), ("0.5 1  123 Rx", "neither a data nor a remote frame"),
        ("0.5 1  123 Rx d", "neither a data nor a remote frame"), ("0.5 1  123 Rx d 8 01 02", "2 of 8 bytes"),
        ("0.5 1  123 Rx d 2 01 0g", "no byte of data"), ("0.5 1  123 Rx d 2 01 100", "a byte of data above 255"),
        ("0.5 1  Speed Rx d 1 01", "no identifier in 'Speed'"), ("0.5 1  800 Rx d 0", "of more than 11 bits"),
        ("0.5 1  20000000x Rx d 0", "of more than 29 bits"), ("0.5 1  123 Rx d 1f 1", "a data length code of 31"),
        ("0.5 1x  123 Rx d 0", "no channel"), ("0.5 CANFD 1 Rx", "the line ends before a frame"),
        ("0.5 CANFD 1 Rx 300 0 0", "the line ends before the data"),
        ("0.5 CANFD 1 Rx 300 0 0 9 12 01", "1 of 12 bytes"),
        ("0.5 CANFD 1 Rx 300 0 0 2 3 01 02 03", "where the code 2 means 2"),
        ("0.5 CANFD 1 Up 300 " + FAST, "no direction"),
        ("9999999999.0 1 123 Rx d 0", "a time after 2116"),
    ],
)  # fmt: skip
def test_a_wrong_line_of_asc_is_named(tmp_path: Path, line: str, told: str) -> None:
    good = "0.1 1 123 Rx d 1 11\n"
    source, found = read(tmp_path / "a.asc", f"{ASC}{good}{line}\n{good}")
    assert len(found) == 2
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert truncation.message.startswith("line 5: ")
    assert told in truncation.message
    assert truncation.offset == len((ASC + good).encode())


@utc
@pytest.mark.parametrize("head", ["", "no internal events logged\n", "internal events logged\n", "// version 9\n"])
def test_no_frame_of_asc_is_lost_behind_any_head(tmp_path: Path, zone: None, head: str) -> None:
    text = f"date {DATE}\nbase hex  timestamps absolute {head}0.1 1 123 Rx d 1 11\n0.2 1 124 Rx d 1 11\n"
    _, found = read(tmp_path / "a.asc", text if head else text.replace("absolute ", "absolute\n"))
    assert [frame.identifier for frame in found] == [0x123, 0x124]


@utc
def test_relative_times_of_asc_are_those_since_the_line_before(tmp_path: Path, zone: None) -> None:
    """Lines of other events count too; a block begins anew."""
    later = "Sat Sep 30 10:06:23.191 PM 2017"
    text = (
        f"date {DATE}\nbase hex  timestamps relative\n0.5 1 001 Rx d 0\n0.25 SV: 1\n0.25 1 002 Rx d 0\n"
        f"Begin Triggerblock {later}\n0.125 1 003 Rx d 0\n"
    )
    _, found = read(tmp_path / "a.asc", text)
    assert [frame.ts_ns - START_NS for frame in found] == [500_000_000, 1_000_000_000, 10_125_000_000]


def test_decimal_numbers_of_asc(tmp_path: Path) -> None:
    text = f"date {DATE}\nbase dec  timestamps absolute\n0.5 1 100 Rx d 2 10 255\n"
    assert one(tmp_path / "a.asc", text)[2:] == (100, "", 2, b"\n\xff", 0)


@pytest.mark.parametrize("zone", ["Europe/Berlin"], indirect=True)
@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (".asc", f"date {DATE}\nbase hex  timestamps absolute\n0.0 1 123 Rx d 0\n"),
        (".trc", ";$FILEVERSION=1.1\n;$STARTTIME=43008.92098600694444444\n 1)  0.0  Rx  0123  0\n"),
        (".trc", ";   Start time: 30.09.2017 22:06:13.191\n 1)  0  0123  0\n"),
    ],
)
def test_times_are_those_of_the_local_zone(tmp_path: Path, zone: None, suffix: str, text: str) -> None:
    assert abs(one(tmp_path / f"a{suffix}", text).ts_ns - (START_NS - 2 * 3600 * 10**9)) < 1000


@pytest.mark.parametrize("zone", ["Europe/Berlin"], indirect=True)
def test_times_of_a_trc_that_python_can_wrote_are_of_utc(tmp_path: Path, zone: None) -> None:
    head = ";$FILEVERSION=2.1\n;$STARTTIME=43008.92098600694444444\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    text = f"{head};   Generated by python-can TRCWriter\n 1  0.0 DT 1 0123 Rx - 0\n"
    assert abs(one(tmp_path / "a.trc", text).ts_ns - START_NS) < 1000


TRC_2 = ";$FILEVERSION=2.1\n;$STARTTIME=43008.92098600694444444\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;---\n"
TRC_20 = ";$FILEVERSION=2.0\n;$STARTTIME=43008.5\n;$COLUMNS=N,O,T,I,d,l,D\n"


def trc_1(minor: int) -> str:
    return f";$FILEVERSION=1.{minor}\n;$STARTTIME=43008.92098600694444444\n"


@pytest.mark.parametrize(
    ("text", "channel", "expected"),
    [
        (";   Start time: 18.12.2021 14:28:07.062\n 1)  17535  0100  2  01 02\n", "can1", (0x100, "", 2, b"\1\2", 0)),
        (";   Start time: 18.12.2021 14:28:07.062\n 1)  17535  0100  3  RTR\n", "can1", (0x100, "r", 3, b"", 0)),
        (trc_1(1) + " 1)  17535.4  Tx  00000100  2  01 02\n", "can1", (0x100, "x", 2, b"\1\2", 0)),
        (trc_1(1) + " 1)  17535.4  Rx  0704  1  RTR\n", "can1", (0x704, "r", 1, b"", 0)),
        (trc_1(2) + " 1)  17535.4 3 Rx  0704  1  07\n", "can3", (0x704, "", 1, b"\7", 0)),
        (trc_1(3) + " 1)  17535.4 2 Rx  0704 -  1  07\n", "can2", (0x704, "", 1, b"\7", 0)),
        (TRC_2 + "  1  17535.4 DT 2  0100 Tx -  2    01 02\n", "can2", (0x100, "", 2, b"\1\2", 0)),
        (TRC_2 + "  1  17535.4 FB 2  0100 Tx -  9    " + "0A " * 12, "can2", (0x100, "fb", 12, b"\n" * 12, 0)),
        (TRC_2 + "  1  17535.4 FE 2  0100 Tx -  1    0A\n", "can2", (0x100, "fs", 1, b"\n", 0)),
        (TRC_2 + "  1  17535.4 BI 2  0100 Tx -  1    0A\n", "can2", (0x100, "fbs", 1, b"\n", 0)),
        (TRC_2 + "  1  17535.4 RR 2  0100 Tx -  4\n", "can2", (0x100, "r", 4, b"", 0)),
        (TRC_20 + "  1  17535.4 FD 0100 Tx 12 " + "0A " * 12, "can1", (0x100, "f", 12, b"\n" * 12, 0)),
        # Errors: version 1 tells kind, direction, segment and counters, version 2 nobody knows what.
        (trc_1(1) + " 1)  1.0  Error  0008  4  00 19 08 10\n", "can1", (0x208, "e", 8, b"\0\0\x80\x19\0\0\x10\x08", 0)),
        (trc_1(1) + " 1)  1.0  Error  0004  4  01 02 00 00\n", "can1", (0x208, "e", 8, b"\0\0\x04\x02\0\0\0\0", 0)),
        (";  Start time: 1.1.2021 1:00:00.000\n 1)  17535  0008  4  ERROR  00 19 08 10\n", "can1",
         (0x208, "e", 8, b"\0\0\x80\x19\0\0\x10\x08", 0)),
        (TRC_2 + "  1  17535.4 ER 2     - Rx -  5    04 00 19 08 10\n", "can2", (0, "e", 8, bytes(8), 0)),
    ],
)  # fmt: skip
def test_lines_of_trc(tmp_path: Path, text: str, channel: str, expected: tuple[object, ...]) -> None:
    assert one(tmp_path / "a.trc", text)[1:] == (channel, *expected)


@pytest.mark.parametrize("length", ["l", "L"])
@pytest.mark.parametrize("optional", ["", "N", "B", "R", "NB", "NR", "BR", "NBR"])
def test_lines_of_trc_with_any_columns_that_version_2_permits(tmp_path: Path, optional: str, length: str) -> None:
    letters = [one for one in f"NOTBIdR{length}D" if one not in "NBR" or one in optional]
    told = {"N": "7", "O": "500.000", "B": "2", "I": "0110", "d": "Rx", "R": "-"}
    frames = [
        ("DT", {"l": "2", "L": "2", "D": "05 06"}, (0x110, "", 2, b"\5\6", 0)),
        ("FB", {"l": "12", "L": "9", "D": "0A " * 12}, (0x110, "fb", 12, b"\n" * 12, 0)),
        ("RR", {"l": "4", "L": "4", "D": ""}, (0x110, "r", 4, b"", 0)),
    ]
    lines = ("  ".join((told | {"T": kind} | own)[letter] for letter in letters) for kind, own, _ in frames)
    head = f";$FILEVERSION=2.1\n;$STARTTIME=43008.5\n;$COLUMNS={','.join(letters)}\n"
    source, found = read(tmp_path / "a.trc", head + "\n".join(lines) + "\n")
    assert source.infos[0].truncation is None
    channel = "can2" if "B" in optional else "can1"
    assert [frame[1:] for frame in found] == [(channel, *expected) for _, _, expected in frames]


@pytest.mark.parametrize(
    ("head", "line"),
    [
        (";   Start time: 18.12.2021 14:28:07.062\n", " 2)  17540  FFFFFFFF  4  00 00 00 08 -- -- -- -- BUSHEAVY"),
        (trc_1(1), " 2)  17540.3  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY"),
        (trc_1(3), " 2)  17540.3 1  Warng FFFFFFFF -  4    00 00 00 08 BUSHEAVY"),
        (TRC_2, "  2  17540.3 ST 1         - Rx -  4    00 00 00 08"),
        (TRC_2, "  2  17540.3 EC 1         - Rx -  2    00 08"),
        (TRC_2, "  2  17540.3 EV 1  a word of the user"),
        (TRC_20, "  2  17540.300 ST          Rx    00 00 00 08"),
        (TRC_2, "; a comment"),
    ],
)
def test_lines_of_trc_that_are_no_frames(tmp_path: Path, head: str, line: str) -> None:
    source, found = read(tmp_path / "a.trc", f"{head}{line}\n")
    assert not found
    assert source.infos[0].truncation is None


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("what a crash left here", "no number of a message"), ("  2  1", "no type"), ("  2  1.0 DT", "no identifier"),
        ("  2  1.0 XY 1 0100 Rx - 1 00", "no type of a message in 'XY'"),
        ("  2  1.0 DT 1 0100 Rx - 8 00", "1 of 8 bytes"),
        ("  2  1.0 DT 1 0100 Rx - 8", "0 of 8 bytes"), ("  2  x DT 1 0100 Rx - 1 00", "no time in 'x'"),
        ("  2  1.0 DT 1 0100 Rx - 1 0g", "no byte of data"), ("  2  1.0 DT b 0100 Rx - 1 00", "no bus"),
        ("  2  1.0 FD 1 0100 Rx - 9 00", "1 of 12 bytes"), ("  2  1.0 DT 1 0800 Rx - 0", "of more than 11 bits"),
        ("  2  1.0 DT 1 0100 Rx - 99 00", "a data length code of 99"),
    ],
)  # fmt: skip
def test_a_wrong_line_of_trc_is_named(tmp_path: Path, line: str, told: str) -> None:
    good = "  1  0.5 DT 1 0100 Rx - 1 00\n"
    source, found = read(tmp_path / "a.trc", f"{TRC_2}{good}{line}\n{good}")
    assert len(found) == 2
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert truncation.message.startswith("line 6: ")
    assert told in truncation.message


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.asc", ASC + "0.1 1 123 Rx d 0\n0.2 1 123 Tx d 0\n0.3 1 ErrorFrame\n"),
        ("a.trc", TRC_2 + " 1 0.5 DT 1 0100 Rx - 0\n 2 0.5 DT 1 0100 Tx - 0\n 3 0.5 DT 1 0100 - - 0\n"),
        ("a.log", "(1.0) can0 123# R\n(1.0) can0 123# T\n(1.0) can0 123#\n"),
        ("a.log", "(1.000000) can0 123#01 R\n(1.000000) can0 123#01 T\n(1.000000) can0 123#01\n" * 200),
    ],
)
def test_directions(tmp_path: Path, name: str, text: str) -> None:
    source, _ = read(tmp_path / name, text)
    (batch,) = source
    told = [Direction.RX, Direction.TX, Direction.UNKNOWN]
    assert batch.directions.tolist() == told * (len(batch) // 3)


@pytest.mark.parametrize("suffix", [".pcapng", ".log"])
def test_directions_are_written_and_read_again(tmp_path: Path, suffix: str) -> None:
    source, _ = read(tmp_path / "a.asc", ASC + "0.1 1 123 Rx d 1 11\n0.2 1 123 Tx d 2 11 22\n0.3 1 ErrorFrame\n" * 3)
    (batch,) = source
    with open_sink(str(tmp_path / f"b{suffix}"), source.channels) as sink:
        sink.write(batch)
    (again,) = CaptureFile(str(tmp_path / f"b{suffix}"))
    assert again.directions.tolist() == batch.directions.tolist() == [1, 2, 0] * 3
    assert [again.packet(row) for row in range(9)] == [batch.packet(row) for row in range(9)]


def test_directions_of_files_are_kept_where_they_are_merged(tmp_path: Path) -> None:
    for name, way in (("a", "R"), ("b", "T")):
        lines = [f"({number}.{ord(name)}) can0 123#11 {way}\n" for number in range(5)]
        (tmp_path / f"{name}.log").write_text("".join(lines))
    (tmp_path / "c.log").write_text("(9.0) can0 123#11\n")
    source = open_source([str(tmp_path / f"{name}.log") for name in "abc"])
    told = [way for batch in source for way in batch.directions.tolist()]
    assert told == [1, 2] * 5 + [0]
    part = open_source([str(tmp_path / "a.log")]).between(2 * 10**9, None)
    assert [way for batch in part for way in batch.directions.tolist()] == [1] * 3


@pytest.mark.skipif(not shutil.which("tshark"), reason="no tshark")
def test_directions_are_those_that_tshark_reads(tmp_path: Path) -> None:
    source, _ = read(tmp_path / "a.asc", ASC + "0.1 1 123 Rx d 1 11\n0.2 1 123 Tx d 2 11 22\n0.3 1 ErrorFrame\n")
    with open_sink(str(tmp_path / "b.pcapng"), source.channels) as sink:
        for batch in source:
            sink.write(batch)
    command = ["tshark", "-r", str(tmp_path / "b.pcapng"), "-T", "fields", "-e", "frame.packet_flags_direction"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n")
    assert [int(one, 16) if one else 0 for one in told[:3]] == [1, 2, 0]


@utc
@pytest.mark.parametrize(
    "date",
    [
        "Sat Sep 30 22:06:13 2017", "Sam Sep 30 10:06:13 pm 2017", "Sep 30, 2017 22:06:13", "30 Sep 2017 10:06:13pm",
        "30. September 2017 22:06:13", "30-Sep-2017 22:06:13", "30.09.2017 22:06:13", "30.9.2017, 22:06:13.000",
        "2017-09-30 22:06:13", "2017/09/30 22:06:13", "2017-09-30T22:06:13Z", "2017-10-01T00:06:13.000+02:00",
        "9/30/2017 10:06:13 PM", "09/30/2017 22:06:13", "30/09/2017 22:06:13",
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    ("ending", "text"),
    [
        ("asc", "date {}\nbase hex  timestamps absolute\n0.5 1 123 Rx d 0\n"),
        ("asc", "date rubbish\nbase hex\nBegin Triggerblock {}\n0.5 1 123 Rx d 0\n"),
        ("trc", ";   Start time: {}\n 1)  500  0123  0\n"),
    ],
)
def test_dates_in_the_forms_that_programs_write(tmp_path: Path, zone: None, date: str, ending: str, text: str) -> None:
    assert one(tmp_path / f"a.{ending}", text.format(date)).ts_ns == START_NS - 191_000_000 + 500_000_000


@pytest.mark.parametrize(
    ("ending", "text", "expected"),
    [
        ("asc", "base hex  timestamps absolute\n0.5 1 123 Rx d 0\n", "no date, so times"),
        ("asc", "// 1\ndate rubbish\nbase hex\n0.5 1 123 Rx d 0\n", "line 2: date not understood, so times"),
        # It may be the 5th of June, or the 6th of May.
        ("asc", "date 5/6/2017 15:06:13\nbase hex\n0.5 1 123 Rx d 0\n", "line 1: date not understood, so times"),
        ("asc", "date 31.02.2017 15:06:13\nbase hex\n0.5 1 123 Rx d 0\n", "line 1: date not understood, so times"),
        ("trc", ";$FILEVERSION=1.1\n 1)  500.0 Rx 0123  0\n", "no start time, so times"),
        ("trc", ";$FILEVERSION=1.1\n;$STARTTIME=1700000000.123\n 1)  500.0 Rx 0123  0\n",
         "line 2: start time not understood, so times"),
    ],
)  # fmt: skip
def test_a_start_that_is_not_known_is_told_once(tmp_path: Path, ending: str, text: str, expected: str) -> None:
    source, (frame,) = read(tmp_path / f"a.{ending}", text)
    told = source.infos[0].truncation
    assert told
    assert told.message == f"{expected} count from 1970"
    assert frame.ts_ns == 500_000_000
    source, _ = read(tmp_path / f"a.{ending}", text + "rubbish\n")
    told = source.infos[0].truncation
    assert told
    assert told.message.startswith(f"{expected} count from 1970; line ")
    assert told.message.endswith("; the line is left out")


@utc
@pytest.mark.parametrize(
    ("told", "hour"), [("12:06:13 AM", 0), ("12:06:13 PM", 12), ("1:06:13 PM", 13), ("12:06:13", 12)]
)
def test_hours_of_dates(tmp_path: Path, zone: None, told: str, hour: int) -> None:
    text = f"date Sat Sep 30 {told} 2017\nbase hex  timestamps absolute\n0.0 1 123 Rx d 0\n"
    seconds = one(tmp_path / "a.asc", text).ts_ns // 10**9
    assert seconds % 86_400 == hour * 3600 + 6 * 60 + 13
