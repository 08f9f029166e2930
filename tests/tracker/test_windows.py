"""Windows: the same whatever the batches, joined the whole, and each with extremes of its own."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.buses import Buses, BusSettings
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.errors import UsageError
from nvscope.tracker.counted import Counted
from nvscope.tracker.counters import Scope
from nvscope.tracker.figures import BY_NAME, BY_SCOPE, FIGURES, Joins, Of, Provided
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary, summarize
from nvscope.tracker.windows import Window, Windows
from tests.engine.traffic import CHANNELS, length_of, reading_of, span_ns, traffic, with_holes
from tests.laws import examples, some
from tests.oracle.builders import ACKNOWLEDGEMENT, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of, cut, document_of
from tests.records import replace
from tests.simulate.simulation import project_of, simulated
from tests.tracker.can.test_state import batch as can_batch
from tests.tracker.counted_tables import Who, all_figures, named, tables
from tests.tracker.test_figures import ALL, HMI, MS, PRESS, S, at

SCENARIOS = sorted((Path(__file__).parents[1] / "scenarios").glob("*.toml"))
BIT_RATES = Buses(tuple((channel, BusSettings(500_000)) for channel in CHANNELS))
TELLING_SEEDS = (9, 35, 48, 120, 155)
"""Of random traffic; all but overtaken telegrams are in several of its windows."""
OVERTAKEN = next(path for path in SCENARIOS if path.stem == "overtaken")
OVER_TIME = {"rate", "load"}
"""Figures of a second, or of the time that was watched: of a window, that is its length."""


def watched(
    windows: Windows,
    batches: Sequence[PacketBatch],
    reading: Reading | None = None,
    channels: Sequence[str] = CHANNELS,
    beside: Sequence[Observer] = (),
) -> list[Window]:
    """Return the windows that end, and the one that is open in the end, if any."""
    found = []
    for _ in run(windows.cut(Batches(batches, channels)), reading or reading_of(None), [*beside, windows]):
        found += windows.closed()
    last = windows.open()
    return found if last is None else [*found, last]


def told(windows: Sequence[Window]) -> list[Any]:
    return [(one.number, one.start_ns, one.end_ns, one.complete, named(one.counted)) for one in windows]


@given(st.integers(0, 10_000))
@example(143)  # intervals whose extremes, in an earlier window, decide whether counters are believed
@examples(60)
def test_windows_joined_are_the_whole_with_its_extremes(seed: int) -> None:
    chance, state = random.Random(seed), TrackerState()
    batches = traffic(seed)
    length_ns = length_of(batches, chance)
    windows = watched(Windows(length_ns), with_holes(batches, chance), beside=[state])
    whole = reduce(add, [one.counted for one in windows])
    expected = tables(Counted.of(state))
    assert {path: value for path, value in tables(whole).items() if path != "end"} == {
        path: value for path, value in expected.items() if path != "end"
    }
    figures, plain = all_figures(whole.summary()), all_figures(summarize(state))
    for who, row in plain.items():
        for name in set(row) - OVER_TIME:
            assert figures[who][name] == row[name], (who, name)
    assert figures.keys() == plain.keys()


@given(st.integers(0, 10_000), st.sampled_from([1, 7, 100]))
@examples(20)
def test_any_cut_into_batches_gives_the_same_windows(seed: int, packets: int) -> None:
    batches, chance = traffic(seed), random.Random(seed)
    length_ns = length_of(batches, chance)
    start_ns = chance.choice([None, int(batches[0].ts_ns[0]) + chance.randrange(-2 * length_ns, 2 * length_ns)])
    pieces = [piece for batch in batches for piece in cut(batch, packets)]
    assert told(watched(Windows(length_ns, start_ns), pieces)) == told(watched(Windows(length_ns, start_ns), batches))


@given(st.integers(0, 10_000))
@example(2538)  # requests that end at an edge, of which a clock that stepped back asked the later one first
@examples(20)
def test_other_observers_see_the_same(seed: int) -> None:
    batches, state, alone = traffic(seed), TrackerState(), TrackerState()
    watched(Windows(length_of(batches, random.Random(seed))), batches, beside=[state])
    for _ in run(Batches(batches, CHANNELS), reading_of(None), [alone]):
        pass
    assert document_of(state) == document_of(alone)


FOLDS: dict[Joins, Callable[[list[Any]], Any]] = {
    Joins.SUM: sum,
    Joins.LEAST: lambda values: min(values, default=None),
    Joins.MAX: lambda values: max(values, default=None),
    Joins.LAST: lambda values: values[-1] if values else None,
}


@pytest.mark.parametrize("path", some(SCENARIOS), ids=lambda path: path.stem)
def test_figures_join_as_the_table_says(path: Path, tmp_path: Path) -> None:
    """The figures of a scenario's windows, put together one by one, are those of the whole."""
    windows, state = windows_of_scenario(path, tmp_path)
    assert len(windows) > 1
    check_joins(windows, state)


@given(st.integers(0, 10_000))
@examples(60)
def test_figures_of_any_traffic_join_as_the_table_says(seed: int) -> None:
    check_joins(*windows_of_traffic(seed))


def test_every_figure_of_the_table_is_put_together_of_several_windows(tmp_path: Path) -> None:
    """What is nothing in all windows but one would join in any way."""
    told = [windows_of_traffic(seed) for seed in TELLING_SEEDS]
    told.append(windows_of_scenario(OVERTAKEN, tmp_path))
    together = set().union(*(check_joins(*one) for one in told))
    missing = {(of.value, figure.name) for figure in FIGURES for of in figure.of} - together
    assert missing == {("bus", "fast_bits"), ("bus", "data_bit_rate")}  # CAN FD comes in tests of its own


def windows_of_traffic(seed: int) -> tuple[list[Window], TrackerState]:
    """Return the windows of random traffic, and what was counted of it at once."""
    batches, state = traffic(seed), TrackerState()
    return watched(Windows(length_of(batches, random.Random(seed))), batches, beside=[state]), state


def windows_of_scenario(path: Path, directory: Path) -> tuple[list[Window], TrackerState]:
    """Return the seventh parts of a scenario, and what was counted of it at once."""
    simulation, state = simulated(path), TrackerState()
    batches, channels = simulation.batches, simulation.channels
    definition = project_of(simulation.scenario, directory).definition
    reading, length_ns = Reading(pdos=Pdos(definition).rules()), max(span_ns(batches) // 7, 1) + 1
    for _ in run(Batches(batches, channels), reading, [state]):
        pass
    return watched(Windows(length_ns), batches, reading, channels), state


def check_joins(windows: Sequence[Window], state: TrackerState) -> set[tuple[str, str]]:
    """Hold each figure of the whole against those of the windows, and return those that several windows have.

    What joins by a fold is put together of theirs; what is read from histograms or computed anew, from the windows
    joined.
    """
    summaries = [one.counted.summary(buses=BIT_RATES) for one in windows]
    depends, several = dependence(windows, summaries), set()
    parts = [all_figures(summary) for summary in summaries]
    joined = all_figures(reduce(add, [one.counted for one in windows]).summary(buses=BIT_RATES))
    for who, row in all_figures(summarize(state, buses=BIT_RATES)).items():
        told = [part[who] for part in parts if who in part]
        for name, value in row.items():
            fold = FOLDS.get(BY_NAME[name].joins)
            known = [one[name] for one in told if one[name] not in (None, "NOERROR")]
            if fold is None:
                assert name in OVER_TIME or joined[who][name] == value, (who, name)
            elif not told:  # a node that is known to read a list by the whole alone
                assert value in (0, None, "NOERROR") or BY_NAME[name].provided is Provided.READING, (who, name)
            elif value is None or value == "NOERROR":
                assert name == "lost" or not known, (who, name)
            elif depends(who, name) or (BY_NAME[name].provided is Provided.SENT and len(told) < len(parts)):
                continue
            else:
                assert fold(known) == value, (who, name)
            if sum(one not in (0, None) for one in known) > 1:
                several.add((who[0].value, name))
    return several


def dependence(windows: Sequence[Window], summaries: Sequence[Summary]) -> Callable[[Who, str], bool]:
    """Return what tells whether a figure hangs on what was known of a sender or reader, and that changed meanwhile."""
    scopes: dict[int, set[Scope]] = {}
    for summary in summaries:
        for node, scope in summary.scopes.items():
            scopes.setdefault(node, set()).add(scope)
    changed = len({one.counted.erratic for one in windows}) > 1 or any(len(own) > 1 for own in scopes.values())
    untold = {number for one in windows for number in lists_with_untold_steps(one.counted)}
    readers = [{entry.number: set(entry.readers) for entry in summary.lists} for summary in summaries]

    def depends(who: Who, name: str) -> bool:
        if BY_NAME[name].provided is Provided.READING:
            own = {who[2] in readers_of[who[1]] for readers_of in readers if who[1] in readers_of}
            return who[0] is Of.NODE and len(own) > 1
        return BY_NAME[name].provided is Provided.COUNTING and (changed or who[1] in untold)

    return depends


def lists_with_untold_steps(counted: Counted) -> Iterator[int]:
    """Yield the lists with streams of which something is counted, but not told as long as their counter stands."""
    loss, keys = counted.state.senders.loss.streams, counted.state.keys
    steps = sum(np.abs(loss.column(name)).sum(axis=1) for name in BY_SCOPE)  # a loss taken back is less than nothing
    for stream in np.flatnonzero((loss.column("counting") == 0) & (steps > 0)).tolist():
        yield int(keys.places.high[int(keys.streams.high[stream])])


def test_every_way_of_joining_is_looked_at() -> None:
    assert {figure.joins for figure in FIGURES} == {*FOLDS, Joins.HISTOGRAM, Joins.DERIVED}


# --- worked out by hand


def figures(window: Window, of: Of = Of.LIST) -> dict[str, Any]:
    rows: dict[Who, dict[str, Any]] = all_figures(window.counted.summary())
    return next((row for who, row in rows.items() if who[0] is of), {})


def test_each_window_has_what_happened_in_it() -> None:
    """A telegram each 100 ms, one of 250 ms in the second second, a gap in the third, nothing in the fifth."""
    times = [*range(0, 1_200, 100), *range(1_350, 1_950, 100), 2_000, 2_150, 2_250, 5_100, 5_200]
    counters = [*range(18), 18, 22, 23, 24, 25]
    frames = [at(time, 0, counter) for time, counter in zip(times, counters, strict=True)]
    for packets in (1, 4, 100):
        windows = watched(Windows(S), cut(batch_of(frames), packets))
        assert [(one.number, one.start_ns - START, one.end_ns - START, one.complete) for one in windows] == [
            (0, 0, S, True), (1, S, 2 * S, True), (2, 2 * S, 3 * S, True), (3, 3 * S, 4 * S, True),
            (4, 4 * S, 5 * S, True), (5, 5 * S, 5_200 * MS, False),
        ]  # fmt: skip
        rows = [figures(one) for one in windows]
        names = ("telegrams", "lost", "longest_gap", "interval_count", "interval_min", "interval_max", "rate")
        assert [[row.get(name) for name in names] for row in rows] == [
            [10, 0, 0, 9, 100 * MS, 100 * MS, 10.0],
            [8, 0, 0, 8, 100 * MS, 250 * MS, 8.0],
            [3, 3, 3, 3, 100 * MS, 150 * MS, 3.0],
            [0, 0, 0, 0, None, None, 0.0],
            [0, 0, 0, 0, None, None, 0.0],
            [2, 0, 0, 2, 100 * MS, 2_850 * MS, 10.0],
        ]


def test_an_edge_belongs_to_the_window_that_begins_there() -> None:
    windows = watched(Windows(S), [batch_of([at(0, 0, 0), at(999.999999, 0, 1), at(1_000, 0, 2)])])
    assert [figures(one)["telegrams"] for one in windows] == [2, 1]


@pytest.mark.parametrize("packets", [1, 100])
def test_what_comes_before_a_given_start_is_in_no_window(packets: int) -> None:
    frames = [at(100 * place, 0, place) for place in range(30)]
    windows = watched(Windows(S, START + S), cut(batch_of(frames), packets))
    assert [(one.number, figures(one)["telegrams"], figures(one)["interval_count"]) for one in windows] == [
        (0, 10, 10), (1, 10, 10),
    ]  # fmt: skip
    before = watched(Windows(S, START - 2 * S), cut(batch_of(frames), packets))
    assert [figures(one).get("telegrams", 0) for one in before] == [0, 0, 10, 10, 10]
    assert watched(Windows(S, START + 60 * S), cut(batch_of(frames), packets)) == []


def test_frames_of_a_clock_that_steps_back_are_in_the_window_that_is_open() -> None:
    frames = [at(time, 0, counter) for counter, time in enumerate([0, 1_500, 400, 1_900, 2_100])]
    for packets in (1, 2, 100):
        windows = watched(Windows(S), cut(batch_of(frames), packets))
        assert [figures(one)["telegrams"] for one in windows] == [1, 3, 1]


def waiting(ms: int, counter: int) -> Frame:
    return data_frame(START + ms * MS, PRESS, ALL, telegram(list_id=7, counter=counter, flags=1))


def answer(ms: int, counter: int) -> Frame:
    return data_frame(START + ms * MS, HMI, PRESS, telegram(ACKNOWLEDGEMENT, list_id=7, counter=counter, data=b""))


def test_acknowledgements_are_of_the_window_in_which_they_come() -> None:
    frames = [waiting(0, 0), answer(10, 0), waiting(900, 1), answer(1_200, 1), waiting(2_500, 2), answer(2_520, 2)]
    windows = watched(Windows(S), [batch_of(frames)])
    told = [[figures(one)[name] for name in ("latency_count", "latency_max", "nAcknowledges")] for one in windows]
    assert told == [[1, 10 * MS, 1], [1, 300 * MS, 1], [1, 20 * MS, 1]]


@pytest.mark.parametrize("steps", [[8_400], [1_700, 1_701, 2_600, 8_400], [100, 4_000, 8_400]])
def test_time_that_passes_ends_windows_and_waits(steps: Sequence[int]) -> None:
    """A telegram at 0.8 s waits in vain until 1.8 s: that is in the second window, however seldom a source speaks."""
    batches = [batch_of([waiting(0, 0), answer(10, 0), waiting(800, 1)])]
    if steps[0] > 100:
        batches[0] = replace(batches[0], until_ns=START + steps[0] * MS)
    batches += [PacketBatch.nothing(START + step * MS) for step in steps]
    windows = watched(Windows(S), batches)
    assert [(one.number, one.complete) for one in windows] == [(number, number < 8) for number in range(9)]
    assert [figures(one)["missing_acknowledgements"] for one in windows] == [0, 1, 0, 0, 0, 0, 0, 0, 0]
    assert windows[-1].end_ns == START + 8_400 * MS


@pytest.mark.parametrize("until", [False, True])
def test_a_wait_in_vain_is_of_the_window_of_its_deadline(until: bool) -> None:
    """Several windows fit into the timeout: a telegram at 0.7 s waits until 1.7 s, in the ninth of 0.2 s."""
    batches = [batch_of([waiting(0, 0), answer(10, 0), waiting(700, 1)])]
    batches.append(PacketBatch.nothing(START + 9 * S) if until else batch_of([at(9_000, 1, 1)]))
    windows = watched(Windows(200 * MS), batches)
    assert [one.number for one in windows if figures(one)["missing_acknowledgements"]] == [8]
    assert len(windows) == 46


def test_each_window_has_the_highest_error_counters_of_its_own() -> None:
    """Frames of a controller that tells its error counters: 120 and 3, later 9 and 40, then none."""
    told_errors, data = 0x2000_0200, 0x181
    frames = [
        (START, 0, told_errors, bytes([0, 0, 0, 0, 0, 0, 120, 3])),
        (START + 1_500 * MS, 0, told_errors, bytes([0, 0, 0, 0, 0, 0, 9, 40])),
        (START + 2_500 * MS, 0, data, bytes(8)),
    ]
    windows = watched(Windows(S), [can_batch(frames)])
    names = ("frames", "error_frames", "tx_errors", "rx_errors")
    assert [[figures(one, Of.BUS)[name] for name in names] for one in windows] == [
        [1, 1, 120, 3], [1, 1, 9, 40], [1, 0, None, None],
    ]  # fmt: skip
    errors = [one.counted.summary().can.buses[0].errors for one in windows]
    assert [told and told.classes for told in errors] == [{"counters": 1}, {"counters": 1}, None]


def test_the_load_of_a_window_is_that_over_its_length() -> None:
    """Frames of 8 bytes in the first and the third of three windows, on a bus of 500 kbit/s."""
    frames = [(START + ms * MS, 0, 0x181, bytes(8)) for ms in (0, 100, 200, 2_100, 2_999)]
    windows = watched(Windows(S), [can_batch(frames)])
    given = Buses((("can0", BusSettings(500_000)),))
    buses = [one.counted.summary(buses=given).can.buses[0] for one in windows[:2]]
    assert [bus.frames for bus in buses] == [3, 0]
    assert [bus.seconds for bus in buses] == [1, 0]
    assert [bus.load and bus.load.mean for bus in buses] == [pytest.approx(100 * buses[0].bits / 500_000), 0]
    assert [len(bus.identifiers) for bus in buses] == [1, 0]
    twice = watched(Windows(2 * S), [can_batch(frames)])[0].counted.summary(buses=given)
    assert [bus.load and bus.load.mean for bus in twice.can.buses] == [pytest.approx(50 * buses[0].bits / 500_000)]
    loads = [bus.load for one in windows for bus in one.counted.summary(buses=given).can.buses]
    assert [len(load.second_ns) for load in loads if load] == [1, 1, 1]
    lists = [one.counted.summary().can.lists[0] for one in windows]
    assert [entry.diagnosis.nSendCount for entry in lists] == [3, 0, 2]
    last = [START + 200 * MS, None, START + 2_999 * MS]
    assert [entry.diagnosis.tLastSend for entry in lists] == last


def test_nothing_has_no_windows() -> None:
    assert watched(Windows(S), []) == []
    assert watched(Windows(S), [PacketBatch.nothing(START)]) == []
    assert [one.complete for one in watched(Windows(S, START), [PacketBatch.nothing(START + 2 * S)])] == [
        True,
        True,
        False,
    ]


def test_years_without_a_frame_take_no_time_before_somebody_looks() -> None:
    windows = Windows(100 * MS)
    batches = [batch_of([at(0, 0, 0)]), batch_of([at(10**12, 0, 1)])]
    for _ in run(windows.cut(Batches(batches)), reading_of(None), [windows]):
        pass
    ended = windows.closed()
    assert [next(ended).number for _ in range(3)] == [0, 1, 2]


def test_batches_that_are_not_cut_are_refused() -> None:
    windows = Windows(S)
    with pytest.raises(ValueError, match="cut"):
        for _ in run(Batches([batch_of([at(0, 0, 0), at(1_500, 0, 1)])]), reading_of(None), [windows]):
            pass


@pytest.mark.parametrize("length_ns", [0, -5])
def test_a_window_has_a_length(length_ns: int) -> None:
    with pytest.raises(UsageError):
        Windows(length_ns)
