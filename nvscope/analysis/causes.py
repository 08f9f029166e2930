"""What happened in captures: the causes behind their findings."""

from __future__ import annotations

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.snapshot import snapshot
from nvscope.causes.cause import Cause
from nvscope.causes.judge import judge_causes
from nvscope.findings.facts import Facts
from nvscope.tracker.evidence.witness import Witness
from nvscope.tracker.summary import Summary


def causes_of(inquiry: Inquiry) -> tuple[Summary, list[Cause]]:
    """Return what explains the findings on captures, and the summary whose nodes causes know by number.

    The captures are read for it. All telegrams count, whatever a filter chooses.
    """
    witness = Witness()
    source, state = inquiry.open(), inquiry.state(listeners=(witness,))
    for _ in inquiry.run(source, [state, witness]):
        pass
    project = inquiry.project
    found = snapshot(state, source, project, inquiry.pdos, protocols=inquiry.protocols)
    facts = Facts(state, found.summary, found.infos, found.at_ns or 0, project.limits, project.definition)
    return found.summary, judge_causes(facts, found.findings, witness, source.channels)
