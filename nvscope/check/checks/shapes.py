"""Checks of what telegrams hold: whether definitions fit, and whether the parts of a list belong together."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from nvscope.check.asked_rows import EVERY_LIST, OfLists
from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.early_cycles import Counted, EarlyCycles
from nvscope.check.parameters import RATIO, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.findings.can import DLC_MISMATCH
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN
from nvscope.tracker.counters import Scope
from nvscope.tracker.event_kinds import FRAMES_KEPT, EventKind
from nvscope.tracker.figures import Of
from nvscope.units import count_of, duration

_SECOND_NS = 1_000_000_000
_MISFITS = (DEFINITION_MISMATCH, DLC_MISMATCH)
"""The findings that say that telegrams are not as a definition has them."""


def _definition(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    defined = known.project.definition.by_key()
    came = {one.list: known.keys[one.list] for one in known.of(Of.LIST, lists) if one.list is not None}
    unfit: dict[ListKey, list[Any]] = {}
    for finding in known.findings:
        if finding.kind in _MISFITS:
            for number in finding.lists or (finding.list_number,):
                if number in came:
                    unfit.setdefault(came[number], []).append(finding)
    for key in sorted(lists):
        if key not in defined and key.on_any_channel not in defined:
            if told["list_named"]:
                yield Judged(Verdict.INCONCLUSIVE, key, reason="nobody has defined it")
            continue
        if key not in came.values():
            yield Judged(Verdict.INCONCLUSIVE, key, reason="it never came")
            continue
        found = unfit.get(key)
        if not found:
            yield Judged(Verdict.PASS, key, worst=0, limit=0, unit="findings")
            continue
        first = found[0]
        parts = [one for one in first.parts if one.list_number is not None and known.keys[one.list_number] == key]
        first = parts[0] if parts else first
        variable = first.misfit.variable if first.misfit else None
        yield Judged(
            Verdict.FAIL, key, subindex=first.subindex, variable=variable or None, reason=first.message,
            worst=len(found), limit=0, unit="findings", count=first.count, first_ns=first.first_ns,
            frames=tuple(first.frames),
        )  # fmt: skip


def _watch_cycles(setting: Setting, told: Mapping[str, Any]) -> EarlyCycles:
    lists = OfLists(patterns=setting.lists) if setting.lists else EVERY_LIST
    return EarlyCycles(setting.rows, lists, setting.since_ns)


def _coherence(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    most, skew_limit_ns = told["max"], told["skew"]
    watcher: EarlyCycles = told["watched"]
    for entry in known.summary.lists:
        if entry.key not in lists:
            continue
        for node in dict.fromkeys(stream.node for stream in entry.streams):
            own = [stream.stream for stream in entry.streams if stream.node == node]
            if len(own) < 2:
                if told["list_named"]:
                    reason = "all of it is in one telegram"
                    yield Judged(
                        Verdict.INCONCLUSIVE, entry.key, known.node(node), reason=reason, limit=most, unit="ratio"
                    )
                continue
            scope = known.scope_of(entry.number)
            early = watcher.counted(own) if scope != Scope.NODE_TELEGRAM else Counted()
            cycles, torn, skew_ns = known.cycles(own) or (0, 0, 0)
            counted = cycles + early.cycles, torn + early.torn, max(skew_ns, early.skew_ns)
            if not counted[0]:
                yield Judged(
                    Verdict.INCONCLUSIVE, entry.key, known.node(node),
                    reason="it came for too short: cycles are told once its intervals are known",
                    limit=most, unit="ratio",
                )  # fmt: skip
                continue
            yield _of_cycles(
                known, entry.number, entry.key, known.node(node), counted, early.frames, most, skew_limit_ns
            )  # fmt: skip


def _of_cycles(
    known: Evidence, number: int, key: ListKey, node: str | None, counted: tuple[int, int, int],
    early: Sequence[tuple[int, int]], most: float, skew_limit_ns: int | None,
) -> Judged:  # fmt: skip
    cycles, torn, skew_ns = counted
    share = torn / cycles
    if skew_limit_ns is not None and skew_ns > skew_limit_ns and share <= most:
        return Judged(
            Verdict.FAIL, key, node, reason="the parts of one cycle are that far apart", worst=skew_ns / _SECOND_NS,
            limit=skew_limit_ns / _SECOND_NS, unit="s",
        )  # fmt: skip
    verdict, reason = Verdict.PASS, f"{torn} of {count_of(cycles, 'cycle')}" if torn else ""
    frames = sorted([*early, *known.frames.of([EventKind.TORN_CYCLE], number)])[:FRAMES_KEPT] if torn else []
    if share > most:
        verdict = Verdict.FAIL
        if known.drops and torn - known.drops <= most * cycles:
            verdict = Verdict.INCONCLUSIVE
            reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"
    elif skew_limit_ns is not None:
        reason = f"its parts are up to {duration(skew_ns)} apart"
    return Judged(
        verdict, key, node, reason=reason, worst=share, limit=most, unit="ratio", count=torn,
        first_ns=frames[0][1] if frames else None, frames=tuple(frame for frame, _ in frames),
    )  # fmt: skip


CHECKS = (
    Check(
        "definition", "list", "Telegrams are as their definition has them.", "the first variable that does not fit",
        "there is one", 'check = "definition"\nlist = "axis"', _definition, needs_definitions=True,
    ),
    Check(
        "coherence", "list", "The telegrams of a list that takes several belong together.",
        "share of torn cycles, or their skew",
        "it is above max, or parts of a cycle are farther apart than skew",
        'check = "coherence"\nlist = "recipe"\nmax = "1%"', _coherence,
        (
            Parameter("max", RATIO, "so large a share of the cycles may lack a part", 0.0),
            Parameter("skew", SPAN, "so far apart the parts of a cycle may be", None),
        ),
        _watch_cycles,
    ),
)  # fmt: skip
