"""What telegrams, streams and events are told apart by."""

from __future__ import annotations

from typing import NamedTuple

from tests.oracle.frame import Address


class ListKey(NamedTuple):
    transport: str
    port: int
    list_id: int

    def __str__(self) -> str:
        return f"{self.transport}/{self.port}/{self.list_id}"


class StreamKey(NamedTuple):
    node: Address
    list_key: ListKey
    subindex: int


class Moment(NamedTuple):
    """When something happened: the time, and the 1-based number of the frame."""

    time: int
    frame: int


def node_order(node: Address | None) -> tuple[int, int]:
    """Order addresses by number, IPv4 before IPv6, nothing at all before both."""
    return (0, 0) if node is None else (node.version, int(node))
