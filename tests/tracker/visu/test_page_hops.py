"""What pages show of variables that lists carry: which belong together, how late, and how long they differ."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.engine.run import run
from nvscope.tracker.readings.read_hops import ReadHops
from nvscope.tracker.visu.page_likeness import PageLikeness
from nvscope.view.documents.read_hops import read_hop_rows
from tests.laws import examples
from tests.oracle.builders import MILLISECOND
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of, cut, recorded
from tests.tracker.visu.followed import reading
from tests.tracker.visu.shown_and_carried import GVL, plant

NAMED = [".CurrentPassword", ".ncount", ".sText", "bodd", "plant.rLevel", "TRUN"]


@pytest.fixture(scope="module")
def layouts(tmp_path_factory: pytest.TempPathFactory) -> Layouts:
    file = tmp_path_factory.mktemp("definition") / "plant.gvl"
    file.write_text(GVL)
    return Layouts(load_definitions([str(file)]))


def compared(
    batches: Iterable[PacketBatch], layouts: Layouts, end_ns: int | None = None
) -> list[dict[str, Any]]:  # fmt: skip
    hops = ReadHops(layouts, PageLikeness())
    for _ in run(Batches(batches), reading(), [hops]):
        pass
    return read_hop_rows(hops, end_ns)


def rows_of(frames: Sequence[Frame], layouts: Layouts) -> list[dict[str, Any]]:
    return compared([batch_of(frames)], layouts)


def test_a_variable_of_a_page_is_that_of_a_list_by_its_name(layouts: Layouts) -> None:
    rows = rows_of(plant(range(0, 1000, 10), range(25, 1000, 50)), layouts)
    assert [row["variable"] for row in rows] == NAMED
    assert {(row["from"]["list"], row["to"]["list"]) for row in rows} == {("udp/1202/9", "visu/10.0.0.5")}


def test_a_page_follows_the_list_as_late_as_it_asks(layouts: Layouts) -> None:
    # The list changes each 50 ms, the page asks 25 ms later, and is answered 1 ms after that.
    for row in rows_of(plant(range(0, 1000, 10), range(25, 1000, 50)), layouts):
        assert row["changes"] == row["followed"] == 19
        assert abs(row["delay_ns"]["max"] - 26 * MILLISECOND) < MILLISECOND


def test_values_with_six_digits_behind_the_point_are_those_of_the_list(layouts: Layouts) -> None:
    rows = rows_of(plant(range(0, 1000, 10), [996]), layouts)
    assert {row["variable"]: row["equal"] for row in rows} == dict.fromkeys(NAMED, True)


def test_passwords_are_hidden_at_both_ends(layouts: Layouts) -> None:
    (row,) = [one for one in rows_of(plant([10], [500]), layouts) if one["hidden"]]
    assert row["variable"] == ".CurrentPassword"
    assert [(row[end]["value"], row[end]["text"]) for end in ("from", "to")] == [(None, "(hidden)")] * 2


def test_what_a_list_sent_once_before_the_page_asked_counts(layouts: Layouts) -> None:
    (row,) = [one for one in rows_of(plant([10], [500, 900]), layouts) if one["variable"] == ".ncount"]
    assert (row["from"]["telegrams"] + row["to"]["telegrams"], row["equal"], row["differed_ns"]) == (3, True, 0)


def test_what_a_page_shows_of_before_differs_for_so_long(layouts: Layouts) -> None:
    frames = plant(range(0, 1000, 10), range(1, 1000, 10), late=20)
    (row,) = [one for one in rows_of(frames, layouts) if one["variable"] == ".ncount"]
    assert 0.3 < row["differed_ns"] / row["observed_ns"] < 0.6


@pytest.mark.parametrize("packets", [1, 7, 1000])
@pytest.mark.parametrize(("again", "known_ms", "equal"), [((), 525, False), (range(905, 1000, 50), 609, True)])
def test_what_a_page_shows_counts_until_it_should_have_asked_again(
    layouts: Layouts, packets: int, again: Sequence[int], known_ms: int, equal: bool
) -> None:
    # It asks each 50 ms, and has the last reply at 406 ms: that counts for 125 ms, and the list went on.
    frames = plant(range(0, 1000, 10), [*range(5, 430, 50), *again])
    rows = compared(cut(batch_of(frames), packets), layouts, end_ns=frames[-1].ts_ns)
    (row,) = [one for one in rows if one["variable"] == ".ncount"]
    assert abs(row["observed_ns"] - known_ms * MILLISECOND) < 10 * MILLISECOND
    assert row["differed_ns"] / row["observed_ns"] < 0.3
    assert row["equal"] is equal


@examples(25)
@given(
    st.lists(st.integers(0, 90), max_size=40, unique=True), st.lists(st.integers(0, 90), max_size=12, unique=True),
    st.integers(1, 30),
)  # fmt: skip
def test_any_cut_gives_the_same(layouts: Layouts, sent: list[int], polls: list[int], packets: int) -> None:
    frames = plant([10 * at for at in sorted(sent)], [10 * at + 3 for at in sorted(polls)])
    assert compared(cut(batch_of(frames), packets), layouts) == rows_of(frames, layouts)


def test_behind_a_time_in_which_nobody_listened_it_begins_anew(layouts: Layouts) -> None:
    first = plant(range(0, 300, 10), range(25, 300, 50))
    later = [frame._replace(ts_ns=frame.ts_ns + 10**12) for frame in first]
    both = compared(recorded([batch_of(first)], [batch_of(later)]), layouts)
    assert [row["changes"] for row in both] == [2 * row["changes"] for row in rows_of(first, layouts)]
    assert all(row["observed_ns"] < 10**10 for row in both)
