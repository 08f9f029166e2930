"""What a row of the catalogue is: one kind of finding, and how bad it is.

The rows stand beside the judges that find them, in the file of their theme. Codes are stable and never used again for
something else: scripts, rules and baselines rely on them. The sentence with the figures of one capture is made where
the finding is made; in a row is what is true of all findings of its kind.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from enum import IntEnum

from nvscope.tracker.event_kinds import EventKind

MOST_APART = 8
"""So many hosts that do the same have a finding each; of more, as made-up ones are, one tells of all."""


class Severity(IntEnum):
    """How bad a finding is; the worse one is the greater."""

    NOTE = 1
    WARNING = 2
    ERROR = 3

    @property
    def word(self) -> str:
        """The severity as written in reports: ``error``, ``warning``, ``note``."""
        return self.name.lower()

    @classmethod
    def of(cls, word: str) -> Severity:
        """Return the severity that a report's word stands for; ValueError if there is none."""
        try:
            return cls[word.upper()]
        except KeyError:
            raise ValueError(f"no severity is called '{word}'") from None


@dataclass(frozen=True, slots=True)
class FindingKind:
    """One kind of finding, and what an engineer in front of the plant should know about it.

    ``causes`` are ordered from the most usual one, ``next_steps`` in the order in which to take them. ``from_event`` is
    the event of the tracker's log that is this finding, None where it takes more to judge it. ``of_capture`` marks what
    concerns the capture as a whole, ``of_security`` what is about who should not be there, ``protocol`` names the one
    that it is about where that has ports of its own. ``of_databases`` marks what audits of DataLogger databases find.
    What is not ``judged`` is found in no capture: it is one of these, or has its code, and no judge yet.
    """

    code: str
    name: str
    severity: Severity
    _: KW_ONLY
    meaning: str
    causes: tuple[str, ...]
    next_steps: tuple[str, ...]
    from_event: EventKind | None = None
    of_capture: bool = False
    of_security: bool = False
    protocol: str = ""
    of_databases: bool = False
    judged: bool = True
