"""Frames of a capture in which something was found, each with its place in it: its number, what came before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64, U8, U64, Bool, PacketBatch
from dissectors.can.frame import CanBatch
from dissectors.carried import Carried, Carrier
from dissectors.netvar import TelegramBatch
from dissectors.sorted_telegrams import SortedTelegrams
from dissectors.transport import DatagramBatch, IpEnds, SegmentBatch
from nvscope.capture.spans import stretches
from nvscope.engine.told import Told

if TYPE_CHECKING:  # without being asked for all frames, nothing of them is imported
    from dissectors.other_frames import OtherFrames

NETVAR, CAN = "nv", "can"
"""Network variables on UDP, and CAN frames, among the protocols of frames."""

IP, UDP, TCP = "ip", "udp", "tcp"
"""What protocols are carried over: parts of frames too, but no frame is of these alone."""

OTHER, ARP, ICMP, ICMPV6 = "other", "arp", "icmp", "icmpv6"
"""The protocol of frames in which no other is found, which are rows where all frames are wanted; what is in them."""

_CARRIERS = (IP, UDP, TCP)
_PIECE_FRAMES = 8192
_PIECE_BYTES = 4 << 20


class Found(Struct, frozen=True):
    """What a protocol found in some of the rows: its ``part``, and the positions of these rows, rising.

    ``at`` is None where all rows are its own.
    """

    part: Any
    at: I64 | None = None

    def take(self, rows: I64, count: int) -> Found | None:
        """Return what was found in rows at the given positions, of ``count``; None where that is nothing."""
        if self.at is None:
            return Found(self.part.take(rows))
        place = np.full(count, -1)
        place[self.at] = np.arange(len(self.at))
        own = place[rows]
        at = np.flatnonzero(own >= 0)
        if not len(at):
            return None
        return Found(self.part.take(own[at]), None if len(at) == len(rows) else at)

    def positions(self, count: int) -> I64:
        """Return the positions of its rows among ``count``."""
        return np.arange(count) if self.at is None else self.at


class FrameRows(Struct, frozen=True):
    """Some frames of one packet batch, with what was found in them.

    ``packets`` is the whole batch, ``row`` the row of each frame in it, ``protocol`` which of ``protocols`` it is of.
    ``parts`` are what these protocols found, by name, and what they are carried over (``IP``, ``UDP``, ``TCP``).
    ``carried`` tells of each row which variables of which list it carries, ``channel`` what CAN channels are called.

    ``frames_before`` counts the frames of the capture before the batch. Times in ns: ``start_ns`` of the capture's
    first frame, ``frame_before_ns`` of the last frame before the batch, ``shown_before_ns`` of the last frame shown
    before the first one here (None: there is none), ``since_ns`` since the frame shown before where that is not the row
    above. ``finding`` and ``cause`` are the numbers of those with which a frame is looked at, -1 for none; a frame that
    shows several is there as often (``nvscope.view.fields.shown``). ``number`` and ``before_ns``, the time of the frame
    before, are there where the frames of the batch do not follow each other in the capture.
    """

    packets: PacketBatch
    row: I64
    protocols: Sequence[str]
    protocol: U8
    parts: Mapping[str, Found]
    carried: Carried
    channel: Callable[[int], str] = "can{}".format
    frames_before: int = 0
    start_ns: int = 0
    frame_before_ns: int = 0
    shown_before_ns: int | None = None
    finding: I64 | None = None
    cause: I64 | None = None
    since_ns: I64 | None = None
    number: I64 | None = None
    before_ns: I64 | None = None

    @staticmethod
    def of(told: Told, packet: I64) -> FrameRows:
        """Return some packets of a batch, rising, in each of which something was found."""
        carried = told.varieties.carried.of_packets(told.variety[packet], told.packets.offset[packet])
        parts = _Parts(packet)
        others = told.others
        if told.can is None and not told.parts and others is None:
            parts.add_telegrams(SortedTelegrams(told.batch, packet), None)
        else:
            on_udp = np.flatnonzero(carried.carrier == Carrier.UDP)
            parts.add_telegrams(SortedTelegrams(told.batch, packet[on_udp]), on_udp)
            if told.can is not None:
                parts.add(CAN, told.can)
            for name, part in told.parts.items():
                parts.add(name, part)
            if others is not None:
                parts.add_others(others)
            parts.add_carriers(told)
        return FrameRows(
            told.packets, packet, tuple(parts.found), parts.protocol(), parts.found | parts.carriers, carried,
            told.pdos.channel, told.first_frame - 1, told.start_ns, told.before_ns,
        )  # fmt: skip

    @staticmethod
    def of_varieties(told: Told, numbers: I64) -> FrameRows:
        """Return what is the same in all frames of varieties, one row each; CAN frames have no part there."""
        nothing = np.zeros(len(numbers), np.int64)
        carried = told.varieties.carried.of_packets(numbers, nothing)
        parts = _Parts(nothing)
        on_udp = np.flatnonzero(carried.carrier == Carrier.UDP)
        parts.add_telegrams(told.varieties.telegrams_of(numbers[on_udp]), on_udp)
        return FrameRows(
            told.packets, nothing, tuple(parts.found), parts.protocol(), parts.found | parts.carriers, carried,
            told.pdos.channel,
        )  # fmt: skip

    @staticmethod
    def nothing(count: int) -> FrameRows:
        """Return rows of which nothing is known."""
        blank = np.zeros(count, np.int64)
        carried = Carried.nothing(count).of_packets(blank, blank)
        return FrameRows(PacketBatch.nothing(), blank, (), np.zeros(count, np.uint8), {}, carried)

    def __len__(self) -> int:
        return len(self.row)

    @property
    def ts_ns(self) -> I64:
        """When each frame was captured."""
        return self.packets.ts_ns[self.row]

    @property
    def frame_number(self) -> I64:
        """Frame numbers from 1 across the capture, int64 of shape (n,)."""
        return self.row + (self.frames_before + 1) if self.number is None else self.number

    @property
    def since_start_ns(self) -> I64:
        """Time since the first frame of the capture."""
        return self.ts_ns - self.start_ns

    @property
    def since_frame_ns(self) -> I64:
        """Time since the frame before, whatever that is; of the first frame 0."""
        if self.before_ns is not None:
            return self.ts_ns - self.before_ns
        before = np.where(self.row > 0, self.packets.ts_ns[self.row - 1], self.frame_before_ns)
        return self.ts_ns - before

    @property
    def since_shown_ns(self) -> I64:
        """Time since the frame shown before; of the first one 0."""
        if self.since_ns is not None:
            return self.since_ns
        ts_ns = self.ts_ns
        first = ts_ns[:1] if self.shown_before_ns is None else np.array([self.shown_before_ns])
        return np.diff(ts_ns, prepend=first)

    @property
    def telegrams(self) -> TelegramBatch:
        """The telegrams, of rows that are all of network variables on UDP."""
        telegrams: TelegramBatch = self._all_of(NETVAR)
        return telegrams

    @property
    def can(self) -> CanBatch:
        """The CAN frames, of rows that are all such."""
        frames: CanBatch = self._all_of(CAN)
        return frames

    def _all_of(self, name: str) -> Any:
        found = self.parts[name]
        assert found.at is None, f"not all rows are of {name}"
        return found.part

    def have(self, name: str) -> Bool:
        """Tell which rows have a part of a protocol, or of what protocols are carried over."""
        own = np.zeros(len(self), np.bool_)
        if found := self.parts.get(name):
            own[found.positions(len(self))] = True
        return own

    @property
    def senders(self) -> tuple[U64, U64]:
        """The halves of the address that each frame comes from; 0 where there is none, as on CAN."""
        high, low = np.zeros(len(self), np.uint64), np.zeros(len(self), np.uint64)
        if found := self.parts.get(IP):
            at = found.positions(len(self))
            high[at], low[at] = found.part.source_hi, found.part.source_lo
        return high, low

    def name_of(self, row: int) -> str:
        """Return the protocol of one row."""
        return self.protocols[int(self.protocol[row])]

    def by_protocol(self) -> Iterator[tuple[str, I64, FrameRows]]:
        """Yield each protocol with the positions of its rows, and these, to be shown with the others."""
        if len(self.protocols) == 1:
            yield self.protocols[0], np.arange(len(self)), self
            return
        for number, name in enumerate(self.protocols):
            own = np.flatnonzero(self.protocol == number)
            if len(own):
                yield name, own, self.part(own)

    def take(self, rows: I64 | Bool) -> FrameRows:
        """Return the frames at the given positions or where the mask is set; the others count as not shown."""
        which: I64 = np.arange(len(self))[rows]
        taken = {name: found.take(which, len(self)) for name, found in self.parts.items()}
        return replace(
            self, row=self.row[which], protocol=self.protocol[which], carried=self.carried.take(which),
            parts={name: found for name, found in taken.items() if found is not None},
            finding=None if self.finding is None else self.finding[which],
            cause=None if self.cause is None else self.cause[which], since_ns=None,
            number=None if self.number is None else self.number[which],
            before_ns=None if self.before_ns is None else self.before_ns[which],
        )  # fmt: skip

    def part(self, rows: I64 | Bool) -> FrameRows:
        """Return some of the frames, to be shown with the others: each still follows the one before it."""
        return replace(self.take(rows), since_ns=self.since_shown_ns[rows])

    def placed(self, number: I64, before_ns: I64) -> FrameRows:
        """Return the same frames, each with its number in the capture, and the time of the frame before it there."""
        return replace(self, number=number, before_ns=before_ns)

    def shown_after(self, since_ns: I64) -> FrameRows:
        """Return the same frames, each shown so long after the one that is shown before it."""
        return replace(self, since_ns=since_ns)

    def looked_at_with(self, finding: I64, cause: I64) -> FrameRows:
        """Return the same frames, each looked at with a finding and a cause, by number; -1 for none."""
        return replace(self, finding=finding, cause=cause)


class _Parts(Struct):
    """What was found in some packets, as it is put together."""

    packet: I64
    found: dict[str, Found] = field(default_factory=dict)
    carriers: dict[str, Found] = field(default_factory=dict)

    def add_telegrams(self, telegrams: TelegramBatch, at: I64 | None) -> None:
        """Add telegrams at some positions, and that they came over UDP."""
        if at is not None and len(at) == len(self.packet):
            at = None
        if at is None or len(at):
            self.found[NETVAR] = Found(telegrams, at)
            self.carriers[IP] = self.carriers[UDP] = Found(telegrams.datagram, at)

    def add(self, name: str, part: Any) -> None:
        """Add what a protocol found in the whole batch, as far as it lies in the packets."""
        if found := self._of_packets(part):
            self.found[name] = found

    def add_carriers(self, told: Told) -> None:
        """Add over what the parts came that are no telegrams."""
        own = [self.carriers[UDP].part] if UDP in self.carriers else []
        others = told.others
        udp, tcp = [*own, *self._known(told.batch.datagrams, others)], self._known(told.batch.segments, others)
        ends: list[IpEnds] = [*udp, *tcp]
        if others is not None:
            udp += self._known(others.udp)
            tcp += self._known(others.tcp)
            ends += self._known(others.ends)
        if len(udp) > len(own):
            self._carry(UDP, DatagramBatch.joined(udp))
        if tcp:
            self._carry(TCP, SegmentBatch.joined(tcp))
        if len(ends) > len(own):
            self._carry(IP, IpEnds.joined(ends))

    def add_others(self, others: OtherFrames) -> None:
        """Add the frames in which nothing else was found, and what is in them."""
        self.add(OTHER, others.frames)
        for name, part in ((ARP, others.arp), (ICMP, others.icmp), (ICMPV6, others.icmpv6)):
            if found := self._of_packets(part):
                self.carriers[name] = found

    def protocol(self) -> U8:
        """Return which of what was found each packet is of."""
        number = np.zeros(len(self.packet), np.uint8)
        for place, found in enumerate(self.found.values()):
            if found.at is not None:
                number[found.at] = place
        return number

    def _known(self, part: Any, others: OtherFrames | None = None) -> list[Any]:
        """Return what of a part lies in the packets, none of it in frames that were read otherwise; [] without any."""
        if others is not None and len(part):
            part = part.take(~np.isin(part.row, others.frames.row))
        found = self._of_packets(part)
        return [found.part] if found else []

    def _carry(self, name: str, part: Any) -> None:
        at = np.searchsorted(self.packet, part.row)
        self.carriers[name] = Found(part, None if len(at) == len(self.packet) else at)

    def _of_packets(self, part: Any) -> Found | None:
        at = np.searchsorted(self.packet, part.row)
        inside = at < len(self.packet)
        inside[inside] = self.packet[at[inside]] == part.row[inside]
        if not inside.any():
            return None
        if not inside.all():
            part, at = part.take(inside), at[inside]
        return Found(part, None if len(at) == len(self.packet) else at)


class PacketRows:
    """The telegrams, CAN frames and what else is found of batches, or all their frames, as ``FrameRows``.

    After ``limit`` frames there are no more (``full``), whether the filter chose them or not; those that it does not
    choose are left out, and count as not shown. Pieces are small in frames and in bytes, so that text made of one of
    them stays small too. ``frames``, ``telegrams`` (frames in which something was found, or all where all are wanted)
    and ``fragments`` (IP fragments, which are not put together) count what has been read so far, ``shown`` what was
    chosen. ``has_others``: something else than telegrams was found in some of them.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, *, limit: int | None = None) -> None:
        self._limit = limit
        self._rows: FrameRows | None = None
        self._shown_before_ns: int | None = None
        self.frames = 0
        self.telegrams = 0
        self.shown = 0
        self.fragments = 0
        self.has_others = False

    @property
    def full(self) -> bool:
        """Whether there are as many telegrams as are wanted."""
        return self.telegrams == self._limit

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.fragments += told.batch.fragments
        self.frames += len(told)
        self.has_others |= any(len(part.row) for part in told.parts.values())
        own = told.wanted
        if self._limit is not None:
            own = own[: self._limit - self.telegrams]
        self.telegrams += len(own)
        if told.chosen is not None:
            own = own[told.chosen[own]]
        self._rows = FrameRows.of(told, own)

    def pieces(self) -> Iterator[FrameRows]:
        """Yield the rows of the batch observed last."""
        if self._rows is None:
            return
        for piece in _pieces(self._rows):
            self.shown += len(piece)
            yield replace(piece, shown_before_ns=self._shown_before_ns)
            self._shown_before_ns = int(piece.ts_ns[-1])


def _pieces(rows: FrameRows) -> Iterator[FrameRows]:
    """Cut frames into pieces of a limited number of them and of captured bytes, but of at least one each."""
    captured = rows.packets.captured
    if len(rows) != len(captured):
        captured = captured[rows.row]
    for part in stretches(captured, _PIECE_FRAMES, _PIECE_BYTES):
        whole = part.stop - part.start == len(rows)
        yield rows if whole else rows.take(np.arange(part.start, part.stop))
