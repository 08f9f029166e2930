"""PairColumns: how many requests of web visualization pages there were, and what became of them, by who asked whom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.webvisu import Request
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.visu.messages import Kind, Outcome, VisuMessages


class PairColumns(KeyedColumns):
    """One row a client, server and port: what became of its requests."""

    connections: I64
    reads: I64
    writes: I64
    entries: I64
    variables: I64
    replies: I64
    refused: I64
    unanswered: I64
    cut: I64
    gap_bytes: I64
    miscounted: I64
    ambiguous: I64
    other_bytes: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1)
        for name in (
            "connections", "reads", "writes", "entries", "variables", "replies", "refused", "unanswered", "cut",
            "gap_bytes", "miscounted", "ambiguous", "other_bytes",
        )
    }  # fmt: skip

    def count(self, pair: I64, messages: VisuMessages, requests: Sequence[Request]) -> None:
        """Count messages, each of a row, but for which variables they are about."""
        kind, asked = messages.kind, messages.asked
        for name, where in (
            ("connections", messages.opens), ("reads", kind == Kind.READ), ("replies", kind == Kind.REPLY),
        ):  # fmt: skip
            np.add.at(getattr(self, name), pair[where], 1)
        asks = (kind == Kind.READ) | (kind == Kind.WRITE)
        entries = np.array([len(one.entries) for one in requests], np.int64)
        np.add.at(self.entries, pair[asks], entries[asked[asks]])
        miscounted = np.array([one.is_miscounted for one in requests], np.bool_)
        ambiguous = np.array([one.ambiguous for one in requests], np.bool_)
        for name, some in (("miscounted", miscounted), ("ambiguous", ambiguous)):
            if some.any():
                np.add.at(getattr(self, name), pair[asks][some[asked[asks]]], 1)
        lacks = np.flatnonzero(messages.gap_bytes)
        np.add.at(self.gap_bytes, pair[lacks], messages.gap_bytes[lacks])
        # Most messages are reads and good replies: of them, that is all there is to count.
        rest = np.flatnonzero((kind != Kind.READ) & ((kind != Kind.REPLY) | (messages.outcome != Outcome.DONE)))
        writes = np.array([one.writes for one in requests], np.bool_)
        self._count_others(pair[rest], messages.take(rest), writes)

    def _count_others(self, pair: I64, messages: VisuMessages, writes: Bool) -> None:
        """Count messages that are neither reads nor good replies; ``writes`` tells which requests do."""
        kind, outcome = messages.kind, messages.outcome
        for name, where in (
            ("writes", kind == Kind.WRITE), ("unanswered", kind == Kind.UNANSWERED), ("cut", kind == Kind.CUT),
            ("miscounted", outcome == Outcome.MISCOUNTED),
            ("ambiguous", (outcome == Outcome.AMBIGUOUS) | (kind == Kind.UNBOUNDED)),
        ):  # fmt: skip
            np.add.at(getattr(self, name), pair[where], 1)
        others = (kind == Kind.OTHER_BYTES) | (kind == Kind.OTHER_REPLY_BYTES)
        np.add.at(self.other_bytes, pair[others], messages.fields[others])
        not_done = (outcome == Outcome.REFUSED) | (outcome == Outcome.STATUS)
        refused = np.flatnonzero(((kind == Kind.REPLY) | (kind == Kind.REFUSED)) & not_done)
        np.add.at(self.refused, pair[refused], writes[messages.asked[refused]])
