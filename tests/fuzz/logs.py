"""CAN logs of every format, damaged: text line by line, containers of .blf also inside, all as any bytes."""

from __future__ import annotations

import random
import re
import struct
import tempfile
import zlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import can

from dissectors.batch import PacketBatch
from nvscope.capture.capture_file import CaptureFile
from nvscope.errors import UnreadableInput
from tests.capture.can.logs import FD_LENGTHS, Frame, line_of, message_of
from tests.capture.can.test_blf import CONTAINER_BYTES, container, file_head
from tests.fuzz.examination import NAME, Examined, check_other_sizes, check_report, ends
from tests.fuzz.mutations import BLIND, COMPRESSIONS

SUFFIXES = (".log", ".screen", ".asc", ".blf", ".trc", ".csv", ".db", ".mf4")
START_NS = 1_700_000_000 * 10**9
_KINDS = 6
_UNSHOWN = 0.7  # most are read only: what shows frames is fuzzed with captures
_ODD = b"#_R()[];: .0Fx-+e\0\r\n\xff\t\x1b"
_NUMBER = re.compile(rb"\d+(?:\.\d+)?")
_NUMBERS = (b"0", b"-1", b"9" * 9, b"9" * 19, b"9" * 40, b"1e9", b"0.0000000001", b"4294967296", b"\xd9\xa3", b"nan")


def fuzz_log(seed: int, number: int) -> tuple[str, bytes]:
    """Return the format of a log and the input that is made of one."""
    rng = random.Random(f"log/{seed}/{number}")
    suffix = rng.choice(SUFFIXES)
    raw, others = log_of(suffix, rng.randrange(_KINDS)), [log_of(suffix, kind) for kind in range(_KINDS)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        if suffix == ".blf" and rng.random() < 0.7:
            raw = _inside(rng, raw, others)
        elif suffix not in (".blf", ".db", ".mf4") and rng.random() < 0.6:
            raw = _lines(rng, raw)
        else:
            raw = rng.choice(BLIND)(rng, raw, others)
        raw = raw[: 1 << 18]
    if rng.random() < 0.05:
        raw = rng.choice(list(COMPRESSIONS.values()))(raw)
    return suffix, raw


@cache
def log_of(suffix: str, kind: int) -> bytes:
    """Return a log of some frames as python-can and candump write it."""
    rng = random.Random(kind)
    fd, others = suffix in (".asc", ".blf", ".mf4", ".log"), suffix not in (".trc", ".screen")
    frames = [_frame(rng, at, fd=fd, others=others) for at in range(rng.choice((2, 20, 60)))]
    if suffix == ".log":
        return "".join(f"{line_of(frame)}\n" for frame in frames).encode()
    if suffix == ".screen":
        return b"".join(
            b" (%.6f)  %s  %03X   [%d]  %s\n"
            % (frame.ts_ns / 1e9, frame.channel.encode(), frame.identifier, frame.length, frame.data.hex(" ").encode())
            for frame in frames
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{suffix}"
        with can.Logger(str(path)) as logger:
            for frame in frames:
                logger.on_message_received(message_of(frame, 0))
        return path.read_bytes()


def _frame(rng: random.Random, at: int, *, fd: bool, others: bool) -> Frame:
    flags = rng.choice(("", "", "", "x", *(("r", "e") if others else ()), *(("f", "fb") if others and fd else ())))
    length = 8 if "e" in flags else rng.choice(FD_LENGTHS if "f" in flags else FD_LENGTHS[:9])
    data = b"" if "r" in flags else rng.randbytes(length)
    identifier = rng.choice((0x110, 0x181, 0x701, 0x123, rng.randrange(0x800)))
    return Frame(START_NS + at * 10**7, f"can{rng.randrange(2)}", identifier, flags, length, data)


def _lines(rng: random.Random, raw: bytes) -> bytes:
    """Change a line: a number, a byte, its end, its place."""
    lines = raw.split(b"\n")
    place = rng.randrange(len(lines))
    line = lines[place]
    numbers = list(_NUMBER.finditer(line))
    match rng.randrange(5):
        case 0 if numbers:
            one = rng.choice(numbers)
            line = line[: one.start()] + rng.choice(_NUMBERS) + line[one.end() :]
        case 1:
            at = rng.randrange(len(line) + 1)
            line = line[:at] + bytes([rng.choice(_ODD)]) + line[at + rng.randrange(2) :]
        case 2:
            line = line[: rng.randrange(len(line) + 1)]
        case 3:
            line += line * rng.choice((1, 1, 50, 2000))
        case _:
            other = rng.randrange(len(lines))
            lines[place] = lines[other]
            place = other
    lines[place] = line
    return b"\n".join(lines)


def _inside(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    """Change what the containers of a BLF file hold, and pack it again."""
    content = rng.choice(BLIND)(rng, _content(raw), [_content(other) for other in others])
    told = rng.choice((None, None, None, 0, 1, len(content) + 7, 300_000_000))
    size = rng.choice((None, None, None, None, 0, 15, 40, 0xFFFFFFFF))
    return file_head() + container(content, method=rng.choice((2, 2, 0, 1)), told=told, size=size)


def _content(raw: bytes) -> bytes:
    """Return what the containers of a BLF file hold, as far as that can be unpacked."""
    parts = []
    at = 144
    while at + CONTAINER_BYTES <= len(raw):
        size, kind, method = struct.unpack_from("<LLH", raw, at + 8)
        body = raw[at + CONTAINER_BYTES : at + max(size, CONTAINER_BYTES)]
        if kind == 10 and method == 2:
            try:
                parts.append(zlib.decompress(body))
            except zlib.error:
                break
        elif kind == 10:
            parts.append(body)
        at += max(size, CONTAINER_BYTES) + size % 4
    return b"".join(parts)


def examine_log(raw: bytes, folder: Path, rng: random.Random) -> Examined:
    """Put a log through everything: it is refused in words, or read, in whatever sizes, and shown."""
    with ends():
        path = folder / NAME
        path.write_bytes(raw)
        refusal: UnreadableInput | None = None
        batches: list[PacketBatch] = []
        try:
            source = CaptureFile(str(path))
            batches += source
        except UnreadableInput as error:
            refusal = error
        if refusal is not None:
            assert refusal.what
            assert refusal.where
            return Examined()
        assert all(len(batch) for batch in batches)
        assert source.info.frames == sum(map(len, batches))
        check_other_sizes(path, rng, source.info, batches)
        if rng.random() < _UNSHOWN:
            return Examined(True, source.info.frames, cut=source.info.truncation is not None)
        return check_report(path, rng, batches)
