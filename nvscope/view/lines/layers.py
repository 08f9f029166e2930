"""The layers of one packet, from the link to UDP or TCP: which header is where.

For looking at a packet. What reads all packets at once is ``dissectors.link``; the tables are the same.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from dissectors.batch import LinkType
from dissectors.headers import ETHERNET, IPV4, IPV6, NULL, SLL, SLL2, TCP, UDP, UPPER_PDU_TAG, VLAN, VLAN_TYPES
from dissectors.layout import Layout
from dissectors.link import MAX_VLAN_TAGS

_LINK_LAYOUTS: dict[int, Layout] = {
    LinkType.ETHERNET: ETHERNET,
    LinkType.LINUX_SLL: SLL,
    LinkType.LINUX_SLL2: SLL2,
    LinkType.NULL: NULL,
    LinkType.LOOP: NULL,
}


class Layer(Struct, frozen=True):
    """A header within a packet, from ``start`` up to ``stop``; without a layout: options, or what is not read here."""

    layout: Layout | None
    start: int
    stop: int


def layers_of_datagram(packet: bytes, link: int, payload_at: int) -> list[Layer]:
    """Return the headers of a UDP datagram whose payload begins at ``payload_at`` of the packet, without gaps."""
    udp_at = payload_at - UDP.size_bytes
    return [*layers_up_to(packet, link, udp_at), Layer(UDP, udp_at, payload_at)]


def layers_of_segment(packet: bytes, link: int, tcp_at: int, payload_at: int) -> list[Layer]:
    """Return the headers of a TCP segment whose header begins at ``tcp_at``, its data at ``payload_at``, without gaps.

    The header was captured whole, its options perhaps not.
    """
    options_at = tcp_at + TCP.size_bytes
    found = [*layers_up_to(packet, link, tcp_at), Layer(TCP, tcp_at, options_at)]
    if options_at < payload_at:
        found.append(Layer(None, options_at, payload_at))
    return found


def layers_up_to(packet: bytes, link: int, transport_at: int) -> list[Layer]:
    """Return the headers of an IP packet in front of its transport header."""
    found = link_layers(packet, link, transport_at)
    at = found[-1].stop if found else 0
    if at < transport_at:
        layout = IPV6 if packet[at] >> 4 == 6 else IPV4
        stop = min(at + layout.size_bytes, transport_at)
        found.append(Layer(layout if stop - at == layout.size_bytes else None, at, stop))
        if stop < transport_at:
            found.append(Layer(None, stop, transport_at))
    return found


def link_layers(packet: bytes, link: int, stop: int) -> list[Layer]:
    """Return the headers of the link layer of a packet, as far as they end at ``stop`` or before."""
    found: list[Layer] = []
    at = 0
    if link == LinkType.UPPER_PDU and stop > UPPER_PDU_TAG.size_bytes:
        # The first of its tags, and the others.
        return [
            Layer(UPPER_PDU_TAG, 0, UPPER_PDU_TAG.size_bytes),
            Layer(None, UPPER_PDU_TAG.size_bytes, stop),
        ]
    for layout in _up_to_ip(packet, link):
        if at + layout.size_bytes > stop:
            break
        found.append(Layer(layout, at, at + layout.size_bytes))
        at += layout.size_bytes
    return found


def values(packet: bytes, layer: Layer) -> np.void:
    """Return the fields of a layer that has a layout."""
    assert layer.layout
    found: np.void = np.frombuffer(packet, layer.layout.dtype, 1, layer.start)[0]
    return found


def _up_to_ip(packet: bytes, link: int) -> Iterator[Layout]:
    layout = _LINK_LAYOUTS.get(link)
    if layout is None:
        return
    yield layout
    at = 0
    for _ in range(MAX_VLAN_TAGS):
        if layout is NULL or _ethertype(packet, layout, at) not in VLAN_TYPES:
            return
        at += layout.size_bytes
        layout = VLAN
        yield layout


def _ethertype(packet: bytes, layout: Layout, at: int) -> int:
    entry = layout["type"]
    begin = at + layout.offset_of("type")
    return int.from_bytes(packet[begin : begin + entry.size_bytes], "big")
