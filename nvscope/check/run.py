"""Judges rules on captures: one reading of them, and each rule by itself."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, Watched, Watching
from nvscope.capture.source import FileSource, Source, SourceInfo
from nvscope.check.check import Evidence, Setting
from nvscope.check.first_frames import FirstFrames
from nvscope.check.lists import chosen
from nvscope.check.rules import Rule, Rules
from nvscope.check.verdict import Judged, Verdict, worst_of
from nvscope.errors import UsageError
from nvscope.list_key import ListKey
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
    names: dict[ListKey, str]

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return self.scene.snapshot.infos

    def of(self, verdict: Verdict) -> Sequence[Decided]:
        """Return the rules with a verdict."""
        return [one for one in self.decided if one.verdict is verdict]


def checked(inquiry: Inquiry, rules: Rules, source: Source | None = None) -> Checked:
    """Judge rules on captures, or on the ``source`` that is open already. Raises what reading it raises."""
    source = source or inquiry.open()
    since_ns = _begin_ns(source, rules.warmup_ns)
    frames = FirstFrames(since_ns)
    windows = Windows(_FOREVER_NS, since_ns, listeners=(frames,))
    setting = Setting(inquiry.project.definition.nominal_intervals_ns(), since_ns)
    watchers = [rule.check.watch and rule.check.watch(setting, rule.parameters) for rule in rules.rules]
    others = [windows, *(one for one in watchers if one is not None)]
    watched = Watched(inquiry, windows.cut(source), Watching(_RING_BYTES, others=others), overdue=False)
    for _ in inquiry.run(watched.source, watched.observers):
        pass
    scene = watched.look()
    evidence, names = _evidence(inquiry, scene, windows, frames, since_ns)
    decided = [
        _decided(rule, evidence, {**rule.parameters, "watched": one})
        for rule, one in zip(rules.rules, watchers, strict=True)
    ]
    return Checked(decided, scene, names)


def _begin_ns(source: Source, warmup_ns: int) -> int | None:
    """Return when rules begin to be judged; None for the first frame."""
    if not warmup_ns:
        return None
    if not isinstance(source, FileSource):
        raise UsageError("warmup counts from the first frame, and needs files", next_step="leave it out of [defaults]")
    first_ns = source.first_ts_ns()
    return None if first_ns is None else first_ns + warmup_ns


def _evidence(
    inquiry: Inquiry, scene: Scene, windows: Windows, frames: FirstFrames, since_ns: int | None
) -> tuple[Evidence, dict[ListKey, str]]:  # fmt: skip
    project, known, window = inquiry.project, scene.snapshot, windows.open()
    summary = known.summary if window is None else window.counted.summary(
        intervals_ns=project.definition.nominal_intervals_ns(), readers=project.readers, buses=project.buses,
        cob_ids=inquiry.pdos.cob_ids if inquiry.pdos else frozenset(),
    )  # fmt: skip
    keys = {one.number: one.key for one in summary.lists} | {one.number: one.key for one in summary.can.lists}
    names = {key: entry.name for key, entry in project.definition.by_key().items() if entry.name}
    drops = sum(info.drops or 0 for info in known.infos)
    truncated = next((info.truncation.message for info in known.infos if info.truncation), "")
    begin_ns = known.summary.start_ns if since_ns is None else since_ns
    happened = known.happened
    evidence = Evidence(
        summary, list(subjects(summary)), keys, names, known.findings, happened.causes if happened else (), frames,
        project, begin_ns, known.summary.end_ns, drops, truncated,
    )  # fmt: skip
    return evidence, names


def _decided(rule: Rule, known: Evidence, told: Mapping[str, Any]) -> Decided:
    keys = dict.fromkeys((*known.keys.values(), *(key for key in known.names if key.port)))
    lists, unknown = chosen(rule.lists, keys, known.names)
    judged = list(rule.check.judge(known, lists, told)) if lists or not rule.lists else []
    for name in unknown:
        # What has to be absent is, as long as it is told by what is on the wire and not by a name.
        is_fine = rule.check.name == "absent" and _ON_THE_WIRE.fullmatch(name) is not None
        verdict = Verdict.PASS if is_fine else Verdict.INCONCLUSIVE
        judged.append(Judged(verdict, reason=f"no list is called {name}"))
    if not judged:
        verdict = Verdict.PASS if rule.optional else Verdict.INCONCLUSIVE
        judged = [Judged(verdict, reason="nothing was there to be judged")]
    return Decided(rule, worst_of(judged), judged)
