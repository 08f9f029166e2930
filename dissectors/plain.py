"""The plain shape: the headers of nearly all telegrams, told apart as rows of words without taking them apart.

Of a stream, only time, Counter and data change. What tells packets of the plain shape apart is a key of some words,
made for whole batches at once; which key stands for what is learned in ``dissectors.sorter``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dissectors.batch import I32, I64, U8, U64, Bool, PacketBatch, Records
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

PLAIN = np.dtype([(layout.name, layout.dtype) for layout in (ETHERNET, IPV4, UDP, HEADER)])
"""The headers of nearly all telegrams: Ethernet without tag, IPv4 without options, UDP, 3S-0."""

# Two bytes in front of a packet make the headers a row of 64 bytes, whose 64-bit words part no field.
LEAD_BYTES = 64 - PLAIN.itemsize
_WORD = np.dtype("<u8")
_WORDS = 64 // _WORD.itemsize
_ROW = np.dtype([("lead", f"V{LEAD_BYTES}"), *((name, PLAIN[name]) for name in PLAIN.names or ())])

_KEY = (
    (("ip", "source", 0), ("ip", "destination", 32)),
    (("nv", "id", 0), ("nv", "index", 32), ("nv", "subindex", 48)),
    (("nv", "items", 0), ("nv", "length", 16), ("eth", "type", 32), ("nv", "flags", 48), ("nv", "checksum", 56)),
    (("udp", "length", 0), ("udp", "destination_port", 16), ("nv", "identity", 32)),
    (("ip", "version_ihl", 0), ("ip", "protocol", 8), ("ip", "total_length", 16), ("ip", "fragment", 48),
     ("eth", "group", 54)),
)  # fmt: skip
"""What tells packets of the plain shape apart: the fields in the words of their key, and the bit where each begins.

The first two words are those that nearly always do.
"""

_FRAGMENT_BITS = 0x3FFF  # of more fragments, and of the offset
_PARTLY = {("ip", "fragment"): _FRAGMENT_BITS, ("eth", "group"): 1}
_CAPTURED_WORD, _CAPTURED_BIT, MOST_CAPTURED = 4, 32, 0xFFFF
"""Where in the key it stands how much was captured, and from what on that is not told apart."""


@dataclass(slots=True)
class _Part:
    """Bits of a word of the row, and how far they are moved to their place in a word of the key."""

    word: int
    left: int
    mask: int

    def of(self, words: U64) -> U64:
        """Return these bits, where they belong in a column of the key."""
        bits: U64 = words[self.word]
        if self.left:
            bits = bits << np.uint64(self.left) if self.left > 0 else bits >> np.uint64(-self.left)
        moved = (1 << 64) - 1 << self.left if self.left > 0 else (1 << 64) - 1 >> -self.left
        if moved & ~self.mask & (1 << 64) - 1:
            bits = bits & np.uint64(self.mask)
        return bits


def _parts(fields_of_word: tuple[tuple[str, str, int], ...]) -> list[_Part]:
    """Find the fields of one word of the key in the row; what is moved equally far is one part."""
    found: dict[tuple[int, int], _Part] = {}
    for layout, name, to_bit in fields_of_word:
        row = np.zeros(1, _ROW)
        row[layout][name] = _PARTLY.get((layout, name), np.iinfo(_ROW[layout][name]).max)
        words = row.view(_WORD)
        word = int(np.flatnonzero(words)[0])
        offset = int(_ROW.fields[layout][1]) + int(_ROW[layout].fields[name][1])  # type: ignore[index]  # structured
        left = to_bit - 8 * (offset - word * _WORD.itemsize)
        mask = int(words[word]) << left if left > 0 else int(words[word]) >> -left
        part = found.setdefault((word, left), _Part(word, left, 0))
        part.mask |= mask
    return list(found.values())


KEY_WORDS = len(_KEY)
_KEY_PARTS = [_parts(fields_of_word) for fields_of_word in _KEY]

_IDENTITY_WORD, _IDENTITY_SHIFT = 3, np.uint64(32)
_COUNTER_WORD, _COUNTER_SHIFT = 7, np.uint64(32)


def words_of(data: U8, offset: I64) -> U64:
    """Return the rows of headers at some offsets as columns of words, of shape (8, n).

    In front of each offset, ``LEAD_BYTES`` bytes can be read.
    """
    rows = gather_bytes(data, offset - LEAD_BYTES, _WORDS * _WORD.itemsize)
    words: U64 = np.ascontiguousarray(rows.view(_WORD).reshape(-1, _WORDS).T)
    return words


def counters_of(words: U64) -> U64:
    """Return the Counter in each row."""
    counters: U64 = words[_COUNTER_WORD] >> _COUNTER_SHIFT
    return counters


def keys_of(words: U64, captured: I32) -> U64:
    """Return the keys of headers as columns, of shape (``KEY_WORDS``, n)."""
    key = np.empty((KEY_WORDS, words.shape[1]), np.uint64)
    for column, (first, *others) in enumerate(_KEY_PARTS):
        key[column] = first.of(words)
        for part in others:
            key[column] |= part.of(words)
    told = np.minimum(captured, MOST_CAPTURED).astype(np.uint64)
    key[_CAPTURED_WORD] |= told << np.uint64(_CAPTURED_BIT)
    return key


def have_identity(key: U64, captured: I32) -> Bool:
    """Tell which headers, by their keys, were captured whole, have the identity of a telegram, and no odd length."""
    identity = key[_IDENTITY_WORD] >> _IDENTITY_SHIFT
    told: Bool = (captured >= PLAIN.itemsize) & (captured < MOST_CAPTURED)
    told &= (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    return told


def heads_of(packets: PacketBatch, rows: I64) -> Records:
    """Return the headers of some packets, as if they were of the plain shape."""
    return gather_bytes(packets.data, packets.offset[rows], PLAIN.itemsize).view(PLAIN)


def is_plain(head: Records) -> Bool:
    """Tell which frames have the plain shape, so that their headers tell everything about them."""
    plain: Bool = (head["eth"]["type"] == TYPE_IPV4) & _is_simple(head["ip"]) & (head["ip"]["protocol"] == PROTOCOL_UDP)
    return plain


def _is_simple(ip: Records) -> Bool:
    """Tell which IPv4 headers have no options and are of whole datagrams."""
    simple: Bool = (ip["version_ihl"] == 0x45) & ((ip["fragment"] & _FRAGMENT_BITS) == 0)
    return simple


def are_claimed(head: Records, claims: Claims) -> Bool:
    """Tell which frames, taken as if of the plain shape, are of ports that somebody asks for."""
    protocol, ports = head["ip"]["protocol"], (head["udp"]["source_port"], head["udp"]["destination_port"])
    claimed = (protocol == PROTOCOL_UDP) & claims.claim_udp(*ports)
    claimed |= (protocol == PROTOCOL_TCP) & claims.claim_tcp(*ports)  # TCP has its ports where UDP has them
    told: Bool = claimed & (head["eth"]["type"] == TYPE_IPV4) & _is_simple(head["ip"])
    return told


def may_hold_telegrams(head: Records) -> Bool:
    """Tell which frames may hold a telegram, or quote one, in other than the plain shape."""
    ethertype = head["eth"]["type"].astype(np.uint16)
    tagged = np.zeros(len(head), np.bool_)
    for known in (TYPE_IPV6, *VLAN_TYPES):
        tagged |= ethertype == known
    ip, identity = head["ip"], head["nv"]["identity"]
    told = (identity == IDENTITY) | (identity == IDENTITY_ASCII)
    idle = _is_simple(ip) & (ip["protocol"] != PROTOCOL_ICMP) & ((ip["protocol"] != PROTOCOL_UDP) | ~told)
    may: Bool = tagged | ((ethertype == TYPE_IPV4) & ~idle)
    return may
