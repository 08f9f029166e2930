"""NodeStream: a stream with its list, as causes look at what a node sends, and Pause: when nothing came of one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from nvscope.tracker.stream_summary import StreamSummary
from nvscope.tracker.summary import ListSummary


class Pause(NamedTuple):
    """A time in which a stream sent nothing, or a node: from its last telegram, the frame ``frame``, to the next one.

    ``until_ns`` is None where none came any more.
    """

    since_ns: int
    until_ns: int | None
    frame: int


class NodeStream(NamedTuple):
    """A stream of a node with its list."""

    list: ListSummary
    stream: StreamSummary

    @property
    def nominal_ns(self) -> int:
        """Its nominal interval, 0 where it has none."""
        return self.stream.intervals.nominal or 0


def lists_of_streams(streams: Iterable[NodeStream]) -> list[ListSummary]:
    """Return the lists that some streams are of, each once."""
    return list({one.list.number: one.list for one in streams}.values())
