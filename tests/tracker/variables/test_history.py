"""Changes of variables, values at a time, and samples, against what one telegram after the other says."""

from __future__ import annotations

import itertools
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.definition.packing import pack
from nvscope.definition.selection import select
from nvscope.definition.variables import String, Type
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.errors import UsageError
from nvscope.tracker.variables import samples as sampling
from nvscope.tracker.variables.history import History
from nvscope.tracker.variables.moment import Moment
from nvscope.tracker.variables.samples import Samples
from nvscope.view.documents.history import at_document, change_row, change_summary
from tests.definition.lists import INT, REAL, UDINT, VARIABLES, list_of, telegram
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of, observed, recorded
from tests.packets import cut as cut_into
from tests.tracker.variables.test_values import POINTER, START_NS, seen, telegrams_of


def shaken(sent: list[tuple[Frame, int, list[bytes]]], seed: int) -> list[tuple[Frame, int, list[bytes]]]:
    """Return frames with times that now and then step back."""
    choice = random.Random(seed)
    now, told = START_NS, []
    for frame, subindex, parts in sent:
        now += choice.choice([0, 1, 5, 5, -7]) * 1_000_000
        told.append((Frame(now, frame.link, frame.data, frame.original), subindex, parts))
    return told


def told_by(history: History, frames: list[Frame], cut: int) -> list[dict[str, Any]]:
    """Return the rows of a history that gets frames some at a time."""
    parts = Batches(cut_into(batch_of(frames), cut))
    return [change_row(entry) for _ in run(parts, Reading(), [history]) for entry in history.entries()]


@settings(deadline=None)
@given(VARIABLES, st.booleans(), st.booleans(), st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 40))
def test_a_history_is_that_of_one_telegram_after_the_other(
    types: list[Type], packed: bool, every: bool, seed: int, count: int, cut: int
) -> None:
    definition = list_of(types, pack=packed)
    sent = shaken(telegrams_of(definition, seed, count), seed)
    layouts = Layouts(Definition((definition,)))
    history = History(layouts, select(layouts, "*").names_in, every=every)
    rows = told_by(history, [frame for frame, _, _ in sent], cut)

    expected = []
    before: dict[int, list[bytes]] = {}
    changes: dict[tuple[int, int], list[int]] = {}
    for number, (frame, subindex, parts) in enumerate(sent):
        elements = pack(definition)[subindex].elements
        old = before.get(subindex)
        for place, element in enumerate(elements):
            changed = old is not None and seen(element.type, old[place]) != seen(element.type, parts[place])
            if changed:
                changes.setdefault((subindex, place), []).append(frame.ts_ns)
            if changed or old is None or every:
                expected.append((number + 1, str(frame.ts_ns), element.name, changed, old is None))
        before[subindex] = parts
    assert [
        (row["frame"], row["time_ns"], row["name"], row["changed"], row["old_text"] is None) for row in rows
    ] == expected

    for row in change_summary(history):
        elements = pack(definition)[row["subindex"]].elements
        place = [element.name for element in elements].index(row["name"])
        times = changes.get((row["subindex"], place), [])
        between = [later - sooner for sooner, later in itertools.pairwise(times) if later >= sooner]
        assert row["changes"] == len(times)
        assert (row["shortest_ns"], row["longest_ns"]) == (min(between, default=None), max(between, default=None))


@settings(deadline=None)
@given(VARIABLES, st.booleans(), st.lists(st.integers(0, 10_000), min_size=2, max_size=4), st.integers(1, 40))
def test_a_history_of_recordings_is_those_of_each_one_behind_the_other(
    types: list[Type], every: bool, seeds: list[int], cut: int
) -> None:
    definition = list_of(types, pack=False)
    layouts = Layouts(Definition((definition,)))
    recordings = [
        cut_into(batch_of([frame for frame, _, _ in shaken(telegrams_of(definition, seed, 20), seed)]), cut)
        for seed in seeds
    ]

    def history_of(batches: list[PacketBatch]) -> tuple[list[dict[str, Any]], dict[tuple[str, int], dict[str, Any]]]:
        history = History(layouts, select(layouts, "*").names_in, every=every)
        parts = Batches(batches)
        rows = [change_row(entry) for _ in run(parts, Reading(), [history]) for entry in history.entries()]
        return rows, {(row["name"], row["subindex"]): row for row in change_summary(history)}

    rows, summary = history_of(recorded(*recordings))
    alone = [history_of(batches) for batches in recordings]
    expected = []
    for number, (own, _) in enumerate(alone):
        before = sum(len(batch) for batches in recordings[:number] for batch in batches)
        expected += [{**row, "frame": row["frame"] + before} for row in own]
    assert rows == expected
    for place, row in summary.items():
        known = [own[place] for _, own in alone if place in own]
        for name, join in (("telegrams", sum), ("changes", sum), ("shortest_ns", min), ("longest_ns", max)):
            figures = [one[name] for one in known if one[name] is not None]
            assert row[name] == (join(figures) if figures else None)


@settings(deadline=None)
@given(VARIABLES, st.booleans(), st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 40), st.integers(-3, 60))
def test_a_moment_is_the_last_frame_that_is_not_later(
    types: list[Type], packed: bool, seed: int, count: int, cut: int, at_ms: int
) -> None:
    definition = list_of(types, pack=packed)
    sent = shaken(telegrams_of(definition, seed, count), seed)
    layouts = Layouts(Definition((definition,)))
    time_ns = START_NS + at_ms * 1_000_000
    frames = [frame for frame, _, _ in sent]
    moment, whole = Moment(layouts, at=lambda _: time_ns), batch_of(frames)
    observed(moment, cut_into(whole, cut))

    counted = [number + 1 for number, frame in enumerate(frames) if frame.ts_ns <= time_ns]
    until = max(counted, default=0)
    by_frame = Moment(layouts, frame=until)
    observed(by_frame, [whole])
    assert moment.last_frame == by_frame.last_frame == until
    rows = at_document(moment, layouts, time_ns)["variables"]
    assert rows == at_document(by_frame, layouts, time_ns)["variables"]
    last = {subindex: (number + 1, parts) for number, (_, subindex, parts) in enumerate(sent[:until])}
    for row in rows:
        assert row["frame"] == (last[row["subindex"]][0] if row["subindex"] in last else None)
        if row["frame"] is not None:
            assert row["age_ns"] == time_ns - frames[row["frame"] - 1].ts_ns


def test_a_change_has_its_old_value_and_strings_end_at_their_nul() -> None:
    layouts = Layouts(Definition((list_of([INT, REAL]),)))
    frames = [
        telegram(bytes([number, 0, 0, 0, 0x48, 0x41]), 2, subindex=0, counter=number, ts_ns=START_NS + number)
        for number in (1, 2, 2)
    ]
    history = History(layouts, select(layouts, "V0").names_in)
    rows = told_by(history, frames, 2)
    assert [(row["frame"], row["old"], row["new"]) for row in rows] == [(1, None, 1), (2, 1, 2)]


@given(st.integers(1, 20))
def test_where_a_program_is_changed_a_history_goes_on_with_the_definition_that_fits(cut: int) -> None:
    layouts = Layouts(Definition((list_of([INT, INT]), list_of([INT, UDINT]))))
    sent = [(4, 5), (4, 6), (6, 7), (6, 7), (6, 8), (7, 9), (4, 6), (4, 9)]
    frames = [
        telegram(bytes([value, 0] * 4)[:size], 2, subindex=0, counter=number, ts_ns=START_NS + number)
        for number, (size, value) in enumerate(sent)
    ]
    history = History(layouts, select(layouts, "v0").names_in)
    rows = told_by(history, frames, cut)
    assert [(row["frame"], row["old"], row["new"]) for row in rows] == [
        (1, None, 5), (2, 5, 6), (3, None, 7), (5, 7, 8), (8, 6, 9),
    ]  # fmt: skip
    assert [(row["telegrams"], row["changes"]) for row in change_summary(history)] == [(4, 2), (3, 1)]
    assert history.unfitting == 1

    moment = Moment(layouts, frame=5)
    observed(moment, [batch_of(frames)])
    rows = at_document(moment, layouts, START_NS)["variables"]
    assert [(row["name"], row["type"], row["value"]) for row in rows] == [
        ("v0", "INT", 8), ("v1", "UDINT", 8 + (8 << 16)),
    ]  # fmt: skip


def test_the_telegrams_that_were_not_sent_are_those_of_the_definition_that_fits() -> None:
    one, two = list_of([INT, INT]), list_of([INT, UDINT, String(254), INT])
    layouts = Layouts(Definition((one, two)))
    frames = [
        telegram(bytes(size), items, subindex=subindex, counter=number, ts_ns=START_NS + number)
        for number, (size, items, subindex) in enumerate([(4, 2, 0), (6, 2, 0), (2, 1, 2)])
    ]
    shown = []
    for frame in (1, 2, 3):
        moment = Moment(layouts, frame=frame)
        observed(moment, [batch_of(frames)])
        rows = at_document(moment, layouts, START_NS)["variables"]
        shown.append([(row["subindex"], row["type"], row["missing"]) for row in rows])
    begin = [(0, "INT", None), (0, "UDINT", None), (1, "STRING(254)", "later")]
    assert shown == [
        [(0, "INT", None), (0, "INT", None)],
        [*begin, (2, "INT", "later")],
        [*begin, (2, "INT", None)],
    ]


def test_what_is_known_of_a_list_with_an_element_of_unknown_size() -> None:
    layouts = Layouts(Definition((list_of([INT, POINTER, INT]),)))
    frames = [
        telegram(bytes([number] * size), 3, subindex=subindex, counter=number, ts_ns=START_NS + number)
        for number, (size, subindex) in enumerate([(5, 0), (3, 1), (5, 0), (1, 0)])
    ]
    for name, told in (
        ("v0", [(1, 0, "v0"), (3, 0, "v0")]),
        ("v1", [(1, 0, "v1 …"), (2, 1, "v1 …"), (3, 0, "v1 …")]),
        ("v1...", [(1, 0, "v1 …"), (2, 1, "v1 …"), (3, 0, "v1 …")]),
    ):
        wanted = select(layouts, name)
        assert wanted.repeated == (name != "v0")
        rows = told_by(History(layouts, wanted.names_in), frames, 2)
        assert [(row["frame"], row["subindex"], row["name"]) for row in rows] == told
    with pytest.raises(UsageError, match="nobody knows where v2 is, behind v1 : POINTER"):
        select(layouts, "v2")
    every = select(layouts, "v*")
    assert (every.names(), [name for name, _ in every.unplaced]) == ({"v0", "v1 …"}, ["v2"])

    moment = Moment(layouts, frame=0)
    observed(moment, [batch_of(frames)])
    rows = at_document(moment, layouts, START_NS)["variables"]
    assert [(row["name"], row["missing"]) for row in rows] == [("v0", "later"), ("v1 …", "later")]


@examples(25)
@given(st.integers(1, 400), st.integers(1, 400), st.integers(0, 1000))
def test_a_sample_does_not_depend_on_how_a_capture_is_cut(count: int, cut: int, seed: int) -> None:
    choice = random.Random(seed)
    frames = [
        telegram(
            choice.randbytes(choice.choice([5, 5, 5, 6])), 2, subindex=choice.randrange(2), counter=0,
            ts_ns=START_NS + number,
        )
        for number in range(count)
    ]  # fmt: skip
    whole = batch_of(frames)
    usual_rows, sampling.MOST_ROWS = sampling.MOST_ROWS, 16
    try:
        found = []
        for step in (cut, count):
            found.append(observed(Samples(), cut_into(whole, step)).usual())
        for (one, others), (two, others_too) in zip(*found, strict=True):
            assert (one.stream.subindex, one.telegrams, one.every, others) == (
                two.stream.subindex, two.telegrams, two.every, others_too,
            )  # fmt: skip
            assert np.array_equal(one.data, two.data)
            assert np.array_equal(one.first_ns, two.first_ns)
            assert len(one.data) <= 32
    finally:
        sampling.MOST_ROWS = usual_rows
