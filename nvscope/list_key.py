"""The key of a list: what it is sent over, and its identifier there.

A list on UDP is told by port and Index, one on CAN by channel and COB-ID, the identifier of its first frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from dissectors.can.pdo import EXTENDED

Port = int | str
"""A UDP port, or the name of a CAN channel; "" is any channel."""

ListKey = tuple[Port, int]
"""What a list is sent over, and its identifier: Index, or COB-ID, with ``EXTENDED`` where it is one of 29 bits."""

ANY_CHANNEL = ""

Told = TypeVar("Told")


def list_key(port: Port, index: int) -> str:
    """Return the key of a list as people and reports name it: udp/1202/7, can/can0/385, can/can0/419430401x.

    An x marks extended identifiers, * any channel.
    """
    if isinstance(port, int):
        return f"udp/{port}/{index}"
    return f"can/{port or '*'}/{index & ~EXTENDED}{'x' if index & EXTENDED else ''}"


def list_order(key: ListKey) -> tuple[str, Port, int]:
    """Return what lists are sorted by: transport, port or channel, identifier."""
    port, index = key
    return "udp" if isinstance(port, int) else "can", port, index


def told_of(table: Mapping[ListKey, Told], key: ListKey) -> Told | None:
    """Return what a table has for a list: on CAN for its channel, else for any channel."""
    found = table.get(key)
    return table.get((ANY_CHANNEL, key[1])) if found is None and isinstance(key[0], str) else found
