"""Law 7: any set of observers gives each the same as alone; and a batch may say no more than that time has passed."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.selection import select
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.report.packets.records import JsonLines
from nvscope.tracker.evidence.event_columns import EventColumns
from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.history import History
from nvscope.tracker.variables.hops import Hops
from nvscope.tracker.variables.moment import Moment
from nvscope.tracker.variables.samples import Samples
from nvscope.tracker.variables.values import Values
from nvscope.tracker.windows import Window, Windows
from nvscope.view.documents.history import at_document, change_row
from nvscope.view.documents.hops import hop_rows
from nvscope.view.documents.inference import inference_document, proposals
from nvscope.view.documents.variables import variables_document
from nvscope.view.fields.frame import DEFAULT_FIELDS
from nvscope.view.rows.defined import DefinedTelegrams
from nvscope.view.rows.frames import PacketRows
from tests.engine.traffic import BOTH, CHANNELS, length_of, reading_of, traffic
from tests.laws import examples
from tests.packets import Batches, document_of
from tests.records import replace
from tests.tracker.counted_tables import named
from tests.tracker.event_rows import named as events_named

LAYOUTS = Layouts(BOTH)


class Watched:
    """An observer, what it told of each batch, and what it knows in the end."""

    def __init__(self, observer: Observer, each: Callable[[], Any] = lambda: None, end: Any = None) -> None:
        self.observer, self.each, self.end = observer, each, end
        self.told: list[Any] = []

    def result(self) -> Any:
        return self.told, self.end() if self.end else None


def watched(name: str, length_ns: int) -> Watched:
    if name == "state":
        state = TrackerState()
        return Watched(state, end=lambda: document_of(state))
    if name == "values":
        with_values = TrackerState(values=Values(LAYOUTS))
        return Watched(with_values, end=lambda: all_of(with_values))
    if name == "parted":
        parted = PartedState(3, values=lambda: Values(LAYOUTS))
        return Watched(parted, end=lambda: all_of(parted.join()))
    if name == "events":
        events = EventColumns()
        teller = TrackerState(listeners=[events])
        return Watched(teller, end=lambda: (document_of(teller), sorted(events_named(teller, events))))
    if name == "windows":
        windows = Windows(length_ns)
        return Watched(windows, lambda: [told_of(one) for one in windows.closed()], lambda: told_of(windows.open()))
    if name == "history":
        history = History(LAYOUTS, select(LAYOUTS, "*").names_in)
        return Watched(history, lambda: [change_row(entry) for entry in history.entries()])
    if name == "moment":
        moment = Moment(LAYOUTS, at=lambda start_ns: start_ns + 300_000_000)
        return Watched(moment, end=lambda: at_document(moment, LAYOUTS, moment.time_ns or 0))
    if name == "samples":
        samples = Samples()
        return Watched(samples, end=lambda: inference_document(proposals(samples), samples))
    if name == "hops":
        hops = Hops(LAYOUTS)
        return Watched(hops, end=lambda: hop_rows(hops, None))
    if name == "packets":
        rows, face = PacketRows(), JsonLines(DEFAULT_FIELDS)
        return Watched(rows, lambda: "".join(text for piece in rows.pieces() for text in face.render(piece)))
    defined = DefinedTelegrams(LAYOUTS, keys=[key for key, _ in LAYOUTS.lists()])
    return Watched(
        defined,
        lambda: defined.rows.frame.tolist(),  # noqa: PLW0108  # the rows are others after each batch
        lambda: (defined.left_out, defined.senders),
    )


def all_of(state: TrackerState) -> tuple[Any, Any]:
    assert state.values is not None
    return document_of(state), variables_document(state, state.values)


def told_of(window: Window | None) -> Any:
    return window and (window.number, window.start_ns, window.end_ns, window.complete, named(window.counted))


NAMES = (
    "state", "values", "parted", "events", "windows", "history", "moment", "samples", "hops", "packets", "defined",
)  # fmt: skip
FILTERS = (None, "nv.index == 7", "can.len == 8", "frame.number % 3 != 0")


def told(names: Sequence[str], batches: Sequence[PacketBatch], reading: Reading, length_ns: int) -> dict[str, Any]:
    """Return what observers of these names come to when all of them are told the same batches."""
    everybody = {name: watched(name, length_ns) for name in names}
    for _ in run(Batches(batches, CHANNELS), reading, [one.observer for one in everybody.values()]):
        for one in everybody.values():
            one.told.append(one.each())
    return {name: one.result() for name, one in everybody.items()}


def at_edges(batches: Sequence[PacketBatch], length_ns: int) -> list[PacketBatch]:
    """Return batches as windows need them: cut at their edges, where time passes."""
    windows, found = Windows(length_ns), []

    def noted() -> Iterator[PacketBatch]:
        for piece in windows.cut(Batches(batches, CHANNELS)):
            found.append(piece)
            yield piece

    for _ in run(Batches(noted(), CHANNELS), reading_of(None, BOTH), [windows]):
        pass
    return found


@pytest.mark.long
@examples(60)
@given(
    st.integers(0, 10_000),
    st.lists(st.sampled_from(NAMES), min_size=1, unique=True),
    st.sampled_from(FILTERS),
)
def test_any_set_of_observers_gives_each_the_same_as_alone(
    seed: int, names: list[str], expression: str | None
) -> None:  # fmt: skip
    batches = traffic(seed)
    length_ns = length_of(batches, random.Random(seed))
    if "windows" in names:
        batches = at_edges(batches, length_ns)
    together = told(names, batches, reading_of(expression, BOTH), length_ns)
    for name in names:
        assert told([name], batches, reading_of(expression, BOTH), length_ns)[name] == together[name], name


@pytest.mark.long
@examples(60)
@given(st.integers(0, 10_000), st.sampled_from(sorted({*NAMES} - {"windows"})), st.sampled_from(FILTERS))
def test_windows_beside_change_nothing(seed: int, name: str, expression: str | None) -> None:
    """Whoever looks at windows has batches cut at their edges, and is told there that time passes."""
    batches = traffic(seed)
    length_ns = length_of(batches, random.Random(seed))
    alone = told([name], batches, reading_of(expression, BOTH), length_ns)[name]
    beside = told([name, "windows"], at_edges(batches, length_ns), reading_of(expression, BOTH), length_ns)[name]
    assert flat(beside[0]) == flat(alone[0])
    assert beside[1] == alone[1]


def flat(told: Sequence[Any]) -> list[Any]:
    """Return what was told of all batches, whatever the batches."""
    return [part for one in told for part in (one.splitlines() if isinstance(one, str) else one or ())]


@examples(40)
@given(st.integers(0, 10_000), st.sampled_from(FILTERS))
def test_a_state_is_the_same_whoever_listens(seed: int, expression: str | None) -> None:
    together = told(["events", "state"], traffic(seed), reading_of(expression, BOTH), 1)
    told_too, _ = together["events"][1]
    assert told_too == together["state"][1]


@examples()
@given(st.integers(0, 10_000), st.sampled_from(NAMES))
def test_time_that_has_not_passed_a_deadline_changes_nothing(seed: int, name: str) -> None:
    """Batches without packets, saying a time that is no later than that of the frames before them."""
    chance = random.Random(seed)
    batches = traffic(seed)
    length_ns = length_of(batches, chance)
    if name == "windows":
        batches = at_edges(batches, length_ns)
    with_pauses = []
    for batch in batches:
        with_pauses.append(batch)
        if chance.random() < 0.5:
            with_pauses.append(replace(batch[:0], until_ns=min(int(part.ts_ns.min()) for part in batches if len(part))))
    plain, paused = (told([name], each, reading_of(None, BOTH), length_ns)[name] for each in (batches, with_pauses))
    assert paused[1] == plain[1]
    assert [one for one in paused[0] if one] == [one for one in plain[0] if one]
