"""The ring of the last frames: what it holds is the end of what came, and can be read again."""

from __future__ import annotations

from itertools import accumulate

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from nvscope.engine.ring import FrameRing, Recent, RecentSource
from tests.laws import examples
from tests.packets import cut, observed

SECOND_NS = 1_000_000_000
PACKETS = st.lists(st.tuples(st.binary(min_size=1, max_size=80), st.integers(0, 5)), min_size=1, max_size=120)


def batch(drawn: list[tuple[bytes, int]]) -> PacketBatch:
    """Return packets so many seconds apart."""
    times = list(accumulate(seconds for _, seconds in drawn))
    return PacketBatch.of([data for data, _ in drawn], LinkType.RAW, [one * SECOND_NS for one in times])


def bytes_of(source: RecentSource) -> list[tuple[bytes, int]]:
    return [(part.packet(row), int(part.ts_ns[row])) for part in source for row in range(len(part))]


def ringed(whole: PacketBatch, size: int, most_bytes: int) -> Recent:
    return observed(FrameRing(most_bytes), cut(whole, size)).recent()


@examples()
@given(PACKETS, st.integers(1, 50), st.sampled_from([1, 3_000, 20_000, 1 << 20]))
def test_it_holds_the_last_frames_as_they_came(drawn: list[tuple[bytes, int]], size: int, most_bytes: int) -> None:
    whole = batch(drawn)
    recent = ringed(whole, size, most_bytes)
    all_of = [(whole.packet(row), int(whole.ts_ns[row])) for row in range(len(whole))]
    assert recent.stop_frame == len(whole) + 1
    assert recent.passed == recent.first_frame - 1
    assert bytes_of(RecentSource(recent)) == all_of[recent.first_frame - 1 :]
    if most_bytes == 1 << 20:
        assert len(recent) == len(whole)
    if len(recent.chunks) > 1:
        assert recent.bytes <= most_bytes


@examples()
@given(PACKETS, st.integers(1, 50), st.integers(0, 130), st.integers(0, 130))
def test_any_part_of_it_can_be_read(drawn: list[tuple[bytes, int]], size: int, first: int, stop: int) -> None:
    whole = batch(drawn)
    recent = ringed(whole, size, 4_000)
    lowest = max(first, recent.first_frame)
    wanted = [whole.packet(frame - 1) for frame in range(lowest, min(stop, len(whole) + 1))]
    pieces = list(recent.pieces(first, stop))
    assert [chunk.packets.packet(row) for chunk in pieces for row in range(len(chunk.packets))] == wanted
    for chunk in pieces:
        before = chunk.first_frame - 2
        assert chunk.before_ns == int(whole.ts_ns[max(before, 0)])
        assert recent.time_of(chunk.first_frame) == int(whole.ts_ns[chunk.first_frame - 1])


@examples()
@given(PACKETS, st.integers(1, 50), st.integers(-1, 400))
def test_a_time_has_the_last_frame_up_to_it(drawn: list[tuple[bytes, int]], size: int, second: int) -> None:
    whole = batch(drawn)
    recent = ringed(whole, size, 4_000)
    earlier = [
        frame for frame in range(recent.first_frame, len(whole) + 1) if whole.ts_ns[frame - 1] <= second * SECOND_NS
    ]
    assert recent.frame_at(second * SECOND_NS) == (earlier[-1] if earlier else recent.first_frame)


def test_small_batches_are_put_together() -> None:
    whole = batch([(b"x" * 40, 1)] * 3_000)
    recent = ringed(whole, 1, 1 << 20)
    assert len(recent) == 3_000
    assert len(recent.chunks) <= 24  # each twice as large as the one behind it, up to an eighth of all


def test_what_was_looked_at_stays_while_more_comes() -> None:
    whole = batch([(bytes([number]), 1) for number in range(200)])
    ring = FrameRing(5_000)
    observed(ring, cut(whole[:100], 7))
    before = ring.recent()
    kept = bytes_of(RecentSource(before))
    observed(ring, cut(whole[100:], 7))
    assert bytes_of(RecentSource(before)) == kept


def test_a_part_of_its_time_is_a_source_too() -> None:
    recent = ringed(batch([(bytes([number]), 1) for number in range(1, 11)]), 3, 1 << 20)
    source = RecentSource(recent).between(3 * SECOND_NS, 5 * SECOND_NS)
    assert isinstance(source, RecentSource)
    assert [data for data, _ in bytes_of(source)] == [b"\3", b"\4", b"\5"]
    source.stop()
    assert bytes_of(source) == []
