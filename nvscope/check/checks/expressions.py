"""Checks of expressions: what has to follow, always be so, never be so, or be so at some time."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.condition import told_of_plants
from nvscope.check.doubt import doubt, doubt_of_ends, doubt_of_several, parts
from nvscope.check.figure_windows import FigureWindows
from nvscope.check.happened_while import HappenedWhile, judged_of, judged_while, title_of, watch_what_happens
from nvscope.check.moments import FirstWatcher, SequenceWatcher, TruthWatcher, WaitWatcher
from nvscope.check.occurrences import Counts, Occurrences
from nvscope.check.parameters import AMOUNT, EXPRESSION, EXPRESSIONS, REQUIRED, Parameter, Unfit
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.while_so import NEVER_SO, NO_WHOLE_WINDOW, TOO_SHORT_SO
from nvscope.list_key import ListKey
from nvscope.toml_table import LENGTH, SPAN
from nvscope.units import count_of

_SECOND_NS = 1_000_000_000
_TOO_SHORT = "the capture is shorter than the rule needs"
_NEVER_JUDGED = "at no moment it was to be judged"
_UNKNOWN = "at no moment anybody knows whether it is so: what it names never came"


def _seconds(time_ns: int | None) -> float | None:
    return None if time_ns is None else time_ns / _SECOND_NS


def _implies(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: WaitWatcher = told["watched"]
    if known.until_ns is None:
        return
    watcher = watcher.up_to(known.until_ns)
    limit = told["within"] / _SECOND_NS
    if not watcher.waits:
        yield Judged(Verdict.INCONCLUSIVE, reason="if never became true", limit=limit, unit="s", vacuous=True)
        return
    verdict, reason = Verdict.PASS, ""
    if watcher.late:
        verdict, reason = Verdict.FAIL, f"{watcher.late} of {count_of(watcher.waits, 'time')}"
        if not watcher.known:
            verdict, reason = Verdict.INCONCLUSIVE, "nobody knows whether then was so: what it names never came"
        elif why := doubt(known, watcher.first_ns, watcher.late):
            verdict, reason = Verdict.INCONCLUSIVE, why
    elif watcher.undecided == watcher.waits:
        verdict, reason = Verdict.INCONCLUSIVE, _TOO_SHORT
    yield Judged(
        verdict, reason=reason, worst=_seconds(watcher.longest_ns), limit=limit, unit="s", count=watcher.late,
        first_ns=watcher.first_ns, frames=tuple(watcher.frames),
    )  # fmt: skip


def _sequence(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: SequenceWatcher = told["watched"]
    if known.until_ns is None:
        return
    watcher = watcher.up_to(known.until_ns)
    limit = told["within"] / _SECOND_NS
    if not watcher.runs:
        yield Judged(
            Verdict.INCONCLUSIVE, reason="its first step never became true", limit=limit, unit="s", vacuous=True
        )
        return
    verdict, reason = Verdict.PASS, ""
    if watcher.broken:
        verdict, reason = Verdict.FAIL, f"{watcher.reason}, {watcher.broken} of {count_of(watcher.runs, 'run')}"
        if why := doubt(known, watcher.first_ns, watcher.broken):
            verdict, reason = Verdict.INCONCLUSIVE, why
    elif watcher.undecided == watcher.runs:
        verdict, reason = Verdict.INCONCLUSIVE, _TOO_SHORT
    # A run that was broken by its order has no time.
    longest_ns = watcher.longest_ns
    if watcher.broken and longest_ns is not None and longest_ns <= told["within"]:
        longest_ns = None
    yield Judged(
        verdict, reason=reason, worst=_seconds(longest_ns), limit=limit, unit="s", count=watcher.broken,
        first_ns=watcher.first_ns, frames=tuple(watcher.frames),
    )  # fmt: skip


def _truth(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher = told["watched"]
    if watcher is None or isinstance(watcher, HappenedWhile):
        yield _matching(known, told["expr"], watcher)
        return
    if known.until_ns is None:
        return
    if isinstance(watcher, FigureWindows):
        yield from watcher.judged(known, lists)
        return
    watcher = watcher.up_to(known.until_ns)
    broken, limit = watcher.broken, told["for"] / _SECOND_NS
    if not watcher.known:
        reason = _UNKNOWN if watcher.judged else _NEVER_JUDGED
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, limit=limit, unit="s", vacuous=True)
        return
    verdict, reason = Verdict.FAIL if broken.count else Verdict.PASS, ""
    since_ns = known.until_ns if known.since_ns is None else known.since_ns
    if not broken.count and told["for"] > watcher.longest_judged_ns(since_ns, known.until_ns):
        reason = _TOO_SHORT if not watcher.is_conditional else TOO_SHORT_SO
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, worst=_seconds(broken.longest_ns or 0), limit=limit, unit="s")
        return
    # What was seen was so; but for how long it was, telegrams that are missing could tell otherwise.
    needed = parts(broken.longest_ns or 0, told["for"]) if told["for"] else known.drops + 1
    if broken.count and (why := doubt(known, broken.first_ns, needed)):
        verdict, reason = Verdict.INCONCLUSIVE, why
    yield Judged(
        verdict, reason=reason, worst=(broken.longest_ns or 0) / _SECOND_NS, limit=limit, unit="s", count=broken.count,
        first_ns=broken.first_ns, frames=tuple(broken.frames),
    )  # fmt: skip


def _matching(known: Evidence, expression: str, watched: HappenedWhile | None) -> Judged:
    """Return the verdict on what is to happen never: findings and causes that an expression is true of."""
    found, verdict, reason = judged_while(known.matching(expression), watched)
    titles = list(dict.fromkeys(map(title_of, found)))
    return judged_of(found, verdict, reason or "; ".join(titles[:3]), "events")


def _watch_truth(*, wanted: bool) -> Any:
    def watch(setting: Setting, told: Mapping[str, Any]) -> TruthWatcher | FigureWindows | HappenedWhile | None:
        if told["window"] is not None:
            return FigureWindows(setting, told["expr"], told["window"], told["for"], wanted=wanted)
        if told_of_plants(told["expr"], setting.fields):
            if wanted or told["for"]:
                raise Unfit(
                    "causes and findings begin by themselves, and hold at no moment",
                    "expr",
                    next_step="never is for what must not happen, without for",
                )
            return watch_what_happens(setting, told)
        return TruthWatcher(setting, told["expr"], told["for"], wanted=wanted)

    return watch


def _eventually(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: FirstWatcher = told["watched"]
    if known.since_ns is None or known.until_ns is None:
        return
    watcher = watcher.up_to(known.until_ns)
    within_ns = told["within"]
    limit = _seconds(within_ns)
    took_ns = None if watcher.first_ns is None else max(watcher.first_ns - known.since_ns, 0)
    verdict, reason = Verdict.FAIL, "" if took_ns is not None else "it was never so"
    if took_ns is not None and (within_ns is None or took_ns <= within_ns):
        verdict = Verdict.PASS
    elif not watcher.known:
        verdict, reason = Verdict.INCONCLUSIVE, _UNKNOWN if watcher.judged else _NEVER_JUDGED
    elif within_ns is not None and known.until_ns - known.since_ns < within_ns:
        verdict, reason = Verdict.INCONCLUSIVE, _TOO_SHORT
    elif why := doubt(known, None):
        verdict, reason = Verdict.INCONCLUSIVE, why
    yield Judged(
        verdict, reason=reason, worst=_seconds(took_ns), limit=limit, unit="s", first_ns=watcher.first_ns,
        frames=() if watcher.frame is None else (watcher.frame,),
    )  # fmt: skip


def _occurrence(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: Occurrences = told["watched"]
    if known.since_ns is None or known.until_ns is None:
        return
    windows = watcher.windows(known.until_ns)
    if not windows:
        is_conditional = watcher.is_conditional
        reason = _TOO_SHORT
        if is_conditional:
            reason = NO_WHOLE_WINDOW if watcher.judged else NEVER_SO
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, vacuous=is_conditional)
        return
    if told["expr"] is not None and not watcher.known:
        reason = _UNKNOWN if watcher.judged else _NEVER_JUDGED
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, unit="events", vacuous=True)
        return
    if told["expr"] is not None:
        yield _of_windows(known, watcher, 0, None, windows, told)
        return
    numbers = {key: number for number, key in known.keys.items()}
    for key in sorted(lists):
        yield _of_windows(known, watcher, numbers.get(key, -1), key, windows, told)


def _watch_occurrences(setting: Setting, told: Mapping[str, Any]) -> Occurrences:
    if told["min"] is None and told["max"] is None:
        raise Unfit("an occurrence needs min, max, or both")
    if told["min"] is not None and told["max"] is not None and told["min"] > told["max"]:
        raise Unfit("min is more than max", "min")
    return Occurrences(setting, told["expr"], told["per"], told["min"], told["max"])


def _watch_sequence(setting: Setting, told: Mapping[str, Any]) -> SequenceWatcher:
    if len(told["steps"]) < 2:
        raise Unfit("a sequence has two steps at least", "steps")
    return SequenceWatcher(setting, told["steps"], told["within"])


def _of_windows(
    known: Evidence, watcher: Occurrences, number: int, key: ListKey | None, windows: int, told: Mapping[str, Any]
) -> Judged:  # fmt: skip
    assert known.until_ns is not None
    counts = watcher.counts(number, known.until_ns)
    fewest, highest = counts.fewest or 0, counts.highest or 0
    least, most = told["min"], told["max"]
    rooms = [] if least is None else [(fewest - least, fewest, least, False)]
    rooms += [] if most is None else [(most - highest, highest, most, True)]
    room, worst, limit, above = min(rooms)
    verdict, reason = Verdict.FAIL if room < 0 else Verdict.PASS, ""
    if room < 0:
        reason = f"{counts.broken} of {count_of(windows, 'window')}"
        if not above and (why := _why_too_few(known, counts, least - fewest, told["per"])):
            verdict, reason = Verdict.INCONCLUSIVE, why
    unit = "telegrams" if key is not None else "events"
    return Judged(
        verdict, key, reason=reason, worst=worst, limit=limit, above=above, unit=unit, count=counts.broken,
        first_ns=counts.first_ns, frames=tuple(counts.frames),
    )  # fmt: skip


def _why_too_few(known: Evidence, counts: Counts, missing: int, length_ns: int) -> str:
    """Return why what is missing in windows may be the capture's doing; so many are in one of them at most."""
    # A window is broken anywhere within it.
    middle_ns = [one + length_ns // 2 for one in counts.times_ns]
    needed = counts.broken - 1 + missing
    if why := doubt_of_several(known, middle_ns, needed, length_ns // 2):
        return why
    return doubt_of_ends(known, counts.first_ns) if counts.broken == 1 else ""


_EXPR = Parameter("expr", EXPRESSION, "what is asked", REQUIRED)
_WITHIN = Parameter("within", LENGTH, "so long it may take", 0)
_TRUTH = (
    _EXPR,
    Parameter("window", SPAN, "figures of a list are looked at in windows of so long; without it, telegrams are", None),
    Parameter("for", LENGTH, "so long it may be otherwise", 0),
)

CHECKS = (
    Check(
        "occurrence", "list, or expression", "Something happens as often as it should.",
        "the window with fewest or most", "there are fewer than min or more than max in a window",
        'check = "occurrence"\nlist = "recipe"\nper = "10s"\nmin = 1\nmax = 5', _occurrence,
        (
            Parameter("expr", EXPRESSION, "how often it becomes true; else how often telegrams of the list come", None),
            Parameter("per", SPAN, "the windows, end to end; one that is not over in the end is left out", REQUIRED),
            Parameter("min", AMOUNT, "so many there are at least", None),
            Parameter("max", AMOUNT, "so many there are at most", None),
        ),
        _watch_occurrences,
        by_moment=True,
    ),
    Check(
        "implies", "expression", "What has to follow does, in time.", "the longest time from if to then",
        "then does not hold at some moment within the time after if becomes true",
        'check = "implies"\nif = "rose(var.bStop)"\nthen = "var.bClosed"\nwithin = "200ms"', _implies,
        (
            Parameter("if", EXPRESSION, "what begins it, each time that it becomes true", REQUIRED),
            Parameter("then", EXPRESSION, "what has to hold", REQUIRED), _WITHIN,
        ),
        lambda setting, told: WaitWatcher(setting, told["if"], told["then"], told["within"]), by_moment=True,
    ),
    Check(
        "sequence", "expression", "Steps follow each other, in order and in time.", "the longest run",
        "a run that began does not end in order and in time",
        'check = "sequence"\nsteps = ["rose(var.bStart)", "rose(var.bRuns)"]\nwithin = "5s"', _sequence,
        (
            Parameter("steps", EXPRESSIONS, "what becomes true one after the other", REQUIRED),
            Parameter("within", SPAN, "so long a run may take", REQUIRED),
        ),
        _watch_sequence, by_moment=True,
    ),
    Check(
        "always", "expression", "Something is so all the time.", "the longest time in which it was not",
        "that is longer than for", 'check = "always"\nexpr = "var.fPressure < 8"\nfor = "100ms"', _truth, _TRUTH,
        _watch_truth(wanted=True), by_moment=True,
    ),
    Check(
        "never", "expression", "Something is so at no time.", "the longest time in which it was",
        "that is longer than for", 'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"', _truth, _TRUTH,
        _watch_truth(wanted=False), by_moment=True,
    ),
    Check(
        "eventually", "expression", "Something becomes so.", "when it was so first", "it was not until then",
        'check = "eventually"\nexpr = "var.bReady"\nwithin = "10s"', _eventually,
        (_EXPR, Parameter("within", LENGTH, "by when; else at all", None)),
        lambda setting, told: FirstWatcher(setting, told["expr"]), by_moment=True,
    ),
)  # fmt: skip
