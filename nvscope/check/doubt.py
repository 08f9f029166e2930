"""Why what breaks a rule may be the capture's own doing."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.check.check import Evidence
from nvscope.units import count_of

BEGAN_LATER = "one of the captures began later: it may be the one that has it"

_AROUND_NS = 1_000_000_000


def doubt(known: Evidence, at_ns: int | None, needed: int = 1, until_ns: int | None = None) -> str:
    """Return why something that was missing at a time may have been there; "" where nothing says so.

    It is what was missing at about ``at_ns``, or from then to ``until_ns``; ``at_ns`` is None for what was missing
    up to the end. Few captures say when they lost frames: else it may have been at any time. ``needed`` is how many
    it must have lost for that to explain what was missing. A clock that stepped, or an end that is cut off,
    explains what is near to it.
    """
    return doubt_of_drops(known, at_ns, needed, until_ns) or doubt_of_ends(known, at_ns)


def doubt_of_drops(known: Evidence, at_ns: int | None, needed: int = 1, until_ns: int | None = None) -> str:
    """Return the same, as far as it may be that the capture lost it."""
    drops = known.drops
    if at_ns is not None:
        drops = known.lost_between(at_ns - _AROUND_NS, (at_ns if until_ns is None else until_ns) + _AROUND_NS)
    if drops >= max(needed, 1):
        return f"the capture itself lost {count_of(drops, 'frame')}: it may have been these"
    return ""


def doubt_of_ends(known: Evidence, at_ns: int | None) -> str:
    """Return the same, as far as the capture was cut then, or its clock stepped."""
    if known.truncated and (at_ns is None or known.until_ns is None or known.until_ns - at_ns <= _AROUND_NS):
        return f"the capture was cut: {known.truncated}"
    return doubt_of_clock(known, at_ns)


def doubt_of_several(known: Evidence, times_ns: Sequence[int], needed: int, within_ns: int = 0) -> str:
    """Return why all that was missing at some times may be what the capture lost around them; "" where nothing says so.

    ``needed`` is how many frames that takes. Of more than are kept, the first times stand for all. Each is one that
    lies up to ``within_ns`` before or behind.
    """
    around_ns = _AROUND_NS + within_ns
    if not times_ns or not all_near_drops(known, times_ns, around_ns):
        return ""
    drops = known.lost_near(times_ns, around_ns)
    if drops < needed:
        return ""
    return f"the capture itself lost {count_of(drops, 'frame')}: it may have been these"


def all_near_drops(known: Evidence, times_ns: Sequence[int], around_ns: int = _AROUND_NS) -> bool:
    """Tell whether at each of some times the capture may have lost frames itself."""
    return all(known.lost_near([one], around_ns) for one in times_ns)


def parts(length_ns: int, most_ns: int) -> int:
    """Return how many telegrams within a time leave no part of it longer than so long."""
    return -(-length_ns // most_ns) - 1 if most_ns > 0 else 1


def doubt_of_clock(known: Evidence, at_ns: int | None) -> str:
    """Return why times around one may be wrong; "" where nothing says so."""
    if at_ns is not None and any(abs(step_ns - at_ns) <= _AROUND_NS for step_ns in known.clock_steps_ns):
        return "the clock of the capture stepped then"
    return ""
