"""How the intervals of lists are spread: one habit is one peak, two are two, and a single outage hides neither."""

from __future__ import annotations

from itertools import accumulate, groupby
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.tracker.buckets import bucket_of
from nvscope.tracker.histograms import Histogram
from nvscope.view.interval_shapes import Bar, IntervalShape, IntervalShapes
from tests.oracle.builders import data_frame, telegram
from tests.oracle.pcap import write_pcap

MS = 1_000_000
US = 1_000
CELLS = 24


def shapes_of(path: Path) -> IntervalShapes:
    found = Inquiry([str(path)]).analyze(causes=False)
    return IntervalShapes(found.state, found.summary)


def shape(intervals_ns: list[int], directory: Path) -> IntervalShape:
    times_ns = accumulate([1_000_000_000, *intervals_ns])
    frames = [
        data_frame(at_ns, "10.0.0.1", "255.255.255.255", telegram(list_id=7, counter=number + 1))
        for number, at_ns in enumerate(times_ns)
    ]
    write_pcap(frames, directory / "sent.pcap")
    return shapes_of(directory / "sent.pcap").of("udp/1202/7")["10.0.0.1"]


def bar(intervals_ns: list[int], directory: Path) -> Bar:
    found = shape(intervals_ns, directory).bar(CELLS)
    assert found is not None
    return found


def peaks(found: Bar) -> int:
    """Return how many stretches of cells in a row have something in them."""
    return sum(filled for filled, _ in groupby(found.cells, bool))


def jittered(interval_ns: int, count: int) -> list[int]:
    """Return intervals that are up to half a percent off, in no order that repeats soon."""
    return [interval_ns + (number * 7919 % 101 - 50) * interval_ns // 10_000 for number in range(count)]


def test_a_regular_list_has_one_peak_at_its_nominal_interval(tmp_path: Path) -> None:
    found = bar(jittered(100 * MS, 200), tmp_path)
    assert peaks(found) == 1
    assert found.nominal is not None
    assert found.cells[found.nominal]
    assert sum(found.cells) == 200
    assert found.first_ns < 100 * MS < found.last_ns


def test_a_list_with_two_habits_has_two_peaks(tmp_path: Path) -> None:
    two = [one for pair in zip(jittered(94 * MS, 100), jittered(107 * MS, 100), strict=True) for one in pair]
    found = bar(two, tmp_path)
    assert peaks(found) == 2
    assert sorted(filter(None, found.cells))[-1] <= 100


def test_a_rare_second_habit_is_seen_too(tmp_path: Path) -> None:
    two = [140 * MS if number % 20 == 19 else 100 * MS for number in range(200)]
    assert [one for one in bar(two, tmp_path).cells if one] == [190, 10]


def test_bursts_and_pauses_are_on_one_scale(tmp_path: Path) -> None:
    found = bar([50 * US, 100 * MS] * 50, tmp_path)
    assert peaks(found) == 2
    assert found.first_ns <= 50 * US < 100 * MS <= found.last_ns


def test_an_outage_leaves_room_for_the_rest_and_is_counted(tmp_path: Path) -> None:
    two = [94 * MS, 107 * MS] * 50
    found = bar([*two, 3_600_000 * MS, *two], tmp_path)
    assert (peaks(found), found.longer, found.shorter) == (2, 1, 0)


def test_few_intervals_are_all_drawn(tmp_path: Path) -> None:
    found = bar([100 * MS, 100 * MS, 5_000 * MS], tmp_path)
    assert ([one for one in found.cells if one], found.longer) == ([2, 1], 0)


def test_a_clock_that_stepped_back_is_told_as_shorter(tmp_path: Path) -> None:
    found = bar([100 * MS] * 30 + [-5 * MS] + [100 * MS] * 30, tmp_path)
    assert (peaks(found), found.shorter) == (1, 1)


def test_all_subindexes_of_a_sender_are_one_shape_and_each_frame_of_a_list_on_can(tmp_path: Path) -> None:
    found = [
        data_frame(number * 100 * MS + subindex * MS, "10.0.0.1", "255.255.255.255",
                   telegram(list_id=7, subindex=subindex, counter=number + 1))
        for number in range(20) for subindex in range(3)
    ]  # fmt: skip
    write_pcap(found, tmp_path / "three.pcap")
    (together,) = shapes_of(tmp_path / "three.pcap").of("udp/1202/7").values()
    assert (int(together.histogram.count.sum()), together.nominal_ns) == (57, 100 * MS)
    log = tmp_path / "a.log"
    log.write_text("".join(f"({number / 10:.6f}) can0 111#01020304\n" for number in range(20)))
    on_can = shapes_of(log)
    ((node, frames),) = on_can.of(*on_can.lists).items()
    assert (node, int(frames.histogram.count.sum())) == (None, 19)


@given(st.lists(st.integers(1, 10**12), min_size=1, max_size=60), st.integers(1, 40))
def test_every_interval_is_in_a_cell_or_beyond(intervals_ns: list[int], cells: int) -> None:
    bucket, count = np.unique(bucket_of(np.array(intervals_ns)), return_counts=True)
    drawn = IntervalShape(Histogram(bucket, count, min(intervals_ns), max(intervals_ns)), None).bar(cells)
    assert drawn is not None
    assert sum(drawn.cells) + drawn.shorter + drawn.longer == len(intervals_ns)
    assert len(drawn.cells) == cells
    assert drawn.first_ns <= drawn.last_ns
