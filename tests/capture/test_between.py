"""Parts of sources: what lies between two times, in the order of the whole; as a plain filter and editcap have it."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.time_span import TimeSpan
from nvscope.capture.timeline import Timeline
from tests.capture import build
from tests.capture.reference import Packet
from tests.capture.test_sinks import batch_of
from tests.capture.test_timeline import FakeFile
from tests.records import replace

_slow = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
_bounds = st.one_of(st.none(), st.integers(-1, 14))


def within(packets: list[Packet], start_ns: int | None, end_ns: int | None) -> list[Packet]:
    return [
        packet
        for packet in packets
        if (start_ns is None or packet.ts_ns >= start_ns) and (end_ns is None or packet.ts_ns <= end_ns)
    ]


@_slow
@given(
    times=st.lists(st.lists(st.integers(0, 12), max_size=14), min_size=1, max_size=4),
    start=_bounds,
    end=_bounds,
    batch_packets=st.sampled_from((1, 3, 131_072)),
)
def test_a_part_is_a_filter_of_the_whole(
    tmp_path: Path, times: list[list[int]], start: int | None, end: int | None, batch_packets: int
) -> None:
    """Also where clocks step back, and in the order of the whole timeline, not of one of the parts."""
    names = []
    for number, seconds in enumerate(times):
        packets = [Packet(second, 1000 + row, 1, bytes((number, row))) for row, second in enumerate(seconds)]
        path = tmp_path / f"{number}.pcap"
        path.write_bytes(build.pcap(packets))
        names.append(str(path))
    whole = build.packets_of(open_source(names, batch_packets=batch_packets))
    source = open_source(names, batch_packets=batch_packets)
    part = source.between(start, end)
    assert build.packets_of(part) == within(whole, start, end)
    # What was read is told, not what is left of it.
    assert sum(info.frames for info in part.infos) == len(whole)
    assert (part.size_bytes, part.position_bytes) == (source.size_bytes, source.size_bytes)
    assert part.first_ts_ns() == min((each[0] for each in times if each), default=None)
    assert len(list(part.first_batches())) == sum(map(bool, times))
    assert build.packets_of(source.between(start, None).between(None, end)) == within(whole, start, end)


@pytest.mark.skipif(shutil.which("editcap") is None, reason="needs editcap")
@pytest.mark.parametrize("step_ns", [10**6, -(10**6)])
def test_editcap_leaves_the_same_packets(tmp_path: Path, step_ns: int) -> None:
    """editcap takes the begin, and leaves out the end."""
    base = build.BASE_S * 10**9
    packets = [Packet(base + n * step_ns + n % 7 * 10**5, 9, 1, bytes(9)) for n in range(500)]
    whole, cut = tmp_path / "whole.pcap", tmp_path / "cut.pcap"
    whole.write_bytes(build.pcap(packets))
    start, end = sorted((base + 100 * step_ns, base + 300 * step_ns))
    bounds = [f"{ns // 10**9}.{ns % 10**9:09d}" for ns in (start, end + 1)]
    subprocess.run(["editcap", "-A", bounds[0], "-B", bounds[1], str(whole), str(cut)], check=True)
    expected = build.packets_of(open_source([str(cut)]))
    assert build.packets_of(open_source([str(whole)]).between(start, end)) == expected
    assert 190 < len(expected) < 210


def test_packets_that_lie_apart_share_the_buffer_of_their_batch() -> None:
    packets = [Packet(ts_ns, 5, 1, bytes((ts_ns, 1, 2))) for ts_ns in (5, 1, 6, 2, 7)]
    batch = batch_of(packets)
    for taken in (batch, replace(batch, link=PacketBatch.link_column(1, 5), channel=batch.link)):
        part = TimeSpan.of(5, 6).part(taken)
        assert part is not None
        assert part.data is batch.data
        assert [part.packet(row)[0] for row in range(len(part))] == [5, 6]
        assert part.single_link == 1
        assert (part.channel is None) == (taken.channel is None)
    assert TimeSpan.of(None, None).part(batch) is batch
    assert TimeSpan.of(-(1 << 70), 1 << 70).part(batch) is batch


@pytest.mark.parametrize(("until_ns", "told"), [(None, None), (3, None), (5, 5), (8, 8), (20, 10)])
def test_time_that_passes_is_told_up_to_the_end_of_the_part(until_ns: int | None, told: int | None) -> None:
    span = TimeSpan.of(5, 10)
    alone = span.part(PacketBatch.nothing(until_ns))
    assert (None if alone is None else alone.until_ns) == told
    beside = span.part(replace(batch_of([Packet(6, 1, 1, b"")]), until_ns=until_ns))
    assert beside is not None
    assert (len(beside), beside.until_ns) == (1, told)
    outside = span.part(replace(batch_of([Packet(2, 1, 1, b"")]), until_ns=until_ns))
    assert (None if outside is None else (len(outside), outside.until_ns)) == (None if told is None else (0, told))


class _Indexed(FakeFile):
    """A recording that knows the times of its chunks, and does not read those that nobody wants."""

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        for batch in super().read(share, span):
            first_ns, last_ns = int(batch.ts_ns.min()), int(batch.ts_ns.max())
            if first_ns <= span.end_ns and last_ns >= span.start_ns:
                yield batch
            else:
                yield PacketBatch.nothing(last_ns)


@_slow
@given(
    tracks=st.lists(st.lists(st.integers(0, 12), min_size=1, max_size=12).map(sorted), min_size=1, max_size=4),
    chunk=st.integers(1, 4),
    start=_bounds,
    end=_bounds,
)
def test_an_index_changes_nothing(tracks: list[list[int]], chunk: int, start: int | None, end: int | None) -> None:
    parts = {str(number): _chunks(number, times, chunk) for number, times in enumerate(tracks)}
    whole = [FakeFile(name, batches) for name, batches in parts.items()]
    indexed = [_Indexed(name, batches) for name, batches in parts.items()]
    packets = build.packets_of(Timeline(whole))
    left = [batch for batch in Timeline(indexed).between(start, end) if len(batch)]
    assert build.packets_of(left) == within(packets, start, end)


def _chunks(number: int, times: list[int], size: int) -> list[PacketBatch]:
    packets = [Packet(ts_ns, 1000, 1, bytes((number, row))) for row, ts_ns in enumerate(times)]
    return [batch_of(packets[begin : begin + size]) for begin in range(0, len(packets), size)]


def test_a_reader_is_told_what_is_wanted_of_it(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(build.pcap([Packet(5, 1, 1, b"x")]))
    source = CaptureFile(str(path), sizes=ReadingSizes(batch_packets=1))
    opened = source._open(1, TimeSpan.of(3, 4))
    assert opened.reader.content.span == TimeSpan(3, 4)
    opened.content.close()
