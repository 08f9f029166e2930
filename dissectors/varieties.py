"""Varieties: what frames have in common is taken apart once, and a frame is told by its number.

A plant sends the same telegrams again and again: of a stream, only time, Counter and data change. What is the same in
all frames of a kind stands here, with one row a kind; what comes out is as if each frame had been taken apart.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U16, U64, Bool, PacketBatch, Records
from dissectors.can.frame import FRAME, CanBatch
from dissectors.can.frame import Fault as CanFault
from dissectors.can.pdo import PdoRules, is_pdo, words
from dissectors.carried import Carried, Carrier
from dissectors.keys import KeyTable, first_rows
from dissectors.layout import take_rows
from dissectors.netvar import HEADER, IS_PARAMETER, Fault, Service, TelegramBatch
from dissectors.transport import NO_DATAGRAMS, DatagramBatch

NO_TELEGRAM = 0
"""The variety of packets that hold neither a telegram nor a CAN frame."""

_UNKNOWN = -1
_MOST_PLAIN_CHANNELS = 64
"""Plain CAN frames of the channels below it are found in a table, without a search: standard data frames."""
_PLAIN_LENGTH_BITS, _PLAIN_CHANNEL_BIT = 4, 15

_HEADER_WORDS = np.dtype(
    {
        "names": ["service", "place", "tail"],
        "formats": ["<u8", "<u8", "<u2"],
        "offsets": [0, HEADER.offset_of("index"), HEADER.offset_of("flags")],
        "itemsize": HEADER.size_bytes,
    }
)


class CommonTelegrams(Struct, frozen=True):
    """What the telegrams of each kind have in common: columns as of a ``TelegramBatch``, one row a kind.

    ``datagram.payload`` is relative to the packet's first byte. Of no use are ``datagram.row``, the source port and
    Counter, and, where too little was captured, the fields behind SubIndex.
    """

    datagram: DatagramBatch
    header: Records
    fault: U8

    @property
    def truncated(self) -> Bool:
        """Tell of which less was captured than sent."""
        return self.datagram.captured_bytes < self.datagram.payload_bytes

    def joined(self, more: CommonTelegrams) -> CommonTelegrams:
        """Return this with more kinds behind it."""
        datagram = DatagramBatch.stacked([self.datagram, more.datagram])
        header, fault = np.concatenate([self.header, more.header]), np.concatenate([self.fault, more.fault])
        return CommonTelegrams(datagram, header, fault)


class Varieties:
    """What the frames of each variety have in common.

    ``carried`` has one row a variety; row 0 is ``NO_TELEGRAM``. What else telegrams on UDP have in common stands in
    ``telegrams``, in row ``part``, which is 0 of other varieties.
    """

    def __init__(self) -> None:
        self._keys = KeyTable(8)
        self._of_key = np.empty(0, np.int64)
        self._frames = KeyTable()
        self._of_frame = np.empty(0, np.int64)
        self._of_plain_frame = np.empty(0, np.int64)
        self.carried = Carried.nothing(1)
        self.part = np.zeros(1, np.int64)
        self.telegrams = CommonTelegrams(NO_DATAGRAMS, np.empty(0, HEADER.dtype), np.empty(0, np.uint8))

    def __len__(self) -> int:
        return len(self.part)

    def telegrams_of(self, numbers: I64) -> TelegramBatch:
        """Return what varieties of telegrams have in common as telegrams, without bytes and times."""
        part, nothing = self.part[numbers], np.zeros(len(numbers), np.int64)
        header = take_rows(self.telegrams.header, part)
        datagram, fault = self.telegrams.datagram.take(part), self.telegrams.fault[part]
        return TelegramBatch(np.zeros(0, np.uint8), datagram, nothing, header, fault)

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
            common = CommonTelegrams(replace(part.datagram, payload=relative[first]), part.header, part.fault)
            rows = np.arange(len(self.telegrams.fault), len(self.telegrams.fault) + len(first))
            self.telegrams = self.telegrams.joined(common)
            self._of_key = np.append(self._of_key, self._add(_carried_by_telegrams(common), rows))
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
            carried = _carried_by_frames(frames.take(first), relative[first], rules)
            self._of_frame = np.append(self._of_frame, self._add(carried, np.zeros(len(first), np.int64)))
        return self._of_frame[found]

    def _add(self, carried: Carried, part: I64) -> I64:
        """Add varieties, and return their numbers."""
        known = len(self)
        self.carried = Carried.stacked([self.carried, carried])
        self.part = np.append(self.part, part)
        return np.arange(known, len(self))


def _carried_by_telegrams(common: CommonTelegrams) -> Carried:
    header, datagram = common.header, common.datagram
    service = np.minimum(header["id"], len(IS_PARAMETER) - 1)
    return Carried(
        np.full(len(header), Carrier.UDP, np.uint8), datagram.destination_port.astype(np.int64),
        header["index"].astype(np.int64), header["subindex"].astype(np.int64), header["items"].astype(np.int64),
        datagram.payload + HEADER.size_bytes, np.maximum(datagram.payload_bytes - HEADER.size_bytes, 0),
        np.maximum(datagram.captured_bytes - HEADER.size_bytes, 0), ~IS_PARAMETER[service],
        (common.fault == Fault.NONE) & (service == Service.ODStateFree),
    )  # fmt: skip


def _carried_by_frames(frames: CanBatch, relative: I64, rules: PdoRules) -> Carried:
    own, is_data = words(frames).astype(np.int64), is_pdo(frames)
    parts = [rules.part_of(channel, word) for channel, word in zip(frames.channel.tolist(), own.tolist(), strict=True)]
    lists, subindexes = (np.array(column, np.int64) for column in zip(*parts, strict=True))
    return Carried(
        np.full(len(frames), Carrier.CAN, np.uint8), frames.channel.astype(np.int64), lists, subindexes,
        np.zeros(len(frames), np.int64), relative, frames.length.astype(np.int64), frames.captured.astype(np.int64),
        is_data, is_data,
    )  # fmt: skip


def _packed(*parts: tuple[I64 | U8 | U16 | U64 | Bool, int]) -> U64:
    """Return one word a row, with each column at its bit."""
    packed = np.zeros(len(parts[0][0]), np.uint64)
    for column, bit in parts:
        packed |= column.astype(np.uint64) << np.uint64(bit)
    return packed
