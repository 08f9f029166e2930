"""candump logs: every line by columns is the line by itself, and nothing of a damaged log is lost without a word."""

from __future__ import annotations

import bz2
import gzip
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import can
import lz4.frame
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture.can.candump_line import LineFault, is_silent, parse
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from nvscope.capture.reader import ReadingSizes
from nvscope.errors import UnreadableInput
from tests.capture import build
from tests.capture.can import logs
from tests.capture.can.logs import Frame, frames_of, line_of, unpacked
from tests.capture.reference import Packet
from tests.laws import share_of

_slow = settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], deadline=None)

NAMES = ("can0", "can1", "vcan12", "slcan0", "PCAN_USBBUS1")


def read(path: Path, raw: bytes, **sizes: int) -> tuple[CaptureFile, list[Frame]]:
    path.write_bytes(raw)
    small = sizes.pop("small_file_bytes", 8 << 20)
    source = CaptureFile(str(path), sizes=ReadingSizes(**sizes), small_file_bytes=small)
    return source, frames_of(source)


def plainly(raw: bytes) -> tuple[list[Frame], list[int]]:
    """The frames of a log and the numbers of its wrong lines, one line after the other."""
    found, wrong = [], []
    lines = raw.split(b"\n")
    for number, line in enumerate(lines if lines[-1] else lines[:-1], 1):
        whole = line.removesuffix(b"\r")
        if is_silent(whole):
            continue
        try:
            frame, name = parse(whole)
        except LineFault:
            wrong.append(number)
            continue
        packed = frame.packed()[: frame.captured_bytes]
        found.append(unpacked(frame.ts_ns, name.decode("utf-8", "backslashreplace"), packed))
    return found, wrong


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("(1436509052.249713) vcan0 044#2A366C2BBA", Frame(1436509052249713000, "vcan0", 0x44, "", 5, b"*6l+\xba")),
        ("(1.249713123)   can0   1F334455#11 R", Frame(1249713123, "can0", 0x1F334455, "x", 1, b"\x11")),
        ("(0.0) can0 123#R", Frame(0, "can0", 0x123, "r", 0, b"")),
        ("(0.5) can0 123#R4 T", Frame(500_000_000, "can0", 0x123, "r", 4, b"")),
        ("(1.000000) can0 123#R8_D", Frame(10**9, "can0", 0x123, "r", 8, b"", 13)),
        ("(1.000000) can0 123##1112233", Frame(10**9, "can0", 0x123, "fb", 3, b"\x11\x22\x33")),
        ("(1.000000) can0 123##6", Frame(10**9, "can0", 0x123, "fs", 0, b"")),
        ("(1.000000) can0 123##8112233", Frame(10**9, "can0", 0x123, "f", 3, b"\x11\x22\x33")),
        ("(1.000000) can0 123##F112233", Frame(10**9, "can0", 0x123, "fbs", 3, b"\x11\x22\x33")),
        ("(1.000000) can0 20000004#000C000000000000", Frame(10**9, "can0", 4, "e", 8, b"\0\x0c" + bytes(6))),
        ("(1.000000) can0 123#", Frame(10**9, "can0", 0x123, "", 0, b"")),
        ("(1.000000) can0 123#11.22.33", Frame(10**9, "can0", 0x123, "", 3, b"\x11\x22\x33")),
        ("(1.000000) can0 123#3031323334353637_B", Frame(10**9, "can0", 0x123, "", 8, b"01234567", 11)),
        ("(-1.5) can0 00000123#aaBB", Frame(-1_500_000_000, "can0", 0x123, "x", 2, b"\xaa\xbb")),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", ""])
def test_lines(tmp_path: Path, line: str, expected: Frame, end: str) -> None:
    """One line by itself, and in the middle of so many that it is read by columns."""
    source, found = read(tmp_path / "a.log", (line + end).encode())
    assert found == [expected]
    assert source.infos[0].truncation is None
    assert (source.infos[0].format, source.infos[0].frames) == ("candump", 1)
    if end:
        _, found = read(tmp_path / "b.log", (line + end).encode() * 200)
        assert found == [expected] * 200


@_slow
@given(
    log=st.lists(logs.frames(channels=NAMES), max_size=120),
    repeats=st.sampled_from((1, 40)),
    decimals=st.sampled_from((6, 9)),
    end=st.sampled_from(("\n", "\r\n", " R\n", " T\r\n")),
    lower=st.booleans(),
    last=st.booleans(),
    sizes=st.builds(
        dict,
        batch_packets=st.sampled_from((1, 7, 100, 131_072)),
        stride_bytes=st.sampled_from((1, 50, 300, 5000, 1 << 20)),
        small_file_bytes=st.sampled_from((0, 8 << 20)),
    ),
)
def test_what_was_written_is_read_for_any_cut_of_the_work(
    tmp_path: Path,
    log: list[Frame],
    repeats: int,
    decimals: int,
    end: str,
    lower: bool,
    last: bool,
    sizes: dict[str, int],
) -> None:
    if not log:
        return
    text = "".join(line_of(frame, decimals=decimals, lower=lower) + end for frame in log) * repeats
    if not last:
        text = text.rstrip("\r\n")
    source, found = read(tmp_path / "a.log", text.encode(), **sizes)
    expected = [frame._replace(channel=frame.channel.lower() if lower else frame.channel) for frame in log] * repeats
    cut = not last and is_shorter_than_its_like([line.split(") ", 1)[1] for line in text.splitlines()])
    assert found == (expected[:-1] if cut else expected)
    assert (source.infos[0].truncation is not None) == cut
    assert len(set(source.channels)) == len(source.channels)


def is_shorter_than_its_like(lines: list[str]) -> bool:
    """Whether the last line has less data than the one before of its channel and identifier."""
    begun, content = lines[-1].split("#", 1)
    before = [line.split("#", 1)[1] for line in lines[:-1] if line.split("#", 1)[0] == begun]
    return bool(before) and len(content.split()[0] if content else "") < len(before[-1].split(" ")[0])


def some_log(seed: int, count: int) -> bytes:
    chance = random.Random(seed)
    lines = []
    now = logs.BASE_US
    for _ in range(count):
        now += chance.randrange(1, 500)
        kind = chance.choices(("", "f", "r"), (17, 2, 1))[0]
        extended = chance.random() < 0.2
        data = chance.randbytes(chance.choice(logs.FD_LENGTHS if kind == "f" else (8, 8, 8, 4, 2, 0)))
        frame = Frame(
            1000 * now,
            chance.choice(NAMES),
            chance.randrange(1 << (29 if extended else 11)),
            "x" * extended + kind,
            chance.randrange(9) if kind == "r" else len(data),
            b"" if kind == "r" else data,
        )
        lines.append(line_of(frame) + "\n")
    return "".join(lines).encode()


@pytest.mark.parametrize("small_file_bytes", [0, 8 << 20])
def test_damaged_logs_are_read_as_line_by_line(tmp_path: Path, small_file_bytes: int) -> None:
    """Hundreds of logs with bytes changed, lines lost, doubled or cut: the frames and faults of the plain reading."""
    chance = random.Random(1)
    original = some_log(2, 120)
    alphabet = b"0123456789ABCDEFabcdef#R_.() \n\r\tgTt\0\xff-:"
    for _ in range(share_of(700)):
        raw = bytearray(original)
        for _ in range(chance.choice((1, 1, 3, 30))):
            at = chance.randrange(len(raw))
            what = chance.randrange(4)
            if what == 0:
                raw[at] = chance.choice(alphabet)
            elif what == 1:
                raw[at : at + chance.randrange(60)] = b""
            elif what == 2:
                raw[at:at] = bytes(chance.choice(alphabet) for _ in range(chance.randrange(5)))
            else:
                raw[at:at] = raw[at : at + chance.randrange(100)]
        expected, wrong = plainly(bytes(raw))
        try:
            source, found = read(
                tmp_path / "a.log",
                bytes(raw),
                small_file_bytes=small_file_bytes,
                stride_bytes=chance.choice((100, 3000, 1 << 20)),
            )
        except UnreadableInput:
            assert len(expected) < 5
            continue
        assert found == expected
        truncation = source.infos[0].truncation
        if not wrong:
            assert truncation is None
            continue
        assert truncation is not None
        assert truncation.message.startswith(f"line {wrong[0]}, column ")
        told = "it is left out" if len(wrong) == 1 else f"{len(wrong)} such lines are left out"
        assert truncation.message.endswith(told)
        assert bytes(raw)[: truncation.offset].count(b"\n") == wrong[0] - 1


def test_a_log_cut_anywhere_gives_its_whole_lines(tmp_path: Path) -> None:
    raw = some_log(3, 12)
    for cut in range(20, len(raw)):
        whole = raw[:cut].count(b"\n")
        expected, wrong = plainly(raw[:cut])
        source, found = read(tmp_path / "a.log", raw[:cut])
        assert found == expected
        assert whole <= len(found) <= whole + 1
        assert (source.infos[0].truncation is None) == (not wrong)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("rubbish", "line 2, column 1: no time in parentheses"),
        ("(1.0) can0", "line 2, column 11: the line ends before a frame"),
        ("(1.0) can0 12#00", "line 2, column 12: no identifier of 3 or 8"),
        ("(1.0) can0 FFF#00", "line 2, column 12: an identifier of 3 digits above 7FF"),
        ("(1.0) can0 FFFFFFFF#00", "line 2, column 12: an identifier of more than 29 bits"),
        ("(1.0) can0 123#001", "line 2, column 18: no hexadecimal digits in pairs"),
        ("(1.0) can0 123#001122334455667788", "line 2, column 16: 9 bytes of data, expected at most 8"),
        ("(1.0) can0 123#00 X", "line 2, column 18: something else follows the frame"),
        ("(1.0) can0 123#00 R T", "line 2, column 18: something else follows the frame"),
        ("(99999999999.0) can0 123#00", "line 2, column 2: a time after 2116"),
        ("(1.0) can0 00123#00:000:00000000#1122", "line 2, column 12: a CAN XL frame"),
        ("x" * 100_000, "line 2: more than 65536 characters"),
        ("\0" * 70_000, "line 2: more than 65536 characters"),
    ],
)
@pytest.mark.parametrize("small_file_bytes", [0, 8 << 20])
def test_a_wrong_line_is_named_and_left_out(tmp_path: Path, line: str, message: str, small_file_bytes: int) -> None:
    good = "(1.000000) can0 123#00\n"
    for repeats in (1, 500):
        raw = (good + line + "\n" + good * repeats).encode()
        source, found = read(tmp_path / "a.log", raw, small_file_bytes=small_file_bytes, stride_bytes=3000)
        assert len(found) == repeats + 1
        truncation = source.infos[0].truncation
        assert truncation is not None
        assert truncation.message.startswith(message)
        assert truncation.offset == len(good)


def test_comments_and_blank_lines_say_nothing(tmp_path: Path) -> None:
    raw = b"\xef\xbb\xbf# recorded in hall 3\n\n  \r\n; so\n// and so\n(1.0) can0 123#00\n\n#\n(2.0) can0 123#00\n"
    source, found = read(tmp_path / "a.log", raw)
    assert [frame.ts_ns for frame in found] == [10**9, 2 * 10**9]
    assert source.infos[0].truncation is None


def test_a_log_whose_begin_is_damaged_is_still_told_to_be_one(tmp_path: Path) -> None:
    source, found = read(tmp_path / "a.log", b"49713) can0 123#00\n(1.0) can0 123#00\n(1.5) can0 123#00\n")
    assert len(found) == 2
    assert source.infos[0].truncation is not None
    assert source.infos[0].truncation.message.startswith("line 1, column 1")


COMPRESSIONS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "zst": zstandard.ZstdCompressor().compress,
    "lz4": lz4.frame.compress,
}


@pytest.mark.parametrize("compress", COMPRESSIONS.values(), ids=COMPRESSIONS.keys())
def test_compressed_logs(tmp_path: Path, compress: Callable[[bytes], bytes]) -> None:
    raw = some_log(4, 3000)
    expected, _ = plainly(raw)
    source, found = read(tmp_path / "a", compress(raw))
    assert found == expected
    assert source.infos[0].truncation is None
    # Cut: whole lines only, as the last one may have lost more than its end.
    source, found = read(tmp_path / "b", compress(raw)[:-700])
    assert found == expected[: len(found)]
    assert source.infos[0].truncation is not None
    assert "end early" in source.infos[0].truncation.message


def test_a_log_from_a_pipe(tmp_path: Path) -> None:
    raw = some_log(5, 5000)
    script = (
        "from nvscope.capture.open import open_source; source = open_source(['-']);"
        "print(sum(len(batch) for batch in source), len(source.channels), source.infos[0].truncation)"
    )
    done = subprocess.run([sys.executable, "-c", script], input=raw, capture_output=True, check=True)
    assert done.stdout.decode().split() == ["5000", str(len(NAMES)), "None"]


def test_a_log_and_an_ethernet_capture_are_one_timeline(tmp_path: Path) -> None:
    ethernet = [Packet(logs.BASE_US * 1000 + 2000 * n, 60, 1, bytes(60)) for n in range(300)]
    blocks = [build.enhanced("<", packet.ts_ns // 1000, packet.data) for packet in ethernet]
    named = build.interface("<", options=build.option("<", 2, b"eth0") + build.option("<", 0, b""))
    (tmp_path / "eth.pcapng").write_bytes(build.section("<") + named + b"".join(blocks))
    lines = [f"({logs.BASE_US // 10**6}.{2 * n + 1:06d}) can{n % 2} 181#{n:04X}\n" for n in range(300)]
    (tmp_path / "can.log").write_text("".join(lines))
    source = open_source([str(tmp_path / "eth.pcapng"), str(tmp_path / "can.log")], batch_packets=50)
    found = [
        (ts_ns, link, source.channels[number])
        for batch in source
        for ts_ns, link, number in zip(batch.ts_ns.tolist(), batch.link.tolist(), batch.channels.tolist(), strict=True)
    ]
    assert found == sorted(found)
    assert [entry for entry in found if entry[1] == 1] == [(packet.ts_ns, 1, "eth0") for packet in ethernet]
    assert {entry[2] for entry in found if entry[1] == 227} == {"can0", "can1"}
    assert len(found) == 600
    assert len(build.packets_of(open_source([str(tmp_path)]))) == 600


def test_more_shapes_than_are_kept(tmp_path: Path) -> None:
    lines = [f"(1.{n:06d}) {'c' * (1 + n % 90)}{n % 7} 123#{n % 256:02X}\n" for n in range(20_000)]
    raw = "".join(lines).encode()
    expected, _ = plainly(raw)
    assert read(tmp_path / "a.log", raw)[1] == expected


def test_memory_does_not_grow_with_the_log(tmp_path: Path) -> None:
    script = (
        "import sys; from nvscope.capture.open import open_source\n"
        "for batch in open_source(sys.argv[1:]): pass\n"
        "lines = dict(line.split(':') for line in open('/proc/self/status'))\n"
        "print(int(lines['VmHWM'].split()[0]))"
    )
    body = some_log(6, 20_000)
    peaks = []
    for times in (10, 80):
        path = tmp_path / "a.log"
        path.write_bytes(body * times)
        done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True)
        peaks.append(int(done.stdout))
    assert peaks[1] < peaks[0] + 40_000


@pytest.mark.skipif(shutil.which("log2asc") is None, reason="needs can-utils")
def test_can_utils_read_the_same_log(tmp_path: Path) -> None:
    """log2asc's output, read by python-can, has our frames."""
    chance = random.Random(7)
    lines = []
    for n in range(500):
        identifier = f"{chance.randrange(1 << 29):08X}" if chance.random() < 0.3 else f"{chance.randrange(1 << 11):03X}"
        data = chance.randbytes(chance.randrange(9)).hex().upper()
        lines.append(f"(1436509052.{n:06d}) can{n % 2} {identifier}#{data}\n")
    log, asc = tmp_path / "a.log", tmp_path / "a.asc"
    log.write_text("".join(lines))
    subprocess.run(["log2asc", "-I", str(log), "-O", str(asc), "can0", "can1"], check=True)
    source = CaptureFile(str(log))
    ours = frames_of(source)
    theirs = list(can.LogReader(str(asc)))
    assert [(f.identifier, f.flags, f.data, f.channel) for f in ours] == [
        (m.arbitration_id, "x" * m.is_extended_id, bytes(m.data), f"can{m.channel}") for m in theirs
    ]


def test_other_compressions_are_told_as_unknown(tmp_path: Path) -> None:
    path = tmp_path / "a.log.bz2"
    path.write_bytes(bz2.compress(some_log(8, 10)))
    with pytest.raises(UnreadableInput, match="expected a pcap, pcapng or mcap file, a CAN log or"):
        open_source([str(path)])
