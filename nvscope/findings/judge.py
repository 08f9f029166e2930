"""judge: from what is on the wire, what should be, and a time, to findings; a pure function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nvscope.capture.source import SourceInfo
from nvscope.definition.limits import Limits
from nvscope.findings.alike import taken_together
from nvscope.findings.answers import judge_answers
from nvscope.findings.can import judge_can
from nvscope.findings.can_bus import judge_buses
from nvscope.findings.capture import judge_capture
from nvscope.findings.cob_ids import judge_cob_ids
from nvscope.findings.consistency import judge_consistency
from nvscope.findings.counter_takeovers import judge_takeovers
from nvscope.findings.definition import judge_definition
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.findings.header import judge_headers
from nvscope.findings.loss import judge_loss
from nvscope.findings.parameter import judge_parameters
from nvscope.findings.scans import judge_scans
from nvscope.findings.security import judge_security
from nvscope.findings.subnets import judge_subnets
from nvscope.findings.timing import judge_timing
from nvscope.findings.unallowed_writes import judge_writes
from nvscope.list_key import Transport
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import ListSummary, Summary, summarize

if TYPE_CHECKING:
    from nvscope.definition.model import Definition
    from nvscope.definition.project_nodes import Node
    from nvscope.definition.project_security import Security
    from nvscope.tracker.evidence.witness import Witness

Judge = Callable[[Facts], Iterable[Finding]]

JUDGES: tuple[Judge, ...] = (
    judge_headers, judge_loss, judge_answers, judge_consistency, judge_definition, judge_timing, judge_cob_ids,
    judge_can, judge_buses, judge_parameters, judge_security, judge_writes,
    judge_takeovers, judge_subnets, judge_scans, judge_capture,
)  # fmt: skip


def judge(
    state: TrackerState,
    sources: Sequence[SourceInfo] = (),
    *,
    summary: Summary | None = None,
    at_ns: int | None = None,
    limits: Limits | None = None,
    definition: Definition | None = None,
    judges: Sequence[Judge] = (),
    nodes: Mapping[str, Node] = MappingProxyType({}),
    security: Security | None = None,
    witness: Witness | None = None,
) -> list[Finding]:
    """Return the findings on a state: worst first, then by code, list, node and SubIndex.

    ``at_ns`` is the time to judge at: then what is overdue counts, too. By default it is the latest time that is known
    to have passed, and what waits at the end stays open. ``definition`` is what should be on the wire. A ``summary``
    that is given is to know of its intervals too. ``judges`` judge beside those that always do. ``nodes`` and
    ``security`` are what the project says, ``witness`` who else observed, as in ``Facts``.
    """
    summary = summary or summarize(state, intervals_ns=definition.nominal_intervals_ns() if definition else {})
    now = summary.capture.at_ns if at_ns is None else at_ns
    facts = Facts(
        state, summary, sources, now or 0, limits or Limits(), definition, at_ns is not None, nodes, security, witness
    )
    found = [finding for judge_some in (*JUDGES, *judges) for finding in judge_some(facts)]
    everything: list[ListSummary | CanListSummary] = [*summary.can.lists, *summary.lists]
    places = {entry.number: entry.key for entry in everything}
    found = taken_together(found, places)

    def order(finding: Finding) -> tuple[Any, ...]:
        key = finding.key if finding.list_number is None else places[finding.list_number]
        place: tuple[Any, ...] = (Transport.CAN, finding.channel) if finding.channel else ()
        place = place if key is None else key
        node = () if finding.node is None else summary.address_order[finding.node]
        subindex = -1 if finding.subindex is None else finding.subindex
        return -finding.kind.severity, finding.code, place, node, subindex, finding.variable

    return sorted(found, key=order)
