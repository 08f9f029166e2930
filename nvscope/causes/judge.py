"""judged: from findings, their events, and who was there, to what happened; a pure function."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType

from nvscope.capture.source import any_live
from nvscope.causes.addresses import judge_duplicate_addresses
from nvscope.causes.buses import (
    judge_bus_errors,
    judge_buses_off,
    judge_incomplete_cycles,
    judge_overloads,
)
from nvscope.causes.case import Case, Explained
from nvscope.causes.counters import judge_foreign_counters
from nvscope.causes.definitions import judge_differing_definitions
from nvscope.causes.elsewhere import judge_definitions_elsewhere
from nvscope.causes.further_readers import judge_further_readers
from nvscope.causes.headers import judge_foreign_headers
from nvscope.causes.identifiers import judge_collisions
from nvscope.causes.impossible import judge_impossible
from nvscope.causes.incomplete import judge_incomplete_captures
from nvscope.causes.interleaved import judge_interleaved
from nvscope.causes.lateness import judge_bursts, judge_late_senders
from nvscope.causes.losses import judge_losses_at_senders, judge_losses_of_lists
from nvscope.causes.many_partners import judge_many_refused, judge_many_unanswered
from nvscope.causes.not_found import judge_readers_not_found
from nvscope.causes.other import judge_others, judge_rest
from nvscope.causes.parameters import judge_refused_parameters, judge_unanswered_parameters
from nvscope.causes.paths import judge_two_paths
from nvscope.causes.readers import (
    judge_boot_up,
    judge_rejections,
    judge_silent_readers,
    judge_without_program,
)
from nvscope.causes.recording import judge_clock_steps, judge_mirroring
from nvscope.causes.refusals import judge_refusals
from nvscope.causes.restarts import judge_list_restarts, judge_node_restarts
from nvscope.causes.scans import judge_scanned_lists
from nvscope.causes.senders import judge_second_senders
from nvscope.causes.silences import NODE_SILENT, PROGRAM_STOPPED, judge_lists, judge_nodes
from nvscope.causes.snapped import judge_cut_frames, judge_cut_pages, judge_drops
from nvscope.causes.standstills import judge_standstills
from nvscope.causes.unplugged import judge_without_carrier
from nvscope.causes.unseen_requests import judge_unseen_requests
from nvscope.causes.unseen_restarts import judge_unseen_restarts
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.tracker.evidence.witness import Witness

Judge = Callable[[Case], Iterator[Explained]]

JUDGES: tuple[Judge, ...] = (
    judge_without_carrier,
    judge_incomplete_captures,
    judge_drops,
    judge_cut_frames,
    judge_cut_pages,
    judge_mirroring,
    judge_clock_steps,
    judge_standstills,
    judge_buses_off,
    judge_bus_errors,
    judge_overloads,
    judge_duplicate_addresses,
    judge_second_senders,
    judge_collisions,
    judge_interleaved,
    judge_foreign_headers,
    judge_foreign_counters,
    judge_unseen_restarts,
    judge_two_paths,
    judge_node_restarts,
    partial(judge_nodes, kind=NODE_SILENT),
    partial(judge_nodes, kind=PROGRAM_STOPPED),
    judge_list_restarts,
    judge_lists,
    judge_definitions_elsewhere,
    judge_differing_definitions,
    judge_rejections,
    judge_without_program,
    judge_impossible,
    judge_silent_readers,
    judge_readers_not_found,
    judge_scanned_lists,
    judge_boot_up,
    judge_many_unanswered,
    judge_unanswered_parameters,
    judge_unseen_requests,
    judge_many_refused,
    judge_refused_parameters,
    judge_losses_at_senders,
    judge_losses_of_lists,
    judge_late_senders,
    judge_bursts,
    judge_incomplete_cycles,
    judge_further_readers,
    judge_refusals,
    judge_others,
)
"""In the order of causes.md, section 2: an event belongs to the first one that explains it."""


MOST_CAUSES, MOST_CAUSES_LIVE = 10_000, 1000
"""So many are told one by one, of captures and of what goes on: each takes time, and made-up ones have no end."""


def judged(
    facts: Facts, findings: Sequence[Finding], witness: Witness, channels: Sequence[str] = (),
    names: Mapping[str, str] = MappingProxyType({}), clock: Callable[[int], str] | None = None,
) -> Case:  # fmt: skip
    """Return the case of some findings, with everything explained.

    ``channels`` are those of CAN by number; ``names`` are those of nodes, by the text of their address; ``clock`` is
    as for ``Case``.
    """
    case = Case(facts, findings, witness, channels, names, clock)
    most = MOST_CAUSES_LIVE if any_live(facts.sources) else MOST_CAUSES
    for draft, chosen in _explained(case):
        case.explain(draft, chosen)
        if len(case.drafts) >= most:
            for rest in judge_rest(case):
                case.explain(*rest)
            break
    return case


def _explained(case: Case) -> Iterator[Explained]:
    """Yield what happened; what a judge finds next hangs on what was explained before."""
    for judge in JUDGES:
        yield from judge(case)
