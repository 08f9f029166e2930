"""Checks of time: intervals, jitter, bursts, silences."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from nvscope.check.asked_rows import EVERY_LIST, OfLists
from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.doubt import (
    BEGAN_LATER,
    doubt,
    doubt_of_clock,
    doubt_of_drops,
    doubt_of_ends,
    doubt_of_several,
    parts,
)
from nvscope.check.parameters import PERCENT_OR_TIME, RATIO, REQUIRED, Parameter
from nvscope.check.silence import Silence, SilenceWatcher
from nvscope.check.stream_intervals import IntervalWatcher, SpreadWatcher, StreamIntervals, StreamSpread
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.while_so import TOO_SHORT_SO, WhileSo, while_so
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.figures import Of
from nvscope.tracker.subjects import Subject

_SECOND_NS = 1_000_000_000
_LEAST_INTERVALS = 5
_TOO_FEW = "fewer than 5 intervals: the capture is shorter than the rule needs"
_NO_NOMINAL = "nobody says at which interval it is sent: tell it, or give its definition"


def _watch_cycle(setting: Setting, told: Mapping[str, Any]) -> IntervalWatcher:
    interval_ns, nominal = told["interval"], setting.nominal_ns

    def wanted_ns(key: ListKey) -> int | None:
        return interval_ns or nominal.get(key) or nominal.get(key.on_any_channel)

    return IntervalWatcher(
        wanted_ns, told["tolerance"], setting.since_ns, rows=setting.rows, lists=_lists(setting),
        holds=while_so(setting),
    )  # fmt: skip


def _lists(setting: Setting) -> OfLists:
    return OfLists(patterns=setting.lists) if setting.lists else EVERY_LIST


def _watch_spread(setting: Setting, told: Mapping[str, Any]) -> SpreadWatcher:
    return SpreadWatcher(
        told.get("min", 0), setting.since_ns, rows=setting.rows, lists=_lists(setting), holds=while_so(setting)
    )  # fmt: skip


def _watch_jitter(setting: Setting, told: Mapping[str, Any]) -> SpreadWatcher | None:
    """Return what watches at times only: of all of the time, the report knows it."""
    return _watch_spread(setting, told) if setting.when else None


def _cycle(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: IntervalWatcher = told["watched"]
    judged = set()
    there = {_named(known, one) for one in known.of(Of.STREAM, lists)}
    for one in watcher.streams:
        if (one.key, known.node(one.node), one.subindex) in there:
            judged.add(one.key)
            yield _of_stream(known, one, told)
    # Of every list that there is, only some have an interval.
    others = {key for key, *_ in there} - judged
    for key in sorted(others) if told["list_named"] or told["interval"] or not judged else ():
        yield Judged(Verdict.INCONCLUSIVE, key, reason=_NO_NOMINAL if not told["interval"] else _TOO_FEW)


def _of_stream(known: Evidence, one: StreamIntervals, told: Mapping[str, Any]) -> Judged:
    room_ns = one.wanted_ns * told["tolerance"]
    late = one.worst_ns is None or one.worst_ns >= one.wanted_ns
    limit_s = (one.wanted_ns + room_ns if late else one.wanted_ns - room_ns) / _SECOND_NS
    verdict, reason = Verdict.PASS, ""
    if one.count < _LEAST_INTERVALS:
        verdict, reason = Verdict.INCONCLUSIVE, _TOO_FEW
    elif one.outside > told["exceptions"] * one.count:
        verdict = Verdict.FAIL
        # Each frame that was not captured makes one interval longer, and none shorter.
        more = one.outside - int(told["exceptions"] * one.count)
        needed = more - 1 + max(parts(one.worst_ns or 0, int(one.wanted_ns + room_ns)), 1)
        why = ""
        if late and told["exceptions"] and needed <= known.drops:
            why = doubt_of_drops(known, one.first_ns, needed)
        elif late:
            why = doubt_of_several(known, one.times_ns, needed)
        if why or (more == 1 and (why := doubt_of_ends(known, one.first_ns))):
            verdict, reason = Verdict.INCONCLUSIVE, why
    elif one.outside:
        reason = f"{one.outside} of {one.count} intervals lie outside, as is allowed"
    return Judged(
        verdict, one.key, known.node(one.node), one.subindex, reason=reason,
        worst=None if one.worst_ns is None else one.worst_ns / _SECOND_NS, limit=limit_s, above=late, unit="s",
        count=one.outside, first_ns=one.first_ns, frames=tuple(one.frames),
    )  # fmt: skip


def _named(known: Evidence, subject: Subject) -> tuple[ListKey, str | None, int | None]:
    assert subject.list is not None
    return known.keys[subject.list], known.node(subject.node), subject.subindex


def _by_stream(
    known: Evidence, watcher: SpreadWatcher | None
) -> Mapping[tuple[ListKey, str | None, int | None], StreamSpread]:
    spreads = watcher.spreads if watcher else []
    return {(one.key, known.node(one.node), one.subindex): one for one in spreads}


def _jitter(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    most, watcher = told["max"], told["watched"]
    spreads = _by_stream(known, watcher)
    for subject in known.of(Of.STREAM, lists):
        intervals = subject.measured.intervals
        where = _named(known, subject)
        if intervals is None:
            continue
        count, p50, p99, nominal = intervals.count, intervals.p50, intervals.p99, intervals.nominal
        if watcher:
            spread = spreads.get(where)
            own = None if spread is None else spread.histogram
            count = 0 if own is None else int(own.count.sum())
            p50, p99 = (None if own is None else own.percentile_ns(percent) for percent in (50, 99))
        if count < _LEAST_INTERVALS or p99 is None or p50 is None:
            yield Judged(Verdict.INCONCLUSIVE, *where, reason=_TOO_FEW)
            continue
        spread_ns = p99 - p50
        if isinstance(most, float):
            if not nominal:
                yield Judged(Verdict.INCONCLUSIVE, *where, reason=_NO_NOMINAL)
                continue
            worst, limit, unit = spread_ns / nominal, most, "ratio"
        else:
            worst, limit, unit = spread_ns / _SECOND_NS, most / _SECOND_NS, "s"
        yield Judged(Verdict.FAIL if worst > limit else Verdict.PASS, *where, worst=worst, limit=limit, unit=unit)


def _min_gap(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: SpreadWatcher = told["watched"]
    spreads = _by_stream(known, watcher)
    for subject in known.of(Of.STREAM, lists):
        where = _named(known, subject)
        spread = spreads.get(where)
        if spread is None or spread.least_ns is None:
            yield Judged(Verdict.INCONCLUSIVE, *where, reason=_TOO_FEW)
            continue
        worst, limit = spread.least_ns / _SECOND_NS, told["min"] / _SECOND_NS
        verdict, reason = Verdict.FAIL if spread.short else Verdict.PASS, ""
        if spread.short == 1 and (why := doubt_of_clock(known, spread.first_ns)):
            verdict, reason = Verdict.INCONCLUSIVE, why
        yield Judged(
            verdict, *where, reason=reason, worst=worst, limit=limit, above=False, unit="s",
            count=spread.short, first_ns=spread.first_ns, frames=tuple(spread.frames),
        )  # fmt: skip


def _silent_all_the_time(known: Evidence, key: ListKey, most_ns: int, silence: tuple[int, int]) -> Judged:
    length_ns, since_ns = silence
    limit = most_ns / _SECOND_NS
    verdict, reason = Verdict.FAIL, "it never came"
    if length_ns <= most_ns:
        verdict, reason = Verdict.INCONCLUSIVE, "it never came, and the capture is shorter than the rule needs"
    elif why := doubt(known, None, parts(length_ns, most_ns)):
        verdict, reason = Verdict.INCONCLUSIVE, f"it never came; {why}"
    return Judged(
        verdict, key, reason=reason, worst=length_ns / _SECOND_NS, limit=limit, unit="s", count=1,
        first_ns=since_ns,
    )  # fmt: skip


def _watch_silence(setting: Setting, told: Mapping[str, Any]) -> SilenceWatcher:
    watcher = setting.shared(
        ("silence", setting.when),
        lambda: SilenceWatcher(setting.since_ns, rows=setting.rows, holds=while_so(setting)),
    )
    watcher.want(told["max"], OfLists(patterns=setting.lists) if setting.lists else EVERY_LIST)
    return watcher


def _silence(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: SilenceWatcher = told["watched"]
    if known.since_ns is None or known.until_ns is None:
        return
    found = watcher.of(lists, known.until_ns)
    for key in sorted(lists):
        if key in found:
            yield _of_silences(known, key, found[key], told["max"], watcher.holds)
        elif told["list_named"]:
            yield _silent_all_the_time(known, key, told["max"], watcher.nothing(known.until_ns))


def _of_silences(
    known: Evidence, key: ListKey, silences: Sequence[Silence], most_ns: int, holds: WhileSo | None
) -> Judged:  # fmt: skip
    """Return the verdict on the silences of a list, the longest first: one that nothing explains breaks the rule."""
    assert known.since_ns is not None
    assert known.until_ns is not None
    worst, verdict, reason = silences[0], Verdict.PASS, ""
    broken = _explained(known, [one for one in silences if one.length_ns > most_ns], most_ns)
    unexplained = [one for one, why in broken if not why]
    if unexplained:
        worst, verdict = unexplained[0], Verdict.FAIL
    elif broken:
        verdict, reason = Verdict.INCONCLUSIVE, broken[0][1]
    elif known.until_ns - known.since_ns < most_ns:
        verdict, reason = Verdict.INCONCLUSIVE, "the capture is shorter than the rule needs"
    elif holds is not None and holds.spans.longest_ns(known.since_ns, known.until_ns) < most_ns:
        verdict, reason = Verdict.INCONCLUSIVE, TOO_SHORT_SO
    told = sorted(unexplained or [one for one, _ in broken], key=lambda one: one.begin_ns)
    frames = [one.frame for one in told if one.frame is not None]
    return Judged(
        verdict, key, reason=reason, worst=worst.length_ns / _SECOND_NS, limit=most_ns / _SECOND_NS, unit="s",
        count=len(told), first_ns=told[0].begin_ns if told else None, frames=tuple(frames[:FRAMES_KEPT]),
    )  # fmt: skip


def _explained(known: Evidence, silences: Sequence[Silence], most_ns: int) -> list[tuple[Silence, str]]:
    """Return silences with why a list may have been silent only for the capture; "" where nothing says so.

    What the capture lost explains all that it is to explain, or nothing.
    """
    needed = {one: parts(one.length_ns, most_ns) for one in silences}
    lost = {one: doubt_of_drops(known, one.begin_ns, needed[one], one.end_ns) for one in silences}
    if sum(needed[one] for one in silences if lost[one]) > known.drops:
        lost = {}
    found = []
    for one in silences:
        is_later = one.is_first and known.began_between(one.begin_ns, one.end_ns)
        found.append((one, BEGAN_LATER if is_later else lost.get(one) or doubt_of_ends(known, one.begin_ns)))
    return found


CHECKS = (
    Check(
        "cycle", "stream", "Telegrams come at their interval.", "the interval that is farthest from it",
        "more than exceptions of the intervals lie outside",
        'check = "cycle"\nlist = "axis"\ninterval = "50ms"\ntolerance = "20%"', _cycle,
        (
            Parameter("interval", SPAN, "the interval; else that of the definition", None),
            Parameter("tolerance", RATIO, "by how much of it one may differ", 0.2),
            Parameter("exceptions", RATIO, "so large a share of them may lie outside", 0.0),
        ),
        _watch_cycle, at_times=True,
    ),
    Check(
        "jitter", "stream", "Intervals are alike.", "how far the 99th percentile is from the median",
        "it is more than max, a share of the nominal interval or a time",
        'check = "jitter"\nlist = "axis"\nmax = "10%"', _jitter,
        (Parameter("max", PERCENT_OR_TIME, "so much they may differ", REQUIRED),), _watch_jitter, at_times=True,
    ),
    Check(
        "min_gap", "stream", "Telegrams do not come faster than readers can take them.", "the shortest interval",
        "it is shorter than min", 'check = "min_gap"\nlist = "recipe"\nmin = "10ms"', _min_gap,
        (Parameter("min", SPAN, "so long it has to be at least", REQUIRED),), _watch_spread, at_times=True,
    ),
    Check(
        "silence", "list", "A list does not fall silent.",
        "the longest time without a telegram of it, up to the end of the capture", "it is longer than max",
        'check = "silence"\nlist = "axis"\nmax = "1s"', _silence,
        (Parameter("max", SPAN, "so long it may be", REQUIRED),),
        _watch_silence, at_times=True,
    ),
)  # fmt: skip
