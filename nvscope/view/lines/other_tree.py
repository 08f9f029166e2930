"""The tree of a frame in which nothing is found that is looked for: its headers, ARP, ICMP, the rest as bytes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from ipaddress import IPv4Address

import numpy as np

from dissectors.batch import I64, U8
from dissectors.headers import ARP, TCP, TYPE_IPV4, UDP
from dissectors.icmp import ICMP, ICMPV6
from dissectors.other_frames import FrameKind, OtherBatch
from nvscope.units import count_of
from nvscope.view.lines.layers import Layer, layers_of_datagram, layers_of_segment, layers_up_to, link_layers
from nvscope.view.lines.message_tree import table_entries
from nvscope.view.lines.other_words import words_of
from nvscope.view.lines.page_bytes import may_hold_pages
from nvscope.view.lines.shown import HIDDEN_BYTES, Spans, Wording
from nvscope.view.lines.table import Cell, Tone
from nvscope.view.lines.tree_lines import Entry, Place, bytes_entries, title_entry, trailer_entries
from nvscope.view.rows.frames import OTHER, FrameRows

_OFFSET_AT = TCP.offset_of("offset")
_ARP_FIXED = (1, TYPE_IPV4, 6, 4)
_LAYOUTS = {FrameKind.ARP: ARP, FrameKind.ICMP: ICMP, FrameKind.ICMPV6: ICMPV6}
_IN_IP = frozenset(kind for kind in FrameKind if kind > FrameKind.ARP)


def _ipv4(number: int) -> str:
    return str(IPv4Address(number))


class OtherTree:
    """A ``Tree``."""

    def __init__(self, rows: FrameRows, wording: Wording, *, dumps: bool) -> None:
        found = rows.parts[OTHER]
        self._frames: OtherBatch = found.part
        own = found.positions(len(rows))
        packet_at = rows.packets.offset[rows.row[own]]
        self._start, self._stop = self._frames.at - packet_at, self._frames.end - packet_at
        self._transport_bytes = _transport_bytes(self._frames, rows.packets.data)
        self._words = words_of(rows.part(own))
        self._dumps = dumps
        ports = frozenset() if wording.secrets else frozenset(wording.page_ports)
        self._hidden = may_hold_pages(self._frames, rows.packets.data, ports)

    def spans(self, place: int) -> Spans:
        start, stop = int(self._start[place] + self._transport_bytes[place]), int(self._stop[place])
        layout = _LAYOUTS.get(self._kind(place))
        data = min(start + (layout.size_bytes if layout else 0), stop)
        if self._hidden[place] and data < stop:
            return Spans(data, data, stop, hidden=True)
        return Spans(start, data, stop)

    def layers(self, place: int, packet: bytes, link: int) -> Sequence[Layer]:
        start, kind, fault = int(self._start[place]), self._kind(place), bool(self._frames.fault[place])
        if kind is FrameKind.UDP and not fault:
            return layers_of_datagram(packet, link, start + UDP.size_bytes)
        if kind is FrameKind.TCP and not fault:
            return layers_of_segment(packet, link, start, start + int(self._transport_bytes[place]))
        if kind in _IN_IP and not (kind is FrameKind.IP and fault):
            return layers_up_to(packet, link, start)
        return link_layers(packet, link, start)

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        start, stop = int(self._start[place]), int(self._stop[place])
        kind, words = self._kind(place), self._words[place]
        tone = words.tone if words.tone is not Tone.PLAIN else Tone.FAINT
        yield title_entry(words.protocol, [Cell(f"  {words.info}", tone)], Place(start, stop))
        layout = _LAYOUTS.get(kind)
        if layout is ARP and not _is_usual(packet[start:stop]):
            layout = None
        if layout is not None:
            tell = {"sender": _ipv4, "target": _ipv4} if layout is ARP else {}
            yield from table_entries(layout, packet, start, stop, tell)
        begin = start + (layout.size_bytes if layout else int(self._transport_bytes[place]))
        if begin < stop:
            hidden = bool(self._hidden[place])
            facts = [Cell(f"  {count_of(stop - begin, 'byte')}{', ' + HIDDEN_BYTES if hidden else ''}")]
            yield from bytes_entries("Data", facts, packet[begin:stop], begin, dumps=self._dumps and not hidden)
        yield from trailer_entries(packet, stop, dumps=self._dumps)

    def _kind(self, place: int) -> FrameKind:
        return FrameKind(int(self._frames.kind[place]))


def _transport_bytes(frames: OtherBatch, data: U8) -> I64:
    """Return how much of the headers of UDP and TCP was captured; 0 where there is none, or one that is broken."""
    size = np.zeros(len(frames), np.int64)
    size[(frames.kind == FrameKind.UDP) & ~frames.fault] = UDP.size_bytes
    tcp = np.flatnonzero((frames.kind == FrameKind.TCP) & ~frames.fault)
    size[tcp] = (data[frames.at[tcp] + _OFFSET_AT] >> 4).astype(np.int64) * 4
    captured: I64 = np.minimum(size, frames.end - frames.at)
    return captured


def _is_usual(message: bytes) -> bool:
    """Tell whether an ARP message is of the usual shape: IPv4 over Ethernet."""
    fixed = (
        int.from_bytes(message[:2], "big"), int.from_bytes(message[2:4], "big"), *message[4:6],
    )  # fmt: skip
    return fixed == _ARP_FIXED
