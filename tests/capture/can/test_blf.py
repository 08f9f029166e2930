"""BLF files put together object by object: what python-can does not write, and what damages there are."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given

from dissectors.batch import Direction
from nvscope.capture.can.blf_walk import walk
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from tests.capture.can.logs import Frame, frames_of
from tests.laws import examples

_slow = examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
START_S = 1_436_509_052
"""2015-07-10 06:17:32 UTC."""
CONTAINER_BYTES = 32


def file_head(size: int = 0, objects: int = 0) -> bytes:
    start = struct.pack("<8H", 2015, 7, 5, 10, 6, 17, 32, 0)
    return (struct.pack("<4sL8xQ8xL4x", b"LOGG", 144, size, objects) + start).ljust(144, b"\0")


def item(
    kind: int, body: bytes, *, time: int = 0, flags: int = 2, size: int | None = None, version: int = 1, pad: int = 0
) -> bytes:
    """An object; ``size`` is what it says of itself."""
    head_bytes = 40 if version == 2 else 32
    head = struct.pack("<LHHQ", flags, 0, 0, time) + bytes(head_bytes - 32)
    told = head_bytes + len(body) if size is None else size
    return struct.pack("<4sHHLL", b"LOBJ", head_bytes, version, told, kind) + head + body + bytes(pad)


def container(
    content: bytes, *, method: int = 2, told: int | None = None, size: int | None = None, kind: int = 10
) -> bytes:
    data = zlib.compress(content) if method == 2 else content
    told_bytes = len(content) if told is None else told
    own = CONTAINER_BYTES + len(data) if size is None else size
    head = struct.pack("<4sHHLL", b"LOBJ", 16, 1, own, kind) + struct.pack("<H6xL4x", method, told_bytes)
    return head + data + bytes((CONTAINER_BYTES + len(data)) % 4)


def message(
    identifier: int = 0x123, data: bytes = bytes(8), *, flags: int = 0, dlc: int | None = None, channel: int = 1
) -> bytes:
    code = len(data) if dlc is None else dlc
    return struct.pack("<HBBL8s", channel, flags, code, identifier, data)


def fd_message_64(told: int, data: bytes, *, dlc: int, valid: int, way: int = 0, ext_at: int = 0) -> bytes:
    head = struct.pack("<BBBBLLLLLLLHBBL", 2, dlc, valid, 0, 0x123, 0, told, 0, 0, 0, 0, 0, way, ext_at, 0)
    return head + data


def error_ext(flags: int, ecc: int, code: int) -> bytes:
    return struct.pack("<HHLBBBxLLHH8s", 1, 0, flags, ecc, 5, 8, 0, 0x2C0, code, 0, b"\xaa" * 8)


def fd_error_64(flags: int, ecc: int, code: int) -> bytes:
    return struct.pack("<BBBBHHHBxL", 1, 8, 8, ecc, flags, code, 0, 0, 0x2C0).ljust(52, b"\0")


def read(path: Path, content: bytes, **sizes: int) -> tuple[CaptureFile, list[Frame]]:
    path.write_bytes(content)
    source = CaptureFile(str(path), sizes=ReadingSizes(**sizes))
    return source, frames_of(source)


def one(path: Path, kind: int, body: bytes) -> Frame:
    """The frame of a file with one object."""
    source, found = read(path, file_head() + container(item(kind, body)))
    assert source.infos[0].truncation is None
    (frame,) = found
    return frame


NOTHING = bytes(8)
STUFF, SENDING, ACKNOWLEDGEMENT, PROTOCOL = 0x04, 0x80, 0x20, 0x08


@pytest.mark.parametrize(
    ("kind", "body", "classes", "detail"),
    [
        (2, struct.pack("<HHL", 1, 0, 0), 0, NOTHING),
        (3, struct.pack("<HHL", 1, 0, 0), PROTOCOL, b"\0\0\x20\0\0\0\0\0"),
        # Nothing of it is valid, as python-can writes it.
        (73, error_ext(0, 0xFF, 0xFFFF), 0, NOTHING),
        # The register of an SJA1000: stuff error at a receiver, in the bits 28 to 21.
        (73, error_ext(1, 0xA2, 0), PROTOCOL, bytes((0, 0, STUFF, 0x02, 0, 0, 0, 0))),
        (73, error_ext(1, 0x8F, 0), PROTOCOL, bytes((0, 0, STUFF | SENDING, 0x0F, 0, 0, 0, 0))),
        (73, error_ext(1, 0xE0, 0), PROTOCOL, NOTHING),
        # Those of Vector's CAN core, of which two are from files that CANoe wrote.
        (73, error_ext(0x0E, 0x82, 0x20A2), PROTOCOL, bytes((0, 0, STUFF, 0, 0, 0, 0, 0))),
        (73, error_ext(0xFFFE, 0xC7, 0x31CA), ACKNOWLEDGEMENT, NOTHING),
        # An older program left the repetition 0; where both differ, the register counts.
        (73, error_ext(2, 0x82, 0), PROTOCOL, bytes((0, 0, STUFF, 0, 0, 0, 0, 0))),
        (73, error_ext(2, 0xC1, 0), PROTOCOL, bytes((0, 0, 2 | SENDING, 0, 0, 0, 0, 0))),
        (73, error_ext(2, 0x42, 0x3000), ACKNOWLEDGEMENT, NOTHING),
        (73, error_ext(2, 0x80, 0x3000 | 1 << 6), PROTOCOL, bytes((0, 0, 1, 0, 0, 0, 0, 0))),
        # Nobody filled in either.
        (73, error_ext(2, 0, 0), 0, NOTHING),
        (73, error_ext(2, 0, 0x003F), 0, NOTHING),
        (73, error_ext(2, 0, 0x3000), PROTOCOL, bytes((0, 0, 1 | SENDING, 0, 0, 0, 0, 0))),
        (73, error_ext(2, 0, 0x2000 | 4 << 6), PROTOCOL, bytes((0, 0, 0, 0x08, 0, 0, 0, 0))),
        (73, error_ext(2, 0, 0x2000 | 3 << 6), PROTOCOL, NOTHING),
        (73, error_ext(2, 0, 0x1000 | 2 << 6), ACKNOWLEDGEMENT, NOTHING),
        (104, fd_error_64(0, 0xFF, 0xFFFF), 0, NOTHING),
        (104, fd_error_64(2, 0, 0x2000 | 1 << 6), PROTOCOL, bytes((0, 0, 2, 0, 0, 0, 0, 0))),
        (104, fd_error_64(2, 0x84, 0), PROTOCOL, bytes((0, 0, 0, 0x08, 0, 0, 0, 0))),
        (104, fd_error_64(2, 0, 0), 0, NOTHING),
        (104, fd_error_64(1, 0xA2, 0), PROTOCOL, bytes((0, 0, STUFF, 0x02, 0, 0, 0, 0))),
    ],
)
def test_an_error_frame_tells_what_its_own_fields_say(
    tmp_path: Path, kind: int, body: bytes, classes: int, detail: bytes
) -> None:
    """Each disturbed a frame 0x2C0, whose bits would be "bus off" and "bus error"."""
    found = one(tmp_path / "a.blf", kind, body)
    assert (found.channel, found.identifier, found.flags, found.data) == ("can1", classes, "e", detail)


@pytest.mark.parametrize(
    ("kind", "body", "expected"),
    [
        (1, message(0x123, b"12345678"), (0x123, "", 8, b"12345678", 0)),
        (86, message(0x123, b"12345678") + bytes(8), (0x123, "", 8, b"12345678", 0)),
        (86, message(0x8000_0123, b"12"), (0x123, "x", 2, b"12", 0)),
        (1, message(0x123, b"12345678", dlc=13), (0x123, "", 8, b"12345678", 13)),
        (1, message(0x123, bytes(8), flags=0x80, dlc=4), (0x123, "r", 4, b"", 0)),
        (101, fd_message_64(0x1000, b"1" * 12, dlc=9, valid=12), (0x123, "f", 12, b"1" * 12, 0)),
        (101, fd_message_64(0x7000, b"1" * 12, dlc=9, valid=12), (0x123, "fbs", 12, b"1" * 12, 0)),
        # What is recorded ends early: the rest is zero, as in Vector's tools.
        (101, fd_message_64(0x1000, b"1" * 8, dlc=9, valid=12), (0x123, "f", 12, b"1" * 8 + bytes(4), 0)),
        # Other data follow those of the frame.
        (
            101,
            fd_message_64(0x1000, b"1" * 8 + b"?" * 4, dlc=9, valid=12, ext_at=32 + 40 + 8),
            (0x123, "f", 12, b"1" * 8 + bytes(4), 0),
        ),
        # Frames of 64 bytes in which fewer are told: the others are not recorded.
        (101, fd_message_64(0x1000, b"1" * 8, dlc=15, valid=8), (0x123, "f", 64, b"1" * 8, 0)),
        (101, fd_message_64(0, b"12345678", dlc=8, valid=8), (0x123, "", 8, b"12345678", 0)),
        (101, fd_message_64(0x10, b"", dlc=4, valid=0), (0x123, "r", 4, b"", 0)),
        (101, fd_message_64(0x1010, b"12", dlc=2, valid=2), (0x123, "f", 2, b"12", 0)),
    ],
)
def test_frames(tmp_path: Path, kind: int, body: bytes, expected: tuple[object, ...]) -> None:
    assert one(tmp_path / "a.blf", kind, body)[2:] == expected


def test_direction_and_requests(tmp_path: Path) -> None:
    """A request to send (2) is no frame on the bus, which follows as sent."""
    content = b"".join(
        [
            item(1, message(1)), item(86, message(2, flags=1)), item(86, message(3, flags=2)),
            item(101, fd_message_64(0, b"1", dlc=1, valid=1, way=1)),
            item(101, fd_message_64(0, b"1", dlc=1, valid=1, way=2)), item(2, bytes(8)),
        ]
    )  # fmt: skip
    source, found = read(tmp_path / "a.blf", file_head() + container(content))
    assert len(found) == 4
    (batch,) = source
    assert batch.directions.tolist() == [Direction.RX, Direction.TX, Direction.TX, Direction.UNKNOWN]


@pytest.mark.parametrize(
    ("flags", "time", "expected_ns"), [(2, 1_234_567_891, 1_234_567_891), (1, 123_456, 1_234_560_000), (0, 5, 5)]
)
@pytest.mark.parametrize("version", [1, 2, 3])
def test_times(tmp_path: Path, flags: int, time: int, expected_ns: int, version: int) -> None:
    content = item(1, message(), flags=flags, time=time, version=version)
    _, (frame,) = read(tmp_path / "a.blf", file_head() + container(content))
    assert frame.ts_ns == START_S * 10**9 + expected_ns


@_slow
@given(
    data=st.data(),
    sizes=st.fixed_dictionaries(
        {"batch_packets": st.sampled_from((1, 7, 131_072)), "stride_bytes": st.sampled_from((1, 90, 1 << 20))}
    ),
)
def test_any_cut_into_containers_is_the_same_stream(tmp_path: Path, data: st.DataObject, sizes: dict[str, int]) -> None:
    """Objects may be cut by containers, lie in none, be padded, and hold what looks like the begin of one."""
    numbers = data.draw(st.lists(st.integers(0, 0x7FF), min_size=1, max_size=40))
    content = b""
    for number in numbers:
        content += item(1, message(number, b"LOBJ" + bytes(4)), pad=data.draw(st.integers(0, 4)))
        if data.draw(st.booleans()):
            other = b"LOBJ" * data.draw(st.integers(0, 30))
            content += item(65, other + bytes(data.draw(st.integers(0, 3))), pad=data.draw(st.integers(0, 3)))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(content)), max_size=8)))
    parts = [content[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(content)], strict=True)]
    methods = data.draw(st.lists(st.sampled_from((0, 2)), min_size=len(parts), max_size=len(parts)))
    raw = file_head() + b"".join(container(part, method=method) for part, method in zip(parts, methods, strict=True))
    source, found = read(tmp_path / "a.blf", raw, **sizes)
    assert [frame.identifier for frame in found] == numbers
    assert source.infos[0].truncation is None


def test_objects_in_no_container(tmp_path: Path) -> None:
    raw = (
        file_head()
        + item(1, message(1))
        + item(65, bytes(21), pad=1)
        + item(1, message(2))
        + container(item(1, message(3)))
    )
    source, found = read(tmp_path / "a.blf", raw)
    assert [frame.identifier for frame in found] == [1, 2, 3]
    assert source.infos[0].truncation is None


GOOD = item(1, message(1))
HUGE = 300_000_000


@pytest.mark.parametrize(
    ("content", "frames", "told"),
    [
        (container(GOOD + item(1, message(2), size=0) + GOOD), 1, "an object of 0 bytes"),
        (container(GOOD + item(1, message(2), size=15) + GOOD), 1, "an object of 15 bytes"),
        (container(GOOD + item(1, message(2), size=HUGE) + GOOD), 1, f"a CAN frame in an object of {HUGE} bytes"),
        (container(GOOD + item(65, message(2), size=HUGE) + GOOD), 1, "the last object is cut short"),
        (container(GOOD + b"\xff" * 40 + GOOD), 1, "no object begins here"),
        (container(GOOD + item(1, message(2), size=20) + GOOD), 1, "too short for what it is"),
        (container(GOOD) + container(GOOD, size=HUGE), 1, f"a container of {HUGE} bytes"),
        (container(GOOD) + container(GOOD, size=0), 1, "an object of 0 bytes"),
        (container(GOOD) + container(GOOD, method=7), 1, "the compression method 7"),
        (
            container(GOOD) + container(GOOD, kind=11) + container(GOOD),
            1,
            "a container that says it is an object of type 11",
        ),
        (container(GOOD, method=0, kind=138), 0, "a container that says it is an object of type 138"),
        (container(GOOD) + container(GOOD)[:-9], 1, "cut short within a container"),
        (container(GOOD + GOOD[:30]), 1, "the last object is cut short"),
        (container(GOOD) + b"\xff" * 16, 1, "no object begins here"),
        (container(GOOD + item(1, message(2, dlc=200)) + GOOD), 2, "a data length code above 15"),
        (container(GOOD + item(1, message(0x800)) + GOOD), 2, "an identifier of more than 11 bits"),
        (container(GOOD + item(1, message(2), version=9) + GOOD), 2, "a header of an unknown version"),
        (container(GOOD + item(1, message(2), time=1 << 63) + GOOD), 2, "a time after 2116"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, content: bytes, frames: int, told: str) -> None:
    source, found = read(tmp_path / "a.blf", file_head() + content)
    assert len(found) == frames
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert told in truncation.message
    assert 144 <= truncation.offset < 144 + len(content)


def test_a_file_without_any_object_is_damaged_where_its_header_tells_of_some(tmp_path: Path) -> None:
    told, _ = read(tmp_path / "told.blf", file_head(objects=3) + container(b""))
    assert "it holds no object, and its header tells of 3" in str(told.infos[0].truncation)
    # A program that did not finish tells of none, and one may count what it holds in its own way.
    for content in (file_head(), file_head(objects=7) + container(item(65, bytes(24)))):
        source, found = read(tmp_path / "a.blf", content)
        assert (found, source.infos[0].truncation) == ([], None)


def test_a_container_holds_no_more_than_it_may(tmp_path: Path) -> None:
    """One that tells 48 bytes may hold some MiB, since some programs tell nothing; not 40 of them."""
    content = item(65, bytes(40 << 20)) + GOOD
    _, found = read(tmp_path / "a.blf", file_head() + container(content))
    assert len(found) == 1
    source, found = read(tmp_path / "a.blf", file_head() + container(content, told=48))
    assert not found
    assert "holds more than the 48 bytes" in str(source.infos[0].truncation)


def test_ethernet_frames_that_are_not_read_are_told(tmp_path: Path) -> None:
    source, found = read(tmp_path / "a.blf", file_head() + container(GOOD + item(71, bytes(60)) * 3 + GOOD))
    assert len(found) == 2
    assert source.infos[0].comments == ((None, "3 Ethernet frames of this log are not read"),)


def walked_singly(content: bytes) -> Sequence[int]:
    """Places of whole objects, each found behind the one before it."""
    found: list[int] = []
    here = 0
    while (at := content.find(b"LOBJ", here, here + 8)) >= 0 and at + 16 <= len(content):
        size = int.from_bytes(content[at + 8 : at + 12], "little")
        if size < 16 or at + size > len(content):
            break
        found.append(at)
        here = at + size
    return found


@_slow
@given(
    pieces=st.lists(
        st.one_of(
            st.binary(max_size=12),
            st.just(b"LOBJ"),
            st.tuples(st.integers(0, 120), st.binary(max_size=60)).map(lambda told: item(1, told[1], size=told[0])),
            st.binary(max_size=60).map(lambda body: item(65, body)),
        ),
        max_size=30,
    )
)
def test_objects_are_found_at_once_where_they_are_found_one_by_one(tmp_path: Path, pieces: list[bytes]) -> None:
    import numpy as np  # noqa: PLC0415

    content = b"".join(pieces)
    data = np.frombuffer(content + bytes(128), np.uint8)
    assert walk(data, 0, len(content)).at.tolist() == list(walked_singly(content))


def test_an_object_too_short_for_its_head_is_none_even_if_another_seems_to_follow(tmp_path: Path) -> None:
    """Its type reads "LOBJ", and begins where it says that it ends."""
    short = b"LOBJ" + struct.pack("<HHL", 32, 1, 12) + GOOD
    source, found = read(tmp_path / "a.blf", file_head() + container(GOOD + short))
    assert len(found) == 1
    assert "an object of 12 bytes" in str(source.infos[0].truncation)


@pytest.mark.parametrize("year", [1601, 1822, 2117, 9999])
def test_a_measurement_that_began_when_nobody_measured(tmp_path: Path, year: int) -> None:
    head = file_head()
    raw = head.replace(struct.pack("<H", 2015), struct.pack("<H", year)) + container(GOOD + GOOD)
    source, found = read(tmp_path / "a.blf", raw)
    assert not found
    truncation = source.infos[0].truncation
    assert truncation is not None
    assert "a time before 1823 or after 2116" in truncation.message
