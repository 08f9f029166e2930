"""Judges rules on captures: one reading of them, and each rule by itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, Watched, Watching
from nvscope.capture.source import FileSource, Source, SourceInfo
from nvscope.causes.cause import Cause
from nvscope.check.asked_rows import AskedRows
from nvscope.check.check import Evidence, Setting
from nvscope.check.condition import compiled
from nvscope.check.figure_windows import FigureWindows
from nvscope.check.first_frames import FirstFrames
from nvscope.check.lists import chosen
from nvscope.check.rules import Mistakes, Rule, Rules
from nvscope.check.verdict import Judged, Verdict, worst_of
from nvscope.engine.run import Observer
from nvscope.engine.told import Told
from nvscope.errors import ConfigurationError, UsageError
from nvscope.findings.finding import Finding
from nvscope.findings.torn_cycles import CycleSizes
from nvscope.list_key import ListKey
from nvscope.tracker.state import TrackerState
from nvscope.tracker.subjects import subjects
from nvscope.tracker.windows import Windows

_RING_BYTES = 1 << 20
_FOREVER_NS = 1 << 61
_ON_THE_WIRE = re.compile(r"(?:udp/\d+/|can/[^/]+/)?(?:\d+x?|0x[0-9a-fA-F]+)")


@dataclass(frozen=True, slots=True)
class Decided:
    """A rule, its verdict, and that of each of its subjects, in the order of lists and streams."""

    rule: Rule
    verdict: Verdict
    subjects: Sequence[Judged]


@dataclass(frozen=True, slots=True)
class Checked:
    """All rules with their verdicts, in the order of their files, and what was known at the end."""

    decided: Sequence[Decided]
    scene: Scene
    names: Mapping[ListKey, str]

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return self.scene.snapshot.infos

    def of(self, verdict: Verdict) -> Sequence[Decided]:
        """Return the rules with a verdict."""
        return [one for one in self.decided if one.verdict is verdict]


@dataclass(slots=True)
class _Watched:
    """A rule, what watches for it, and why it cannot be judged, "" where it can."""

    rule: Rule
    watcher: Observer | None = None
    reason: str = ""


def checked(inquiry: Inquiry, rules: Rules, source: Source | None = None) -> Checked:
    """Judge rules on captures, or on the ``source`` that is open already.

    Raises what reading it raises, and Mistakes where a rule asks for what nothing is called, though definitions are
    given that say what there is.
    """
    watched_rules = watching(inquiry, rules, None)
    source = source or inquiry.open()
    since_ns = _begin_ns(source, rules.warmup_ns)
    if since_ns is not None:
        watched_rules = watching(inquiry, rules, since_ns)
    frames = FirstFrames(since_ns)
    watchers = [one.watcher for one in watched_rules if one.watcher is not None]
    for one in watchers:
        if isinstance(one, FigureWindows):
            source = one.windows.cut(source)
    counted = _Counted(inquiry, frames, since_ns)
    listeners = () if since_ns is not None else (frames,)
    how = Watching(_RING_BYTES, others=[*counted.observers, *watchers], listeners=listeners)
    watched = Watched(inquiry, counted.cut(source), how, overdue=False)
    for _ in inquiry.run(watched.source, watched.observers):
        pass
    scene = watched.look()
    evidence = _evidence(inquiry, scene, counted, watched.state, frames)
    decided = [_decided(one, evidence) for one in watched_rules]
    _tell_of_unknown(watched_rules, evidence)
    return Checked(decided, scene, evidence.names)


def watching(inquiry: Inquiry, rules: Rules, since_ns: int | None) -> list[_Watched]:
    """Return what watches for each rule; Mistakes with all that rules ask for and that there is not."""
    names = {key: entry.name for key, entry in inquiry.project.definition.by_key().items() if entry.name}
    setting = Setting(
        inquiry.project.definition.nominal_intervals_ns(), inquiry.fields, AskedRows(names), names, inquiry.layouts,
        since_ns,
    )  # fmt: skip
    found, mistakes = [], []
    for rule in rules.rules:
        one = _Watched(rule)
        found.append(one)
        own = replace(setting, lists=tuple(rule.lists), when=rule.when)
        if setting.layouts is None and (rule.check.needs_definitions or rule.names_variables):
            one.reason = "no definition is given that knows variables"
            continue
        wrong = [] if rule.parameters.get("window") else list(_mistakes(rule, inquiry))
        mistakes += wrong
        try:
            one.watcher = rule.check.watch(own, rule.parameters) if rule.check.watch and not wrong else None
        except UsageError as error:
            mistakes.append(rule.mistake(error))
    if mistakes:
        raise Mistakes(mistakes)
    return found


def _mistakes(rule: Rule, inquiry: Inquiry) -> Iterator[ConfigurationError]:
    """Yield what is wrong with expressions of a rule."""
    for key, text in rule.expressions.items():
        try:
            compiled(text, inquiry.fields)
        except UsageError as error:
            yield rule.mistake(error, key)


class _Counted:
    """What is counted behind the warm-up: by a state of its own, or without one by that of all."""

    def __init__(self, inquiry: Inquiry, frames: FirstFrames, since_ns: int | None) -> None:
        self._inquiry = inquiry
        self.since_ns = since_ns
        self.windows = None if since_ns is None else Windows(_FOREVER_NS, since_ns, listeners=(frames,))
        self._before = None if self.windows is None else _CyclesBefore(self.windows, since_ns or 0)

    @property
    def observers(self) -> Sequence[Observer]:
        return () if self.windows is None or self._before is None else (self._before, self.windows)

    def cut(self, source: Source) -> Source:
        return source if self.windows is None else self.windows.cut(source)

    def summary(self, scene: Scene) -> Any:
        inquiry, window = self._inquiry, None if self.windows is None else self.windows.open()
        if window is None:
            return scene.snapshot.summary
        return window.counted.summary(
            intervals_ns=inquiry.project.definition.nominal_intervals_ns(), readers=inquiry.project.readers,
            buses=inquiry.project.buses, cob_ids=inquiry.pdos.cob_ids if inquiry.pdos else frozenset(),
        )  # fmt: skip

    def cycles(self, state: TrackerState) -> Callable[[Sequence[int]], tuple[int, int, int] | None]:
        sizes = CycleSizes((self.windows.state if self.windows else state).senders.cycles)
        before = self._before

        def counted(streams: Sequence[int]) -> tuple[int, int, int] | None:
            found = sizes.counted(streams)
            if found is None or before is None:
                return found
            cycles, torn = before.of(streams)
            return found[0] - cycles, found[1] - torn, found[2]

        return counted


class _CyclesBefore:
    """Remembers how many cycles there were before a time; it observes in front of the state that counts them."""

    by_stream: ClassVar[bool] = True

    def __init__(self, windows: Windows, since_ns: int) -> None:
        self._windows, self._since_ns = windows, since_ns
        self._sizes: tuple[Any, Any] | None = None

    def observe(self, told: Told) -> None:
        if self._sizes is None and len(told) and int(told.packets.ts_ns.max()) >= self._since_ns:
            counts = self._windows.state.senders.cycles.stream_counts
            self._sizes = counts.cycles.copy(), counts.torn.copy()

    def of(self, streams: Sequence[int]) -> tuple[int, int]:
        """Return cycles and torn ones of the stream that counts for some."""
        if self._sizes is None:
            return 0, 0
        counts = self._windows.state.senders.cycles.stream_counts
        first = min(streams, key=lambda stream: int(counts.last_frame[stream]))
        cycles, torn = self._sizes
        return (int(cycles[first]), int(torn[first])) if first < len(cycles) else (0, 0)


def _begin_ns(source: Source, warmup_ns: int) -> int | None:
    """Return when rules begin to be judged; None for the first frame."""
    if not warmup_ns:
        return None
    if not isinstance(source, FileSource):
        raise UsageError("warmup counts from the first frame, and needs files", next_step="leave it out of [defaults]")
    first_ns = source.first_ts_ns()
    return None if first_ns is None else first_ns + warmup_ns


def _evidence(
    inquiry: Inquiry, scene: Scene, counted: _Counted, state: TrackerState, frames: FirstFrames
) -> Evidence:  # fmt: skip
    project, known, since_ns = inquiry.project, scene.snapshot, counted.since_ns
    summary = counted.summary(scene)
    keys = {one.number: one.key for one in summary.lists} | {one.number: one.key for one in summary.can.lists}
    names = {key: entry.name for key, entry in project.definition.by_key().items() if entry.name}
    drops = sum(info.drops or 0 for info in known.infos)
    truncated = next((info.truncation.message for info in known.infos if info.truncation), "")
    begin_ns = known.summary.start_ns if since_ns is None else since_ns
    happened = known.happened
    causes = [one for one in (happened.causes if happened else ()) if _counts(one.until_ns, since_ns)]
    findings = [one for one in known.findings if _counts(one.last_ns, since_ns)]

    def matching(expression: str) -> Sequence[Finding | Cause]:
        own = scene.filter(expression)
        of_findings, of_causes = own.shown()
        every = happened.causes if happened else ()
        found: list[Finding | Cause] = (
            [known.findings[number] for number in sorted(of_findings)] if own.findings else []
        )
        found += [every[number] for number in sorted(of_causes)] if own.causes else []
        kept = {id(one) for one in (*causes, *findings)}
        return [one for one in found if id(one) in kept]

    return Evidence(
        summary, list(subjects(summary)), keys, names, findings, causes, frames, project, counted.cycles(state),
        matching, begin_ns, known.summary.end_ns, drops, truncated,
    )  # fmt: skip


def _counts(until_ns: int | None, since_ns: int | None) -> bool:
    """Tell whether what went on up to a time, None: up to the end, goes on behind the warm-up."""
    return since_ns is None or until_ns is None or until_ns >= since_ns


def _decided(watched: _Watched, known: Evidence) -> Decided:
    rule = watched.rule
    if watched.reason:
        return Decided(rule, Verdict.INCONCLUSIVE, [Judged(Verdict.INCONCLUSIVE, reason=watched.reason)])
    lists, unknown = chosen(rule.lists, _keys(known), known.names)
    told = {**rule.parameters, "watched": watched.watcher, "list_named": bool(rule.lists)}
    judged = list(rule.check.judge(known, lists, told)) if lists or not rule.lists else []
    for name in unknown:
        # What has to be absent is, as long as it is told by what is on the wire and not by a name.
        on_the_wire = _ON_THE_WIRE.fullmatch(name) is not None
        verdict = Verdict.PASS if rule.check.name == "absent" and on_the_wire else Verdict.INCONCLUSIVE
        judged.append(Judged(verdict, reason=f"no list is called {name}", vacuous=on_the_wire))
    if not judged:
        judged = [Judged(Verdict.INCONCLUSIVE, reason="nothing was there to be judged", vacuous=True)]
    if rule.optional:
        judged = [replace(one, verdict=Verdict.PASS) if one.vacuous else one for one in judged]
    return Decided(rule, worst_of(judged), judged)


def _keys(known: Evidence) -> Sequence[ListKey]:
    """Return the lists that came, and those that are defined for one place."""
    return list(dict.fromkeys((*known.keys.values(), *(key for key in known.names if key.port))))


def _tell_of_unknown(rules: Sequence[_Watched], known: Evidence) -> None:
    """Raise Mistakes where rules name lists that neither definitions nor captures know, if definitions are given."""
    if not known.project.definition.by_key():
        return
    mistakes: list[ConfigurationError] = []
    for one in rules:
        _, unknown = chosen(one.rule.lists, _keys(known), known.names)
        for name in unknown:
            if (one.rule.check.name == "absent" or one.rule.optional) and _ON_THE_WIRE.fullmatch(name):
                continue
            error = UsageError(
                f"no list is called '{name}', neither by definitions nor in the capture",
                next_step=f"there are {', '.join(sorted(set(known.names.values()))[:6])}" if known.names else "",
            )
            mistakes.append(one.rule.mistake(error, "list"))
    if mistakes:
        raise Mistakes(mistakes)
