"""A text log whose last line is cut: its frame is the one that was there, or it is named; no value is made up."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.capture.capture_file import CaptureFile
from tests.capture.can.logs import Frame, frames_of

ASC = "date Sat Sep 30 10:06:13.191 2017\nbase {base}  timestamps absolute\nno internal events logged\n"
HEX, DEC = ASC.format(base="hex"), ASC.format(base="dec")
TRC_1 = ";$FILEVERSION=1.1\n;$STARTTIME=43008.920986006944\n"
TRC_2 = ";$FILEVERSION=2.1\n;$STARTTIME=43008.920986006944\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
CSV = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"

LAST_LINES = [
    ("asc", HEX, " 0.2 1 110 Rx d 2 05 06"),
    ("asc", HEX, " 0.2 1 110x Rx d 2 05 06  Length = 240015 BitCount = 124 ID = 272"),
    ("asc", HEX, " 0.2 1 110 Rx d c 1 2 3 4 5 6 7 08"),
    ("asc", HEX, " 0.2 1 110 Rx r 8"),
    ("asc", HEX, " 0.2 1 ErrorFrame ECC: 10100010"),
    ("asc", HEX, " 0.2 1 ErrorFrame Flags = 0x2 CodeExt = 0x0 Code = 0x82 ID = 0 DLC = 0"),
    ("asc", HEX, " 0.2 1 OverloadFrame"),
    ("asc", HEX, " 0.2 CANFD 1 Rx 300  NAME_1  1 0 2 2 01 02 1 2 3000 4 5 6 7 8"),
    ("asc", HEX, " 0.2 CANFD 1 Rx 300  0 0 2 2 01 02 1 2 200000 4 5 6 7 8"),
    ("asc", DEC, " 0.2 1 110 Rx d 2 5 123"),
    ("trc", TRC_1, "     2)       200.0  Rx         0110  2  05 06"),
    ("trc", TRC_1, "     2)       200.0  Rx         0110  8  RTR"),
    ("trc", TRC_1, "     2)       200.0  Error      0004  4  01 02 03 11"),
    ("trc", TRC_2, "     2       200.000 DT 1      0110 Rx -  2    05 06"),
    ("trc", TRC_2, "     2       200.000 FB 1      0110 Rx -  9    " + "1a " * 11 + "1b"),
    ("trc", TRC_2, "     2       200.000 RR 1      0110 Rx -  4"),
    ("csv", CSV, "0.2,0x110,0,0,0,8,AQIDBAUGBwg="),
    ("csv", CSV, "0.2,0x110,0,0,0,12,AQIDBAUGBwgJCgsM"),
    ("csv", CSV, "0.2,0x4,0,0,1,8,AQIDBAUGBwg="),
    ("log", "(1.0) can1 110#0000000000000000\n(1.0) can0 110#0102\n", "(1.2) can0 110#0506"),
    ("log", "(1.0) can0 110#0102 R\r\n", "(1.2) can0 110#0506 R"),
    ("log", "(1.0) can0 110##1010203\n", "(1.2) can0 110##1040506"),
    ("log", "(1.0) can0 110#R8\n", "(1.2) can0 110#R8"),
    ("txt", " (001.0)  can0  110   [2]  01 02\n", " (001.2)  can0  110   [2]  05 06"),
    (
        "txt",
        " (001.0)  can0  110   [2]  01 02\n",
        " (001.2)  can0  20000088   [8]  00 00 04 00 00 00 00 00   ERRORFRAME",
    ),
    ("txt", " (001.0)  can0  110   [2]  01 02\n", " (001.2)  can0  110   [8]  remote request"),
]
"""Format, what is before, and a last line."""


def read(path: Path, text: str) -> tuple[list[Frame], str]:
    path.write_text(text)
    source = CaptureFile(str(path))
    found = frames_of(source)
    told = source.infos[0].truncation
    return found, told.message if told else ""


@pytest.mark.parametrize(("ending", "before", "line"), LAST_LINES)
def test_a_last_line_that_is_cut_is_no_other_frame(tmp_path: Path, ending: str, before: str, line: str) -> None:
    path = tmp_path / f"a.{ending}"
    whole, fault = read(path, f"{before}{line}\n")
    assert not fault
    # A line that says itself that it is whole needs no line end.
    assert read(path, before + line)[0] == whole
    for end in range(1, len(line)):
        found, fault = read(path, before + line[:end])
        last = found[len(whole) - 1 :]
        if last:
            # An error frame may have lost its class, which says then that it is not known.
            untold = whole[-1]._replace(identifier=0, data=bytes(8))
            assert last[0] in ([whole[-1], untold] if "e" in whole[-1].flags else whole[-1:]), line[:end]
        elif line[:end].strip():
            assert fault, line[:end]
        assert found[: len(whole) - 1] == whole[:-1]


@pytest.mark.parametrize(("ending", "head"), [("trc", TRC_1), ("trc", TRC_2), ("asc", HEX), ("asc", DEC)])
def test_a_log_that_is_cut_within_its_head_is_told(tmp_path: Path, ending: str, head: str) -> None:
    assert read(tmp_path / f"a.{ending}", head) == ([], "")
    for end in range(20, len(head)):
        fault = read(tmp_path / f"a.{ending}", head[:end])[1]
        told = "the file ends within this line" in fault or "neither a time nor a head of a log" in fault
        assert told is (head[end - 1] != "\n"), head[:end]


def test_a_last_comment_behind_messages_needs_no_line_end(tmp_path: Path) -> None:
    for name, text in (
        ("a.trc", TRC_1 + "     1)       200.0  Rx         0110  1  05\n; end"),
        ("a.asc", HEX + " 0.2 1 110 Rx d 2 05 06\nEnd TriggerBlock"),
    ):
        found, fault = read(tmp_path / name, text)
        assert (len(found), fault) == (1, "")
