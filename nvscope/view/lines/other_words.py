"""What frames are in words in which nothing is found that is looked for: protocol, and a few words on it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from dissectors import address
from dissectors.arp import OPERATIONS, REPLY, REQUEST
from dissectors.batch import LinkType
from dissectors.headers import NULL, TCP, UDP
from dissectors.icmp import IP_PROTOCOLS, IcmpBatch, Quoted, describe, quoted_in
from dissectors.other_frames import LEAST_TYPE, FrameKind, OtherBatch
from dissectors.transport import SegmentBatch
from nvscope.units import count_of
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells
from nvscope.view.lines.table import Tone
from nvscope.view.rows.frames import ICMP, ICMPV6, OTHER, FrameRows
from nvscope.view.rows.frames import TCP as OVER_TCP

ETHERTYPES = {
    0x0842: "Wake-on-LAN",
    0x8035: "RARP",
    0x809B: "AppleTalk",
    0x80F3: "AppleTalk ARP",
    0x8137: "IPX",
    0x8809: "LACP",
    0x8847: "MPLS",
    0x8863: "PPPoE",
    0x8864: "PPPoE",
    0x888E: "EAPOL",
    0x8892: "PROFINET",
    0x88A4: "EtherCAT",
    0x88AB: "POWERLINK",
    0x88B8: "GOOSE",
    0x88BA: "sampled values",
    0x88CC: "LLDP",
    0x88CD: "SERCOS III",
    0x88E3: "MRP",
    0x88E5: "MACsec",
    0x88F7: "PTP",
    0x88FB: "PRP",
    0x892F: "HSR",
    0x9000: "loopback test",
}
"""EtherTypes that have a name here (IEEE registration authority)."""

FAMILIES = {7: "OSI", 10: "IPv6 of Linux", 16: "AppleTalk", 23: "IPX"}
"""Address families of BSD's loopback that have a name here (LINKTYPE_NULL), and what Linux calls IPv6."""

COOKED = {1: "IEEE 802.3", 4: "IEEE 802.2"}
"""What cooked frames say in place of an EtherType (LINKTYPE_LINUX_SLL)."""

_WITH_FAMILY = frozenset({LinkType.NULL, LinkType.LOOP})
_MOST_FAMILY = 0xFFFF
_BROKEN = "header cut short, or contradicts itself"
_NOBODY = "0.0.0.0"


class Words(NamedTuple):
    """A protocol, and what a frame of it says."""

    protocol: str
    info: str
    tone: Tone = Tone.PLAIN


def words_of(rows: FrameRows) -> list[Words]:
    """Return what frames are, of rows that are all of no protocol that is looked for."""
    frames: OtherBatch = rows.parts[OTHER].part
    links = rows.packets.link[rows.row].tolist()
    transports = {FrameKind.UDP: _udp(rows), FrameKind.TCP: _tcp(rows)}
    arp, icmp = _arp(rows), {FrameKind.ICMP: _icmp(rows, ICMP), FrameKind.ICMPV6: _icmp(rows, ICMPV6)}
    columns = (
        links, frames.kind.tolist(), frames.ethertype.tolist(), frames.version.tolist(), frames.protocol.tolist(),
        (frames.end - frames.at).tolist(), frames.fault.tolist(), frames.at.tolist(),
    )  # fmt: skip
    told = []
    for row, (link, number, ethertype, version, protocol, size, fault, at) in enumerate(zip(*columns, strict=True)):
        kind = FrameKind(number)
        if kind is FrameKind.LINK:
            told.append(_of_link(link, size, rows.packets.data[at : at + NULL.size_bytes].tobytes(), fault=fault))
        elif kind is FrameKind.TYPE:
            told.append(_of_type(link, ethertype, size, fault=fault))
        elif kind is FrameKind.ARP:
            told.append(Words("ARP", _cut(arp.get(row, ""), fault=fault), _tone(fault=fault)))
        elif kind in icmp:
            name = "ICMP" if kind is FrameKind.ICMP else "ICMPv6"
            told.append(Words(name, _cut(icmp[kind].get(row, ""), fault=fault), _tone(fault=fault)))
        elif kind in transports:
            info = transports[kind].get(row, _BROKEN)
            told.append(Words(kind.name, info, _tone(fault=fault)))
        else:
            inside = IP_PROTOCOLS.get(protocol, f"protocol {protocol}") if protocol >= 0 else ""
            if kind is FrameKind.FRAGMENT:
                told.append(Words(f"IPv{version}", f"{f'{inside}, ' if inside else ''}a fragment, not put together"))
            elif fault:
                told.append(Words(f"IPv{version}", _BROKEN, Tone.WARNING))
            else:
                told.append(Words(f"IPv{version}", f"{inside}, {count_of(size, 'byte')}"))
    return told


def quoted_text(quoted: Quoted) -> str:
    """Return which packet it is: its protocol, and from where to where it went."""
    ends = [address.text(*quoted.source), address.text(*quoted.destination)]
    if quoted.ports is not None:
        ends = [
            f"[{text}]:{port}" if ":" in text else f"{text}:{port}"
            for text, port in zip(ends, quoted.ports, strict=True)
        ]
    return f"{IP_PROTOCOLS.get(quoted.protocol, f'protocol {quoted.protocol}')} {' → '.join(ends)}"


def icmp_text(message: bytes, *, is_ipv4: bool) -> str:
    """Return an ICMP message in words, with the packet that it is about."""
    quoted = quoted_in(message, is_ipv4=is_ipv4)
    text = describe(message, is_ipv4=is_ipv4)
    return f"{text} ({quoted_text(quoted)})" if quoted else text


def arp_text(operation: int, sender: str, sender_hardware: str, target: str) -> str:
    """Return an ARP message in words; addresses are "" where they are not known."""
    if operation == REQUEST and sender == target and target:
        return f"{target} is at {sender_hardware or '?'} (gratuitous)"
    if operation == REQUEST and target:
        return f"who has {target}? {'(probe)' if sender == _NOBODY else 'tell ' + (sender or '?')}"
    if operation == REPLY and sender:
        return f"{sender} is at {sender_hardware or '?'}{' (gratuitous)' if sender == target else ''}"
    return OPERATIONS.get(operation, f"operation {operation}")


def _cut(text: str, *, fault: bool) -> str:
    return ", ".join(part for part in (text, "cut short" if fault else "") if part)


def _tone(*, fault: bool) -> Tone:
    return Tone.WARNING if fault else Tone.PLAIN


def _of_link(link: int, size: int, head: bytes, *, fault: bool) -> Words:
    known = LinkType(link).name if link in set(LinkType) else ""
    counted = count_of(size, "byte")
    if fault or (link in _WITH_FAMILY and size < NULL.size_bytes) or (link == LinkType.RAW and not size):
        return Words("link", f"cut short: {counted}", Tone.WARNING)
    if link in _WITH_FAMILY:
        family = _family(link, head)
        return Words(FAMILIES.get(family, known), f"address family {family}, {counted}")
    if link == LinkType.RAW:
        return Words(known, f"neither IPv4 nor IPv6: version {head[0] >> 4}, {counted}")
    return Words(f"link type {link}", f"{f'{known}, ' if known else ''}{counted}, not read here")


def _family(link: int, head: bytes) -> int:
    """Return the address family: LOOP has it in network byte order, NULL in that of the capturing host."""
    little = int.from_bytes(head, "little")
    return little if link == LinkType.NULL and little <= _MOST_FAMILY else int.from_bytes(head, "big")


def _of_type(link: int, ethertype: int, size: int, *, fault: bool) -> Words:
    if fault:
        return Words("VLAN", "cut short in its tags, or too many of them", Tone.WARNING)
    if ethertype >= LEAST_TYPE:
        name = ETHERTYPES.get(ethertype, "")
        return Words(name or "EtherType", f"{'EtherType ' if name else ''}0x{ethertype:04x}, {count_of(size, 'byte')}")
    if link == LinkType.ETHERNET:
        return Words("IEEE 802.3", count_of(size, "byte"))
    return Words(COOKED.get(ethertype, "link"), f"protocol 0x{ethertype:04x}, {count_of(size, 'byte')}")


def _udp(rows: FrameRows) -> dict[int, str]:
    source, destination, length = (
        cells.texts(FIELDS[f"udp.{name}"], rows) for name in ("srcport", "dstport", "length")
    )
    return {
        row: f"{source[row]} → {destination[row]}, {count_of(int(length[row]) - UDP.size_bytes, 'byte')}"
        for row in range(len(rows))
        if source[row]
    }


def _tcp(rows: FrameRows) -> dict[int, str]:
    return dict(_segments(rows))


def _segments(rows: FrameRows) -> Iterator[tuple[int, str]]:
    found = rows.parts.get(OVER_TCP)
    if not found:
        return
    part: SegmentBatch = found.part
    columns = (found.positions(len(rows)), part.source_port, part.destination_port, part.flags, part.payload_bytes)
    for row, source, destination, flags, size in zip(*(column.tolist() for column in columns), strict=True):
        named = " ".join(bit.name.upper() for bit in TCP["flags"].bits if flags >> bit.position & 1)
        yield row, f"{source} → {destination}{f' [{named}]' if named else ''}, {count_of(size, 'byte')}"


def _icmp(rows: FrameRows, name: str) -> dict[int, str]:
    found = rows.parts.get(name)
    if not found:
        return {}
    part: IcmpBatch = found.part
    columns = (found.positions(len(rows)), part.at, part.end)
    return {
        row: icmp_text(rows.packets.data[at:end].tobytes(), is_ipv4=name == ICMP)
        for row, at, end in zip(*(column.tolist() for column in columns), strict=True)
    }


def _arp(rows: FrameRows) -> dict[int, str]:
    names = ("opcode", "src.proto_ipv4", "src.hw_mac", "dst.proto_ipv4")
    columns = [cells.texts(FIELDS[f"arp.{name}"], rows) for name in names]
    return {
        row: arp_text(int(operation), sender, hardware, target)
        for row, (operation, sender, hardware, target) in enumerate(zip(*columns, strict=True))
        if operation
    }
