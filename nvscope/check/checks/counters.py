"""Checks of what the counters of a list tell: losses, duplicates, restarts, malformed telegrams."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from nvscope.check.check import Check, Evidence, Judge
from nvscope.check.counted_while import NOTHING_CAME, CountedWhile, telegrams_of, watch_counters
from nvscope.check.doubt import all_near_drops
from nvscope.check.parameters import AMOUNT, RATIO, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.figures import Of
from nvscope.tracker.frame_counts import STEPS
from nvscope.tracker.subjects import Subject
from nvscope.units import count_of

_NOT_BELIEVED = "its counters are not believed: they say that more was lost than there was time to send"
_OF_NETWORK = ("lost", "gaps", "longest_gap")
"""What the capture itself may have lost."""


_AROUND_NS = 1_000_000_000
COUNTS_NOTHING = "a sender leaves its Counter as it is: nobody can tell from it what was lost"
_OF_ANY_COUNTER = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts")
_OF_COUNTERS = ("longest_gap", "duplicates", "overtaken", "restarts")


def _is_on_can(known: Evidence, subject: Subject) -> bool:
    assert subject.list is not None
    return known.keys[subject.list].transport is Transport.CAN


def _without_header(known: Evidence, subject: Subject, limit: float, unit: str) -> Judged:
    assert subject.list is not None
    reason = "it is on CAN, where telegrams have no header that tells it"
    return Judged(Verdict.INCONCLUSIVE, known.keys[subject.list], reason=reason, limit=limit, unit=unit, vacuous=True)


def _figure(known: Evidence, subject: Subject, name: str, counted: CountedWhile | None) -> float | None:
    value = subject.measured.counters.get(name)
    if value is None or counted is None:
        return value
    assert subject.list is not None
    return counted.figure(subject.list, name, known.scope_of(subject.list))


def _at_most(
    known: Evidence, subject: Subject, figure: str, value: float | None, told: Mapping[str, Any], unit: str
) -> Judged:  # fmt: skip
    """Return the verdict on a value of a list that may not be above a limit."""
    assert subject.list is not None
    key, limit, counted = known.keys[subject.list], told["max"], told["watched"]
    if value is None:
        return Judged(Verdict.INCONCLUSIVE, key, reason=_NOT_BELIEVED, limit=limit, unit=unit)
    if counted is not None and counted.holds is not None and not value and not counted.telegrams(subject.list):
        return Judged(Verdict.INCONCLUSIVE, key, reason=NOTHING_CAME, limit=limit, unit=unit, vacuous=True)
    if value <= limit and figure in _OF_ANY_COUNTER and known.counts_nothing(subject.list):
        return Judged(Verdict.INCONCLUSIVE, key, reason=COUNTS_NOTHING, limit=limit, unit=unit)
    if value <= limit:
        return Judged(Verdict.PASS, key, worst=value, limit=limit, unit=unit)
    verdict, reason = Verdict.FAIL, ""
    if figure in _OF_NETWORK and _may_be_drops(known, subject, figure, value, told):
        verdict = Verdict.INCONCLUSIVE
        reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"
    scope = known.scope_of(subject.list)
    frames = (known.frames.of if counted is None else counted.frames)(kinds_of(figure), subject.list, scope)
    count = int(_figure(known, subject, "gaps" if figure in _OF_NETWORK else figure, counted) or 0)
    return Judged(
        verdict, key, reason=reason, worst=value, limit=limit, unit=unit, count=count,
        first_ns=frames[0][1] if frames else None, frames=tuple(frame for frame, _ in frames),
    )  # fmt: skip


def _may_be_drops(known: Evidence, subject: Subject, figure: str, value: float, told: Mapping[str, Any]) -> bool:
    """Tell whether what the capture itself lost explains that a limit is broken: the rest of it would be kept."""
    assert subject.list is not None
    counted, scope = told["watched"], known.scope_of(subject.list)
    events = (known.frames.of if counted is None else counted.frames)(kinds_of(figure), subject.list, scope)
    # Where the capture says when it lost frames, what happened at other times is the network's.
    times_ns = [at_ns for _, at_ns in events]
    drops = known.lost_near(times_ns, _AROUND_NS) if times_ns else known.drops
    if not drops or (not told["max"] and not all_near_drops(known, times_ns)):
        return False
    lost = _figure(known, subject, "lost", told["watched"]) or 0
    if figure != "lost":
        # Where none may be missing, all that are have to be explained.
        return bool(value - drops <= told["max"] and (told["max"] or lost <= drops))
    telegrams = telegrams_of(subject, told["watched"])
    return bool(max(lost - drops, 0) <= told["max"] * (lost + telegrams))


def kinds_of(figure: str) -> tuple[EventKind, ...]:
    """Return the kinds of events that a figure counts up by."""
    return tuple(step.kind for step in STEPS[figure] if step.by > 0)


def _loss(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    for subject in known.of(Of.LIST, lists):
        lost, telegrams = _figure(known, subject, "lost", told["watched"]), telegrams_of(subject, told["watched"])
        if lost is None and _is_on_can(known, subject):
            if told["list_named"]:
                yield _without_header(known, subject, told["max"], "ratio")
            continue
        # Where a Counter begins anew between them, more may come late than was ever missing.
        missing = None if lost is None else max(lost, 0)
        share = None if missing is None else missing / (missing + telegrams) if missing + telegrams else 0.0
        yield _at_most(known, subject, "lost", share, told, "ratio")


def _counted(figure: str, unit: str) -> Judge:
    def judge(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
        for subject in known.of(Of.LIST, lists):
            value = _figure(known, subject, figure, told["watched"])
            lost = _figure(known, subject, "lost", told["watched"])
            if figure in _OF_COUNTERS and lost is None:
                value = None  # they are told by the same counters
            elif figure == "longest_gap" and value is not None and lost is not None:
                value = min(value, max(lost, 0))  # what came late is not missing
            if value is None and _is_on_can(known, subject):
                if told["list_named"]:
                    yield _without_header(known, subject, told["max"], unit)
                continue
            yield _at_most(known, subject, figure, value, told, unit)

    return judge


def _number(what: str) -> tuple[Parameter, ...]:
    return (Parameter("max", AMOUNT, f"so many {what} are allowed", 0),)


CHECKS = (
    Check(
        "loss", "list", "Telegrams that were sent come.",
        "share of telegrams that never came: lost / (lost + telegrams)", "it is above max",
        'check = "loss"\nlist = "axis"\nmax = "0.1%"', _loss,
        (Parameter("max", RATIO, "so large a share may be lost", 0.0),),
        watch_counters, at_times=True,
    ),
    Check(
        "gap", "list", "No more telegrams in a row are lost than its readers can do without.",
        "most telegrams missing in one place", "they are more than max",
        'check = "gap"\nlist = "axis"\nmax = 1', _counted("longest_gap", "telegrams"), _number("telegrams in a row"),
        watch_counters, at_times=True,
    ),
    Check(
        "duplicates", "list", "No telegram comes twice.", "telegrams that came again", "they are more than max",
        'check = "duplicates"', _counted("duplicates", "telegrams"), _number("duplicates"),
        watch_counters, at_times=True,
    ),
    Check(
        "overtaken", "list", "Telegrams come in the order in which they were sent.",
        "telegrams that came after a later one", "they are more than max",
        'check = "overtaken"', _counted("overtaken", "telegrams"), _number("overtaken telegrams"),
        watch_counters, at_times=True,
    ),
    Check(
        "restarts", "list", "Senders run through.", "counters that began anew", "they are more than max",
        'check = "restarts"\nmax = 0', _counted("restarts", "events"), _number("restarts"),
        watch_counters, at_times=True,
    ),
    Check(
        "malformed", "list", "Telegrams are as the protocol has them.",
        "telegrams too short, of a wrong Length or an unknown service", "they are more than max",
        'check = "malformed"', _counted("malformed", "telegrams"), _number("malformed telegrams"),
        watch_counters, at_times=True,
    ),
)  # fmt: skip
