"""Checks of answers: acknowledgements of readers, and current values for who starts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from msgspec import Struct

from nvscope.check.answered_while import AnsweredWhile, watch_answers
from nvscope.check.check import Check, Evidence
from nvscope.check.first_frames import Longest
from nvscope.check.parameters import RATIO, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.figures import Of
from nvscope.tracker.subjects import Subject
from nvscope.units import count_of, duration

_SECOND_NS = 1_000_000_000


class _Answers(Struct, frozen=True):
    """What came of what was asked of a list: how many answers, how many are missing, and how long others have waited.

    ``slowest_ns`` is how long the slowest answer took; None where there is none, or nobody knows any.
    """

    came: int
    missing: int
    waiting_ns: Sequence[int]
    slowest_ns: int | None
    slowest: Longest | None
    frames: Sequence[tuple[int, int]]


def _acknowledgements(known: Evidence, subject: Subject, watched: AnsweredWhile | None) -> _Answers | None:
    """Return what came of what a list asked to be acknowledged; None where that is not to be seen."""
    assert subject.list is not None
    number, latency = subject.list, subject.measured.latency
    missing = subject.measured.counters.get("missing_acknowledgements")
    came = None if latency is None else latency.count
    if missing is None or came is None:
        return None
    if watched is not None:
        return _while_so(known, number, watched, EventKind.ACKNOWLEDGED, known.open_waits)
    # What was asked in the warm-up is not judged.
    missing -= known.frames.begun_before.get((EventKind.NO_ACKNOWLEDGEMENT, number), 0)
    came -= known.frames.begun_before.get((EventKind.ACKNOWLEDGED, number), 0)
    slowest = known.frames.longest(EventKind.ACKNOWLEDGED, number)
    frames = known.frames.of([EventKind.NO_ACKNOWLEDGEMENT], number)
    waiting_ns = known.waited_ns(number, known.open_waits)
    return _Answers(came, missing, waiting_ns, slowest.took_ns if slowest else None, slowest, frames)


def _boot_ups(known: Evidence, subject: Subject, watched: AnsweredWhile | None) -> _Answers | None:
    """Return what came of requests for the values of a list; None where that is not to be seen."""
    assert subject.list is not None
    number = subject.list
    asked = subject.measured.counters.get("bootup_requests")
    unanswered = subject.measured.counters.get("bootup_unanswered")
    if asked is None or unanswered is None:
        return None
    if watched is not None:
        return _while_so(known, number, watched, EventKind.BOOT_UP_ANSWERED, known.open_requests)
    unanswered -= known.frames.begun_before.get((EventKind.BOOT_UP_UNANSWERED, number), 0)
    waiting_ns = known.waited_ns(number, known.open_requests)
    slowest = known.frames.longest(EventKind.BOOT_UP_ANSWERED, number)
    return _Answers(
        asked - unanswered - len(waiting_ns), unanswered, waiting_ns, slowest.took_ns if slowest else None, slowest,
        known.frames.of([EventKind.BOOT_UP_UNANSWERED], number),
    )  # fmt: skip


_IN_VAIN = {
    EventKind.ACKNOWLEDGED: EventKind.NO_ACKNOWLEDGEMENT,
    EventKind.BOOT_UP_ANSWERED: EventKind.BOOT_UP_UNANSWERED,
}


def _while_so(
    known: Evidence, number: int, watched: AnsweredWhile, kind: EventKind, waiting: Mapping[int, Sequence[int]]
) -> _Answers:  # fmt: skip
    slowest = watched.longest(kind, number)
    open_ns = np.array(waiting.get(number, ()), np.int64)
    since_ns = open_ns[watched.spans.at(open_ns)].tolist()
    return _Answers(
        watched.count(kind, number), watched.count(_IN_VAIN[kind], number),
        [(known.until_ns or one) - one for one in since_ns], slowest.took_ns if slowest else None, slowest,
        watched.of(_IN_VAIN[kind], number),
    )  # fmt: skip


def _acknowledged(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    least, within_ns = told["min"], told["within"]
    for subject in known.of(Of.LIST, lists):
        assert subject.list is not None
        key, answers = known.keys[subject.list], _acknowledgements(known, subject, told["watched"])
        if answers is None:
            reason = "what readers answer is not to be seen in this capture"
            yield Judged(Verdict.INCONCLUSIVE, key, reason=reason, limit=least, above=False, unit="ratio")
            continue
        late = sum(one > within_ns for one in answers.waiting_ns) if within_ns is not None else 0
        came, missing = answers.came, answers.missing + late
        if not came + missing:
            if told["list_named"] or answers.waiting_ns:
                reason = "none of its telegrams asks to be acknowledged"
                if answers.waiting_ns:
                    reason = "the capture ended before an acknowledgement was due"
                yield Judged(
                    Verdict.INCONCLUSIVE, key, reason=reason, limit=least, above=False, unit="ratio",
                    vacuous=not answers.waiting_ns,
                )  # fmt: skip
            continue
        share, slowest_ns = came / (came + missing), answers.slowest_ns
        is_slow = within_ns is not None and slowest_ns is not None and slowest_ns > within_ns
        verdict, reason = Verdict.PASS, ""
        if share < least:
            verdict = Verdict.FAIL
            if known.drops and (came + min(known.drops, missing)) / (came + missing) >= least:
                verdict = Verdict.INCONCLUSIVE
                reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"
        if is_slow and verdict is not Verdict.FAIL:
            assert slowest_ns is not None
            slowest = answers.slowest
            yield Judged(
                Verdict.FAIL, key, reason="the slowest acknowledgement", worst=slowest_ns / _SECOND_NS,
                limit=within_ns / _SECOND_NS, unit="s", count=1, first_ns=slowest.time_ns if slowest else None,
                frames=(slowest.frame,) if slowest else (),
            )  # fmt: skip
            continue
        if slowest_ns is not None and verdict is Verdict.PASS and within_ns is not None:
            reason = f"the slowest took {duration(slowest_ns)}"
        frames = answers.frames
        yield Judged(
            verdict, key, reason=reason, worst=share, limit=least, above=False, unit="ratio", count=missing,
            first_ns=frames[0][1] if frames else None, frames=tuple(frame for frame, _ in frames),
        )  # fmt: skip


def _boot_up(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    limit = told["within"] / _SECOND_NS
    for subject in known.of(Of.LIST, lists):
        assert subject.list is not None
        key, answers = known.keys[subject.list], _boot_ups(known, subject, told["watched"])
        asked = 0 if answers is None else answers.came + answers.missing + len(answers.waiting_ns)
        if answers is None or not asked:
            if told["list_named"]:
                reason = "nobody knows what was answered" if answers is None else "nobody asked for its values"
                is_vacuous = answers is not None
                yield Judged(Verdict.INCONCLUSIVE, key, reason=reason, limit=limit, unit="s", vacuous=is_vacuous)
            continue
        unanswered = answers.missing + sum(one > told["within"] for one in answers.waiting_ns)
        slowest, slowest_ns, frames = answers.slowest, answers.slowest_ns, answers.frames
        late = slowest_ns is not None and slowest_ns > told["within"]
        verdict = Verdict.FAIL if unanswered or late else Verdict.PASS
        reason = f"{unanswered} of {count_of(asked, 'request')} had no answer in time" if unanswered else ""
        if not frames and late and slowest:
            frames = [(slowest.frame, slowest.time_ns)]
        if unanswered and unanswered <= known.drops:
            verdict = Verdict.FAIL if late else Verdict.INCONCLUSIVE
            reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"
        if slowest_ns is None and not unanswered:
            verdict, reason = Verdict.INCONCLUSIVE, "the capture ended before the answer was due"
        yield Judged(
            verdict, key, reason=reason, worst=None if slowest_ns is None else slowest_ns / _SECOND_NS, limit=limit,
            unit="s", count=unanswered, first_ns=frames[0][1] if frames else None,
            frames=tuple(frame for frame, _ in frames),
        )  # fmt: skip


CHECKS = (
    Check(
        "acknowledged", "list", "Readers acknowledge what they are asked to.",
        "share of telegrams that were acknowledged; or the slowest acknowledgement",
        "it is below min, or slower than within", 'check = "acknowledged"\nlist = "recipe"\nwithin = "20ms"',
        _acknowledged,
        (
            Parameter("min", RATIO, "so large a share is acknowledged at least", 1.0),
            Parameter("within", SPAN, "so long an acknowledgement may take; else up to the timeout", None),
        ),
        watch_answers, at_times=True,
    ),
    Check(
        "boot_up", "list", "Who starts gets current values.", "the slowest answer to a boot-up request",
        "one has no answer, or a slower one than within", 'check = "boot_up"\nlist = "axis"', _boot_up,
        (Parameter("within", SPAN, "so long an answer may take", _SECOND_NS),), watch_answers, at_times=True,
    ),
)  # fmt: skip
