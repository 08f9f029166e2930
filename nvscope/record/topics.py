"""Topics of a recording: for each list that is defined, its variables as JSON, which other tools plot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nvscope.capture.mcap.sink import TopicSink
from nvscope.capture.spans import stretches
from nvscope.definition.layouts import Layouts
from nvscope.engine.told import Told
from nvscope.list_key import ANY_CHANNEL, ListKey
from nvscope.record.list_messages import TelegramMessages, list_schema
from nvscope.units import list_key
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams

MAX_ELEMENTS = 10_000
"""A list with more elements has no topic: a message of it would be larger than many packets."""

_PIECE_BYTES = 4 << 20


def topic_of(key: ListKey) -> str:
    """Return the name of the topic of a list: ``/nv/udp/1202/7``, ``/nv/can/can0/0x181``."""
    return f"/nv/{list_key(str(key))}"


class _Topic(NamedTuple):
    """Of which list it is, the name of its definition, and what its messages look like."""

    key: ListKey
    title: str
    schema: bytes


class ListTopics:
    """The messages of the lists of ``layouts``; ``left_out`` are those that are too large."""

    def __init__(self, layouts: Layouts) -> None:
        keys = [key for key, _ in layouts.lists()]
        sizes = {key: _elements(layouts, key) for key in keys}
        self.left_out = [key for key in keys if sizes[key] > MAX_ELEMENTS]
        keys = [key for key in keys if 0 < sizes[key] <= MAX_ELEMENTS]
        self._telegrams = DefinedTelegrams(layouts, keys=keys)
        self._topics = [_topic(layouts, key) for key in keys]
        self._messages = [TelegramMessages(place) for place in self._telegrams.places]
        self._declared: dict[ListKey, str] = {}

    def declare(self, sink: TopicSink) -> None:
        """Have all topics in a file: those without a telegram show what is missing.

        Of a list that is defined for any channel, which these are is known when it comes.
        """
        self._declared = {}
        for topic in self._topics:
            if topic.key.port != ANY_CHANNEL:
                self._name(sink, topic, topic.key)

    def _name(self, sink: TopicSink, topic: _Topic, key: ListKey) -> str:
        """Return the name of the topic of a list; the file has it then."""
        if key not in self._declared:
            self._declared[key] = topic_of(key)
            sink.topic(self._declared[key], topic.title, topic.schema)
        return self._declared[key]

    def observe(self, told: Told) -> None:
        """Take a batch, whose messages are asked for next."""
        self._telegrams.observe(told)

    def write(self, sink: TopicSink, first_frame: int, behind_frame: int) -> None:
        """Write the messages of some frames of the batch."""
        rows = self._telegrams.rows
        begin, end = np.searchsorted(rows.frame, [first_frame, behind_frame]).tolist()
        if begin == end:
            return
        rows = rows.take(slice(begin, end))
        for piece in stretches(rows.size_bytes, len(rows), _PIECE_BYTES):
            own = rows.take(piece)
            sink.messages(*self._of(sink, own), own.frame, own.ts_ns)

    def _of(self, sink: TopicSink, rows: DefinedRows) -> tuple[list[str], list[bytes]]:
        """Return the topics and the messages of telegrams, in their order."""
        senders = self._telegrams.senders
        names, texts = [""] * len(rows), [b""] * len(rows)
        for place, which in rows.by_place():
            topic = self._topics[self._telegrams.places[place].number]
            own = rows.sender[which].tolist()
            # On CAN, it is the channel that is known of the sender.
            keys = {
                sender: topic.key._replace(port=senders[sender]) if topic.key.port == ANY_CHANNEL else topic.key
                for sender in set(own)
            }
            name_of = {sender: self._name(sink, topic, key) for sender, key in keys.items()}
            messages = self._messages[place].messages(rows, which, senders)
            for row, sender, text in zip(which.tolist(), own, messages, strict=True):
                names[row], texts[row] = name_of[sender], text
        return names, texts


def _elements(layouts: Layouts, key: ListKey) -> int:
    telegrams = [one for candidate in layouts.candidates_of(key) for one in candidate] or layouts.partly_of(key)
    return sum(len(one.elements) for one in telegrams)


def _topic(layouts: Layouts, key: ListKey) -> _Topic:
    definitions, has_rest = layouts.definitions_of(key), bool(layouts.partly_of(key))
    return _Topic(key, definitions[0].name, list_schema(definitions, has_rest=has_rest).encode())
