"""Changes: what telegrams of a list looked like before and after, where that held."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from nvscope.causes.case import Case
from nvscope.causes.words import moment
from nvscope.findings.facts import AnyList
from nvscope.tracker.evidence.look_runs import LookRun
from nvscope.units import count, count_of

HOLDS = 10
"""A change is one if so many telegrams in a row show it, or all that come up to the end."""


class Change(NamedTuple):
    """A stream whose telegrams look otherwise from a time on; ``back_ns`` is when they did again as before, if ever."""

    node: int
    subindex: int
    before: LookRun
    after: LookRun
    back_ns: int | None


def changes_of(case: Case, entry: AnyList) -> list[Change]:
    """Return the first change that held of each stream of a list, by time."""
    found = [change for stream in entry.streams for change in _of_stream(case, stream)]
    return sorted(found, key=lambda one: (one.after.first_ns, one.subindex))


def _of_stream(case: Case, stream: object) -> Iterator[Change]:
    number, node, subindex = (getattr(stream, name) for name in ("stream", "node", "subindex"))
    runs = case.witness.looks.runs_of(number)
    # What comes once or twice between is no change: before is what held last.
    held = runs[0] if runs else None
    for place, run in enumerate(runs[1:], 1):
        assert held is not None
        new = run.look not in {one.look for one in runs[:place]}
        to_the_end = place == len(runs) - 1 and held.telegrams >= HOLDS and new
        if run.look == held.look or not (run.telegrams >= HOLDS or to_the_end):
            continue
        look = held.look
        back_ns = next((one.first_ns for one in runs[place + 1 :] if one.look == look), None)
        yield Change(node, subindex, held, run, back_ns)
        return


def change_in_words(case: Case, entry: AnyList, change: Change) -> list[str]:
    """Return what of the telegrams changed, and which side the definition that is known is of."""
    before, after = change.before, change.after
    time, told = moment(case, after.first_ns), []
    if before.look[:2] != after.look[:2]:
        which = f"SubIndex {change.subindex}: " if len(entry.streams) > 1 else ""
        told.append(f"{which}{_shape(before)} until {time}, {_shape(after)} since")
    if before.checksum != after.checksum:
        told.append(f"{_checksum(before)} until {time}, {_checksum(after)} since")
    told.append(f"it held for {count_of(after.telegrams, 'telegram')}, {count(before.telegrams)} came before")
    if age := _age(case, entry, change):
        told.append(age)
    return told


def _shape(run: LookRun) -> str:
    return f"{count_of(run.items, 'item')} in {count_of(run.length, 'byte')}"


def _checksum(run: LookRun) -> str:
    return "no checksum" if run.checksum is None else f"checksum 16#{run.checksum:02X}"


def _age(case: Case, entry: AnyList, change: Change) -> str:
    """Return whether the definition that is known is of before the change, or of after it; '' where nobody knows."""
    values = case.facts.state.values
    shapes = {
        (layouts[change.subindex].items, layouts[change.subindex].length)
        for layouts in (values.layouts.candidates_of(entry.key) if values else ()) if change.subindex < len(layouts)
    }  # fmt: skip
    old, new = change.before.look[:2] in shapes, change.after.look[:2] in shapes
    if old == new:
        return ""
    time = moment(case, change.after.first_ns)
    if old:
        return f"the definition is the older side: it fits what came until {time}"
    return f"the definition is the newer side: it fits what comes since {time}"
