"""pcapng files, as of draft-ietf-opsawg-pcapng.

::

    block        type u32 | total length u32 | body, padded to 4 | total length u32
    section      magic u32 | major u16 | minor u16 | section length i64 | options
    interface    link type u16 | reserved u16 | snap length u32 | options
    enhanced     interface u32 | time high u32 | time low u32 | captured u32 | original u32 | bytes, padded | options
    obsolete     interface u16 | drops u16, then like enhanced
    simple       original u32 | bytes, padded
    statistics   interface u32 | time high u32 | time low u32 | options
    option       code u16 | length u16 | value, padded to 4

Every section has a byte order, which its magic tells, and its own interfaces, numbered from 0 as they come.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from dissectors.batch import I64, U8, U16, U32, U64, Bool, PacketBatch
from nvscope.capture.batch_builder import join
from nvscope.capture.output import FileSink
from nvscope.capture.reader import (
    MAX_PACKET_BYTES,
    MAX_SNAP_BYTES,
    TIME_LIMIT_NS,
    ReadingSizes,
    RecordReader,
    Taken,
)
from nvscope.capture.source import SourceInfo
from nvscope.capture.spans import BATCH_BYTES, copy_spans, put_blocks, stretches
from nvscope.capture.window import View
from nvscope.errors import UnreadableInput

SECTION = 0x0A0D0D0A
INTERFACE = 1
OBSOLETE_PACKET = 2
SIMPLE_PACKET = 3
STATISTICS = 5
ENHANCED_PACKET = 6

BYTE_ORDER_MAGIC = 0x1A2B3C4D
# The section's magic as bytes → byte order.
BYTE_ORDERS: dict[bytes, str] = {struct.pack(order + "I", BYTE_ORDER_MAGIC): order for order in "<>"}

# Fewest bytes of a block of each type, both lengths included.
_FEWEST_BYTES = {SECTION: 28, INTERFACE: 20, STATISTICS: 24}
_PACKET_OVERHEAD = 32
_SIMPLE_OVERHEAD = 16

_OPTION_END = 0
_OPTION_COMMENT = 1
_OPTION_INTERFACE_NAME = 2
_OPTION_TIME_RESOLUTION = 9
_OPTION_TIME_OFFSET = 14
_OPTION_PACKET_DROPS = 4
_OPTION_INTERFACE_DROPS = 5
_OPTION_SYSTEM_DROPS = 7

MAX_BLOCK_BYTES = MAX_SNAP_BYTES + (1 << 20)
MAX_INTERFACES = 65_536
MAX_CHANNELS = 65_536
MAX_NAME_BYTES = 256
MAX_COMMENTS = 10_000
MAX_COMMENT_BYTES = 4 << 20
_MAX_PACKET_OPTIONS = 64
_MAX_BLOCK_OPTIONS = 1024
_UNKNOWN_DROPS = 0xFFFF
# One count of a field of 64 bits is not believed beyond this, so that sums stay int64.
_MOST_DROPS = 1 << 40

_DEFAULT_RESOLUTION = 6


class BlockFraming:
    """Where blocks follow each other; a likely packet block has the type of the one before, and its length twice."""

    header_bytes = 8
    length_at = 4
    length_adds = 0
    shortest = 12
    longest = MAX_BLOCK_BYTES
    alignment = 4

    def __init__(self, byte_order: str) -> None:
        self.byte_order = byte_order
        self.packet_type = ENHANCED_PACKET

    def words(self, data: U8, at: I64, count: int) -> U32:
        """Return ``count`` (1, 2 or 4) 32-bit words at each position, as (n, count)."""
        # Void items are copied as one block; a structured type would be copied field by field.
        spans = np.ndarray((max(len(data) - 4 * count + 1, 0),), f"V{4 * count}", buffer=data, strides=(1,))
        words: U32 = spans[at].view(self.byte_order + "u4").reshape(-1, count)
        return words

    def needle(self, data: U8, start: int) -> tuple[int, int]:
        return 0, int.from_bytes(struct.pack(self.byte_order + "I", self.packet_type), sys.byteorder)

    def plausible(self, data: U8, at: I64, start: int) -> Bool:
        length = self.words(data, at, 2)[:, 1].astype(np.int64)
        likely: Bool = (length >= self.shortest) & (length & 3 == 0) & (at + length <= len(data))
        last_word = np.where(likely, at + length - 4, at)
        likely &= self.words(data, last_word, 1)[:, 0] == length
        return likely


@dataclass(slots=True)
class Interface:
    """One interface of a section. ``longest`` are the captured bytes of a packet that are believed.

    ``channel`` is the number of its name among those of the file; interfaces of one name are one channel.
    """

    position: int
    link: int
    snap_bytes: int
    channel: int = 0
    resolution: int = _DEFAULT_RESOLUTION
    offset_s: int = 0
    statistics_drops: int | None = None
    packet_drops: int = 0

    @property
    def longest(self) -> int:
        return max(MAX_PACKET_BYTES, min(self.snap_bytes, MAX_SNAP_BYTES))

    @property
    def drops(self) -> int:
        return self.packet_drops if self.statistics_drops is None else self.statistics_drops


def nanoseconds(units: U64, resolution: int) -> I64:
    """Return times in units of an interface's resolution option as ns, rounded down, at most ``TIME_LIMIT_NS``.

    ``resolution`` is the option's byte: the negative exponent of 10 or, with the highest bit set, of 2.
    """
    exponent = resolution & 0x7F
    if not resolution & 0x80:
        if exponent <= 9:
            factor = 10 ** (9 - exponent)
            units = np.minimum(units, np.uint64(TIME_LIMIT_NS // factor + 1)) * np.uint64(factor)
        else:
            divisor = 10 ** (exponent - 9)
            units = units // np.uint64(divisor) if divisor < 1 << 64 else np.zeros_like(units)
        return np.minimum(units, np.uint64(TIME_LIMIT_NS)).astype(np.int64)
    billion = np.uint64(1_000_000_000)
    if exponent < 64:
        seconds = units >> np.uint64(exponent)
        fraction = units & np.uint64((1 << exponent) - 1)
    else:
        seconds, fraction = np.zeros_like(units), units
    # fraction × 10⁹ ÷ 2^exponent in two halves of 32 bits, as the product may have 94.
    high = (fraction >> np.uint64(32)) * billion
    low = (fraction & np.uint64(0xFFFFFFFF)) * billion
    if exponent <= 32:
        part = low >> np.uint64(exponent)
    elif exponent < 96:
        part = (high + (low >> np.uint64(32))) >> np.uint64(exponent - 32)
    else:
        part = np.zeros_like(units)
    seconds = np.minimum(seconds, np.uint64(TIME_LIMIT_NS // 1_000_000_000 + 1))
    ts_ns: I64 = np.minimum(seconds * billion + part, np.uint64(TIME_LIMIT_NS)).astype(np.int64)
    return ts_ns


@dataclass(slots=True)
class _Packets:
    """Columns of the packet blocks of a stretch, before their interfaces are looked up."""

    at: I64
    index: I64
    length: I64
    interface: I64
    captured: I64
    original: I64
    units: U64
    simple: Bool | None
    drops: I64 | None

    def __getitem__(self, rows: slice) -> _Packets:
        return _Packets(
            self.at[rows],
            self.index[rows],
            self.length[rows],
            self.interface[rows],
            self.captured[rows],
            self.original[rows],
            self.units[rows],
            None if self.simple is None else self.simple[rows],
            None if self.drops is None else self.drops[rows],
        )


@dataclass(slots=True)
class _Stretch:
    """Some blocks of one section that follow each other: where they begin, and their first four words."""

    view: View
    at: I64
    words: U32
    fault: str = ""
    comments: list[tuple[int, int | None, bytes]] = field(default_factory=list)

    def cut(self, index: int, fault: str) -> None:
        self.at, self.words, self.fault = self.at[:index], self.words[:index], fault


class PcapngReader(RecordReader):
    """Reads the blocks of one pcapng file, which begins with ``head`` (at least a whole section header)."""

    framing: BlockFraming

    def __init__(self, head: bytes, info: SourceInfo, sizes: ReadingSizes) -> None:
        super().__init__(info, 0, sizes)
        info.format = "pcapng"
        byte_order = BYTE_ORDERS.get(head[8:12])
        if byte_order is None and len(head) >= 12:
            raise UnreadableInput(
                f"the byte order magic {head[8:12].hex(' ')}, expected 1a 2b 3c 4d or its reverse",
                where=f"{info.path}, offset 8",
            )
        fewest = _FEWEST_BYTES[SECTION]
        length = struct.unpack_from(f"{byte_order}I", head, 4)[0] if byte_order else fewest
        if len(head) < fewest:
            raise UnreadableInput(
                f"the file ends within its header: {len(head)} bytes, expected a section header of {length}",
                where=f"{info.path}, offset {len(head)}",
                next_step="copy the file again; it holds no packet",
            )
        major, minor = struct.unpack_from(f"{byte_order}HH", head, 12)
        if major != 1:
            raise UnreadableInput(f"pcapng version {major}.{minor}, expected 1.x", where=f"{info.path}, offset 12")
        self.framing = self._blocks = BlockFraming(byte_order or "<")
        self._interfaces: list[Interface] = []
        self._names: dict[str, int] = {}
        self._unsaid: list[str] = []
        self._closed_drops = 0
        self._last_ts_ns = 0
        self._comment_bytes = 0

    def _take(self, view: View, found: I64) -> Taken:
        framing = self._blocks = self.framing
        words = framing.words(view.data, found, 4)
        sections = np.flatnonzero(words[:, 0] == SECTION)
        usable, after, fault, incomplete = self._up_to_other_order(view, found, sections)
        ends = np.append(usable[1:], after)
        mismatch = framing.words(view.data, ends[: len(usable)] - 4, 1)[:, 0] != words[: len(usable), 1]
        if mismatch.any():
            first = int(mismatch.argmax())
            after, incomplete = int(usable[first]), False
            fault = "a block whose second length differs from its first"
            usable = usable[:first]
        parts: list[PacketBatch] = []
        frames = self.info.frames
        bounds = [0, *sections[(sections > 0) & (sections < len(usable))].tolist(), len(usable)]
        for begin, end in pairwise(bounds):
            stretch = _Stretch(view, usable[begin:end], words[begin:end])
            part = self._decode(stretch, frames)
            frames += len(part)
            parts.append(part)
            if stretch.fault:
                fault, incomplete = stretch.fault, False
                after = int(usable[begin + len(stretch.at)])
                break
        self.info.drops = self._closed_drops + sum(interface.drops for interface in self._interfaces)
        return Taken(join(parts), after, fault, incomplete)

    def _up_to_other_order(self, view: View, found: I64, sections: I64) -> tuple[I64, int, str, bool]:
        """Like ``_judge_last``, but end before a section in the other byte order, and take that order from there on."""
        for index in sections.tolist():
            at = int(found[index])
            if at + 12 > view.end:
                return found[:index], at, "", True
            magic = view.data[at + 8 : at + 12].tobytes()
            order = BYTE_ORDERS.get(magic)
            if order is None:
                return found[:index], at, f"a section header with the byte order magic {magic.hex(' ')}", False
            if order != self._blocks.byte_order:
                self.framing = BlockFraming(order)
                return found[:index], at, "", False
        return self._judge_last(view, found)

    def _decode(self, stretch: _Stretch, frames: int) -> PacketBatch:
        """Return the packets of blocks of one section; ``frames`` are the packets before them."""
        types = stretch.words[:, 0]
        is_packet = types == self._blocks.packet_type
        others = np.flatnonzero(~is_packet)
        defines = False
        if len(others):
            special = others[np.isin(types[others], (SECTION, INTERFACE, STATISTICS))]
            fewest = np.array([_FEWEST_BYTES[kind] for kind in types[special].tolist()], np.int64)
            short = np.flatnonzero(stretch.words[special, 1] < fewest)
            if len(short):
                index = int(special[short[0]])
                stretch.cut(index, f"a block of type {int(types[index])} and only {int(stretch.words[index, 1])} bytes")
                special = special[special < index]
                types = types[:index]
            defines = self._define_interfaces(stretch, special)
            types = types[: len(stretch.at)]
            special = special[special < len(stretch.at)]
            is_packet = (types == ENHANCED_PACKET) | (types == SIMPLE_PACKET) | (types == OBSOLETE_PACKET)
        else:
            special = others
        packets = self._packets(stretch, np.flatnonzero(is_packet))
        if not self._interfaces and len(packets.at):
            stretch.cut(int(packets.index[0]), "a packet of an interface that is not described")
            packets = packets[:0]
        table = _InterfaceTable(self._interfaces)
        packets = self._check(stretch, packets, table, defines)
        self._read_statistics(stretch, special)
        self._read_packet_options(stretch, packets, frames)
        self._keep_comments(stretch)
        if len(packets.at):
            self._blocks.packet_type = int(stretch.words[packets.index[-1], 0])
        return self._batch(stretch, packets, table)

    def _define_interfaces(self, stretch: _Stretch, special: I64) -> bool:
        defined = False
        for index in special.tolist():
            kind = int(stretch.words[index, 0])
            body = self._body(stretch, index)
            if kind == SECTION:
                major, minor = struct.unpack_from(f"{self._blocks.byte_order}HH", body, 4)
                if major != 1:
                    stretch.cut(index, f"a section of pcapng version {major}.{minor}, expected 1.x")
                    break
                self._closed_drops += sum(interface.drops for interface in self._interfaces)
                self._interfaces = []
                stretch.comments += self._comments(index, body[16:])
            elif kind == INTERFACE:
                if len(self._interfaces) >= MAX_INTERFACES:
                    stretch.cut(index, f"more than {MAX_INTERFACES} interfaces in a section")
                    break
                interface = self._interface(stretch.view.origin + int(stretch.at[index]), body)
                if interface.channel >= MAX_CHANNELS:
                    stretch.cut(index, f"more than {MAX_CHANNELS} names of interfaces")
                    break
                self._interfaces.append(interface)
                stretch.comments += self._comments(index, body[8:])
                defined = True
        return defined

    def _interface(self, position: int, body: bytes) -> Interface:
        order = self._blocks.byte_order
        link, _, snap_bytes = struct.unpack_from(order + "HHI", body)
        interface = Interface(position, link, snap_bytes)
        name = ""
        for code, value in self._options(body[8:]):
            if code == _OPTION_TIME_RESOLUTION and len(value) == 1:
                interface.resolution = value[0]
            elif code == _OPTION_TIME_OFFSET and len(value) == 8:
                interface.offset_s = struct.unpack(order + "q", value)[0]
            elif code == _OPTION_INTERFACE_NAME:
                name = value[:MAX_NAME_BYTES].rstrip(b"\0").decode("utf-8", "replace")
        self._number_channel(interface, name)
        return interface

    def _number_channel(self, interface: Interface, name: str) -> None:
        """Give an interface the number of its name; a file with one interface without a name tells no channels."""
        known = name or f"interface {len(self._interfaces)}"
        if known not in self._names:
            self._names[known] = len(self._names)
            self._unsaid.append(known)
        interface.channel = self._names[known]
        if name or len(self._names) > 1:
            self.channels += self._unsaid
            self._unsaid.clear()

    def _packets(self, stretch: _Stretch, index: I64) -> _Packets:
        """Return the columns of the packet blocks at ``index``, whatever is in them."""
        at, words = stretch.at, stretch.words
        if len(index) != len(at):
            at, words = at[index], words[index]
        types = words[:, 0]
        more = self._blocks.words(stretch.view.data, at + 16, 4)
        interface = words[:, 2].astype(np.int64)
        captured = more[:, 1].astype(np.int64)
        original = more[:, 2].astype(np.int64)
        units = (words[:, 3].astype(np.uint64) << np.uint64(32)) | more[:, 0]
        simple: Bool | None = None
        drops: I64 | None = None
        if not (types == ENHANCED_PACKET).all():
            obsolete = types == OBSOLETE_PACKET
            first, second = interface & 0xFFFF, interface >> 16
            if self._blocks.byte_order == ">":
                first, second = second, first
            drops = np.where(obsolete & (second != _UNKNOWN_DROPS), second, 0)
            simple = types == SIMPLE_PACKET
            original = np.where(simple, interface, original)
            captured = np.where(simple, interface, captured)
            interface = np.where(obsolete, first, np.where(simple, 0, interface))
        return _Packets(at, index, words[:, 1].astype(np.int64), interface, captured, original, units, simple, drops)

    def _check(self, stretch: _Stretch, packets: _Packets, table: _InterfaceTable, defines: bool) -> _Packets:
        """Return the packets before the first one that cannot be right, and cut the stretch there."""
        if not len(packets.at):
            return packets
        known = packets.interface < len(self._interfaces)
        interface = packets.interface if known.all() else np.where(known, packets.interface, 0)
        if defines:
            known &= table.position[interface] < packets.at + stretch.view.origin
        room = packets.length - _PACKET_OVERHEAD
        if packets.simple is not None:
            room = np.where(packets.simple, packets.length - _SIMPLE_OVERHEAD, room)
            snapped = np.minimum(packets.captured, table.snap_bytes[interface])
            packets.captured = np.where(packets.simple, snapped, packets.captured)
        good = known & (packets.captured <= room) & (packets.captured <= table.longest[interface])
        if good.all():
            return packets
        first = int(good.argmin())
        if not known[first]:
            fault = f"a packet of interface {int(packets.interface[first])}, which is not described"
        else:
            fault = (
                f"a packet of {int(packets.captured[first])} captured bytes, expected at most "
                f"{max(min(int(room[first]), int(table.longest[interface[first]])), 0)}"
            )
        stretch.cut(int(packets.index[first]), fault)
        return packets[:first]

    def _batch(self, stretch: _Stretch, packets: _Packets, table: _InterfaceTable) -> PacketBatch:
        count = len(packets.at)
        offset = packets.at + 28
        if packets.simple is not None:
            offset -= np.where(packets.simple, 16, 0)
        ts_ns = table.ts_ns(packets.units, packets.interface)
        if packets.simple is not None:
            # A simple packet has no time of its own: that of the packet before it in the file.
            timed = np.where(packets.simple, -1, np.arange(count))
            before = np.maximum.accumulate(timed)
            ts_ns = np.where(before >= 0, ts_ns[before], self._last_ts_ns)
        if count:
            self._last_ts_ns = int(ts_ns[-1])
        link = table.only_link
        channel = table.channel[packets.interface] if table.channel is not None else None
        return PacketBatch(
            stretch.view.data,
            offset,
            packets.captured.astype(np.int32),
            packets.original,
            ts_ns,
            PacketBatch.link_column(link, count) if link is not None else table.link[packets.interface],
            channel,
        )

    def _read_statistics(self, stretch: _Stretch, special: I64) -> None:
        order = self._blocks.byte_order
        for index in special[special < len(stretch.at)].tolist():
            if int(stretch.words[index, 0]) != STATISTICS:
                continue
            body = self._body(stretch, index)
            stretch.comments += self._comments(index, body[12:])
            number = int(stretch.words[index, 2])
            at = stretch.view.origin + int(stretch.at[index])
            if number >= len(self._interfaces) or self._interfaces[number].position > at:
                continue
            counts = [
                min(struct.unpack(order + "Q", value)[0], _MOST_DROPS)
                for code, value in self._options(body[12:])
                if code in (_OPTION_INTERFACE_DROPS, _OPTION_SYSTEM_DROPS) and len(value) == 8
            ]
            if counts:
                self._interfaces[number].statistics_drops = sum(counts)

    def _read_packet_options(self, stretch: _Stretch, packets: _Packets, frames: int) -> None:
        """Collect comments and drop counts, one option of every packet at a time."""
        if packets.drops is not None:
            self._add_drops(packets.interface, packets.drops)
        begin = packets.at + 28 + ((packets.captured + 3) & ~3)
        end = packets.at + packets.length - 4
        rows = np.flatnonzero(begin + 4 <= end)
        if packets.simple is not None:
            rows = rows[~packets.simple[rows]]
        at, end = begin[rows], end[rows]
        data = stretch.view.data
        for _ in range(_MAX_PACKET_OPTIONS):
            if not len(rows):
                break
            word = self._blocks.words(data, at, 1)[:, 0].astype(np.int64)
            code, length = word & 0xFFFF, word >> 16
            if self._blocks.byte_order == ">":
                code, length = length, code
            value = at + 4
            following = value + ((length + 3) & ~3)
            going = (code != _OPTION_END) & (following <= end)
            for hit in np.flatnonzero(going & (code == _OPTION_COMMENT)).tolist():
                text = data[value[hit] : value[hit] + length[hit]].tobytes()
                row = int(rows[hit])
                stretch.comments.append((int(packets.index[row]), frames + row + 1, text))
            counts = np.flatnonzero(going & (code == _OPTION_PACKET_DROPS) & (length == 8))
            if packets.drops is not None:
                counts = counts[stretch.words[packets.index[rows[counts]], 0] == ENHANCED_PACKET]
            if len(counts):
                halves = self._blocks.words(data, value[counts], 2).astype(np.int64)
                high, low = (
                    (halves[:, 1], halves[:, 0]) if self._blocks.byte_order == "<" else (halves[:, 0], halves[:, 1])
                )
                drops = (np.minimum(high, _MOST_DROPS >> 32) << 32) | low
                self._add_drops(packets.interface[rows[counts]], np.minimum(drops, _MOST_DROPS))
            going &= following + 4 <= end
            rows, at, end = rows[going], following[going], end[going]

    def _add_drops(self, interface: I64, drops: I64) -> None:
        for number in np.unique(interface[drops > 0]).tolist():
            self._interfaces[number].packet_drops += int(drops[interface == number].sum())

    def _body(self, stretch: _Stretch, index: int) -> bytes:
        at = int(stretch.at[index])
        return stretch.view.data[at + 8 : at + int(stretch.words[index, 1]) - 4].tobytes()

    def _options(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        at = 0
        for _ in range(_MAX_BLOCK_OPTIONS):
            if at + 4 > len(data):
                return
            code, length = struct.unpack_from(self._blocks.byte_order + "HH", data, at)
            if code == _OPTION_END or at + 4 + length > len(data):
                return
            yield code, data[at + 4 : at + 4 + length]
            at += 4 + (length + 3 & ~3)

    def _comments(self, index: int, options: bytes) -> list[tuple[int, int | None, bytes]]:
        return [(index, None, value) for code, value in self._options(options) if code == _OPTION_COMMENT]

    def _keep_comments(self, stretch: _Stretch) -> None:
        """Keep the comments before the end of the stretch, in the order of the file."""
        for index, frame, text in sorted(stretch.comments, key=lambda comment: comment[0]):
            self._comment_bytes += len(text)
            full = len(self.info.comments) >= MAX_COMMENTS or self._comment_bytes > MAX_COMMENT_BYTES
            if index >= len(stretch.at) or full:
                break
            self.info.comments.append((frame, text.decode("utf-8", "replace")))


class _InterfaceTable:
    """The interfaces of a section as columns, to look up those of many packets at once."""

    def __init__(self, interfaces: list[Interface]) -> None:
        self._interfaces = interfaces
        self.position = np.array([each.position for each in interfaces], np.int64)
        self.link: U16 = np.array([each.link for each in interfaces], np.uint16)
        self.longest = np.array([each.longest for each in interfaces], np.int64)
        self.snap_bytes = np.array([each.snap_bytes or MAX_SNAP_BYTES for each in interfaces], np.int64)
        links = {each.link for each in interfaces}
        self.only_link = links.pop() if len(links) == 1 else None
        self.channel: U16 | None = None
        if any(each.channel for each in interfaces):
            self.channel = np.array([each.channel for each in interfaces], np.uint16)

        self.resolution = np.array([each.resolution for each in interfaces], np.int64)
        self.resolutions = sorted({each.resolution for each in interfaces})
        offsets = [min(max(each.offset_s * 1_000_000_000, -TIME_LIMIT_NS), TIME_LIMIT_NS) for each in interfaces]
        self.offset_ns = np.array(offsets, np.int64) if any(offsets) else None

    def ts_ns(self, units: U64, interface: I64) -> I64:
        """Return the times of packets, each in its interface's resolution and offset."""
        if len(self.resolutions) == 1:
            ts_ns = nanoseconds(units, self.resolutions[0])
        else:
            ts_ns = np.zeros(len(units), np.int64)
            of_row = self.resolution[interface]
            for resolution in np.unique(of_row).tolist():
                rows = of_row == resolution
                ts_ns[rows] = nanoseconds(units[rows], resolution)
        if self.offset_ns is not None:
            ts_ns += self.offset_ns[interface]
            np.clip(ts_ns, -TIME_LIMIT_NS, TIME_LIMIT_NS, out=ts_ns)
        return ts_ns


class PcapngSink(FileSink):
    """Writes packets of any link types to a pcapng file of one section in this machine's byte order, times in ns.

    Every link type is an interface; with ``channels``, names by number that may grow, every channel of it is one, and
    has its name. Packets are cut to ``MAX_PACKET_BYTES``, times before 1970 become 1970.
    """

    def __init__(self, path: str, channels: Sequence[str] | None = None) -> None:
        super().__init__(path)
        self._channels = channels
        self._numbers: dict[int, int] = {}
        self._output.write(struct.pack("=IIIHHqI", SECTION, 28, BYTE_ORDER_MAGIC, 1, 0, -1, 28))

    def write(self, batch: PacketBatch) -> None:
        if not len(batch):
            return
        key = batch.link.astype(np.int64)
        if self._channels is not None:
            key = key << 16 | batch.channels
        seen, key = np.unique(key, return_inverse=True)
        for known in seen.tolist():
            if known not in self._numbers:
                self._numbers[known] = len(self._numbers)
                self._output.write(self._interface(known))
        interface = np.array([self._numbers[known] for known in seen.tolist()], np.uint32)[key]
        for rows in stretches(batch.captured, len(batch), BATCH_BYTES):
            self._output.write(self._blocks(batch[rows], interface[rows]))

    def _interface(self, key: int) -> bytes:
        link, options = key, b""
        if self._channels is not None:
            link, channel = key >> 16, key & 0xFFFF
            name = self._channels[channel].encode("utf-8", "replace") if channel < len(self._channels) else b""
            if name:
                options = struct.pack("=HH", _OPTION_INTERFACE_NAME, len(name)) + name + bytes(-len(name) % 4)
        options += struct.pack("=HHB3xHH", _OPTION_TIME_RESOLUTION, 1, 9, _OPTION_END, 0)
        size = 20 + len(options)
        return struct.pack("=IIHHI", INTERFACE, size, link, 0, MAX_PACKET_BYTES) + options + struct.pack("=I", size)

    def _blocks(self, batch: PacketBatch, interface: U32) -> U8:
        captured = np.minimum(batch.captured, MAX_PACKET_BYTES).astype(np.int64)
        sizes = (captured + 3 & ~3) + _PACKET_OVERHEAD
        ends = np.cumsum(sizes)
        begins = ends - sizes
        units = np.maximum(batch.ts_ns, 0)
        headers = np.empty((len(batch), 7), np.uint32)
        headers[:, 0] = ENHANCED_PACKET
        headers[:, 1] = sizes
        headers[:, 2] = interface
        headers[:, 3] = units >> 32
        headers[:, 4] = units & 0xFFFFFFFF
        headers[:, 5] = captured
        headers[:, 6] = np.clip(batch.original, 0, 0xFFFFFFFF)
        blocks = np.zeros(int(ends[-1]), np.uint8)
        put_blocks(blocks, begins, headers)
        put_blocks(blocks, ends - 4, np.ascontiguousarray(headers[:, 1:2]))
        copy_spans(blocks, begins + 28, batch.data, batch.offset, captured)
        return blocks
