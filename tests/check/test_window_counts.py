"""Figures in windows: what is counted by telegrams and events is what windows of the whole state tell."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.asked_rows import EVERY_LIST, AskedRows
from nvscope.check.check import Setting
from nvscope.check.figure_windows import _Run
from nvscope.check.window_counts import COUNTED, WindowCounts
from nvscope.engine.run import run
from nvscope.expression.words import TableWords
from nvscope.tracker.figures import BY_NAME, Of
from nvscope.tracker.state import TrackerState
from nvscope.tracker.subjects import subjects
from nvscope.tracker.windows import Windows
from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import BEGIN_NS, captured, judged, ruled
from tests.engine.traffic import CHANNELS, length_of, reading_of, traffic
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.packets import Batches
from tests.program_here import run_text
from tests.simulate.simulation import simulated
from tests.tracker.test_windows import watched

Figures = dict[tuple[int, int], dict[str, int]]


def counted(batches: Any, length_ns: int) -> tuple[Figures, int]:
    """Return what is counted of each list, by its number, in each window that has ended; and how many have."""
    counts = WindowCounts(Setting({}, TableWords({}), AskedRows({}), {}), length_ns)
    counts.want(EVERY_LIST, COUNTED)
    state = counts.state = TrackerState(listeners=(counts,))
    found: Figures = {}
    until = 0
    for _ in run(Batches(batches, CHANNELS), reading_of(None), [state, counts]):
        for ended in counts.ended:
            assert not ended.breaks
            until = ended.until
            for place, (number, window) in enumerate(zip(ended.list.tolist(), ended.window.tolist(), strict=True)):
                assert (number, window) not in found
                found[number, window] = {name: int(column[place]) for name, column in ended.values.items()}
    return found, until


@given(st.integers(0, 10_000))
@examples(30)
def test_telegrams_are_those_of_windows(seed: int) -> None:
    chance, batches = random.Random(seed), traffic(seed)
    length_ns = length_of(batches, chance)
    found, until = counted(batches, length_ns)
    told = {(number, window): one["telegrams"] for (number, window), one in found.items() if one["telegrams"]}
    expected = {}
    windows = watched(Windows(length_ns), batches)
    for window in windows:
        if window.complete and window.number < until:
            for one in subjects(window.counted.summary()):
                if one.of is Of.LIST and one.list is not None and one.measured.telegrams:
                    expected[one.list, window.number] = one.measured.telegrams
    assert told == expected


@pytest.mark.parametrize("name", ["loss", "overtaken", "duplicate", "restart", "malformed", "acknowledgement-missing"])
def test_events_are_those_of_windows(name: str) -> None:
    batches = simulated(Path(__file__).parents[1] / "scenarios" / f"{name}.toml").batches
    found, until = counted(batches, 1_000_000_000)
    sums: Counter[tuple[int, str]] = Counter()
    for (number, _), values in found.items():
        sums.update({(number, figure): value for figure, value in values.items() if figure != "longest_gap"})
    expected: Counter[tuple[int, str]] = Counter()
    for window in watched(Windows(1_000_000_000), batches):
        for one in subjects(window.counted.summary()) if window.complete and window.number < until else ():
            if one.of is Of.LIST and one.list is not None:
                values = {figure: BY_NAME[figure].read(one.measured) for figure in COUNTED if figure != "longest_gap"}
                expected.update({(one.list, figure): int(value or 0) for figure, value in values.items()})
    assert {key: value for key, value in sums.items() if value} == {
        key: value for key, value in expected.items() if value
    }


@given(st.integers(0, 10_000), st.integers(1, 30))
@examples(30)
def test_the_batches_do_not_matter(seed: int, size: int) -> None:
    chance, batches = random.Random(seed), traffic(seed)
    length_ns = length_of(batches, chance)
    parts = [batch[start : start + size] for batch in batches for start in range(0, len(batch), size)]
    whole, cut = (
        {place: one["telegrams"] for place, one in counted(each, length_ns)[0].items() if one["telegrams"]}
        for each in (batches, parts)
    )
    assert whole == cut


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 5)), max_size=30), st.integers(0, 4))
def test_runs_of_windows_are_measured_one_by_one(stretches: list[tuple[bool, int]], allowed: int) -> None:
    found, single = _Run(10, allowed * 10 + 5), _Run(10, allowed * 10 + 5)
    window = 0
    for is_fine, count in stretches:
        found.take(window, count, is_fine, 1000, None)
        for number in range(window, window + count):
            single.take(number, 1, is_fine, 1000, None)
        window += count
    figures = [(one.windows, one.broken, one.longest_ns, one.first_ns) for one in (found, single)]
    assert figures[0] == figures[1]
    fine = [is_fine for is_fine, count in stretches for _ in range(count)]
    longest = broken = in_a_row = 0
    for one in fine:
        in_a_row = 0 if one else in_a_row + 1
        longest, broken = max(longest, in_a_row), broken + (in_a_row > allowed)
    assert figures[0][:3] == (len(fine), broken, longest * 10)


def test_a_clock_that_jumps_by_years_leaves_no_years_of_work(tmp_path: Path) -> None:
    years = 2 * 366 * 86_400_000
    capture = captured(tmp_path, [(number * 100 + (years if number > 100 else 0), 7, []) for number in range(200)])
    rules = [f'check = "never"\nexpr = "list.{name}"\nwindow = "1s"' for name in ("lost > 0", "interval_max > 200ms")]
    tight = 'check = "never"\nexpr = "list.duplicates > 1"\nwindow = "1ns"'
    found = judged(
        capture, ruled(tmp_path, *rules, tight, 'check = "always"\nexpr = "list.telegrams > 0"\nwindow = "1s"')
    )
    assert [one["verdict"] for one in found["rules"]] == ["pass", "fail", "pass", "fail"]


def test_windows_are_no_shorter_than_they_can_be_looked_at(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "never"\nexpr = "list.interval_max > 200ms"\nwindow = "1ms"')
    done = run_text("check", captured(tmp_path, []), "--rules", rules)
    assert (done.returncode, "100 ms long at least" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("counters", "verdict"),
    [
        ([*range(9), 10, 9, *range(11, 40)], "pass"),
        ([*range(38), 39, 38], "pass"),
        ([*range(9), 10, 11, 9, *range(12, 40)], "fail"),
        ([*range(8), 9, 11, 10, *range(12, 41)], "fail"),
    ],
)
def test_what_is_overtaken_across_the_end_of_a_window_was_not_lost(
    counters: list[int], verdict: str, tmp_path: Path
) -> None:
    """Telegrams come every 100 ms from 50 ms on; one that is 200 ms late was missing for too long to be waited for."""
    packets = []
    for number, counter in enumerate(counters):
        payload = telegram(list_id=8, counter=counter + 1, data=b"\0\0")
        at_ns = BEGIN_NS + (50 + number * 100) * 10**6 if number else BEGIN_NS
        one = data_frame(at_ns, "10.0.0.8", "10.0.0.255", payload)
        packets.append(Packet(one.data, one.original, one.ts_ns, one.link))
    rules = ruled(tmp_path, 'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"')
    (one,) = judged(write(tmp_path / "x.pcap", packets), rules)["rules"]
    assert one["verdict"] == verdict, one
