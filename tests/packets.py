"""Frames of tests as packet batches, and what the product makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dissectors.batch import PacketBatch
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.oracle.frame import Frame


def batch_of(frames: Sequence[Frame]) -> PacketBatch:
    """Return frames as one batch over a buffer that ends with the last of them."""
    data = np.frombuffer(b"".join(frame.data for frame in frames), np.uint8)
    captured = np.array([len(frame.data) for frame in frames], np.int64)
    return PacketBatch(
        data,
        np.cumsum(captured) - captured,
        captured.astype(np.int32),
        np.array([frame.original for frame in frames], np.int64),
        np.array([frame.ts_ns for frame in frames], np.int64),
        np.array([frame.link for frame in frames], np.uint16),
    )


def tracked(batches: Iterable[PacketBatch]) -> TrackerState:
    """Return the state after some batches."""
    state = TrackerState()
    for batch in batches:
        state.observe(batch)
    return state


def document_of(state: TrackerState) -> dict[str, Any]:
    """Return the report of a state as data, without sources."""
    summary = summarize(state)
    return report_document(state, summary, judge(state, summary=summary), [])
