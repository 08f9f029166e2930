"""Topics of transactions: ``/sdo/SERVER/PORT`` of the Parameter Manager, ``/visu/SERVER/PORT`` of web visualization."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import Bool
from nvscope.analysis.transactions.parameter_transactions import ParameterTransactions
from nvscope.analysis.transactions.transaction import Brought, Outcome, Pair, Transaction
from nvscope.analysis.transactions.visu_transactions import VisuTransactions
from nvscope.capture.mcap.sink import TopicSink
from nvscope.engine.told import Told
from nvscope.record.transaction_messages import ROOM, transaction_message, transaction_schema

if TYPE_CHECKING:
    from nvscope.definition.parameters import Parameters

MOST_SERVERS = 1_000
"""So many servers of a protocol have a topic of their own; the others share one."""

_OTHERS = "others"
_MOST_ASKED = 1 << 16


class TransactionTopics:
    """The messages of transactions; a topic is there from its first message on.

    What is known without a packet, as time has passed, goes with the next packet; behind the last one it is nowhere.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        self._sources = ParameterTransactions(parameters, ROOM), VisuTransactions(ROOM)
        self._declared: set[str] = set()
        self._topics: dict[tuple[str, str, int], str] = {}
        self._servers: Counter[str] = Counter()
        self._asked: set[int] = set()  # frames of requests that were chosen
        self._waiting: list[Transaction] = []

    def declare(self, sink: TopicSink) -> None:
        """Begin a file: it has no topic yet."""
        self._declared = set()

    def observe(self, told: Told) -> None:
        """Take a batch, whose messages are asked for next: those of frames that the filter chooses, or of all."""
        for source in self._sources:
            brought = source.of(told)
            self._waiting += brought.transactions if told.chosen is None else self._chosen(told, told.chosen, brought)
        self._waiting.sort(key=lambda one: one.known_frame)

    def _chosen(self, told: Told, chosen: Bool, brought: Brought) -> Iterator[Transaction]:
        """Yield what is told of chosen frames; what nobody answered is told of the request."""
        if len(self._asked) > _MOST_ASKED:
            self._asked.clear()
        self._asked.update((brought.row[chosen[brought.row]] + told.first_frame).tolist())
        for one in brought.transactions:
            is_asked = one.asked_frame in self._asked
            if one.outcome is not Outcome.OPEN:
                self._asked.discard(one.asked_frame or 0)
            if is_asked if one.outcome is Outcome.UNANSWERED else chosen[one.known_frame - told.first_frame]:
                yield one

    def write(self, sink: TopicSink, first_frame: int, behind_frame: int) -> None:
        """Write the messages of what is known with frames up to one."""
        ready: list[Transaction] = []
        for one in self._waiting:
            if one.known_frame >= behind_frame:
                break
            ready.append(one)
        if ready:
            del self._waiting[: len(ready)]
            self._write(sink, ready)

    def _write(self, sink: TopicSink, ready: Sequence[Transaction]) -> None:
        names = [self._topic(sink, one.pair) for one in ready]
        numbers = np.array([one.frame for one in ready], np.int64)
        times_ns = np.array([one.time_ns for one in ready], np.int64)
        sink.messages(names, [transaction_message(one) for one in ready], numbers, times_ns)

    def _topic(self, sink: TopicSink, pair: Pair) -> str:
        """Return the name of the topic of a pair; the file has it then."""
        key = pair.protocol.value, pair.server, pair.port
        name = self._topics.get(key)
        if name is None:
            protocol, server, port = key
            if self._servers[protocol] < MOST_SERVERS:
                self._servers[protocol] += 1
                name = self._topics[key] = f"/{protocol}/{server}/{port}"
            else:
                name = f"/{protocol}/{_OTHERS}"
        if name not in self._declared:
            self._declared.add(name)
            title = f"nvscope.{pair.protocol.value}"
            sink.topic(name, title, transaction_schema(title).encode())
        return name
