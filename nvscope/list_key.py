"""The key of a list: what it is sent over, and its identifier there.

A list on UDP is told by port and Index, one on CAN by channel and COB-ID, the identifier of its first frame. What is
special about a transport stands here: who adds one begins with a word in ``Transport`` and a way to make its keys.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import NamedTuple, TypeVar

from dissectors.can.pdo import EXTENDED
from dissectors.carried import Carrier

Port = int | str
"""A UDP port, or the name of a CAN channel."""

ANY_CHANNEL = ""
"""In place of a channel's name: the list is defined for whichever it is sent over."""

Value = TypeVar("Value")


class Transport(StrEnum):
    """What a list is sent over, by the word that reports and keys have for it."""

    UDP = "udp"
    CAN = "can"


class ListKey(NamedTuple):
    """What a list is told by on the wire; keys sort by transport, port or channel, and identifier.

    ``port`` is a UDP port, or the name of a CAN channel, ``ANY_CHANNEL`` in definitions only. ``identifier`` is the
    Index, or the COB-ID, with ``EXTENDED`` where it is one of 29 bits. Its text is what reports in JSON call the
    list: udp/1202/7, can/can0/385, can/can0/419430401x; an x marks extended identifiers, * any channel. What people
    read has COB-IDs in hexadecimal (``nvscope.units.list_key``).
    """

    transport: Transport
    port: Port
    identifier: int

    @classmethod
    def udp(cls, port: int, index: int) -> ListKey:
        """Return the key of a list on UDP."""
        return cls(Transport.UDP, port, index)

    @classmethod
    def can(cls, channel: str, cob_id: int) -> ListKey:
        """Return the key of a list on CAN, or of one frame of it."""
        return cls(Transport.CAN, channel, cob_id)

    @classmethod
    def of(cls, carrier: Carrier, port: int, identifier: int, channel: Callable[[int], str]) -> ListKey:
        """Return the key of a list as the dissectors tell it; ``channel`` knows what CAN channels are called."""
        return cls.can(channel(port), identifier) if carrier is Carrier.CAN else cls.udp(port, identifier)

    def __str__(self) -> str:
        extended = self.transport is Transport.CAN and self.identifier & EXTENDED
        identifier = f"{self.identifier & ~EXTENDED}x" if extended else str(self.identifier)
        return f"{self.transport}/{'*' if self.port == ANY_CHANNEL else self.port}/{identifier}"

    @property
    def on_any_channel(self) -> ListKey:
        """The key that this list has where it is defined for any channel; of one that is not on CAN, its own."""
        return ListKey.can(ANY_CHANNEL, self.identifier) if self.transport is Transport.CAN else self


def told_of(table: Mapping[ListKey, Value], key: ListKey) -> Value | None:
    """Return what a table has for a list: on CAN for its channel, else for any channel."""
    found = table.get(key)
    return table.get(key.on_any_channel) if found is None else found
