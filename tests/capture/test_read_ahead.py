"""Reading ahead by a second process gives what reading here does, whatever befalls that process."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nvscope.capture import read_ahead
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from tests.capture import build, test_pcapng
from tests.capture.dying import let_it_die
from tests.capture.reference import Packet, read_pcap, read_pcapng

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot copy a process")
_shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
_HERE = 1 << 60
"""More bytes than any file has: it is read here."""


class Copies:
    """The copies that were made of this process."""

    def __init__(self) -> None:
        self.made: list[int] = []

    @property
    def alive(self) -> list[int]:
        return [copy for copy in self.made if Path(f"/proc/{copy}").exists()]


@pytest.fixture
def copies(monkeypatch: pytest.MonkeyPatch) -> Copies:
    """Let every file be read ahead, also on one core, and note by which processes."""
    found = Copies()
    fork = os.fork

    def noted() -> int:
        copy = fork()
        if copy:
            found.made.append(copy)
        return copy

    monkeypatch.setattr(os, "fork", noted)
    monkeypatch.setattr(read_ahead, "is_worth_it", lambda rest, least: rest >= least)
    return found


def _sizes(ahead_bytes: int, batch_packets: int = 50) -> ReadingSizes:
    return ReadingSizes(batch_packets, stride_bytes=3000, ahead_bytes=ahead_bytes)


def _read(path: Path, sizes: ReadingSizes, small_file_bytes: int = 0) -> dict[str, Any]:
    """Return all that a file tells when it is read to its end."""
    source = CaptureFile(str(path), sizes=sizes, small_file_bytes=small_file_bytes)
    rows = [
        (*packet, int(channel), int(direction))
        for batch in source
        for packet, channel, direction in zip(build.packets_of([batch]), batch.channels, batch.directions, strict=True)
    ]
    return {
        "rows": rows, "info": source.info, "channels": list(source.channels), "position": source.position_bytes,
    }  # fmt: skip


def _pcap(count: int, step_ns: int = 10**6) -> bytes:
    begin_ns = build.BASE_S * 10**9
    return build.pcap([Packet(begin_ns + at * step_ns, 60 + at % 7, 1, bytes([at % 251] * 60)) for at in range(count)])


def _pcapng(count: int) -> bytes:
    """Two interfaces in turn, of different link types, with comments, directions and drops; one appears late."""
    parts = [build.section("<"), build.interface("<"), build.interface("<", 113)]
    units = build.BASE_S * 10**6
    for at in range(count):
        if at == count // 2:
            parts.append(build.interface("<", 1))
        number = at % 2 if at < count // 2 else at % 3
        options = build.option("<", 2, bytes((1 + at % 2, 0, 0, 0)))
        if not at % 100:
            options += build.option("<", 1, f"comment {at}".encode())
        parts.append(build.enhanced("<", units + at, bytes([at % 251] * 70), number=number, options=options))
        if not at % 500:
            parts.append(build.statistics("<", number, build.option("<", 5, at.to_bytes(8, "little"))))
    return b"".join(parts)


_FILES: dict[str, Callable[[], bytes]] = {
    "pcap": lambda: _pcap(3000),
    "pcap-cut": lambda: _pcap(3000)[:-17],
    "pcap-damaged": lambda: _pcap(2000) + b"\xff" * 5000 + _pcap(500),
    "pcap-doubtful-times": lambda: build.pcap([Packet(0, 60, 1, bytes(60))] * 10) + _odd_times(1000),
    "pcapng": lambda: _pcapng(3000),
    "pcapng-cut": lambda: _pcapng(3000)[:-9],
}


def _odd_times(count: int) -> bytes:
    """Return records that say a billion and one nanoseconds after a whole second."""
    record = (1).to_bytes(4, "little") + (10**9 + 1).to_bytes(4, "little") + (60).to_bytes(4, "little") * 2 + bytes(60)
    return record * count


@pytest.mark.parametrize("name", _FILES)
def test_a_file_read_ahead_tells_what_it_tells_read_here(tmp_path: Path, copies: Copies, name: str) -> None:
    (path := tmp_path / "a").write_bytes(_FILES[name]())
    ahead = _read(path, _sizes(0))
    assert len(copies.made) == 1
    assert not copies.alive
    here = _read(path, _sizes(_HERE))
    assert len(copies.made) == 1
    assert ahead == here
    assert len(here["rows"]) > 1000


@_shared
@given(raw=test_pcapng.files(), packets=st.integers(1, 5))
def test_pcapng_files_of_all_blocks_are_read_like_block_by_block(
    tmp_path: Path, copies: Copies, raw: bytes, packets: int
) -> None:
    expected = read_pcapng(raw)
    if expected.readable:
        (path := tmp_path / "a").write_bytes(raw)
        ahead = _read(path, _sizes(0, packets))
        assert ahead == _read(path, _sizes(_HERE, packets))
        assert [row[:4] for row in ahead["rows"]] == [tuple(packet) for packet in expected.packets]


@_shared
@given(packets=build.packet_lists(), batch_packets=st.integers(1, 5), cut=st.integers(0, 200))
def test_pcap_files_are_read_like_record_by_record(
    tmp_path: Path, copies: Copies, packets: list[Packet], batch_packets: int, cut: int
) -> None:
    whole = build.pcap(packets)
    raw = whole[: max(len(whole) - cut, 24)]
    (path := tmp_path / "a").write_bytes(raw)
    ahead = _read(path, _sizes(0, batch_packets))
    assert ahead == _read(path, _sizes(_HERE, batch_packets))
    assert [row[:4] for row in ahead["rows"]] == [tuple(packet) for packet in read_pcap(raw).packets]


@pytest.mark.parametrize("after", [0, 1, 7, 100])
@pytest.mark.parametrize("name", ["pcap", "pcapng", "pcap-damaged"])
def test_what_is_left_is_read_here_when_the_copy_dies(
    tmp_path: Path, copies: Copies, monkeypatch: pytest.MonkeyPatch, name: str, after: int
) -> None:
    (path := tmp_path / "a").write_bytes(_FILES[name]())
    let_it_die(monkeypatch, after)
    ahead = _read(path, _sizes(0, 25))
    assert len(copies.made) == 1
    assert ahead == _read(path, _sizes(_HERE, 25))


def test_a_file_is_read_here_where_no_process_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> int:
        raise OSError(errno.EAGAIN, "no more processes")

    (path := tmp_path / "a").write_bytes(_pcap(1000))
    monkeypatch.setattr(read_ahead, "is_worth_it", lambda *_: True)
    monkeypatch.setattr(os, "fork", refused)
    assert _read(path, _sizes(0)) == _read(path, _sizes(_HERE))


def test_a_file_is_read_here_where_no_descriptor_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One pipe may still be had, and a second one not: nothing of it stays open."""
    (path := tmp_path / "a").write_bytes(_pcap(1000))
    monkeypatch.setattr(read_ahead, "is_worth_it", lambda *_: True)
    pipe, made = os.pipe, list[tuple[int, int]]()

    def refused() -> tuple[int, int]:
        if made:
            raise OSError(errno.EMFILE, "too many open files")
        made.append(pipe())
        return made[0]

    monkeypatch.setattr(os, "pipe", refused)
    ahead = _read(path, _sizes(0))
    for end in made[0]:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(end)
    assert ahead == _read(path, _sizes(_HERE))


def test_who_stops_asking_leaves_no_process_behind(tmp_path: Path, copies: Copies) -> None:
    (path := tmp_path / "a").write_bytes(_pcap(3000))
    source = CaptureFile(str(path), sizes=_sizes(0), small_file_bytes=0)
    for number, _ in enumerate(source):
        if number == 3:
            assert copies.alive == copies.made
            source.stop()
    assert len(copies.made) == 1
    assert not copies.alive


def test_who_wants_the_first_packets_only_makes_no_process(tmp_path: Path, copies: Copies) -> None:
    (path := tmp_path / "a").write_bytes(_pcap(3000))
    assert next(iter(CaptureFile(str(path), sizes=_sizes(0), small_file_bytes=0)))
    assert not copies.made


def test_batches_stay_as_they_are_when_the_next_ones_come(tmp_path: Path, copies: Copies) -> None:
    """Columns are nobody else's: an observer may keep them, only not the bytes."""
    (path := tmp_path / "a").write_bytes(_pcap(3000))
    batches = list(CaptureFile(str(path), sizes=_sizes(0), small_file_bytes=0))
    assert [int(time_ns) for batch in batches for time_ns in batch.ts_ns] == [
        build.BASE_S * 10**9 + at * 10**6 for at in range(3000)
    ]
    assert copies.made


def test_a_process_is_made_for_large_files_on_several_cores_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1}, raising=False)
    monkeypatch.setattr(read_ahead.sys, "platform", "linux")
    assert read_ahead.is_worth_it(100, 100)
    assert not read_ahead.is_worth_it(99, 100)
    monkeypatch.setattr(threading, "active_count", lambda: 2)
    assert not read_ahead.is_worth_it(100, 100)
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3})
    assert not read_ahead.is_worth_it(100, 100)
