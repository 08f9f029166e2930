"""Reads pcapng files."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64, U8, U32, Direction, PacketBatch
from nvscope.capture.batch_builder import join
from nvscope.capture.byte_window import View
from nvscope.capture.content import Content
from nvscope.capture.pcapng.blocks import (
    BYTE_ORDERS,
    ENHANCED_PACKET,
    FEWEST_BYTES,
    INTERFACE,
    OBSOLETE_PACKET,
    OPTION_COMMENT,
    OPTION_END,
    OPTION_INTERFACE_DROPS,
    OPTION_INTERFACE_NAME,
    OPTION_PACKET_DROPS,
    OPTION_PACKET_FLAGS,
    OPTION_SYSTEM_DROPS,
    OPTION_TIME_OFFSET,
    OPTION_TIME_RESOLUTION,
    PACKET_OVERHEAD,
    SECTION,
    SIMPLE_OVERHEAD,
    SIMPLE_PACKET,
    STATISTICS,
    BlockFraming,
)
from nvscope.capture.pcapng.interfaces import Interface, InterfaceTable
from nvscope.capture.pcapng.losses import Losses
from nvscope.capture.pcapng.packet_blocks import PacketBlocks
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.record_reader import RecordReader, Taken
from nvscope.capture.source import DropsPart
from nvscope.errors import UnreadableInput

MAX_INTERFACES = 65_536
MAX_CHANNELS = 65_536
MAX_NAME_BYTES = 256
MAX_COMMENTS = 10_000
MAX_COMMENT_BYTES = 4 << 20
_MAX_PACKET_OPTIONS = 64
_NO_TIME = "a time before 1823 or after 2116, in place of which stands that of the frame in front, or 1970"
_DIRECTION_BITS = 3
_MAX_BLOCK_OPTIONS = 1024
# One count of a field of 64 bits is not believed beyond this, so that sums stay int64.
_MOST_DROPS = 1 << 40
_DROPS_PARTS = {OPTION_INTERFACE_DROPS: DropsPart.INTERFACE, OPTION_SYSTEM_DROPS: DropsPart.KERNEL}


class _Stretch(Struct):
    """Some blocks of one section that follow each other: where they begin, and their first four words."""

    view: View
    at: I64
    words: U32
    fault: str = ""
    comments: list[tuple[int, int | None, bytes]] = field(default_factory=list)

    def cut(self, index: int, fault: str) -> None:
        self.at, self.words, self.fault = self.at[:index], self.words[:index], fault


class PcapngReader(RecordReader):
    """Reads the blocks of one pcapng file, which begins with a whole section header."""

    framing: BlockFraming

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        head = content.head
        byte_order = BYTE_ORDERS.get(head[8:12])
        if byte_order is None and len(head) >= 12:
            raise UnreadableInput(
                f"the byte order magic {head[8:12].hex(' ')}, expected 1a 2b 3c 4d or its reverse",
                where=f"{content.path}, offset 8",
            )
        fewest = FEWEST_BYTES[SECTION]
        length = struct.unpack_from(f"{byte_order}I", head, 4)[0] if byte_order else fewest
        if len(head) < fewest:
            raise UnreadableInput(
                f"the file ends within its header: {len(head)} bytes, expected a section header of {length}",
                where=f"{content.path}, offset {len(head)}",
                next_step="copy the file again; it holds no packet",
            )
        major, minor = struct.unpack_from(f"{byte_order}HH", head, 12)
        if major != 1:
            raise UnreadableInput(f"pcapng version {major}.{minor}, expected 1.x", where=f"{content.path}, offset 12")
        self.framing = self._blocks = BlockFraming(byte_order or "<")
        self._interfaces: list[Interface] = []
        self._names: dict[str, int] = {}
        self._unsaid: list[str] = []
        self._losses = Losses()
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
        frames = self.progress.frames
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
        self.progress.drops, self.progress.drops_by = self._losses.counted(self._interfaces)
        self.progress.lost = self._losses.spans(self._interfaces)
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
            fewest = np.array([FEWEST_BYTES[kind] for kind in types[special].tolist()], np.int64)
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
        packets = PacketBlocks.of(self._blocks, stretch.view.data, stretch.at, stretch.words, np.flatnonzero(is_packet))
        if not self._interfaces and len(packets.at):
            stretch.cut(int(packets.index[0]), "a packet of an interface that is not described")
            packets = packets[:0]
        table = InterfaceTable(self._interfaces)
        packets = self._check(stretch, packets, table, defines)
        self._read_statistics(stretch, special)
        direction = self._read_packet_options(stretch, packets, frames)
        self._keep_comments(stretch)
        if len(packets.at):
            self._blocks.packet_type = int(stretch.words[packets.index[-1], 0])
        return replace(self._batch(stretch, packets, table, frames), direction=direction)

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
                self._losses.close(self._interfaces)
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
            if code == OPTION_TIME_RESOLUTION and len(value) == 1:
                interface.resolution = value[0]
            elif code == OPTION_TIME_OFFSET and len(value) == 8:
                interface.offset_s = struct.unpack(order + "q", value)[0]
            elif code == OPTION_INTERFACE_NAME:
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

    def _check(self, stretch: _Stretch, packets: PacketBlocks, table: InterfaceTable, defines: bool) -> PacketBlocks:
        """Return the packets before the first one that cannot be right, and cut the stretch there."""
        if not len(packets.at):
            return packets
        known = packets.interface < len(self._interfaces)
        interface = packets.interface if known.all() else np.where(known, packets.interface, 0)
        if defines:
            known &= table.position[interface] < packets.at + stretch.view.origin
        room = packets.length - PACKET_OVERHEAD
        if packets.simple is not None:
            room = np.where(packets.simple, packets.length - SIMPLE_OVERHEAD, room)
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

    def _batch(self, stretch: _Stretch, packets: PacketBlocks, table: InterfaceTable, frames: int) -> PacketBatch:
        count = len(packets.at)
        offset = packets.at + 28
        if packets.simple is not None:
            offset -= np.where(packets.simple, 16, 0)
        ts_ns, known = table.ts_ns(packets.units, packets.interface)
        if packets.simple is not None:
            known = ~packets.simple if known is None else known & ~packets.simple
        if known is not None:
            # What has no time of its own, or none that can be, has that of the packet before it in the file.
            timed = np.where(known, np.arange(count), -1)
            before = np.maximum.accumulate(timed)
            ts_ns = np.where(before >= 0, ts_ns[before], self._last_ts_ns)
            wrong = np.flatnonzero(~known if packets.simple is None else ~known & ~packets.simple)
            if len(wrong):
                at = stretch.view.origin + int(packets.at[wrong[0]])
                self._doubt_times(wrong, at, frames, _NO_TIME)
        if count:
            self._last_ts_ns = int(ts_ns[-1])
        self._losses.settle(self._interfaces, packets.interface, ts_ns)
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
            counts: Counter[str] = Counter()
            for code, value in self._options(body[12:]):
                if code in _DROPS_PARTS and len(value) == 8:
                    counts[_DROPS_PARTS[code].value] += min(struct.unpack(order + "Q", value)[0], _MOST_DROPS)
            if counts:
                high, low = struct.unpack_from(f"{order}II", body, 4)
                self._interfaces[number].take_statistics(high << 32 | low, counts)

    def _read_packet_options(self, stretch: _Stretch, packets: PacketBlocks, frames: int) -> U8 | None:
        """Collect comments and drop counts, one option of every packet at a time; return directions, if any is told."""
        direction: U8 | None = None
        if packets.drops is not None:
            self._losses.note(np.arange(len(packets.drops)), packets.drops)
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
            going = (code != OPTION_END) & (following <= end)
            for hit in np.flatnonzero(going & (code == OPTION_COMMENT)).tolist():
                text = data[value[hit] : value[hit] + length[hit]].tobytes()
                row = int(rows[hit])
                stretch.comments.append((int(packets.index[row]), frames + row + 1, text))
            flags = np.flatnonzero(going & (code == OPTION_PACKET_FLAGS) & (length == 4))
            if len(flags):
                flags = flags[stretch.words[packets.index[rows[flags]], 0] == ENHANCED_PACKET]
                told = self._blocks.words(data, value[flags], 1)[:, 0] & np.uint32(_DIRECTION_BITS)
                direction = np.zeros(len(packets.at), np.uint8) if direction is None else direction
                direction[rows[flags]] = np.where(told == _DIRECTION_BITS, Direction.UNKNOWN, told)
            counts = np.flatnonzero(going & (code == OPTION_PACKET_DROPS) & (length == 8))
            if packets.drops is not None:
                counts = counts[stretch.words[packets.index[rows[counts]], 0] == ENHANCED_PACKET]
            if len(counts):
                halves = self._blocks.words(data, value[counts], 2).astype(np.int64)
                high, low = (
                    (halves[:, 1], halves[:, 0]) if self._blocks.byte_order == "<" else (halves[:, 0], halves[:, 1])
                )
                drops = (np.minimum(high, _MOST_DROPS >> 32) << 32) | low
                self._losses.note(rows[counts], np.minimum(drops, _MOST_DROPS))
            going &= following + 4 <= end
            rows, at, end = rows[going], following[going], end[going]
        return direction

    def _body(self, stretch: _Stretch, index: int) -> bytes:
        at = int(stretch.at[index])
        return stretch.view.data[at + 8 : at + int(stretch.words[index, 1]) - 4].tobytes()

    def _options(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        at = 0
        for _ in range(_MAX_BLOCK_OPTIONS):
            if at + 4 > len(data):
                return
            code, length = struct.unpack_from(self._blocks.byte_order + "HH", data, at)
            if code == OPTION_END or at + 4 + length > len(data):
                return
            yield code, data[at + 4 : at + 4 + length]
            at += 4 + (length + 3 & ~3)

    def _comments(self, index: int, options: bytes) -> list[tuple[int, int | None, bytes]]:
        return [(index, None, value) for code, value in self._options(options) if code == OPTION_COMMENT]

    def _keep_comments(self, stretch: _Stretch) -> None:
        """Keep the comments before the end of the stretch, in the order of the file."""
        for index, frame, text in sorted(stretch.comments, key=lambda comment: comment[0]):
            self._comment_bytes += len(text)
            full = len(self.progress.comments) >= MAX_COMMENTS or self._comment_bytes > MAX_COMMENT_BYTES
            if index >= len(stretch.at) or full:
                break
            self.progress.comments.append((frame, text.decode("utf-8", "replace")))
