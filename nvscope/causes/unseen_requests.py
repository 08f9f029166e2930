"""Replies of the Parameter Manager to requests that the capture does not have: capture-incomplete."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.asked_partners import asking_nodes
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.incomplete import CAPTURE_INCOMPLETE
from nvscope.engine.runs import distinct
from nvscope.enumeration import first_few
from nvscope.findings.kind import Severity
from nvscope.findings.parameter import SDO_UNEXPECTED_REPLY
from nvscope.tracker.parameter.events import place_of
from nvscope.units import count_of

NEXT_WITHOUT_REQUESTS = (
    "Capture what goes to a controller, too: a mirror port of both directions. Who was written to is told by NV962 and "
    "`nvscope packets -Y sdo.write`; the values are in the requests."
)
NEXT_AT_THE_BEGIN = "Nothing: whoever begins to capture while others speak sees such replies."


def judge_unseen_requests(case: Case) -> Iterator[Explained]:
    """Explain replies of pairs of which no request was captured, and those at the begin, to requests before it."""
    known = case.facts.state.parameters.known
    chosen = case.free(SDO_UNEXPECTED_REPLY) & (case.symptoms.since_ns == case.symptoms.time_ns)
    if known is None or not chosen.any():
        return
    behind = chosen & (case.symptoms.time_ns - case.start_ns > known.timeout_ns)
    at_begin = np.zeros(len(chosen), np.bool_)
    asking = {(one.requester, one.partner) for one in case.facts.summary.parameters if one.requests}
    ends: dict[tuple[str, str], None] = {}
    without = np.zeros(len(chosen), np.bool_)
    for place in distinct(case.symptoms.finding[chosen]).tolist():
        own = chosen & (case.symptoms.finding == place)
        one = case.findings[place]
        if not (own & behind).any():
            # Who asks for a parameter waits for its reply: several are no matter of the begin.
            at_begin |= own & (np.count_nonzero(own) == 1)
        elif one.node is not None:
            pair = case.facts.address(one.node), place_of(one.variable).partner
            if pair not in asking:
                without |= own
                ends[pair] = None
    if ends:
        yield _without_requests(case, [*ends], without), without
    if at_begin.any():
        yield _at_the_begin(case, at_begin), at_begin


def _without_requests(case: Case, ends: list[tuple[str, str]], own: Bool) -> Draft:
    requesters, partners = (first_few([*dict.fromkeys(side)]) for side in zip(*ends, strict=True))
    times = case.symptoms.time_ns[own]
    replies = count_of(len(times), "reply", "replies")
    return Draft(
        CAPTURE_INCOMPLETE, f"The capture has {replies} of {partners} to {requesters}, and no whole request to them",
        NEXT_WITHOUT_REQUESTS, ["of the Parameter Manager: what was asked for, and the values that are written"],
        nodes=asking_nodes(case, own), since_ns=int(times.min()), until_ns=case.end_of(times),
    )  # fmt: skip


def _at_the_begin(case: Case, own: Bool) -> Draft:
    times = case.symptoms.time_ns[own]
    what = "a request of the Parameter Manager and its reply"
    if len(times) > 1:
        what = f"{count_of(len(times), 'request')} of the Parameter Manager and their replies"
    return Draft(
        CAPTURE_INCOMPLETE, f"The capture begins between {what}", NEXT_AT_THE_BEGIN,
        ["within the timeout of its first frame, what was asked for before may be answered"],
        nodes=asking_nodes(case, own), since_ns=int(times.min()), until_ns=int(times.max()),
        at_most=Severity.NOTE,
    )  # fmt: skip
