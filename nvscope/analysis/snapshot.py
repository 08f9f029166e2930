"""Snapshot: what is known at a moment, as a frozen value that screens, reports and rules look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nvscope.capture.source import Source, SourceInfo
from nvscope.definition.defined_pdos import pdos_of
from nvscope.definition.project import Project
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.protocols.protocol import Protocol
from nvscope.protocols.table import PROTOCOLS, judges_of
from nvscope.tracker.counted import Counted
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary, summarize

if TYPE_CHECKING:
    from nvscope.definition.pdos import Pdos


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What follows from all that was observed up to ``at_ns``, what is wrong with it, and what its sources say.

    ``at_ns`` is None where nothing was observed yet. The difference of two snapshots' ``figures`` is what was counted
    between them; None where nobody asked for them.
    """

    summary: Summary
    findings: Sequence[Finding]
    infos: Sequence[SourceInfo]
    at_ns: int | None
    figures: Counted | None = None


def snapshot(
    state: TrackerState, source: Source, project: Project, pdos: Pdos | None = None, *, overdue: bool = False,
    protocols: Sequence[Protocol] = PROTOCOLS, figures: bool = False,
) -> Snapshot:  # fmt: skip
    """Look at a state; nothing in it changes.

    ``pdos`` are those of the project, where they are known already. ``overdue``: what nobody answered in time counts,
    frame or not. ``protocols`` are those that are judged. ``figures``: what was counted is wanted too, so that it can
    be compared with that of other moments.
    """
    definition = project.definition
    pdos = pdos or pdos_of(definition)
    cob_ids = pdos.cob_ids if pdos else frozenset[int]()
    summary = summarize(
        state, intervals_ns=definition.nominal_intervals_ns(), readers=project.readers, buses=project.buses,
        cob_ids=cob_ids,
    )  # fmt: skip
    infos = tuple(source.infos)
    at_ns = summary.capture.at_ns
    findings = judge(
        state, infos, summary=summary, at_ns=at_ns if overdue else None, limits=project.limits, definition=definition,
        judges=judges_of(protocols, state),
    )  # fmt: skip
    return Snapshot(summary, tuple(findings), infos, at_ns, Counted.of(state) if figures else None)
