"""Snapshot: what is known at a moment, as a frozen value that screens, reports and rules look at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from msgspec import Struct

from nvscope.capture.source import Source, SourceInfo, any_live
from nvscope.definition.defined_pdos import pdos_of
from nvscope.definition.project import Project
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.protocols.protocol import Protocol
from nvscope.protocols.table import PROTOCOLS, judges_of
from nvscope.tracker.counted import Counted
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary, summarize

if TYPE_CHECKING:
    from nvscope.causes.cause import Cause
    from nvscope.causes.chronicle import Chronicle
    from nvscope.definition.pdos import Pdos
    from nvscope.tracker.evidence.witness import Witness


class Happenings(Struct, frozen=True):
    """What happened: the causes behind findings, those that are over too, and what each list did when.

    ``left_out`` is how many events and frames there was no room for, so that no cause is told by them.
    """

    causes: Sequence[Cause]
    chronicle: Chronicle
    left_out: int = 0


class Snapshot(Struct, frozen=True):
    """What follows from all that was observed up to ``at_ns``, what is wrong with it, and what its sources say.

    ``at_ns`` is None where nothing was observed yet. The difference of two snapshots' ``figures`` is what was counted
    between them; ``happened`` is why findings are there. None where nobody asked for them.
    """

    summary: Summary
    findings: Sequence[Finding]
    infos: Sequence[SourceInfo]
    at_ns: int | None
    figures: Counted | None = None
    happened: Happenings | None = None


def snapshot(
    state: TrackerState, source: Source, project: Project, pdos: Pdos | None = None, *, overdue: bool = False,
    protocols: Sequence[Protocol] = PROTOCOLS, figures: bool = False, witness: Witness | None = None,
    causes: bool = True, node_names: Mapping[str, str] | None = None, clock: Callable[[int], str] | None = None,
) -> Snapshot:  # fmt: skip
    """Look at a state; nothing in it changes.

    ``pdos`` are those of the project, where they are known already. ``overdue``: what nobody answered in time counts,
    frame or not, as it does of live sources. ``protocols`` are those that are judged. ``figures``: what was counted is
    wanted too, so that it can be compared with that of other moments. ``witness`` has observed what the state did, and
    listened to it: what only it knows is judged too, and ``causes``, where they are wanted, are told by it; these tell
    nodes by ``node_names``, else by those of the project, and moments by the ``clock``, else since the beginning.
    """
    definition = project.definition
    pdos = pdos or pdos_of(definition)
    cob_ids = pdos.cob_ids if pdos else frozenset[int]()
    summary = summarize(
        state, intervals_ns=definition.nominal_intervals_ns(), readers=project.readers, buses=project.buses,
        cob_ids=cob_ids,
    )  # fmt: skip
    infos = tuple(source.infos)
    overdue = overdue or any_live(infos)
    at_ns = summary.capture.at_ns
    if witness is not None:
        witness.settle()
    findings = judge(
        state, infos, summary=summary, at_ns=at_ns if overdue else None, limits=project.limits, definition=definition,
        judges=judges_of(protocols, state), nodes=project.nodes, security=project.security, witness=witness,
    )  # fmt: skip
    happened = None
    if witness is not None and causes:
        facts = Facts(
            state, summary, infos, at_ns or 0, project.limits, definition, overdue, project.nodes, project.security,
            witness,
        )  # fmt: skip
        names = project.node_names if node_names is None else node_names
        happened = _happenings(facts, findings, witness, source.channels, names, clock)
    return Snapshot(summary, tuple(findings), infos, at_ns, Counted.of(state) if figures else None, happened)


def _happenings(
    facts: Facts, findings: Sequence[Finding], witness: Witness, channels: Sequence[str], names: Mapping[str, str],
    clock: Callable[[int], str] | None,
) -> Happenings:  # fmt: skip
    # Who asks for findings alone need not import what judges causes.
    from nvscope.causes.chronicle import chronicle_of  # noqa: PLC0415
    from nvscope.causes.judge import judged  # noqa: PLC0415

    case = judged(facts, findings, witness, channels, names, clock)
    return Happenings(case.causes(), chronicle_of(case), witness.left_out)
