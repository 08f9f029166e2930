"""Which streams should have come again by now, at the moment of a look."""

from __future__ import annotations

from functools import cached_property

from nvscope.analysis.traced_telegrams import SILENT_PERCENT
from nvscope.list_key import ListKey
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.summary import ListSummary
from nvscope.tui.look import Look
from nvscope.view.lines.variable_rows import StreamKey


class Silences:
    """What is known of how often streams come; of no look, nothing."""

    def __init__(self, look: Look | None) -> None:
        self._look = look

    @cached_property
    def _lists(self) -> dict[ListKey, CanListSummary | ListSummary]:
        return {} if self._look is None else {entry.key: entry for entry in self._look.entries}

    def nominal_ns(self, key: StreamKey) -> int | None:
        """Return at which interval a stream should come, None where nobody knows."""
        entry = self._lists.get(key.list)
        if entry is None or self._look is None:
            return None
        addresses = self._look.scene.snapshot.summary.addresses
        for stream in entry.streams:
            if stream.subindex == key.subindex and (stream.node is None or addresses[stream.node] == key.sender):
                return stream.intervals.nominal
        return None

    def silent_ns(self, key: StreamKey, last_ns: int) -> int | None:
        """Return for how long nothing came of a stream that should have come twice since, None where that is not so."""
        nominal_ns = self.nominal_ns(key)
        if not nominal_ns or self._look is None:
            return None
        passed_ns = self._look.now_ns - last_ns
        return passed_ns if passed_ns * 100 > nominal_ns * SILENT_PERCENT else None
