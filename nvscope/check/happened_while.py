"""Whether what a report tells of happened while something was so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, TypeVar

import numpy as np
from msgspec import Struct

from nvscope.causes.cause import Cause
from nvscope.check.check import Setting
from nvscope.check.so_spans import SoSpans
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.while_so import WhileSo, while_so
from nvscope.engine.told import Told
from nvscope.findings.finding import Finding
from nvscope.tracker.event_kinds import FRAMES_KEPT


class HappenedWhile(Struct, frozen=True):
    """An observer of when something ``holds``."""

    holds: WhileSo
    by_stream: ClassVar[bool] = True

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.holds.see(told)


def happened_while(one: Finding | Cause, spans: SoSpans) -> bool | None:
    """Tell whether something happened then; None where nobody knows, for only the first ten frames are kept.

    What is so for a while did where it was so at any moment of it, all else where one of its events was.
    """
    if isinstance(one, Cause) and not one.kind.by_moments:
        return spans.touch(one.since_ns, one.until_ns) or _unless_left_out(spans)
    first_ns, last_ns = (one.since_ns, one.last_ns) if isinstance(one, Cause) else (one.first_ns, one.last_ns)
    if not one.frames:
        return spans.touch(first_ns, last_ns) or _unless_left_out(spans)
    if spans.at_frames(np.array(one.frames, np.int64)).any():
        return True
    if one.frames_cut and spans.touch(first_ns, last_ns, max(one.frames)):
        return None
    return _unless_left_out(spans)


def _unless_left_out(spans: SoSpans) -> bool | None:
    return None if spans.left_out else False


def title_of(one: Finding | Cause) -> str:
    """Return what is told of it in few words."""
    return one.title if isinstance(one, Cause) else f"{one.code} {one.kind.name}"


def _begin_ns(one: Finding | Cause) -> int | None:
    return one.since_ns if isinstance(one, Cause) else one.first_ns


Happened = TypeVar("Happened", bound=Finding | Cause)


def judged_while(found: Sequence[Happened], watched: HappenedWhile | None) -> tuple[list[Happened], Verdict, str]:
    """Return what of all that was found is judged, whether that breaks a rule, and why it cannot be decided."""
    if watched is None:
        return list(found), Verdict.FAIL if found else Verdict.PASS, ""
    has = [happened_while(one, watched.holds.spans) for one in found]
    judged = [one for one, is_so in zip(found, has, strict=True) if is_so]
    if judged or None not in has:
        return judged, Verdict.FAIL if judged else Verdict.PASS, ""
    return judged, Verdict.INCONCLUSIVE, NOBODY_KNOWS


def judged_of(found: Sequence[Finding | Cause], verdict: Verdict, reason: str, unit: str) -> Judged:
    """Return a verdict on what was found, with when the first of it began and its first frames."""
    begin_ns = [one for one in map(_begin_ns, found) if one is not None]
    frames = sorted({frame for one in found for frame in one.frames})[:FRAMES_KEPT]
    return Judged(
        verdict, reason=reason, worst=len(found), limit=0, unit=unit, count=len(found),
        first_ns=min(begin_ns, default=None), frames=tuple(frames),
    )  # fmt: skip


NOBODY_KNOWS = "it goes on for longer than its frames are kept: nobody knows whether it happened while when was so"


def watch_what_happens(setting: Setting, told: Mapping[str, Any]) -> HappenedWhile | None:
    """Return what watches at times only."""
    holds = while_so(setting)
    return None if holds is None else HappenedWhile(holds)
