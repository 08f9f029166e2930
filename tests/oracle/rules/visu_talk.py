"""What is known of a connection between a WebVisu and its controller, of what waits there, and of what was written."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

from tests.oracle.frame import Address as Node
from tests.oracle.rules.http import Reader
from tests.oracle.rules.http_message import Message
from tests.oracle.rules.streams_state import Connection, End
from tests.oracle.rules.visu_body import Asked
from tests.oracle.rules.visu_turns import Turns

Pair = tuple[Node, Node, int]
"""Client, server, port."""
Home = tuple[Node, int]
"""A controller: its address, and its port where that is neither 80 nor 8080, or another one is there on the other."""


class Told(NamedTuple):
    """A whole request or reply of WebVisu, and the frame with which it was there."""

    frame: int
    source: End
    destination: End
    kind: str
    body: bytes


@dataclass
class Written:
    """A variable that was written: when, by whom, over which value (None: nobody knows), and what became of it."""

    time: int
    frame: int
    pair: Pair
    variable: str
    old: str | None
    new: str | None
    outcome: str = "open"
    answer: int | None = None
    status: int | None = None


@dataclass
class Waiting:
    """A request that waits for its response: what it asks for, None where it is cut or none of WebVisu's."""

    asked: Asked | None
    message: Message
    frame: int
    writes: list[Written]
    part: bool = False
    """Whether it is one of a page of which the client sent no more than a part."""
    acknowledged: int | None = None
    """Up to where the client had acknowledged then, if it says so in the frame with which the request was whole."""
    asked_at: int = 0
    """Which one it is of all that happened to values."""
    home: Home | None = None
    """Which controller it was sent to, as far as that was known then."""
    is_behind: bool = False
    """Whether bytes of the server are missing that the client had then."""


class Talk:
    """What is known of one connection."""

    def __init__(self, connection: Connection, happened: Counter[str]) -> None:
        (client, _), (server, port) = connection.client, connection.server
        self.pair: Pair = (client, server, port)
        self.home: Home = (server, 0 if port in (80, 8080) else port)
        self.connection = connection
        self.waiting: list[Waiting] = []
        self.had_request = False
        self.gap_bytes: Counter[bool] = Counter()  # by whether they are the client's
        self.unseen: int | None = None  # where bytes are missing that may be a request which is not answered yet
        self.forgotten = False
        """Whether the response that is being received answers nobody."""
        self.wary = False
        """Whether the client lost step before the server said anything."""
        self.broken_off = False
        """Whether the client broke the connection off."""
        self.early: list[Message] = []  # responses to requests that are being received, or still to come
        self.torn = False  # whether bytes of the server are missing behind these
        self.turns = Turns()
        self.readers: dict[bool, Reader] = {}
        self.closed: int | None = None  # when the client closed its side
        self.others: Counter[bool] = Counter()  # bytes that came again as others, by whether the client sent them
        self.others_ask = False
        self.happened = happened

    def reader(self, from_client: bool) -> Reader:
        """Return the reader of a direction; it is there from the first that the direction delivers."""
        if from_client not in self.readers:
            in_step = self.connection.directions[from_client].began_with_syn
            reader = Reader(not from_client, in_step, self.first_is_head, self.happened)
            if self.wary:
                reader.be_wary()
            self.readers[from_client] = reader
        return self.readers[from_client]

    def be_wary(self) -> None:
        """Take that the client lost step: what the server says may answer HEAD, which nobody saw."""
        if self.connection.directions[False].begin is not None:
            self.wary = True
        if False in self.readers:
            self.readers[False].be_wary()

    def first_is_head(self) -> bool:
        if self.forgotten:
            return False
        if self.waiting:
            return self.waiting[0].message.method == b"HEAD"
        asks = self.readers.get(True)
        if asks is None or asks.head is None or (self.early and self.early[0].told is None):
            return False
        return asks.head.message.method == b"HEAD"
