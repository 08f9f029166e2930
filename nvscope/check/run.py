"""Judges rules on captures: one reading of them, and each rule by itself."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, Watched, Watching
from nvscope.capture.begun import begun
from nvscope.capture.source import Source, SourceInfo, any_live
from nvscope.causes.cause import Cause
from nvscope.check.asked_rows import AskedRows
from nvscope.check.check import Evidence, Setting
from nvscope.check.condition import compiled
from nvscope.check.deciding import Decided, WatchedRule, called_lists, decided, tell_of_unknown, unknown_lists
from nvscope.check.lists import CalledLists
from nvscope.check.read_variables import are_all_read
from nvscope.check.rules import Mistakes, Rule, Rules
from nvscope.check.stage import Stage, StageKey, as_of_all, stage_of
from nvscope.check.verdict import Verdict
from nvscope.engine.run import Observer, run
from nvscope.errors import ConfigurationError, UsageError
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey
from nvscope.tracker.state import TrackerState
from nvscope.tracker.subjects import subjects
from nvscope.tracker.visu.on_demand import OTHERS

_RING_BYTES = 0
_LOOK_S = 1.0
_OF_ANSWERS = ("acknowledged", "boot_up")


class Checked(Struct, frozen=True):
    """All rules with their verdicts, in the order of their files, and what was known at the end."""

    decided: Sequence[Decided]
    scene: Scene
    known: Evidence

    @property
    def names(self) -> Mapping[ListKey, str]:
        """What lists are called."""
        return self.known.names

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return self.scene.snapshot.infos

    def of(self, verdict: Verdict) -> Sequence[Decided]:
        """Return the rules with a verdict."""
        return [one for one in self.decided if one.verdict is verdict]


class Judging(Struct, frozen=True):
    """How rules are judged: ``ring_bytes`` of the last frames are kept; with ``fast``, the first failure ends it.

    That is a rule of severity error that is broken by what came so far, looked at each second of our time.
    """

    ring_bytes: int = _RING_BYTES
    fast: bool = False


def checked(inquiry: Inquiry, rules: Rules, how: Judging | None = None) -> Checked:
    """Judge rules on captures.

    Raises what reading them raises, and Mistakes where a rule asks for what nothing is called, though definitions are
    given that say what there is.
    """
    how = how or Judging()
    # What is wrong is told before anything is waited for.
    try:
        watched = watching(inquiry, rules, None)
    except Mistakes as error:
        raise Mistakes([*error.mistakes, *_lists_nowhere(inquiry, rules.rules)]) from None
    opened = inquiry.open()
    with inquiry.watch(opened) as progress:
        source, first_ns = opened, None
        if any(one.stage.warmup_ns for rule in watched for one in rule.each()):
            source, first_ns = begun(opened)
        if first_ns is not None:
            watched = watching(inquiry, rules, first_ns)
        judge = _Judge(inquiry, watched, source, first_ns, how)
        due_s = time.monotonic() + _LOOK_S
        for _ in run(judge.source, inquiry.reading(), judge.observers):
            progress()
            if how.fast and time.monotonic() >= due_s:
                if judge.is_broken():
                    opened.stop()
                due_s = time.monotonic() + _LOOK_S
    return judge.checked()


class _Judge:
    """What watches for all rules, and what is known of them at any time."""

    def __init__(
        self, inquiry: Inquiry, rules: Sequence[WatchedRule], source: Source, first_ns: int | None, how: Judging
    ) -> None:  # fmt: skip
        self._inquiry = inquiry
        self._rules = rules
        every = [one for rule in self._rules for one in rule.each()]
        # Several rules may have a watcher in common.
        watchers: dict[StageKey, dict[int, Observer]] = {one.stage: {} for one in every}
        for one in every:
            if one.watcher is not None:
                watchers[one.stage][id(one.watcher)] = one.watcher
        self._stages: dict[StageKey, Stage] = {}
        # One state can tell what it has counted since one moment; who wants another one has a state of its own.
        cut = next((key for key in watchers if key.patience_ns is None and key.warmup_ns), None)
        for key, own in watchers.items():
            since_ns = first_ns + key.warmup_ns if first_ns is not None and key.warmup_ns else None
            shared = key.patience_ns is None and (not key.warmup_ns or key == cut)
            self._stages[key] = Stage(inquiry, key, since_ns, list(own.values()), shared=shared)
        stages = list(self._stages.values())
        listeners = [one for stage in stages if stage.is_shared for one in stage.listeners]
        others = Watching(how.ring_bytes, listeners=listeners)
        self._watched = Watched(inquiry, source, others, overdue=any_live(source.infos))
        for stage in stages:
            stage.look_at(self._watched.state)
            source = stage.cut(source)
        self.source = source
        self.observers = [*self._watched.observers, *(one for stage in stages for one in stage.observers)]

    def is_broken(self) -> bool:
        """Tell whether a rule of severity error is broken by now, and not only since something may still come."""
        evidence = self._evidence(self._look())
        called = called_lists(next(iter(evidence.values())))
        return any(
            one.rule.severity == "error" and decided(one, evidence, called).verdict is Verdict.FAIL
            for one in self._rules
            if one.rule.parameters.get("within", 0) is not None
        )

    def checked(self) -> Checked:
        """Return all verdicts."""
        scene = self._look()
        evidence = self._evidence(scene)
        known = next(iter(evidence.values()))
        called = called_lists(known)
        found = [decided(one, evidence, called) for one in self._rules]
        tell_of_unknown(self._rules, known, called)
        return Checked(found, scene, known)

    def _look(self) -> Scene:
        with as_of_all(list(self._stages.values())):
            return self._watched.look()

    def _evidence(self, scene: Scene) -> Mapping[StageKey, Evidence]:
        return {key: _evidence(self._inquiry, scene, stage) for key, stage in self._stages.items()}


def watching(inquiry: Inquiry, rules: Rules, first_ns: int | None) -> list[WatchedRule]:
    """Return what watches for each rule of captures whose first frame came then; None: nobody knows yet, or asks.

    Mistakes with all that rules ask for and that there is not.
    """
    names = {key: entry.name for key, entry in inquiry.project.definition.by_key().items() if entry.name}
    setting = Setting(
        inquiry.project.definition.nominal_intervals_ns(), inquiry.fields, AskedRows(names), names, inquiry.layouts,
        since_ns=first_ns,
    )  # fmt: skip
    mistakes: list[ConfigurationError] = []
    found = _watching(inquiry, rules.rules, setting, mistakes)
    if mistakes:
        raise Mistakes(mistakes)
    return found


def _watching(
    inquiry: Inquiry, rules: Sequence[Rule], setting: Setting, mistakes: list[ConfigurationError]
) -> list[WatchedRule]:  # fmt: skip
    found = []
    for rule in rules:
        stage = stage_of(rule, inquiry)
        one = WatchedRule(rule, stage, inner=_watching(inquiry, rule.inner, setting, mistakes))
        found.append(one)
        first_ns = setting.since_ns
        own = replace(
            setting, lists=tuple(rule.lists), when=rule.when, common=setting.common.setdefault(stage, {}),
            since_ns=first_ns + stage.warmup_ns if first_ns is not None and stage.warmup_ns else None,
        )  # fmt: skip
        one_by_one = rule.check.needs_definitions and are_all_read(rule.parameters)
        if setting.layouts is None and not one_by_one and (rule.check.needs_definitions or rule.names_variables):
            one.reason = "no definition is given"
            continue
        wrong = list(_mistakes(rule, inquiry))
        mistakes += wrong
        try:
            one.watcher = rule.check.watch(own, rule.parameters) if rule.check.watch and not wrong else None
        except UsageError as error:
            mistakes.append(rule.mistake(error))
    return found


def further_mistakes(inquiry: Inquiry, rules: Rules) -> Iterator[ConfigurationError]:
    """Yield what is wrong beside mistakes that reading files has shown: expressions, and lists that captures lack.

    Captures are read for that if definitions are given, and they name no such list.
    """
    try:
        watching(inquiry, rules, None)
    except Mistakes as error:
        yield from error.mistakes
    for rule in rules.halves:
        yield from _mistakes(rule, inquiry)
    yield from _lists_nowhere(inquiry, [*rules.rules, *rules.halves])


def _lists_nowhere(inquiry: Inquiry, rules: Sequence[Rule]) -> Iterator[ConfigurationError]:
    """Yield a mistake for each list that neither definitions nor files have; these are read only if need be."""
    names = {key: entry.name for key, entry in inquiry.project.definition.by_key().items()}
    defined = CalledLists(names, names)
    if names and inquiry.paths and any(defined.chosen(rule.lists)[1] for rule in rules):
        state = inquiry.state()
        for _ in inquiry.run(inquiry.open(), [state]):
            pass
        came = [state.keys.list_key(number) for number in range(len(state.keys.lists))]
        yield from unknown_lists(rules, CalledLists(dict.fromkeys((*came, *names)), names), names)


def _mistakes(rule: Rule, inquiry: Inquiry) -> Iterator[ConfigurationError]:
    """Yield what is wrong with expressions of a rule; figures of windows are for its check to look at."""
    for key, text in rule.expressions.items():
        if key == "expr" and rule.parameters.get("window"):
            continue
        try:
            compiled(text, inquiry.fields)
        except UsageError as error:
            yield rule.mistake(error, key)


def _evidence(inquiry: Inquiry, scene: Scene, stage: Stage) -> Evidence:
    counted, frames = stage.counted, stage.frames
    project, known, since_ns = inquiry.project, scene.snapshot, counted.since_ns
    summary = counted.summary(scene)
    keys = {one.number: one.key for one in summary.lists} | {one.number: one.key for one in summary.can.lists}
    names = {key: entry.name for key, entry in project.definition.by_key().items() if entry.name}
    drops = sum(info.drops or 0 for info in known.infos)
    truncated = next((info.truncation.message for info in known.infos if info.truncation), "")
    begin_ns = known.summary.start_ns if since_ns is None else since_ns
    happened = known.happened
    causes = [one for one in (happened.causes if happened else ()) if _counts(_until_ns(one), since_ns)]
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
        summary, list(subjects(summary)), keys, names, findings, causes, frames, project, inquiry.pdos,
        matching, begin_ns, known.summary.end_ns, drops, truncated,
        [info.start_ns for info in known.infos if info.start_ns is not None], known.infos, counted.is_ahead,
        stage.telegrams.of, *_open_waits(stage.state, since_ns), stage.state.parameters.known,
        stage.state.parameters.known is not None or any(name != OTHERS for name in known.summary.others),
    )  # fmt: skip


def _open_waits(
    state: TrackerState, judged_ns: int | None
) -> tuple[Mapping[int, list[int]], Mapping[int, list[int]]]:  # fmt: skip
    """Return since when telegrams of lists wait to be acknowledged, and nodes for values, of those that are judged."""
    waits: dict[int, list[int]] = {}
    requests: dict[int, list[int]] = {}
    known = state.lists.acknowledgement
    stream = np.flatnonzero(known.waits.column("open"))
    lists = state.keys.described(stream)[0] if len(stream) else stream
    for number, since_ns in zip(lists.tolist(), known.waits.since_ns[stream].tolist(), strict=True):
        if judged_ns is not None and since_ns < judged_ns:
            continue
        waits.setdefault(number, []).append(since_ns)
    asked = known.boot_up_waits
    for number, deadline_ns in zip(asked.list.tolist(), asked.deadline_ns.tolist(), strict=True):
        if judged_ns is None or deadline_ns - known.timeout_ns >= judged_ns:
            requests.setdefault(number, []).append(deadline_ns - known.timeout_ns)
    return waits, requests


def _until_ns(cause: Cause) -> int | None:
    """Return up to when it is known to be so; None for up to the end."""
    return cause.last_ns if cause.until_ns is None and cause.kind.by_moments else cause.until_ns


def _counts(until_ns: int | None, since_ns: int | None) -> bool:
    """Tell whether what went on up to a time, None: up to the end, goes on behind the warm-up."""
    return since_ns is None or until_ns is None or until_ns >= since_ns
