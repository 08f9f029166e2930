"""What is found where some definitions of a list and some telegrams meet."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.position import Position
from nvscope.definition.variables import String, Type
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
from tests.definition.lists import BOOL, INT, LREAL, REAL, list_of, telegram
from tests.packets import batch_of, observed
from tests.records import replace

START_NS = 1_700_000_000_000_000_000
STRING = String(9)
SENT = [BOOL, INT, REAL, LREAL]  # 15 bytes in 4 items


Sent = Sequence[tuple[int, bytes, int]]
"""SubIndex, data and Items of telegrams that are sent every 50 ms."""


def all_findings(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> list[Finding]:
    definition = Definition(lists)
    state = TrackerState(values=Values(Layouts(definition)))
    frames = [
        telegram(data, items, subindex=subindex, counter=number, ts_ns=START_NS + number * 50_000_000)
        for number, (subindex, data, items) in enumerate(sent)
    ]
    observed(state, [batch_of(frames)])
    return judge(state, definition=definition)


def judged(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> dict[str, list[tuple[str, int]]]:
    """Return messages and counts by code, without those that a change of shape brings."""
    found: dict[str, list[tuple[str, int]]] = {}
    for finding in all_findings(*lists, sent=sent):
        if finding.code in {"NV405", "NV406", "NV407"}:
            found.setdefault(finding.code, []).append((finding.message, finding.count))
    return found


def findings(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> dict[str, tuple[str, int]]:
    """Return message and count by code."""
    return {finding.code: (finding.message, finding.count) for finding in all_findings(*lists, sent=sent)}


def mismatch(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> Finding:
    """Return the only NV405 there is."""
    (found,) = (finding for finding in all_findings(*lists, sent=sent) if finding.code == "NV405")
    return found


def named(file: str, types: Sequence[Type], **settings: bool) -> ListDefinition:
    entry = list_of(types, **settings)
    return replace(entry, position=Position(file, 3, 1))
