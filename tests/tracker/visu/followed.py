"""What the product makes of WebVisu in the frames of tests, as the rules written a second time tell it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from dissectors import address
from dissectors.batch import PacketBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.findings.judge import judge
from nvscope.protocols.table import accumulators_of, dissectors_of, judges_of
from nvscope.protocols.visu import VISU
from nvscope.tracker.readings.form import MOST_CHARACTERS
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.tracker.visu.on_demand import WRITES
from nvscope.view.documents.visu import visu_rows
from tests.oracle.frame import Frame
from tests.oracle.rules.visu import Visu
from tests.packets import Batches, batch_of

Rows = list[dict[str, Any]]
_NAMES = ("client_name", "server_name")


def reading() -> Reading:
    """Return a reading that looks for WebVisu alone."""
    return Reading(dissectors=dissectors_of([VISU]))


def followed(batches: Iterable[PacketBatch], others: Sequence[Observer] = ()) -> TrackerState:
    """Return the state of batches, of which others are told, too."""
    state = TrackerState(others=accumulators_of([VISU]))
    for _ in run(Batches(batches), reading(), [state, *others]):
        pass
    return state


def told(state: TrackerState) -> tuple[Rows, Rows]:
    """Return rows and findings of a state, as ``Visu`` does."""
    summary = summarize(state)
    rows = visu_rows(summary.others.get(VISU.name, ()))
    findings = [
        {
            "code": one.code, "client": None if one.node is None else summary.addresses[one.node],
            "variable": one.variable, "count": one.count, "first_ns": one.first_ns, "last_ns": one.last_ns,
            "frames": sorted(one.frames),
        }
        for one in judge(state, summary=summary, judges=judges_of([VISU], state))
        if one.code.startswith("NV8")
    ]  # fmt: skip
    findings.sort(key=lambda one: (one["code"], one["client"], one["variable"]))
    return [{name: value for name, value in row.items() if name not in _NAMES} for row in rows], findings


def writes_of(state: TrackerState) -> list[tuple[Any, ...]]:
    """Return the writes of a state: when, by whom, what, over what, and what came of it."""
    kept = summarize(state).others.get(WRITES, ())
    return [
        (
            one.time_ns, one.frame, address.text(*one.client), address.text(*one.server), one.port, one.variable,
            one.old, one.new, one.outcome.value, one.answer_frame or None, one.status or None,
        )
        for one in kept
    ]  # fmt: skip


def writes_by_the_rules(rules: Visu) -> list[tuple[Any, ...]]:
    """Return the same by the rules, longer values cut."""

    def cut(value: str | None) -> str | None:
        return value if value is None or len(value) <= MOST_CHARACTERS else f"{value[:MOST_CHARACTERS]}…"

    return [
        (
            one.time, one.frame, str(one.pair[0]), str(one.pair[1]), one.pair[2], one.variable, cut(one.old),
            cut(one.new), one.outcome, one.answer, one.status,
        )
        for one in rules.writes
    ]  # fmt: skip


def by_the_rules(frames: Sequence[Frame]) -> Visu:
    """Return what the rules say of frames."""
    rules = Visu()
    for frame in frames:
        rules.observe(frame)
    return rules


def seen(frames: Sequence[Frame]) -> tuple[Rows, Rows]:
    """Return rows and findings of frames that come at once."""
    return told(followed([batch_of(frames)]))
