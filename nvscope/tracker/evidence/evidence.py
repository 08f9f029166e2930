"""Evidence: all events by what they are about, each theme with a limit of its own.

Thousands of unusual intervals must not leave without room the one restart that explains them.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from nvscope.engine.events import EventBatch
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import MOST_EVENTS, EventColumns
from nvscope.tracker.evidence.reader_answers import ReaderAnswers
from nvscope.tracker.parameter.events import USUAL, ParameterEvent

THEMES: Mapping[str, tuple[EventKind, ...]] = MappingProxyType(
    {
        "headers": (
            EventKind.SHORT, EventKind.LENGTH_MISMATCH, EventKind.UNKNOWN_SERVICE, EventKind.RESERVED_FLAGS,
            EventKind.LENGTH_BYTE_SWAPPED, EventKind.ASCII_IDENTITY, EventKind.TRUNCATED,
        ),
        "waits": (
            EventKind.NO_ACKNOWLEDGEMENT, EventKind.NEGATIVE_ACKNOWLEDGEMENT, EventKind.UNEXPECTED_ACKNOWLEDGEMENT,
            EventKind.BOOT_UP_UNANSWERED, EventKind.SEND_REJECTED,
        ),
        "requests": (EventKind.BOOT_UP_ANSWERED,),
        "shapes": (
            EventKind.SHAPE_CHANGED, EventKind.CHECKSUM_CHANGED, EventKind.FLAGS_INCONSISTENT,
            EventKind.PDO_LENGTH_CHANGED,
        ),
        "steps": (EventKind.GAP, EventKind.OVERTAKEN, EventKind.RESTART, EventKind.DUPLICATE),
        "intervals": (EventKind.UNUSUAL_INTERVAL,),
        "cycles": (EventKind.TORN_CYCLE,),
        "clock": (EventKind.STEP_BACK,),
        "buses": (
            EventKind.UNREADABLE_FRAME, EventKind.ERROR_FRAME, EventKind.BUS_OFF, EventKind.BUS_BACK,
            EventKind.NODE_STATE, EventKind.EMERGENCY, EventKind.NODE_COMMAND,
        ),
    }
)  # fmt: skip
"""What each theme keeps; what is in none of them, ``ReaderAnswers`` counts."""

PARAMETERS = "parameters"
"""The theme of what went wrong with requests of the Parameter Manager."""

OTHERS = "others"
"""The theme of what protocols tell of their own."""

_THEME_OF = {kind: theme for theme, kinds in THEMES.items() for kind in kinds}


class Evidence:
    """A listener to everything; ``columns`` are the events by theme, ``answers`` the acknowledgements by reader."""

    def __init__(self, most: int = MOST_EVENTS) -> None:
        self.columns = {theme: EventColumns(most) for theme in (*THEMES, PARAMETERS, OTHERS)}
        self.answers = ReaderAnswers()

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind."""
        if isinstance(events.kind, ParameterEvent):
            # What was answered as it should be explains nothing.
            if events.kind not in USUAL:
                self.columns[PARAMETERS].hear(events)
        elif not isinstance(events.kind, EventKind):
            self.columns[OTHERS].hear(events)
        elif events.kind is EventKind.ACKNOWLEDGED:
            self.answers.hear(events)
        else:
            self.columns[_THEME_OF[events.kind]].hear(events)

    def settle(self) -> None:
        """Make what was told visible: before somebody looks at it."""
        self.answers.settle()

    @property
    def left_out(self) -> int:
        """How many events there was no room for."""
        return self.answers.left_out + sum(columns.left_out for columns in self.columns.values())
