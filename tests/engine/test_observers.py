"""Law 7: any set of observers gives each the same as alone; and a batch may say no more than that time has passed."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.selection import select
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.report.packets.records import JsonLines
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.history import History
from nvscope.tracker.variables.hops import Hops
from nvscope.tracker.variables.moment import Moment
from nvscope.tracker.variables.samples import Samples
from nvscope.tracker.variables.values import Values
from nvscope.view.documents.history import at_document, change_row
from nvscope.view.documents.hops import hop_rows
from nvscope.view.documents.inference import inference_document, proposals
from nvscope.view.documents.variables import variables_document
from nvscope.view.fields.frame import DEFAULT_FIELDS
from nvscope.view.rows.defined import DefinedTelegrams
from nvscope.view.rows.frames import PacketRows
from tests.engine.traffic import LAYOUTS, batches_of, reading_of
from tests.laws import examples
from tests.packets import Batches, document_of


class Watched:
    """An observer, what it told of each batch, and what it knows in the end."""

    def __init__(self, observer: Observer, each: Callable[[], Any] = lambda: None, end: Any = None) -> None:
        self.observer, self.each, self.end = observer, each, end
        self.told: list[Any] = []

    def result(self) -> Any:
        return self.told, self.end() if self.end else None


def watched(name: str) -> Watched:
    if name == "state":
        state = TrackerState()
        return Watched(state, end=lambda: document_of(state))
    if name == "values":
        values = Values(LAYOUTS)
        with_values = TrackerState(values=values)
        return Watched(with_values, end=lambda: (document_of(with_values), variables_document(with_values, values)))
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


NAMES = ("state", "values", "history", "moment", "samples", "hops", "packets", "defined")


def told(names: Sequence[str], batches: Sequence[PacketBatch], reading: Reading) -> dict[str, Any]:
    """Return what observers of these names come to when all of them are told the same batches."""
    everybody = {name: watched(name) for name in names}
    for _ in run(Batches(batches), reading, [one.observer for one in everybody.values()]):
        for one in everybody.values():
            one.told.append(one.each())
    return {name: one.result() for name, one in everybody.items()}


@examples()
@given(
    st.integers(0, 10_000),
    st.lists(st.sampled_from(NAMES), min_size=1, unique=True),
    st.sampled_from([None, "nv.index == 7", "frame.number % 3 != 0"]),
)
def test_any_set_of_observers_gives_each_the_same_as_alone(
    seed: int, names: list[str], expression: str | None
) -> None:  # fmt: skip
    batches = batches_of(seed, random.Random(seed))
    together = told(names, batches, reading_of(expression))
    for name in names:
        assert told([name], batches, reading_of(expression))[name] == together[name], name


@examples()
@given(st.integers(0, 10_000), st.sampled_from(NAMES))
def test_time_that_has_not_passed_a_deadline_changes_nothing(seed: int, name: str) -> None:
    """Batches without packets, saying a time that is no later than that of the frames before them."""
    chance = random.Random(seed)
    batches = batches_of(seed, chance)
    with_pauses = []
    for batch in batches:
        with_pauses.append(batch)
        if chance.random() < 0.5:
            with_pauses.append(replace(batch[:0], until_ns=min(int(part.ts_ns.min()) for part in batches)))
    plain, paused = (told([name], each, reading_of(None))[name] for each in (batches, with_pauses))
    assert paused[1] == plain[1]
    assert [one for one in paused[0] if one] == [one for one in plain[0] if one]
