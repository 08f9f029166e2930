"""Sorter: tells the packets of a capture by varieties, which it learns as they come.

A packet whose headers are those of an earlier one but for time, Counter and data is not taken apart, it is recognised;
``dissect`` sees the first of each kind, everything that is not of the plain shape, and what somebody asks for.
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U16, U64, Bool, LinkType, PacketBatch, Records
from dissectors.can.frame import CanBatch, dissect_can
from dissectors.can.pdo import PdoRules
from dissectors.claims import NO_CLAIMS, Claims
from dissectors.keys import KeyTable, first_rows
from dissectors.layout import take_rows
from dissectors.netvar import Dissection, PortRules, TelegramBatch, dissect
from dissectors.plain import (
    BLOCK,
    LEAD_BYTES,
    MOST_CAPTURED,
    NO_HEADS,
    TELLING_WORDS,
    are_claimed,
    counters_of,
    have_identity,
    heads_of,
    is_plain,
    make_keys,
    may_hold_telegrams,
    name_telegrams,
    rows_of,
    sender_keys_of,
    tell_sender,
)
from dissectors.plain_segments import take_segments
from dissectors.transport import NO_DATAGRAMS, NO_SEGMENTS, DatagramBatch, SegmentBatch
from dissectors.usual import NOBODY, WORDS, UsualRows
from dissectors.varieties import NO_TELEGRAM, Varieties

MOST_VARIETIES = 1 << 16
"""With more than these, what was learned is let go: traffic in which nothing recurs must not fill the memory."""

MOST_SENDERS = MOST_VARIETIES // 2
"""So many headers are numbered at most when those of one more sender are: whoever forges senders crowds nobody out."""

_UNKNOWN, _PECULIAR = NOBODY, -2
_LOOKED_AT = 1 << 8
"""So many packets of a batch show what most of the others are."""

_WITHOUT_CAN = frozenset(LinkType) - {
    LinkType.CAN_SOCKETCAN,
    LinkType.LINUX_SLL,
    LinkType.LINUX_SLL2,
    LinkType.UPPER_PDU,
}


class SortedPackets(Struct, frozen=True):
    """A packet batch, told by varieties.

    ``variety`` int64 (``NO_TELEGRAM`` where there is none) and ``counter`` uint16 have one entry a packet; what a
    variety is stands in ``varieties``. ``quoted`` is as in ``dissectors.netvar.Dissection``, ``fragments`` and
    ``unsupported`` are as in ``dissectors.link.Peeled``. ``header`` int64 numbers, from 1, headers that are the
    same, hardware address and time to live included; of packets that are no telegrams, those that tell who sent them.
    Both kinds are numbered in the order in which they appear. It is 0 where that is not known. Numbers stay as those of
    ``varieties`` do. ``can`` are the CAN frames of the batch, None where there is
    none; each has a variety too. ``datagrams`` and ``segments`` are those of claimed ports; datagrams that are
    telegrams are not among them.
    """

    packets: PacketBatch
    varieties: Varieties
    variety: I64
    counter: U16
    quoted: TelegramBatch
    fragments: int
    unsupported: Bool | None
    datagrams: DatagramBatch
    segments: SegmentBatch
    header: I64
    can: CanBatch | None = None

    def __len__(self) -> int:
        return len(self.variety)


class Sorter:
    """Tells packets by varieties, which it learns as they come.

    ``ports`` as for ``dissect``; ``pdos`` say which lists CAN frames belong to; ``claims`` are the ports of which all
    datagrams and segments are wanted.
    """

    def __init__(
        self, ports: PortRules | None = None, pdos: PdoRules | None = None, claims: Claims = NO_CLAIMS
    ) -> None:
        self._ports = ports
        self._pdos = pdos or PdoRules()
        self._claims = claims
        self._renew()

    @property
    def varieties(self) -> Varieties:
        """Those by which packets are told now."""
        return self._varieties

    def go_on_by_a_copy(self) -> None:
        """Leave the varieties so far as they are, and go on by the same ones."""
        self._varieties = deepcopy(self.varieties)

    def _renew(self) -> None:
        self._varieties = Varieties()
        self._headers = KeyTable(WORDS)
        self._usual = UsualRows(TELLING_WORDS)
        self._usual_senders: UsualRows | None = None
        # By number of the headers.
        self._variety_of = np.empty(0, np.int64)

    def sort(self, packets: PacketBatch) -> SortedPackets:
        """Tell a packet batch by varieties. Total, as ``dissect`` is.

        The numbers of one ``Varieties`` object stay; when it has become too large, there is a new one.
        """
        if max(len(self._varieties), len(self._headers)) > MOST_VARIETIES:
            self._renew()
        packets = packets.with_margin(LEAD_BYTES)
        rest: I64 | None = None
        sent, senders, plain = np.empty(0, np.int64), NO_HEADS, NO_SEGMENTS
        if self._ports is None and packets.single_link == LinkType.ETHERNET:
            head = heads_of(packets, np.arange(len(packets))) if _are_mostly_others(packets) else None
            header, counter = self._recognise(packets) if head is None else self._recognise_some(packets, head)
            # Behind the last one stands what is said of those that are unknown, whose number is -1.
            variety = np.append(self._variety_of, _UNKNOWN)[header]
            rest = np.flatnonzero(variety < 0)
            header += 1
            header[rest] = NO_TELEGRAM
            variety[rest] = NO_TELEGRAM
            counter[rest] = 0
            if head is None or len(rest) < len(packets):
                head = heads_of(packets, rest) if head is None else take_rows(head, rest)
            told = tell_sender(head, packets.captured[rest])
            sent, senders = rest[told], take_rows(head, told)
            rest, plain = self._to_take_apart(packets, rest, head)
        else:
            header = np.zeros(len(packets), np.int64)
            variety, counter = np.zeros(len(packets), np.int64), np.zeros(len(packets), np.uint16)
            if packets.single_link == LinkType.CAN_SOCKETCAN:
                rest = np.empty(0, np.int64)
        dissection = dissect(packets, self._ports, rest, self._claims)
        telegrams = dissection.telegrams
        if len(telegrams):
            row = telegrams.datagram.row
            variety[row] = self._varieties.numbers(telegrams, packets)
            counter[row] = telegrams.header["counter"]
        if len(sent):
            none = variety[sent] == NO_TELEGRAM
            header[sent[none]] = self._senders(take_rows(senders, none)) + 1
        frames = None
        if packets.single_link not in _WITHOUT_CAN and len(found := dissect_can(packets)):
            frames = found
            variety[frames.row] = self._varieties.frame_numbers(frames, packets, self._pdos)
        peeled = dissection.peeled
        unsupported = peeled.unsupported
        if unsupported is not None and frames is not None:
            # Of exported PDUs, CAN frames alone are read.
            unsupported[frames.row] = False
        return SortedPackets(
            packets, self._varieties, variety, counter, dissection.quoted, peeled.fragments, unsupported,
            self._claimed(dissection, variety), _joined(plain, peeled.tcp), header, frames,
        )  # fmt: skip

    def _senders(self, head: Records) -> I64:
        """Return the numbers of who sent some packets, ``_UNKNOWN`` of those for which there is no room."""
        if self._usual_senders is None:
            self._usual_senders = UsualRows(TELLING_WORDS)
        number = np.empty(len(head), np.int64)
        for start in range(0, len(head), BLOCK):
            keys = sender_keys_of(head[start : start + BLOCK])
            number[start : start + BLOCK] = found = self._usual_senders.find(keys)
            unknown = np.flatnonzero(found == NOBODY)
            if len(unknown):
                number[start + unknown] = self._learn_senders(keys[unknown])
        return number

    def _learn_senders(self, keys: U64) -> I64:
        """Return the numbers of senders that are not usual, having learned those that are new."""
        known = len(self._headers)
        number = self._headers.numbers_within(MOST_SENDERS, *keys.T)
        new = np.stack([word[known:] for word in self._headers.words], axis=1)
        if len(new):
            self._variety_of = np.append(self._variety_of, np.full(len(new), NO_TELEGRAM))
            assert self._usual_senders is not None
            self._usual_senders.add(new, np.arange(known, len(self._headers)))
        return number

    def _to_take_apart(self, packets: PacketBatch, rest: I64, head: Records) -> tuple[I64, SegmentBatch]:
        """Return which of some packets have to be taken apart, given their headers, and the segments among the others.

        Those are told by their headers alone.
        """
        claimed = are_claimed(head, self._claims) if self._claims else np.zeros(len(rest), np.bool_)
        segments = NO_SEGMENTS
        if self._claims.tcp:
            segments, own = take_segments(packets, rest, head, claimed)
            if own.any():
                others = ~own
                rest, head, claimed = rest[others], take_rows(head, others), claimed[others]
        return rest[may_hold_telegrams(head) | claimed], segments

    def _claimed(self, dissection: Dissection, variety: I64) -> DatagramBatch:
        """Return the datagrams of claimed ports that are no telegrams."""
        datagrams = dissection.peeled.udp
        if not self._claims.udp:
            return NO_DATAGRAMS
        wanted = self._claims.claim_udp(datagrams.source_port, datagrams.destination_port)
        return datagrams.take(wanted & (variety[datagrams.row] == NO_TELEGRAM))

    def _recognise(self, packets: PacketBatch) -> tuple[I64, U16]:
        """Return the numbers of the packets' headers, ``_UNKNOWN`` of what is no telegram; and the counters."""
        header, counter = np.empty(len(packets), np.int64), np.empty(len(packets), np.uint16)
        captured = np.minimum(packets.captured, MOST_CAPTURED).astype(np.uint16)
        for start in range(0, len(packets), BLOCK):
            part = slice(start, start + BLOCK)
            rows = rows_of(packets.data, packets.offset[part])
            counter[part] = counters_of(rows)
            make_keys(rows, captured[part])
            header[part] = self._usual.find(rows)
        unknown = np.flatnonzero(header == _UNKNOWN)
        count = BLOCK
        while len(unknown):
            # To look rows up takes ten times as long as to find them; what some of them are, most of the others are.
            some, unknown = unknown[:count], unknown[count:]
            header[some] = self._look_up(packets, some, captured[some])
            for start in range(0, len(unknown), BLOCK):
                again = unknown[start : start + BLOCK]
                header[again] = self._usual.find(_keys_of(packets, again, captured[again]))
            unknown = unknown[header[unknown] == _UNKNOWN]
            count *= 2
        return header, counter

    def _recognise_some(self, packets: PacketBatch, head: Records) -> tuple[I64, U16]:
        """Do the same with packets most of which have not even the identity of a telegram, given their headers."""
        header, counter = np.full(len(packets), _UNKNOWN), np.zeros(len(packets), np.uint16)
        told = np.flatnonzero(name_telegrams(head))
        if len(told):
            header[told], counter[told] = self._recognise(packets.take(told))
        return header, counter

    def _look_up(self, packets: PacketBatch, rows: I64, captured: U16) -> I64:
        """Return the numbers of some packets' headers, having learned those that are new; ``_UNKNOWN`` as above.

        In the order of the packets, so that numbers do not depend on how many are looked up at a time.
        """
        keys = _keys_of(packets, rows, captured)
        told = np.flatnonzero(have_identity(keys, captured))
        known = len(self._headers)
        number = self._headers.numbers(*keys[told].T)
        fresh = np.flatnonzero(number >= known)
        if len(fresh):
            self._learn(packets, rows[told[fresh]], number[fresh])
        header = np.full(len(rows), _UNKNOWN)
        header[told] = number
        return header

    def _learn(self, packets: PacketBatch, rows: I64, number: I64) -> None:
        """Find out what the packets are whose headers have new numbers."""
        known = len(self._variety_of)
        first = rows[first_rows(number - known, len(self._headers) - known)]
        head = heads_of(packets, first)
        plain = is_plain(head)
        # What somebody asks for, and is no telegram, has to be taken apart each time.
        learned = np.where(plain & ~are_claimed(head, self._claims), NO_TELEGRAM, _PECULIAR)
        telegrams = dissect(packets, None, first).telegrams
        place = np.searchsorted(first, telegrams.datagram.row)
        own = np.flatnonzero(plain[place])
        learned[place[own]] = self._varieties.numbers(telegrams.take(own), packets)
        self._variety_of = np.concatenate([self._variety_of, learned])
        rows_of_new = np.stack([word[known:] for word in self._headers.words], axis=1)
        self._usual.add(rows_of_new, np.arange(known, len(self._variety_of)))


def _joined(plain: SegmentBatch, others: SegmentBatch) -> SegmentBatch:
    """Return both in the order of the packets."""
    if not (len(plain) and len(others)):
        return plain if len(plain) else others
    return SegmentBatch.joined([plain, others])


def _are_mostly_others(packets: PacketBatch) -> bool:
    """Tell whether few of some packets have the identity of a telegram, by a part of them."""
    some = np.arange(0, len(packets), -(-len(packets) // _LOOKED_AT))
    return 8 * int(np.count_nonzero(name_telegrams(heads_of(packets, some)))) < len(some)


def _keys_of(packets: PacketBatch, rows: I64, captured: U16) -> U64:
    """Return what tells some packets apart, of whose bytes so many were captured."""
    keys = rows_of(packets.data, packets.offset[rows])
    make_keys(keys, captured)
    return keys
