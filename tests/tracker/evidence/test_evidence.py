"""Every event finds its theme, and no theme takes the room of another."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.events import EventBatch
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventColumns
from nvscope.tracker.evidence.evidence import OTHERS, THEMES, Evidence
from nvscope.tracker.parameter.events import USUAL, ParameterEvent
from nvscope.tracker.state import TrackerState
from tests.laws import examples
from tests.packets import Batches, cut
from tests.tracker.test_events import traffic


def test_each_kind_has_one_theme() -> None:
    kinds = [kind for theme in THEMES.values() for kind in theme]
    assert sorted([*kinds, EventKind.ACKNOWLEDGED]) == sorted(EventKind)
    assert OTHERS not in THEMES


class Usual:
    """Counts what went well between nodes that ask for parameters: that explains nothing, and is not kept."""

    def __init__(self) -> None:
        self.count = 0

    def hear(self, events: EventBatch) -> None:
        if isinstance(events.kind, ParameterEvent) and events.kind in USUAL:
            self.count += len(events)


@given(st.integers(0, 10_000), st.integers(1, 40))
@examples(40)
def test_nothing_is_lost_between_the_themes(seed: int, most: int) -> None:
    every, evidence, usual = EventColumns(), Evidence(most), Usual()
    for _ in run(Batches(cut(traffic(seed), 37)), Reading(), [TrackerState(listeners=(every, evidence, usual))]):
        pass
    evidence.settle()
    told = Counter(every.table().kind.tolist())
    acknowledged = told[EventKind.ACKNOWLEDGED]
    assert int(evidence.answers.columns.column("count").sum()) == acknowledged
    for theme, kinds in THEMES.items():
        columns, expected = evidence.columns[theme], sum(told[kind] for kind in kinds)
        assert columns.count == min(expected, most)
        assert columns.count + columns.left_out == expected
    kept = sum(columns.count for columns in evidence.columns.values())
    assert kept + acknowledged + evidence.left_out + usual.count == every.count
