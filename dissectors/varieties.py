"""Varieties: what telegrams have in common is taken apart once, and a telegram is told by its number.

A plant sends the same telegrams again and again: of a stream, only time, Counter and data change. A packet whose
headers are those of an earlier one but for such fields is therefore not taken apart, it is recognised; ``dissect`` sees
the first of each kind, and everything that is not of the plain shape. What comes out is the same as if it saw them all.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from dissectors.batch import I32, I64, U8, U16, U64, Bool, LinkType, PacketBatch, Records
from dissectors.can.frame import FRAME, CanBatch, dissect_can
from dissectors.can.frame import Fault as CanFault
from dissectors.can.pdo import ON_CAN, PdoRules, is_pdo, words
from dissectors.headers import ETHERNET, IPV4, PROTOCOL_ICMP, PROTOCOL_UDP, TYPE_IPV4, TYPE_IPV6, UDP, VLAN_TYPES
from dissectors.keys import KeyTable, first_rows
from dissectors.layout import gather_bytes, take_rows
from dissectors.link import NO_DATAGRAMS, DatagramBatch
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, Fault, PortRules, TelegramBatch, dissect

NO_TELEGRAM = 0
"""The variety of packets that hold no telegram."""

MOST_VARIETIES = 1 << 16
"""With more than these, what was learned is let go: traffic in which nothing recurs must not fill the memory."""

PLAIN = np.dtype([(layout.name, layout.dtype) for layout in (ETHERNET, IPV4, UDP, HEADER)])
"""The headers of nearly all telegrams: Ethernet without tag, IPv4 without options, UDP, 3S-0."""

# Two bytes in front of a packet make the headers a row of 64 bytes, whose 64-bit words part no field.
_LEAD_BYTES = 64 - PLAIN.itemsize
_WORD = np.dtype("<u8")
_WORDS = 64 // _WORD.itemsize
_ROW = np.dtype([("lead", f"V{_LEAD_BYTES}"), *((name, PLAIN[name]) for name in PLAIN.names or ())])
_BLOCK = 1 << 14  # a block of rows stays in the cache while its columns are made
_UNKNOWN, _PECULIAR = -1, -2

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
_CAPTURED_WORD, _CAPTURED_BIT, _MOST_CAPTURED = 4, 32, 0xFFFF
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


_KEY_PARTS = [_parts(fields_of_word) for fields_of_word in _KEY]
_MOST_PLAIN_CHANNELS = 64
"""Plain CAN frames of the channels below it are found in a table, without a search: standard data frames."""
_PLAIN_LENGTH_BITS, _PLAIN_CHANNEL_BIT = 4, 15

_WITHOUT_CAN = frozenset(LinkType) - {LinkType.CAN_SOCKETCAN, LinkType.LINUX_SLL, LinkType.LINUX_SLL2}

_IDENTITY_WORD, _IDENTITY_SHIFT = 3, np.uint64(32)
_COUNTER_WORD, _COUNTER_SHIFT = 7, np.uint64(32)


@dataclass(frozen=True, slots=True)
class SortedPackets:
    """A packet batch, told by varieties.

    ``variety`` int64 (``NO_TELEGRAM`` where there is none) and ``counter`` uint16 have one entry a packet; what a
    variety is stands in ``varieties``. ``quoted`` is as in ``dissectors.netvar.Dissection``, ``fragments`` and
    ``unsupported`` are as in ``dissectors.link.Peeled``. ``can`` are the CAN frames of the batch, None where there is
    none; each has a variety too.
    """

    packets: PacketBatch
    varieties: Varieties
    variety: I64
    counter: U16
    quoted: TelegramBatch
    fragments: int
    unsupported: Bool | None
    can: CanBatch | None = None

    def __len__(self) -> int:
        return len(self.variety)


class Varieties:
    """What the telegrams of each variety have in common.

    ``datagram``, ``header`` and ``fault`` are columns as of a ``TelegramBatch``, with one row a variety;
    ``datagram.payload`` is relative to the packet's first byte. Of no use are ``datagram.row``, the source port and
    Counter, and, where too little was captured, the fields behind SubIndex. Row 0 is ``NO_TELEGRAM``.

    CAN frames (``on_can``) stand here as telegrams with the header that they have not: SubIndex and Length are what
    they would be, all else is 0. ``is_pdo`` are those that may carry variables.

    ``port`` and ``index`` (int64) say which list it is: destination port and Index, or, from ``ON_CAN`` on, channel and
    COB-ID (``dissectors.can.pdo``).
    """

    def __init__(self) -> None:
        self._keys = KeyTable(8)
        self._of_key = np.empty(0, np.int64)
        self._frames = KeyTable()
        self._of_frame = np.empty(0, np.int64)
        self._of_plain_frame = np.empty(0, np.int64)
        nothing = np.zeros(1, np.int64)
        self.datagram = DatagramBatch(
            *(nothing.astype(getattr(NO_DATAGRAMS, column.name).dtype) for column in fields(DatagramBatch))
        )
        self.header: Records = np.zeros(1, HEADER.dtype)
        self.fault: U8 = np.zeros(1, np.uint8)
        self.on_can, self.is_pdo = np.zeros(1, np.bool_), np.zeros(1, np.bool_)
        self.port, self.index = nothing.copy(), nothing.copy()

    def __len__(self) -> int:
        return len(self.fault)

    @property
    def truncated(self) -> Bool:
        """Tell of which varieties less was captured than sent."""
        return self.datagram.captured_bytes < self.datagram.payload_bytes

    def telegrams(self, numbers: I64) -> TelegramBatch:
        """Return what varieties have in common as telegrams, without bytes and times."""
        nothing = np.zeros(len(numbers), np.int64)
        header = take_rows(self.header, numbers)
        return TelegramBatch(np.zeros(0, np.uint8), self.datagram.take(numbers), nothing, header, self.fault[numbers])

    def numbers(self, telegrams: TelegramBatch, packets: PacketBatch) -> I64:
        """Return the variety of each telegram of a packet batch, adding those that are new. Shape (n,)."""
        datagram = telegrams.datagram
        relative = datagram.payload - packets.offset[datagram.row]
        service = telegrams.header.view(_HEADER_WORDS)
        tail = service["tail"].astype(np.uint64)
        place = service["place"].copy()
        cut = np.flatnonzero((telegrams.fault == Fault.HEADER_CUT) | (telegrams.fault == Fault.SHORT))
        place[cut] &= np.uint64(0xFFFFFFFF)
        tail[cut] = 0
        found = self._keys.numbers(
            datagram.source_hi, datagram.source_lo, datagram.destination_hi, datagram.destination_lo,
            service["service"].astype(np.uint64), place,
            _packed((datagram.destination_port, 0), (tail, 16), (datagram.broadcast, 32)),
            _packed((datagram.payload_bytes, 0), (datagram.captured_bytes, 16), (relative, 32)),
        )  # fmt: skip
        fresh = np.flatnonzero(found >= len(self._of_key))
        if len(fresh):
            first = fresh[first_rows(found[fresh] - len(self._of_key), len(self._keys) - len(self._of_key))]
            part = telegrams.take(first)
            common = replace(part.datagram, payload=relative[first])
            no, port, index = np.zeros(len(first), np.bool_), common.destination_port, part.header["index"]
            self._of_key = np.append(self._of_key, self._add(common, part.header, part.fault, no, no, port, index))
        return self._of_key[found]

    def frame_numbers(self, frames: CanBatch, packets: PacketBatch, rules: PdoRules) -> I64:
        """Return the variety of each CAN frame of a packet batch, adding those that are new. Shape (n,)."""
        relative = frames.at - packets.offset[frames.row]
        plain = ~(frames.extended | frames.remote | frames.error | frames.fd)
        plain &= (frames.fault == CanFault.NONE) & (relative == FRAME.size_bytes)
        plain &= frames.channel < _MOST_PLAIN_CHANNELS
        place = frames.channel.astype(np.int64)
        place <<= _PLAIN_CHANNEL_BIT
        place |= frames.identifier.astype(np.int64) << _PLAIN_LENGTH_BITS
        place |= frames.length
        place[~plain] = -1
        room = int(place.max()) + 1
        if room > len(self._of_plain_frame):
            room = ((room >> _PLAIN_CHANNEL_BIT) + 1) << _PLAIN_CHANNEL_BIT
            grown = np.full(room, _UNKNOWN)
            grown[: len(self._of_plain_frame)] = self._of_plain_frame
            self._of_plain_frame = grown
        known = self._of_plain_frame
        found = known[place] if len(known) else np.full(len(place), _UNKNOWN)
        found[~plain] = _UNKNOWN
        other = np.flatnonzero(found < 0)
        if len(other):
            found[other] = self._other_frame_numbers(frames.take(other), relative[other], rules)
            short = other[plain[other]]
            known[place[short]] = found[short]
        return found

    def _other_frame_numbers(self, frames: CanBatch, relative: I64, rules: PdoRules) -> I64:
        """Return the varieties of CAN frames that are told by all that is special about them."""
        word = words(frames)
        found = self._frames.numbers(
            _packed(
                (word, 0), (frames.remote, 32), (frames.error, 33), (frames.fd, 34), (frames.channel, 40)
            ),
            _packed((frames.length, 0), (frames.captured, 8), (frames.fault, 16), (relative, 24)),
        )  # fmt: skip
        fresh = np.flatnonzero(found >= len(self._of_frame))
        if len(fresh):
            first = fresh[first_rows(found[fresh] - len(self._of_frame), len(self._frames) - len(self._of_frame))]
            part, own = frames.take(first), word[first].astype(np.int64)
            header = np.zeros(len(first), HEADER.dtype)
            header["length"] = HEADER.size_bytes + part.length.astype(np.int64)
            index = np.empty(len(first), np.int64)
            for row, (channel, number) in enumerate(zip(part.channel.tolist(), own.tolist(), strict=True)):
                index[row], header["subindex"][row] = rules.part_of(channel, number)
            nothing = np.zeros(len(first), np.int64)
            blank = DatagramBatch(
                *(nothing.astype(getattr(NO_DATAGRAMS, column.name).dtype) for column in fields(DatagramBatch))
            )
            common = replace(
                blank, payload=relative[first] - HEADER.size_bytes,
                payload_bytes=HEADER.size_bytes + part.length.astype(np.int64),
                captured_bytes=HEADER.size_bytes + part.captured.astype(np.int64),
            )  # fmt: skip
            yes, port = np.ones(len(first), np.bool_), part.channel.astype(np.int64) | ON_CAN
            self._of_frame = np.append(
                self._of_frame, self._add(common, header, nothing.astype(np.uint8), yes, is_pdo(part), port, index)
            )
        return self._of_frame[found]

    def _add(
        self, datagram: DatagramBatch, header: Records, fault: U8, on_can: Bool, is_pdo: Bool, port: I64 | U16,
        index: I64 | U16,
    ) -> I64:  # fmt: skip
        """Add varieties, and return their numbers."""
        known = len(self)
        self.datagram = DatagramBatch(
            *(
                np.concatenate([getattr(self.datagram, column.name), getattr(datagram, column.name)])
                for column in fields(DatagramBatch)
            )
        )
        self.header, self.fault = np.concatenate([self.header, header]), np.concatenate([self.fault, fault])
        self.on_can, self.is_pdo = np.concatenate([self.on_can, on_can]), np.concatenate([self.is_pdo, is_pdo])
        self.port, self.index = (
            np.append(self.port, port.astype(np.int64)),
            np.append(self.index, index.astype(np.int64)),
        )
        return np.arange(known, len(self))


_HEADER_WORDS = np.dtype(
    {
        "names": ["service", "place", "tail"],
        "formats": ["<u8", "<u8", "<u2"],
        "offsets": [0, HEADER.offset_of("index"), HEADER.offset_of("flags")],
        "itemsize": HEADER.size_bytes,
    }
)


class Sorter:
    """Tells packets by varieties, which it learns as they come.

    ``ports`` as for ``dissect``; ``pdos`` say which lists CAN frames belong to.
    """

    def __init__(self, ports: PortRules | None = None, pdos: PdoRules | None = None) -> None:
        self._ports = ports
        self._pdos = pdos or PdoRules()
        self._renew()

    def _renew(self) -> None:
        self._varieties = Varieties()
        self._headers = KeyTable(len(_KEY))
        # By number of the headers; the last entry is that of headers without a number.
        self._variety_of = np.array([_UNKNOWN])

    def sort(self, packets: PacketBatch) -> SortedPackets:
        """Tell a packet batch by varieties. Total, as ``dissect`` is.

        The numbers of one ``Varieties`` object stay; when it has become too large, there is a new one.
        """
        if max(len(self._varieties), len(self._headers)) > MOST_VARIETIES:
            self._renew()
        packets = packets.with_margin(_LEAD_BYTES)
        rest: I64 | None = None
        if self._ports is None and packets.single_link == LinkType.ETHERNET:
            variety, counter = self._recognise(packets)
            rest = np.flatnonzero(variety < 0)
            variety[rest] = NO_TELEGRAM
            counter[rest] = 0
            rest = rest[_may_hold_telegrams(_heads(packets, rest))]
        else:
            variety, counter = np.zeros(len(packets), np.int64), np.zeros(len(packets), np.uint16)
            if packets.single_link == LinkType.CAN_SOCKETCAN:
                rest = np.empty(0, np.int64)
        dissection = dissect(packets, self._ports, rest)
        telegrams = dissection.telegrams
        if len(telegrams):
            row = telegrams.datagram.row
            variety[row] = self._varieties.numbers(telegrams, packets)
            counter[row] = telegrams.header["counter"]
        frames = None
        if packets.single_link not in _WITHOUT_CAN and len(found := dissect_can(packets)):
            frames = found
            variety[frames.row] = self._varieties.frame_numbers(frames, packets, self._pdos)
        peeled = dissection.peeled
        return SortedPackets(
            packets, self._varieties, variety, counter, dissection.quoted, peeled.fragments, peeled.unsupported, frames
        )

    def _recognise(self, packets: PacketBatch) -> tuple[I64, U16]:
        """Return the varieties that the headers of packets tell (or ``_UNKNOWN``, ``_PECULIAR``), and the counters."""
        number, counter = np.empty(len(packets), np.int64), np.empty(len(packets), np.uint16)
        for start in range(0, len(packets), _BLOCK):
            part = slice(start, start + _BLOCK)
            words = _words(packets.data, packets.offset[part])
            number[part] = self._headers.find_usual(*_keys(words, packets.captured[part]))
            counter[part] = words[_COUNTER_WORD] >> _COUNTER_SHIFT
        other = np.flatnonzero(number < 0)
        if len(other):
            captured = packets.captured[other]
            key = _keys(_words(packets.data, packets.offset[other]), captured)
            identity = key[_IDENTITY_WORD] >> _IDENTITY_SHIFT
            told = (captured >= PLAIN.itemsize) & (captured < _MOST_CAPTURED)
            told &= (identity == IDENTITY) | (identity == IDENTITY_ASCII)
            known, other = len(self._headers), other[told]
            number[other] = self._headers.numbers(*(word[told] for word in key))
            fresh = other[number[other] >= known]
            if len(fresh):
                self._learn(packets, fresh, number[fresh])
        return self._variety_of[number], counter

    def _learn(self, packets: PacketBatch, rows: I64, number: I64) -> None:
        """Find out what the packets are whose headers have new numbers."""
        known = len(self._variety_of) - 1
        first = rows[first_rows(number - known, len(self._headers) - known)]
        learned = np.where(_is_plain(_heads(packets, first)), NO_TELEGRAM, _PECULIAR)
        telegrams = dissect(packets, None, first).telegrams
        place = np.searchsorted(first, telegrams.datagram.row)
        plain = np.flatnonzero(learned[place] == NO_TELEGRAM)
        learned[place[plain]] = self._varieties.numbers(telegrams.take(plain), packets)
        self._variety_of = np.concatenate([self._variety_of[:-1], learned, [_UNKNOWN]])


def _words(data: U8, offset: I64) -> U64:
    """Return the rows of headers at some offsets as columns of words, of shape (``_WORDS``, n)."""
    rows = gather_bytes(data, offset - _LEAD_BYTES, _WORDS * _WORD.itemsize)
    words: U64 = np.ascontiguousarray(rows.view(_WORD).reshape(-1, _WORDS).T)
    return words


def _keys(words: U64, captured: I32) -> U64:
    """Return the keys of headers as columns, of shape (words of ``_KEY``, n)."""
    key = np.empty((len(_KEY), words.shape[1]), np.uint64)
    for column, (first, *others) in enumerate(_KEY_PARTS):
        key[column] = first.of(words)
        for part in others:
            key[column] |= part.of(words)
    told = np.minimum(captured, _MOST_CAPTURED).astype(np.uint64)
    key[_CAPTURED_WORD] |= told << np.uint64(_CAPTURED_BIT)
    return key


def _heads(packets: PacketBatch, rows: I64) -> Records:
    """Return the headers of some packets, as if they were of the plain shape."""
    return gather_bytes(packets.data, packets.offset[rows], PLAIN.itemsize).view(PLAIN)


def _packed(*parts: tuple[I64 | U8 | U16 | U64 | Bool, int]) -> U64:
    """Return one word a row, with each column at its bit."""
    packed = np.zeros(len(parts[0][0]), np.uint64)
    for column, bit in parts:
        packed |= column.astype(np.uint64) << np.uint64(bit)
    return packed


def _is_plain(head: Records) -> Bool:
    """Tell which frames have the plain shape, so that their headers tell everything about them."""
    plain: Bool = (head["eth"]["type"] == TYPE_IPV4) & _is_simple(head["ip"]) & (head["ip"]["protocol"] == PROTOCOL_UDP)
    return plain


def _is_simple(ip: Records) -> Bool:
    """Tell which IPv4 headers have no options and are of whole datagrams."""
    simple: Bool = (ip["version_ihl"] == 0x45) & ((ip["fragment"] & _FRAGMENT_BITS) == 0)
    return simple


def _may_hold_telegrams(head: Records) -> Bool:
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
