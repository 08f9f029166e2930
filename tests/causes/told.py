"""What happened in captures: the causes behind their findings."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from nvscope.tracker.summary import Summary


def causes_of(inquiry: Inquiry) -> tuple[Summary, Sequence[Cause]]:
    """Return what explains the findings on captures, and the summary whose nodes causes know by number.

    The captures are read for it. All telegrams count, whatever a filter chooses.
    """
    found = inquiry.analyze(causes=True)
    assert found.happened is not None
    return found.summary, found.happened.causes
