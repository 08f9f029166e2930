"""What a row of the catalogue of causes is: one kind of event or condition in a plant that breaks rules.

The rows stand beside the judges that find them, in the file of their family; their names are stable. What happened in
one capture is said where the cause is made; in a row is what is true of all causes of its kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from msgspec import Struct

from nvscope.findings.kind import Severity

Found = TypeVar("Found")

MOST_APART = 8
"""So many things of one kind that are explained by one host have a cause each; of more, one tells of all."""


def many_as_one(found: Sequence[Found]) -> Sequence[Sequence[Found]]:
    """Return what causes are to tell of, each alone; more than ``MOST_APART`` together."""
    return [found] if len(found) > MOST_APART else [[one] for one in found]


class CauseKind(Struct, frozen=True):
    """One kind of cause, and what an engineer in front of the plant should know about it.

    ``brief`` is what it does to a list, ``measured`` the same with ``{time}`` for how long, or counters of the list:
    in the row of the list. ``meaning`` says what happened, ``evidence`` by what it is told, ``next_step`` what to do
    first. ``at_least`` is how bad it is, whatever findings it explains. ``by_moments``: it is told by what happens
    again and again, and between two of these nothing is wrong.
    """

    name: str
    brief: str
    meaning: str
    evidence: str
    next_step: str
    at_least: Severity = Severity.NOTE
    measured: str = ""
    by_moments: bool = False
