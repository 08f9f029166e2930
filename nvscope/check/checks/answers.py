"""Checks of answers: acknowledgements of readers, and current values for who starts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from nvscope.check.check import Check, Evidence
from nvscope.check.parameters import RATIO, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.figures import Of
from nvscope.units import count_of, duration

_SECOND_NS = 1_000_000_000


def _acknowledged(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    least, within_ns = told["min"], told["within"]
    for subject in known.of(Of.LIST, lists):
        assert subject.list is not None
        key, latency = known.keys[subject.list], subject.measured.latency
        missing = subject.measured.counters.get("missing_acknowledgements")
        came = None if latency is None else latency.count
        if missing is None or came is None:
            reason = "what readers answer is not to be seen in this capture"
            yield Judged(Verdict.INCONCLUSIVE, key, reason=reason, limit=least, above=False, unit="ratio")
            continue
        # What was asked in the warm-up is not judged.
        missing -= known.frames.begun_before.get((EventKind.NO_ACKNOWLEDGEMENT, subject.list), 0)
        waiting_ns = known.waiting_ns(subject.list)
        late = sum(one > within_ns for one in waiting_ns) if within_ns is not None else 0
        missing += late
        if not came + missing:
            if told["list_named"] or waiting_ns:
                reason = "none of its telegrams asks to be acknowledged"
                if waiting_ns:
                    reason = "the capture ended before an acknowledgement was due"
                yield Judged(
                    Verdict.INCONCLUSIVE, key, reason=reason, limit=least, above=False, unit="ratio",
                    vacuous=not waiting_ns,
                )  # fmt: skip
            continue
        share = came / (came + missing)
        frames = known.frames.of([EventKind.NO_ACKNOWLEDGEMENT], subject.list)
        slowest_ns = None if latency is None else latency.maximum
        is_slow = within_ns is not None and slowest_ns is not None and slowest_ns > within_ns
        verdict, reason = Verdict.PASS, ""
        if share < least:
            verdict = Verdict.FAIL
            if known.drops and (came + min(known.drops, missing)) / (came + missing) >= least:
                verdict = Verdict.INCONCLUSIVE
                reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"
        if is_slow and verdict is not Verdict.FAIL:
            assert slowest_ns is not None
            slowest = known.frames.longest(EventKind.ACKNOWLEDGED, subject.list)
            yield Judged(
                Verdict.FAIL, key, reason="the slowest acknowledgement", worst=slowest_ns / _SECOND_NS,
                limit=within_ns / _SECOND_NS, unit="s", count=1, first_ns=slowest.time_ns if slowest else None,
                frames=(slowest.frame,) if slowest else (),
            )  # fmt: skip
            continue
        if slowest_ns is not None and verdict is Verdict.PASS and within_ns is not None:
            reason = f"the slowest took {duration(slowest_ns)}"
        yield Judged(
            verdict, key, reason=reason, worst=share, limit=least, above=False, unit="ratio", count=missing,
            first_ns=frames[0][1] if frames else None, frames=tuple(frame for frame, _ in frames),
        )  # fmt: skip


def _boot_up(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    limit = told["within"] / _SECOND_NS
    for subject in known.of(Of.LIST, lists):
        assert subject.list is not None
        key = known.keys[subject.list]
        asked = subject.measured.counters.get("bootup_requests")
        unanswered = subject.measured.counters.get("bootup_unanswered")
        if unanswered is None or not asked:
            if told["list_named"]:
                reason = "nobody asked for its values" if asked == 0 else "nobody knows what was answered"
                yield Judged(Verdict.INCONCLUSIVE, key, reason=reason, limit=limit, unit="s", vacuous=asked == 0)
            continue
        unanswered -= known.frames.begun_before.get((EventKind.BOOT_UP_UNANSWERED, subject.list), 0)
        unanswered += sum(one > told["within"] for one in known.asking_ns(subject.list))
        slowest = known.frames.longest(EventKind.BOOT_UP_ANSWERED, subject.list)
        slowest_ns = slowest.took_ns if slowest else None
        late = slowest_ns is not None and slowest_ns > told["within"]
        frames = known.frames.of([EventKind.BOOT_UP_UNANSWERED], subject.list)
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
    ),
    Check(
        "boot_up", "list", "Who starts gets current values.", "the slowest answer to a boot-up request",
        "one has no answer, or a slower one than within", 'check = "boot_up"\nlist = "axis"', _boot_up,
        (Parameter("within", SPAN, "so long an answer may take", _SECOND_NS),),
    ),
)  # fmt: skip
