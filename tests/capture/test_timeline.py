"""Several captures as one timeline: the order of a plain merge, for any order of the files and any cut of the work."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.capture.between import Between
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.source import Attachment, SourceInfo
from nvscope.capture.time_span import TimeSpan
from nvscope.capture.timeline import Timeline
from tests.capture import build
from tests.capture.reference import Packet
from tests.capture.test_sinks import batch_of
from tests.records import replace


def plain_merge(tracks: Sequence[list[Packet]]) -> list[Packet]:
    """Always the packet next that is earliest among the first ones left; of equals, that of the first track."""
    left = [list(track) for track in tracks]
    merged = []
    while any(left):
        heads = [(track[0].ts_ns, number) for number, track in enumerate(left) if track]
        merged.append(left[min(heads)[1]].pop(0))
    return merged


def in_rank_order(tracks: dict[str, list[Packet]]) -> list[list[Packet]]:
    names = [name for name in tracks if tracks[name]]
    return [tracks[name] for name in sorted(names, key=lambda name: (tracks[name][0].ts_ns, name))]


_times = st.lists(st.integers(0, 12), max_size=14)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    data=st.data(),
    times=st.lists(_times, min_size=2, max_size=5),
    batch_packets=st.sampled_from((1, 2, 3, 8, 32_768)),
    batch_bytes=st.sampled_from((1, 40, 1 << 20)),
)
def test_the_order_is_that_of_a_plain_merge(
    tmp_path: Path, data: st.DataObject, times: list[list[int]], batch_packets: int, batch_bytes: int
) -> None:
    tracks: dict[str, list[Packet]] = {}
    for number, seconds in enumerate(times):
        link = data.draw(st.sampled_from((1, 113)))
        name = str(tmp_path / f"{number}.pcap")
        tracks[name] = [
            Packet(second * 10**9, 1000 + row, link, bytes((number, row)) * (row % 5 * 40))
            for row, second in enumerate(seconds)
        ]
        Path(name).write_bytes(build.pcap(tracks[name], link=link))
    names = data.draw(st.permutations(list(tracks)))
    files = [CaptureFile(name, sizes=ReadingSizes(batch_packets=batch_packets), small_file_bytes=0) for name in names]
    source = Timeline(files, batch_packets=batch_packets, batch_bytes=batch_bytes)
    assert build.packets_of(source) == plain_merge(in_rank_order(tracks))
    assert [info.path for info in source.infos] == names
    assert [info.frames for info in source.infos] == [len(tracks[name]) for name in names]
    assert source.position_bytes == source.size_bytes == sum(Path(name).stat().st_size for name in names)


def test_equal_times_do_not_depend_on_the_order_of_the_arguments(tmp_path: Path) -> None:
    names = []
    for number in range(3):
        path = tmp_path / f"{number}.pcap"
        path.write_bytes(build.pcap([Packet(5, 1, 1, bytes((number, row))) for row in range(4)]))
        names.append(str(path))
    orders = {tuple(build.packets_of(open_source(order))) for order in itertools.permutations(names)}
    assert len(orders) == 1


class FakeTrack:
    """A track of batches, such as an interface, that notes in ``asked`` which of them were asked for."""

    def __init__(self, path: str, batches: list[PacketBatch], asked: list[str] | None = None) -> None:
        self.path = path
        self.infos: list[SourceInfo] = []
        self.channels: list[str] = []
        self.attachments: list[Attachment] = []
        self._batches = batches
        self._asked = [] if asked is None else asked

    def __iter__(self) -> Iterator[PacketBatch]:
        return self.read(1, TimeSpan())

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        for batch in self._batches:
            self._asked.append(self.path)
            yield batch

    def between(self, start_ns: int | None, end_ns: int | None) -> Between:
        raise NotImplementedError

    def stop(self) -> None:
        self._batches = []


class FakeFile(FakeTrack):
    """A track that can be asked when it begins."""

    size_bytes = None
    position_bytes = 0

    def first_ts_ns(self) -> int | None:
        return int(self._batches[0].ts_ns[0]) if self._batches else None

    def first_batches(self) -> Iterator[PacketBatch]:
        return iter(self._batches[:1])


def _batch(first: int, count: int) -> PacketBatch:
    return PacketBatch(
        np.zeros(4096, np.uint8),
        np.zeros(count, np.int64),
        np.full(count, 9, np.int32),
        np.full(count, 9, np.int64),
        np.arange(first, first + count),
        PacketBatch.link_column(1, count),
    )


def test_files_that_do_not_overlap_pass_through_one_after_the_other() -> None:
    asked: list[str] = []
    batches = {name: [_batch(first, 10), _batch(first + 10, 10)] for name, first in (("late", 100), ("early", 0))}
    timeline = Timeline([FakeFile(name, each, asked) for name, each in batches.items()])
    told = [batch for batch in timeline if len(batch)]
    for batch, original in zip(told, batches["early"] + batches["late"], strict=True):
        assert batch.data is original.data
        assert np.array_equal(batch.ts_ns, original.ts_ns)
    assert asked == ["early", "early", "late", "late"]


def test_no_more_than_a_batch_of_each_file_is_held() -> None:
    asked: list[str] = []
    tracks = [
        FakeFile(name, [_batch(first, 10) for first in range(start, 1000, 10)], asked)
        for name, start in (("a", 0), ("b", 5))
    ]
    seen = 0
    for batch in Timeline(tracks):
        seen += len(batch)
        assert len(asked) * 10 - seen <= 40


def test_packets_far_apart_in_a_file_are_copied_without_what_lies_between(tmp_path: Path) -> None:
    filler = build.block("<", 0xBAD, bytes(3_000_000))
    names = []
    for number in range(2):
        blocks = [build.section("<"), build.interface("<")]
        for row in range(4):
            blocks += [build.enhanced("<", row, bytes((number, row)) * 100), filler]
        path = tmp_path / f"{number}.pcapng"
        path.write_bytes(b"".join(blocks))
        names.append(str(path))
    batches = list(open_source(names))
    assert len(batches[0]) == 7
    assert len(batches[0].data) < 10_000
    packets = build.packets_of(batches)
    assert [packet.data[:2] for packet in packets] == [bytes((number, row)) for row in range(4) for number in range(2)]


@pytest.mark.parametrize("seed", range(3))
def test_large_files_with_clocks_that_step_back(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    tracks: dict[str, list[Packet]] = {}
    for number in range(4):
        now = build.BASE_S * 10**9 + chance.choice((0, 10**9))
        packets = []
        for _ in range(3000):
            now += chance.choice((10**6, 10**5, -(10**6), 0))
            data = bytes((number,)) * chance.choice((0, 60, 1500))
            packets.append(Packet(now, len(data), 1, data))
        name = str(tmp_path / f"{number}.pcapng")
        blocks = [build.enhanced("<", packet.ts_ns // 1000, packet.data) for packet in packets]
        Path(name).write_bytes(build.section("<") + build.interface("<") + b"".join(blocks))
        tracks[name] = [packet._replace(ts_ns=packet.ts_ns // 1000 * 1000) for packet in packets]
    assert build.packets_of(open_source(list(tracks), batch_packets=500)) == plain_merge(in_rank_order(tracks))


def test_channels_of_one_name_are_one_channel_whichever_file_they_are_of() -> None:
    """The first file has two channels, the second only one, which is the second of the first file."""
    channel = np.array([1, 0, 1, 0, 1], np.uint16)
    tracks = [FakeFile("a", [replace(_batch(0, 5), channel=channel)], []), FakeFile("b", [_batch(2, 2)], [])]
    tracks[0].channels, tracks[1].channels = ["can0", "can1"], ["can1"]
    timeline = Timeline(tracks)
    found = [
        (ts_ns, timeline.channels[number])
        for batch in timeline
        for ts_ns, number in zip(batch.ts_ns.tolist(), batch.channels.tolist(), strict=True)
    ]
    assert found == [
        (0, "can1"), (1, "can0"), (2, "can1"), (2, "can1"), (3, "can0"), (3, "can1"), (4, "can1"),
    ]  # fmt: skip


def _at(number: int, rows: Sequence[tuple[int, int]], until_ns: int | None = None) -> PacketBatch:
    """Packets of a track as (row, time)."""
    packets = [Packet(ts_ns, 1000, 1, bytes((number, row))) for row, ts_ns in rows]
    return replace(batch_of(packets), until_ns=until_ns)


@settings(deadline=None)
@given(data=st.data(), tracks=st.lists(_times, min_size=1, max_size=4))
def test_time_that_passes_changes_no_order(data: st.DataObject, tracks: list[list[int]]) -> None:
    """Whoever says up to when nothing comes, as often and wherever it is true, gets the same timeline."""
    plain, telling = [], []
    for number, times in enumerate(tracks):
        cuts = sorted(data.draw(st.sets(st.integers(0, len(times)))) | {0, len(times)})
        spans = [list(enumerate(times))[begin:end] for begin, end in itertools.pairwise(cuts)]
        latest = list(itertools.accumulate(times, max))
        batches = []
        for begin, span in zip([0, *cuts[:-1]], [[], *spans], strict=True):
            behind = begin + len(span)
            # What comes behind counts as of the latest time so far: only before that nothing comes any more.
            most = latest[behind] - 1 if behind < len(times) else 20
            untils = data.draw(st.lists(st.integers(-1, most), max_size=2)) if most >= -1 else []
            together = bool(span and untils and data.draw(st.booleans()))
            if span:
                batches.append(_at(number, span, untils.pop(0) if together else None))
            batches += [PacketBatch.nothing(until_ns) for until_ns in untils]
        plain.append(FakeFile(str(number), [_at(number, span) for span in spans]))
        telling.append(FakeTrack(str(number), batches))
    told = list(Timeline(telling))
    assert build.packets_of(batch for batch in told if len(batch)) == build.packets_of(Timeline(plain))
    passed = -2
    latest_ns = [-2] * len(tracks)
    for batch in told:
        if batch.until_ns is not None and not len(batch):
            assert batch.until_ns > passed
            passed = batch.until_ns
        for row in range(len(batch)):
            number = batch.packet(row)[0]
            latest_ns[number] = max(latest_ns[number], int(batch.ts_ns[row]))
            assert latest_ns[number] > passed, "the timeline promised that nothing comes any more"


def test_a_silent_track_holds_back_nobody() -> None:
    """A bus says twice that nothing came; what the other one has goes out up to there before more is asked of it."""
    asked: list[str] = []
    quiet = FakeTrack("quiet", [PacketBatch.nothing(4), PacketBatch.nothing(20), _at(0, [(0, 25)])], asked)
    busy = FakeTrack("busy", [_at(1, [(0, 3), (1, 10)]), _at(1, [(2, 15), (3, 30)])], asked)
    seen = [(batch.ts_ns.tolist(), batch.until_ns, list(asked)) for batch in Timeline([quiet, busy])]
    assert [(times, until_ns) for times, until_ns, _ in seen] == [
        ([3], None), ([], 4), ([10], None), ([15], None), ([], 20), ([25], None), ([30], None),
    ]  # fmt: skip
    assert seen[0][2].count("quiet") == 1


def test_tracks_that_are_all_silent_say_so_together() -> None:
    told = {"a": (3, 9), "b": (5, 7)}
    tracks = [FakeTrack(name, [PacketBatch.nothing(until_ns) for until_ns in untils]) for name, untils in told.items()]
    assert [batch.until_ns for batch in Timeline(tracks)] == [3, 5, 7, 9]


def test_many_files_that_overlap_are_merged_a_batch_at_a_time(tmp_path: Path) -> None:
    """One packet of each at a time would take a time that grows with the square of the files."""
    names = []
    for number in range(200):
        blocks = [build.section("<"), build.interface("<")]
        blocks += [build.enhanced("<", 1000 * row + number, bytes((number, row)) * 10) for row in range(10)]
        path = tmp_path / f"{number:03}.pcapng"
        path.write_bytes(b"".join(blocks))
        names.append(str(path))
    batches = [batch for batch in open_source(names) if len(batch)]
    assert len(batches) == 1
    packets = build.packets_of(batches)
    assert [packet.data[:2] for packet in packets] == [bytes((n, row)) for row in range(10) for n in range(200)]
