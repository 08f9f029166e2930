"""What candump shows on a screen, read as a log: with each kind of time, and as can-utils' log2long writes it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given

from dissectors.batch import Direction
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.text_lines import TextLines
from tests.capture.can import logs
from tests.capture.can.logs import Frame, frames_of, line_of
from tests.laws import examples
from tests.program_here import run_text

_slow = examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
S_NS = 10**9


def read(path: Path, text: str) -> tuple[CaptureFile, list[Frame]]:
    path.write_text(text, encoding="latin-1")
    source = CaptureFile(str(path))
    assert source.infos[0].format == "candump-screen"
    return source, frames_of(source)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("can0  123   [8]  11 22 33 44 55 66 77 88", ("can0", 0x123, "", 8, bytes.fromhex("1122334455667788"), 0)),
        ("  can0       123   [2]  11 22", ("can0", 0x123, "", 2, b"\x11\x22", 0)),
        ("vcan-9  12345678   [0]", ("vcan-9", 0x12345678, "x", 0, b"", 0)),
        ("can0  123   [4]  remote request", ("can0", 0x123, "r", 4, b"", 0)),
        ("can0  123  [12]  " + "AB " * 12, ("can0", 0x123, "f", 12, b"\xab" * 12, 0)),
        ("can0  123  [08]  " + "AB " * 8, ("can0", 0x123, "f", 8, b"\xab" * 8, 0)),
        ("can0  RX - -  123   [1]  11", ("can0", 0x123, "", 1, b"\x11", 0)),
        ("can0  TX B E  123  [01]  11", ("can0", 0x123, "fbs", 1, b"\x11", 0)),
        ("can0  123   {C}  11 22 33 44 55 66 77 88", ("can0", 0x123, "", 8, bytes.fromhex("1122334455667788"), 12)),
        ("can0  123   [3]  41 42 20                  'AB '", ("can0", 0x123, "", 3, b"AB ", 0)),
        ("can0  123   [3]  27 27 27                  ''''''", ("can0", 0x123, "", 3, b"'''", 0)),
        ("can0  123   [3]  33`22`11", ("can0", 0x123, "", 3, b"\x11\x22\x33", 0)),
        ("can0  20000088   [8]  00 00 04 02 00 00 00 00   ERRORFRAME", ("can0", 0x88, "e", 8, b"\0\0\4\2\0\0\0\0", 0)),
        ("\x1b[31m  can0  \x1b[0m123   [1]  11\x1b[0m", ("can0", 0x123, "", 1, b"\x11", 0)),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", ""])
def test_lines(tmp_path: Path, line: str, expected: tuple[object, ...], end: str) -> None:
    source, found = read(tmp_path / "a.txt", f"  (1436509052.249713)  {line}{end}")
    assert found == [(1_436_509_052_249_713_000, *expected)]
    assert source.infos[0].truncation is None


@pytest.mark.parametrize(
    ("times", "expected_ns"),
    [
        # From zero, differences, which fall, absolute ones, and those with a date.
        (["(000.000000)", "(000.010000)", "(001.020000)"], [0, 10_000_000, 1_020_000_000]),
        (["(000.000000)", "(000.010000)", "(000.009000)"], [0, 10_000_000, 19_000_000]),
        (["(1436509052.249713)", "(1436509052.249712)"], [1_436_509_052_249_713_000, 1_436_509_052_249_712_000]),
    ],
)
def test_times(tmp_path: Path, times: list[str], expected_ns: list[int]) -> None:
    source, found = read(tmp_path / "a.txt", "".join(f" {time}  can0  123   [1]  11\n" for time in times))
    assert [frame.ts_ns for frame in found] == expected_ns
    assert source.infos[0].truncation is None


def test_dates_are_of_the_local_zone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import time  # noqa: PLC0415

    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    try:
        _, (found,) = read(tmp_path / "a.txt", " (2015-07-10 08:17:32.249713)  can0  123   [1]  11\n")
    finally:
        monkeypatch.undo()
        time.tzset()
    assert found.ts_ns == 1_436_509_052_249_713_000


def test_without_times_that_is_told(tmp_path: Path) -> None:
    source, found = read(tmp_path / "a.txt", "  can0  123   [1]  11\n" * 3)
    assert [frame.ts_ns for frame in found] == [0, 0, 0]
    assert "no times were recorded" in str(source.infos[0].truncation)


def test_a_bus_is_not_called_busy_where_no_times_were_recorded(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("  can0  123   [8]  11 22 33 44 55 66 77 88\n" * 3000)
    done = run_text("report", "a.txt", "--bitrate", "10k", "--json", cwd=tmp_path)
    assert done.returncode == 3
    assert [finding["code"] for finding in json.loads(done.stdout)["findings"]] == ["NV903"]


def test_directions(tmp_path: Path) -> None:
    text = "".join(f" (001.0)  can0  {way}123   [1]  11\n" for way in ("RX - -  ", "TX - -  ", ""))
    (batch,) = read(tmp_path / "a.txt", text)[0]
    assert batch.directions.tolist() == [Direction.RX, Direction.TX, Direction.UNKNOWN]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("what a crash left here", "no frame as candump shows it"),
        (" (001.0)  can0  123   [8]  11 22", "not 8 bytes of data"),
        (" (001.0)  can0  123   [2]  11 2", "not 2 bytes of data"),
        (" (001.0)  can0  123   [2]  11 2g", "no byte of data"),
        (" (001.0)  can0  123   [2]  11 22 33", "something else follows"),
        (" (001.0)  can0  FFF   [1]  11", "of more than 11 bits"),
        (" (001.0)  can0  FFFFFFFF   [1]  11", "of more than 29 bits"),
        (" (001.0)  can0  123   [2]  00010001 00010001", "not 2 bytes of data"),
        (" (001.0)  can0  123  [70]  " + "11 " * 70, "70 bytes of data"),
        (" (soon)  can0  123   [1]  11", "no time in 'soon'"),
        ("\tcontroller-problem{rx-error-warning}", "no frame as candump shows it"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, line: str, told: str) -> None:
    good = " (001.0)  can0  123   [1]  11\n"
    source, found = read(tmp_path / "a.txt", f"{good}{line}\n{good}")
    assert len(found) == 2
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert truncation.message.startswith("line 2: ")
    assert told in truncation.message


def test_words_of_an_error_and_lost_frames(tmp_path: Path) -> None:
    """With -e a line below an error frame tells it in words; with -d another one how many frames were lost."""
    source, found = read(
        tmp_path / "a.txt",
        " (001.0)  can0  20000004   [8]  00 08 00 00 00 00 00 00   ERRORFRAME\n"
        "\tcontroller-problem{tx-error-warning}\n"
        "\terror-counter-tx-rx{{96}{0}}\n"
        "DROPCOUNT: dropped 7 CAN frames on 'can0' socket (total drops 7)\n"
        " (002.0)  can0  123   [1]  11\n",
    )
    assert [frame.identifier for frame in found] == [4, 0x123]
    assert source.infos[0].truncation is None
    assert source.infos[0].drops == 7


@pytest.mark.skipif(not shutil.which("log2long"), reason="no can-utils")
@_slow
@given(log=st.lists(logs.frames(channels=["can0", "vcan12"]), min_size=1, max_size=60))
def test_it_is_the_log_that_it_is_made_of(tmp_path: Path, log: list[Frame]) -> None:
    """log2long shows neither the flags of CAN FD nor another DLC of 8 bytes."""
    text = "".join(line_of(frame) + "\n" for frame in log)
    shown = subprocess.run(["log2long"], input=text.encode(), capture_output=True, check=True).stdout
    _, found = read(tmp_path / "a.txt", shown.decode("latin-1"))
    told = [frame._replace(flags=frame.flags.replace("b", "").replace("s", ""), raw_dlc=0) for frame in log]
    assert found == told


def test_who_writes_into_a_pipe_sees_what_is_there(tmp_path: Path) -> None:
    """A pause hands on the lines before it, without waiting for more."""
    lines = TextLines(iter([b" (001.0)  can0  123   [1]  11\n (002.0)", b"", b"  can0  124   [1]  11\n"]))
    assert [(line.strip()[-2:], lines.ended) for line in lines] == [("11", True), ("", True), ("11", True)]
    script = (
        "from nvscope.capture.open import open_source\nfor batch in open_source(['-']): print(len(batch), flush=True)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as reader:
        assert reader.stdin is not None
        assert reader.stdout is not None
        for _ in range(2):
            reader.stdin.write(b" (001.0)  can0  123   [1]  11\n" * 300)
            reader.stdin.flush()
            assert reader.stdout.readline() == b"300\n"
        reader.stdin.close()
        assert reader.stdout.read() == b""
