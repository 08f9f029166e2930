"""The plain shape: the headers of nearly all telegrams, told apart as rows of bytes without taking them apart.

Of a stream, only time, Counter and data change. What tells packets of the plain shape apart is left of their headers by
a mask, for whole batches at once; what these keys stand for is learned in ``dissectors.sorter``.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I32, I64, U8, U16, U64, Bool, PacketBatch, Records
from dissectors.claims import Claims
from dissectors.headers import (
    ETHERNET,
    IPV4,
    PROTOCOL_ICMP,
    PROTOCOL_TCP,
    PROTOCOL_UDP,
    TYPE_IPV4,
    TYPE_IPV6,
    UDP,
    VLAN_TYPES,
)
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII
from dissectors.usual import WORDS

PLAIN = np.dtype([(layout.name, layout.dtype) for layout in (ETHERNET, IPV4, UDP, HEADER)])
"""The headers of nearly all telegrams: Ethernet without tag, IPv4 without options, UDP, 3S-0."""

# Two bytes in front of a packet make the headers a row of 64 bytes, whose 64-bit words part no field.
LEAD_BYTES = 8 * WORDS - PLAIN.itemsize
_WORD, _HALF = np.dtype("<u8"), np.dtype("<u2")
_ROW = np.dtype([("lead", f"V{LEAD_BYTES}"), *((name, PLAIN[name]) for name in PLAIN.names or ())])

NO_HEADS: Records = np.empty(0, _ROW)
"""The headers of no packets."""

BLOCK = 1 << 12
"""So many rows stay in the cache while they are looked at."""

_WITHOUT_OPTIONS = 0x45
_FRAGMENT_BITS = 0x3FFF  # of more fragments, and of the offset
# Whose hardware address and time to live differ, tells who sent or forwarded it: not what it is, but by which way.
_TELLING: dict[str, dict[str, int | None]] = {
    "eth": {"group": 1, "source": None, "type": None},
    "ip": {
        "version_ihl": None, "total_length": None, "fragment": _FRAGMENT_BITS, "ttl": None, "protocol": None,
        "source": None, "destination": None,
    },
    "udp": {"destination_port": None, "length": None},
    "nv": {
        "identity": None, "id": None, "index": None, "subindex": None, "items": None, "length": None, "flags": None,
        "checksum": None,
    },
}  # fmt: skip
"""What tells packets of the plain shape apart: fields of their headers, None: all bits of them."""

_SENDING: dict[str, dict[str, int | None]] = {
    "eth": {"source": None, "type": None},
    "ip": {"version_ihl": None, "ttl": None, "source": None},
}
"""What tells apart who sent other packets on Ethernet and IPv4, and by which way they came."""

TELLING_WORDS = 1, 3, 4, 6
"""Words that nearly always tell packets apart: of the sender's hardware address; of time to live and source; of
destination and port; of ID, Index, SubIndex."""

MOST_CAPTURED = 0xFFFF
"""So much captured, and more, is not told apart. It takes the place of the bytes in front of the packet."""

_IDENTITY_WORD, _IDENTITY_SHIFT = 5, np.uint64(32)
_COUNTER_HALF, _CAPTURED_HALF = 30, 0  # 16-bit numbers in a row


def _bits_of(fields: dict[str, dict[str, int | None]]) -> U64:
    """Return a row in which the bits of some fields are set."""
    row = np.zeros(1, _ROW)
    for layout, names in fields.items():
        for name, bits in names.items():
            part = _ROW[layout][name]
            row[layout][name] = np.frombuffer(b"\xff" * part.itemsize, part)[0] if bits is None else bits
    return row.view(_WORD).astype(np.uint64)


_TELLING_BITS = np.tile(_bits_of(_TELLING), BLOCK)
_SENDING_BITS = np.tile(_bits_of(_SENDING), BLOCK)
_WITH_SENDER_BYTES = ETHERNET.size_bytes + IPV4.size_bytes


def rows_of(data: U8, offset: I64) -> U64:
    """Return the rows of headers at some offsets, of shape (n, ``WORDS``).

    In front of each offset, ``LEAD_BYTES`` bytes can be read.
    """
    rows = gather_bytes(data, offset - LEAD_BYTES, _ROW.itemsize)
    words: U64 = rows.view(_WORD).reshape(-1, WORDS)
    return words


def counters_of(rows: U64) -> U16:
    """Return the Counter in each row."""
    counters: U16 = rows.view(_HALF)[:, _COUNTER_HALF]
    return counters


def make_keys(rows: U64, captured: U16) -> None:
    """Leave in rows of headers nothing but what tells packets apart, and how much was captured."""
    _leave(rows, _TELLING_BITS)
    rows.view(_HALF)[:, _CAPTURED_HALF] = captured


def sender_keys_of(head: Records) -> U64:
    """Return what tells apart who sent packets that are no telegrams, given their headers; shape (n, ``WORDS``).

    It differs from all that ``make_keys`` makes of telegrams, by what was captured: here, that is nothing.
    """
    keys: U64 = head.view(_WORD).reshape(-1, WORDS).copy()
    _leave(keys, _SENDING_BITS)
    return keys


def _leave(rows: U64, bits: U64) -> None:
    """Leave some bits in rows of headers; ``bits`` are those of ``BLOCK`` rows."""
    flat = rows.reshape(-1)
    # As one column of words: along rows of eight, numpy takes many times as long.
    for start in range(0, len(flat), len(bits)):
        part = flat[start : start + len(bits)]
        part &= bits[: len(part)]


def tell_sender(head: Records, captured: I32) -> Bool:
    """Tell which frames, taken as if of the plain shape, are of IPv4, and say who sent them."""
    told: Bool = (head["eth"]["type"] == TYPE_IPV4) & (head["ip"]["version_ihl"] == _WITHOUT_OPTIONS)
    told &= captured >= _WITH_SENDER_BYTES
    return told


def have_identity(keys: U64, captured: U16) -> Bool:
    """Tell which headers, by their keys, were captured whole, have the identity of a telegram, and no odd length."""
    identity = keys[:, _IDENTITY_WORD] >> _IDENTITY_SHIFT
    told: Bool = (captured >= PLAIN.itemsize) & (captured < MOST_CAPTURED)
    told &= (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    return told


def heads_of(packets: PacketBatch, rows: I64) -> Records:
    """Return the headers of some packets, as if they were of the plain shape: fields of ``PLAIN``, as rows of words.

    In front of each packet, ``LEAD_BYTES`` bytes can be read.
    """
    return rows_of(packets.data, packets.offset[rows]).view(_ROW)[:, 0]


def is_plain(head: Records) -> Bool:
    """Tell which frames have the plain shape, so that their headers tell everything about them."""
    plain: Bool = (head["eth"]["type"] == TYPE_IPV4) & _is_simple(head["ip"]) & (head["ip"]["protocol"] == PROTOCOL_UDP)
    return plain


def _is_simple(ip: Records) -> Bool:
    """Tell which IPv4 headers have no options and are of whole datagrams."""
    simple: Bool = (ip["version_ihl"] == _WITHOUT_OPTIONS) & ((ip["fragment"] & _FRAGMENT_BITS) == 0)
    return simple


def are_claimed(head: Records, claims: Claims) -> Bool:
    """Tell which frames, taken as if of the plain shape, are of ports that somebody asks for."""
    protocol, udp = head["ip"]["protocol"], head["udp"]
    # In the order of bytes of this machine: they are compared with many ports.
    ports = udp["source_port"].astype(np.uint16), udp["destination_port"].astype(np.uint16)
    claimed = np.zeros(len(head), np.bool_)
    if claims.udp:
        claimed |= (protocol == PROTOCOL_UDP) & claims.claim_udp(*ports)
    if claims.tcp:
        claimed |= (protocol == PROTOCOL_TCP) & claims.claim_tcp(*ports)  # TCP has its ports where UDP has them
    told: Bool = claimed & (head["eth"]["type"] == TYPE_IPV4) & _is_simple(head["ip"])
    return told


def name_telegrams(head: Records) -> Bool:
    """Tell which frames, taken as if of the plain shape, have the identity of a telegram."""
    identity = head["nv"]["identity"]
    told: Bool = (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    return told


def may_hold_telegrams(head: Records) -> Bool:
    """Tell which frames may hold a telegram, or quote one, in other than the plain shape."""
    ethertype = head["eth"]["type"].astype(np.uint16)
    tagged = np.zeros(len(head), np.bool_)
    for known in (TYPE_IPV6, *VLAN_TYPES):
        tagged |= ethertype == known
    ip, told = head["ip"], name_telegrams(head)
    idle = _is_simple(ip) & (ip["protocol"] != PROTOCOL_ICMP) & ((ip["protocol"] != PROTOCOL_UDP) | ~told)
    may: Bool = tagged | ((ethertype == TYPE_IPV4) & ~idle)
    return may
