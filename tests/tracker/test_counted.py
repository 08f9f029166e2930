"""What was counted between two moments: subtracted exactly, and joined to the whole again."""

from __future__ import annotations

import random
from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.run import run
from nvscope.tracker.counted import Counted
from nvscope.tracker.figures import Joins, Of
from nvscope.tracker.joins import TABLES, tables_of
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from tests.engine.traffic import CHANNELS, reading_of, traffic, with_holes
from tests.laws import examples
from tests.packets import Batches, batch_of, cut, document_of, tracked
from tests.tracker.can.bus_traffic import bus_traffic
from tests.tracker.can.test_state import batch as can_batch
from tests.tracker.counted_tables import all_figures, tables
from tests.tracker.test_figures import PRESS, at

EXTREME = {Joins.LEAST, Joins.MAX}


def moments(batches: Sequence[PacketBatch]) -> tuple[TrackerState, list[Counted]]:
    """Return the state in the end, and what was counted before each batch and in the end."""
    state, found = TrackerState(), []
    for _ in run(Batches(batches, CHANNELS), reading_of(None), [state]):
        found.append(Counted.of(state))
    return state, found


def columns(state: TrackerState) -> list[Any]:
    return [(name, table.column(name).tolist()) for table, joins in tables_of(state) for name in joins]


def without_extremes(found: dict[str, Any]) -> dict[str, Any]:
    gone = {
        f"{path}.{name}"
        for path, joins in TABLES.items()
        for name, join in joins.items()
        if join.name in ("LEAST", "MOST")
    }
    return {path: value for path, value in found.items() if path not in gone | {"extremes"}}


@given(st.integers(0, 10_000))
@examples(60)
def test_windows_joined_are_the_whole(seed: int) -> None:
    state, found = moments(with_holes(traffic(seed), random.Random(seed)))
    nothing = Counted.of(TrackerState())
    windows = [later - earlier for earlier, later in zip([nothing, *found], found, strict=False)]
    whole, joined = Counted.of(state), reduce(add, windows)
    assert without_extremes(tables(joined)) == without_extremes(tables(whole))
    for window, later in zip(windows, found, strict=True):
        assert window.summary().scopes == later.summary().scopes
    cut_elsewhere = (found[0] - nothing) + (whole - found[0])
    assert without_extremes(tables(cut_elsewhere)) == without_extremes(tables(whole))


@given(st.integers(0, 10_000))
@examples(20)
def test_a_look_changes_nothing_and_stays_as_it_is(seed: int) -> None:
    batches = traffic(seed)
    state, kept, shown = TrackerState(), [], []
    for _ in run(Batches(batches, CHANNELS), reading_of(None), [state]):
        before = columns(state)
        kept.append(Counted.of(state))
        shown.append((tables(kept[-1]), all_figures(kept[-1].summary())))
        _ = (kept[-1] - kept[0]).summary()
        assert columns(state) == before
    assert [(tables(one), all_figures(one.summary())) for one in kept] == shown
    assert document_of(state) == document_of(looked_at_never(batches))
    assert all_figures(Counted.of(state).summary()) == all_figures(summarize(state))


def looked_at_never(batches: Sequence[PacketBatch]) -> TrackerState:
    state = TrackerState()
    for _ in run(Batches(batches, CHANNELS), reading_of(None), [state]):
        pass
    return state


@given(st.integers(0, 10_000))
@examples(40)
def test_extremes_of_a_difference_are_unknown_and_the_rest_is_not(seed: int) -> None:
    _, found = moments(traffic(seed))
    window = found[-1] - found[0]
    for who, figures in all_figures(window.summary(), *EXTREME).items():
        assert set(figures.values()) <= {None}, who


def test_a_bit_rate_that_is_found_later_is_not_known_before() -> None:
    state, found = moments(cut(can_batch(bus_traffic(500_000, 0.8, 600)), 30))
    rates = [one.summary().can.buses[0].bit_rate for one in found]
    assert rates[0] is None
    assert rates[-1] is not None
    assert (found[-1] - found[-2]).summary().can.buses[0].bit_rate == rates[-1]
    assert summarize(state).can.buses[0].bit_rate == rates[-1]


def test_every_column_of_a_table_says_how_it_joins() -> None:
    for path, (table, joins) in zip(TABLES, tables_of(TrackerState()), strict=True):
        assert isinstance(table, KeyedColumns)
        assert set(joins) == set(table.COLUMNS), path


def test_only_moments_of_one_state_can_be_subtracted_or_joined() -> None:
    one, other = (Counted.of(tracked([batch_of([at(0, 0, 1, source)])])) for source in (PRESS, "10.0.0.9"))
    for earlier, later in ((one, other), (other, one)):
        with pytest.raises(ValueError, match="same state"):
            _ = later - earlier
        with pytest.raises(ValueError, match="same state"):
            _ = earlier + later
    more = Counted.of(tracked([batch_of([at(0, 0, 1), at(1, 1, 1)])]))
    with pytest.raises(ValueError, match="same state"):
        _ = one - more


def test_a_state_that_has_counted_less_or_began_at_another_time_is_no_later_one() -> None:
    few, many, begun_later = (
        Counted.of(tracked([batch_of([at(number, 0, number) for number in range(*numbers)])]))
        for numbers in ((3,), (10,), (1, 12))
    )
    assert (many - few).summary().lists[0].diagnosis.nSendCount == 7
    for earlier, later in ((many, few), (few, begun_later)):
        with pytest.raises(ValueError, match="same state"):
            _ = later - earlier


# --- worked out by hand


def window_of(count: int) -> tuple[Counted, Counted]:
    """Return what was counted in the first telegrams of a stream, and in the rest.

    100 ms apart, five counters lost behind the 20th, then 300 ms apart from the 60th on.
    """
    frames, time_ms = [], 0
    for place in range(100):
        frames.append(at(time_ms, 0, place + (5 if place > 20 else 0)))
        time_ms += 100 if place < 60 else 300
    state, found = moments(cut(batch_of(frames), count))
    return found[0], Counted.of(state) - found[0]


def figures(counted: Counted) -> dict[str, Any]:
    (figures,) = (row for who, row in all_figures(counted.summary()).items() if who[0] is Of.LIST)
    return figures


def test_a_window_has_its_own_percentiles_loss_and_rate() -> None:
    first, rest = window_of(70)
    assert [figures(first)[name] for name in ("telegrams", "lost", "gaps", "interval_count")] == [70, 5, 1, 69]
    told = figures(rest)
    assert [told[name] for name in ("telegrams", "lost", "gaps", "interval_count", "nSendCount")] == [30, 0, 0, 30, 30]
    assert told["interval_mean"] == 300_000_000
    # Some of them were events before anything was usual, the others are within a bucket of 0.8 %.
    assert told["interval_p50"] == pytest.approx(300_000_000, rel=0.008)
    assert told["interval_p50"] == told["interval_p99"]
    # From the 70th telegram to the last: 30 in 9 s.
    assert told["rate"] == pytest.approx(30 / 9)
    assert (told["interval_min"], told["interval_max"], told["longest_gap"]) == (None, None, None)
    assert figures(first)["longest_gap"] == 5


def test_what_was_not_there_in_a_window_has_no_time_and_no_error() -> None:
    frames = [at(ms, 0, counter) for counter, ms in enumerate([0, 100, 200])]
    frames += [at(5_000, 0, 1, "10.0.0.2", 9)]
    _, found = moments(cut(batch_of(frames), 3))
    summary = (found[1] - found[0]).summary()
    silent = next(entry for entry in summary.lists if entry.key.identifier == 7)
    assert (silent.diagnosis.nSendCount, silent.diagnosis.tLastSend) == (0, None)
    assert (silent.diagnosis.sLastError, silent.nodes) == ("NOERROR", ())
    assert [stream.telegrams for stream in silent.streams] == [0]
    assert found[1].summary().lists[0].diagnosis.tLastSend is not None


def test_whether_counters_are_believed_is_told_by_all_that_was_seen() -> None:
    """Counters that jump at random: the last window alone has one gap only, and a steady window before any."""
    steady = [at(100 * place, 0, place) for place in range(40)]
    jumping = [at(4_000 + 100 * place, 0, 1_000 * place % 30_000) for place in range(1, 60)]
    state, found = moments(cut(batch_of(steady + jumping), 40))
    assert summarize(state).lists[0].counters["lost"] is None
    first, last = (one.summary().lists[0].counters for one in (found[0], found[-1] - found[1]))
    assert first["lost"] == 0
    assert last["lost"] is None
    assert last["lost_claimed"]
