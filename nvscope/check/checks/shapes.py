"""Checks of what telegrams hold: whether definitions fit, and whether the parts of a list belong together."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.counted_while import NOTHING_CAME, CountedWhile, watch_at_times
from nvscope.check.cycle_watcher import CycleWatcher, watch_cycles
from nvscope.check.doubt import doubt_of_clock
from nvscope.check.happened_while import NOBODY_KNOWS, happened_while
from nvscope.check.judged_cycles import JudgedCycles
from nvscope.check.parameters import RATIO, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.findings.can import DLC_MISMATCH
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN
from nvscope.tracker.counters import Scope
from nvscope.tracker.figures import Of
from nvscope.units import count_of, duration

_SECOND_NS = 1_000_000_000
_AROUND_NS = 1_000_000_000
_MISFITS = (DEFINITION_MISMATCH, DLC_MISMATCH)
"""The findings that say that telegrams are not as a definition has them."""


def _definition(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    defined = known.project.definition.by_key()
    watched: CountedWhile | None = told["watched"]
    came = {one.list: known.keys[one.list] for one in known.of(Of.LIST, lists) if one.list is not None}
    numbers = {key: number for number, key in came.items()}
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
        every = unfit.get(key, [])
        found = every
        if watched is not None and watched.holds is not None:
            has = [happened_while(one, watched.holds.spans) for one in every]
            found = [one for one, is_so in zip(every, has, strict=True) if is_so]
            if not found and (None in has or not watched.telegrams(numbers[key])):
                reason, is_vacuous = (NOBODY_KNOWS, False) if None in has else (NOTHING_CAME, True)
                yield Judged(Verdict.INCONCLUSIVE, key, reason=reason, limit=0, unit="findings", vacuous=is_vacuous)
                continue
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


def _watch_cycles(setting: Setting, told: Mapping[str, Any]) -> CycleWatcher:
    return watch_cycles(setting)


def _coherence(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: CycleWatcher = told["watched"]
    for entry in known.summary.lists:
        if entry.key not in lists:
            continue
        for node in dict.fromkeys(stream.node for stream in entry.streams):
            own = [stream.stream for stream in entry.streams if stream.node == node]
            place = entry.number, entry.key, known.node(node)
            if len(own) > 1:
                cycles = watcher.of(own, early=known.scope_of(entry.number) != Scope.NODE_TELEGRAM)
                yield _of_cycles(known, place, cycles, told)
            elif told["list_named"]:
                yield _undecided(place, "all of it is in one telegram", told)
    for on_can in known.summary.can.lists:
        if on_can.key not in lists or not on_can.streams:
            continue
        defined = () if on_can.extended or known.pdos is None else known.pdos.own_of(on_can.key)
        place = on_can.number, on_can.key, None
        if len(defined) > 1:
            cycles = watcher.on_can([one.stream for one in on_can.streams], len(defined))
            yield _of_cycles(known, place, cycles, told)
        elif told["list_named"]:
            reason = "all of it is in one frame" if defined else "only a definition says which frames belong together"
            yield _undecided(place, reason, told)


Place = tuple[int, ListKey, str | None]
"""A list by number and key, and the node that sends it."""


def _undecided(place: Place, reason: str, told: Mapping[str, Any]) -> Judged:
    return Judged(Verdict.INCONCLUSIVE, *place[1:], reason=reason, limit=told["max"], unit="ratio")


def _of_cycles(known: Evidence, place: Place, found: JudgedCycles | None, told: Mapping[str, Any]) -> Judged:
    most, skew_limit_ns = told["max"], told["skew"]
    if found is None or not found.cycles:
        return _undecided(place, "it came for too short: cycles are told once its intervals are known", told)
    share = found.torn / found.cycles
    if skew_limit_ns is not None and found.skew_ns > skew_limit_ns and share <= most:
        return _too_far_apart(known, place, found, skew_limit_ns)
    verdict, reason = Verdict.PASS, f"{found.torn} of {count_of(found.cycles, 'cycle')}" if found.torn else ""
    if share > most:
        verdict = Verdict.FAIL
        if why := _may_be_drops(known, found, most):
            verdict, reason = Verdict.INCONCLUSIVE, why
    elif skew_limit_ns is not None:
        reason = f"its parts are up to {duration(found.skew_ns)} apart"
    return Judged(
        verdict, *place[1:], reason=reason, worst=share, limit=most, unit="ratio", count=found.torn,
        first_ns=found.frames[0][1] if found.frames else None, frames=tuple(frame for frame, _ in found.frames),
    )  # fmt: skip


def _may_be_drops(known: Evidence, found: JudgedCycles, most: float) -> str:
    """Return what the capture itself lost, where the rest of the torn cycles would be allowed."""
    near = [known.lost_between(at_ns - _AROUND_NS, at_ns + _AROUND_NS) for _, at_ns in found.frames]
    drops = max(near, default=known.drops)
    if not drops or found.torn - drops > most * found.cycles or (not most and not min(near, default=1)):
        return ""
    return f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"


def _too_far_apart(known: Evidence, place: Place, found: JudgedCycles, limit_ns: int) -> Judged:
    frame, begin_ns = found.widest or (None, None)
    verdict, reason = Verdict.FAIL, "the parts of one cycle are that far apart"
    if why := doubt_of_clock(known, begin_ns):
        verdict, reason = Verdict.INCONCLUSIVE, why
    return Judged(
        verdict, *place[1:], reason=reason, worst=found.skew_ns / _SECOND_NS, limit=limit_ns / _SECOND_NS, unit="s",
        count=1, first_ns=begin_ns, frames=() if frame is None else (frame,),
    )  # fmt: skip


CHECKS = (
    Check(
        "definition", "list", "Telegrams are as their definition has them.", "the first variable that does not fit",
        "there is one", 'check = "definition"\nlist = "axis"', _definition, (),
        watch_at_times, needs_definitions=True, at_times=True,
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
        _watch_cycles, at_times=True,
    ),
)  # fmt: skip
