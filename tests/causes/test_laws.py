"""Laws of causes: each event has one, however the capture is cut, and nothing that is sent makes judging them fail."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.causes.case import NOBODY, Case
from nvscope.causes.judge import judged as explained
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.findings.facts import Facts
from nvscope.findings.judge import judge
from nvscope.findings.kind import Severity
from nvscope.tracker.evidence.witness import Witness
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from tests.engine.traffic import CHANNELS, traffic
from tests.laws import examples
from tests.oracle.traffic import generate, mutate
from tests.packets import Batches, batch_of, cut


def judged(batches: Sequence[PacketBatch]) -> Case:
    """Return what all judges have explained of some traffic."""
    witness = Witness()
    state = TrackerState(listeners=(witness,))
    for _ in run(Batches(list(batches), CHANNELS), Reading(), [state, witness]):
        pass
    summary = summarize(state)
    findings = judge(state, summary=summary)
    facts = Facts(state, summary, (), summary.capture.at_ns or 0)
    return explained(facts, findings, witness, CHANNELS)


def told(case: Case) -> list[Any]:
    """Return causes with their findings as values that can be compared."""
    return [
        (
            cause.kind.name, cause.severity, cause.title, cause.checked, cause.lists,
            [case.address(node) for node in cause.nodes], cause.channel, cause.since_ns, cause.until_ns, cause.frames,
            cause.count, sorted((finding.code, finding.message) for finding in cause.findings),
        )
        for cause in case.causes()
    ]  # fmt: skip


def check(case: Case) -> None:
    symptoms = case.symptoms
    for place, finding in enumerate(case.findings):
        own = symptoms.finding == place
        assert own.any(), "a finding without an event"
        if finding.kind.severity > Severity.NOTE:
            assert (case.owner[own] != NOBODY).all(), (finding.code, finding.message)
    causes = case.causes()
    listed = Counter(id(finding) for cause in causes for finding in cause.findings)
    assert not listed or max(listed.values()) == 1
    rows = np.concatenate([draft.rows for draft in case.drafts] or [np.empty(0, np.int64)])
    assert len(np.unique(rows)) == len(rows)
    for cause in causes:
        assert cause.title
        assert cause.next
        assert cause.severity >= cause.kind.at_least
        assert cause.until_ns is None or cause.since_ns is None or cause.since_ns <= cause.until_ns


@given(st.integers(0, 10_000), st.booleans())
@examples(120)
def test_each_event_behind_an_error_or_warning_has_one_cause(seed: int, damaged: bool) -> None:
    frames = generate(seed, frames=200, link=None)
    check(judged([batch_of(mutate(seed, frames) if damaged else frames)]))


@given(st.integers(0, 10_000))
@examples(60)
def test_on_can_too(seed: int) -> None:
    check(judged(traffic(seed)))


@given(st.integers(0, 10_000), st.integers(1, 90))
@examples(60)
def test_any_cut_gives_the_same_causes(seed: int, packets: int) -> None:
    whole = batch_of(generate(seed, frames=150, link=None))
    assert told(judged(cut(whole, packets))) == told(judged([whole]))
