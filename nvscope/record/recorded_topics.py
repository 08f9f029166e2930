"""All topics of a recording that go with its packets, written beside these."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from dissectors.batch import I64, PacketBatch
from nvscope.capture.mcap.sink import TopicSink
from nvscope.capture.spans import stretches
from nvscope.engine.told import Told
from nvscope.record.topics import ListTopics
from nvscope.record.transaction_topics import TransactionTopics

if TYPE_CHECKING:
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.model import Definition
    from nvscope.definition.parameters import Parameters

_PIECE_ROWS, _PIECE_BYTES = 8192, 4 << 20


class TopicPart(Protocol):
    """Some topics, whose messages are of frames."""

    def declare(self, sink: TopicSink) -> None:
        """Begin a file: it has no topic yet."""
        ...

    def observe(self, told: Told) -> None:
        """Take a batch, whose messages are asked for next."""
        ...

    def write(self, sink: TopicSink, first_frame: int, behind_frame: int) -> None:
        """Write the messages of some frames of the batch; all stretches of it are asked for in their order."""
        ...


class RecordedTopics:
    """The topics of the lists that are defined, and of transactions, together.

    What it observes is one stretch of frames, which may go to several files.
    """

    def __init__(self, lists: ListTopics | None, parameters: Parameters | None) -> None:
        self._lists, self._parameters = lists, parameters
        transactions = TransactionTopics(parameters)
        self._parts: Sequence[TopicPart] = (transactions,) if lists is None else (lists, transactions)

    @staticmethod
    def of(definition: Definition, layouts: Layouts | None) -> RecordedTopics:
        """Return those of a project."""
        return RecordedTopics(None if layouts is None else ListTopics(layouts), definition.parameters)

    def anew(self) -> RecordedTopics:
        """Return the same for another stretch of frames: nothing is known of what was open, or said, before."""
        return RecordedTopics(self._lists, self._parameters)

    def declare(self, sink: TopicSink) -> None:
        """Have those topics in a file of which it is known beforehand that they are there."""
        for part in self._parts:
            part.declare(sink)

    def observe(self, told: Told) -> None:
        """Take a batch, whose messages are asked for next."""
        for part in self._parts:
            part.observe(told)

    def write_with(self, sink: TopicSink, packets: PacketBatch, frame: I64) -> None:
        """Write packets of the batch, which have these numbers, and the messages of theirs, in the order of time.

        Both go piece by piece: what waits for its packets is in memory.
        """
        for rows in stretches(packets.captured, _PIECE_ROWS, _PIECE_BYTES):
            for part in self._parts:
                part.write(sink, int(frame[rows.start]), int(frame[rows.stop - 1]) + 1)
            sink.write(packets[rows])
