"""All that is whole in an MCAP file that was cut off or damaged, as a file of its own."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from msgspec import Struct, field

from dissectors.batch import PAD_BYTES, U8
from nvscope.capture.compressed import Unpackable, unpack_into
from nvscope.capture.mcap.packets import ENCODING, LONGEST_NS, MOST_BYTES, packets_in
from nvscope.capture.mcap.records import (
    MAGIC,
    AttachedFile,
    Channel,
    ChunkHead,
    Damaged,
    Metadata,
    Op,
    Schema,
    channels_of_chunk,
)
from nvscope.capture.mcap.unpacking import MESSAGE_HEAD_BYTES
from nvscope.capture.mcap.walk import Place, chunk_behind, place_at, places, record_at, summary_of
from nvscope.capture.mcap.writer import Chunk, McapWriter
from nvscope.units import count_of, duration

_MOST_UNPACKED_BYTES = 256 << 20
_MOST_WORDS = 1_000


class Recovered(Struct):
    """What was recovered of a file, and what was lost.

    ``packets`` and ``messages`` (those of topics) are in the new file. ``lost_packets`` are those known to be missing
    between others; how many were in what is cut off at the end, nobody knows. ``gaps_ns`` are the times in which they
    are missing, as (last packet before, first behind). ``damages`` say where something was wrong. ``is_complete``: the
    file had the end of its data; if not, ``cut_bytes`` of it were behind the last whole record. ``lacks_summary``: what
    stands behind that was cut off, which is made anew. ``lost_at_end_ns``: so long behind the last packet there were
    others, nobody knows how many.
    """

    packets: int = 0
    messages: int = 0
    lost_packets: int = 0
    gaps_ns: list[tuple[int, int]] = field(default_factory=list)
    damages: list[str] = field(default_factory=list)
    is_complete: bool = False
    cut_bytes: int = 0
    lacks_summary: bool = False
    lost_at_end_ns: int = 0
    last_ns: int | None = None


class Recovery:
    """Writes what is whole of ``data``, the bytes of an MCAP file, with a writer, and says what was not."""

    def __init__(self, data: U8, writer: McapWriter) -> None:
        self._data = data
        self._writer = writer
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunk = Chunk()
        self._next_packet: int | None = None
        self._search_from = len(MAGIC)
        self._spare_schemas: dict[int, Schema] = {}
        self._spare_channels: dict[int, Channel] = {}
        self._latest_ns = self._orphans = 0
        self.found = Recovered()

    def run(self) -> Recovered:
        """Write all of it, and return what there was."""
        at, end, found = len(MAGIC), len(self._data), self.found
        self._look_at_summary()
        while not found.is_complete and (place := self._next(at)) is not None:
            at = place.end
            if place.kind == Op.DATA_END:
                self._end(place)
            else:
                self._take(place)
        self._write_single()
        if self._orphans:
            self._damaged(f"{count_of(self._orphans, 'message')} of topics that are not told any more")
        if found.last_ns is not None and self._latest_ns > found.last_ns + LONGEST_NS:
            found.lost_at_end_ns = self._latest_ns - found.last_ns
        if not found.is_complete:
            found.cut_bytes = end - at
        elif self._data[max(end - len(MAGIC), at) :].tobytes() != MAGIC:
            found.lacks_summary = True
        self._writer.finish()
        return found

    def _look_at_summary(self) -> None:
        """Learn of topics, and up to when there were packets: it repeats what may be damaged in front of it."""
        for place in summary_of(self._data, len(self._data), (Op.SCHEMA, Op.CHANNEL, Op.CHUNK_INDEX)):
            try:
                content = self._content(place)
                if place.kind == Op.SCHEMA:
                    self._spare_schemas.setdefault((one := Schema.of(content)).id, one)
                elif place.kind == Op.CHANNEL:
                    self._spare_channels.setdefault((two := Channel.of(content)).id, two)
                elif any(self._holds_packets(number) for number in channels_of_chunk(content)):
                    self._latest_ns = max(self._latest_ns, int.from_bytes(content[8:16], "little"))
            except Damaged:
                continue

    def _holds_packets(self, number: int) -> bool:
        channel = self._spare_channels.get(number)
        return channel is not None and channel.encoding == ENCODING

    def _knows(self, number: int) -> bool:
        """Tell whether a channel is known; one that the summary alone tells of is written now."""
        if number not in self._channels and (channel := self._spare_channels.get(number)) is not None:
            schema = self._spare_schemas.get(channel.schema)
            if schema is not None and self._schemas.setdefault(schema.id, schema) is schema:
                self._writer.keep_schema(schema)
            if not channel.schema or channel.schema in self._schemas:
                self._channels[number] = channel
                self._writer.keep_channel(channel)
        return number in self._channels

    def _next(self, at: int) -> Place | None:
        """Return the record at a place; where there is none, the next chunk behind it, if there is one."""
        end = len(self._data)
        place = record_at(self._data, at, end)
        if place is None and (begin := chunk_behind(self._data, self._search_from, end)) is not None:
            self._damaged(f"offset {min(at, begin)}: there is no record where one should begin")
            place = place_at(self._data, begin, end)
        if place is not None:
            # Where bytes are gone from a chunk, the next one begins in front of where this one seems to end.
            self._search_from = place.content if place.kind == Op.CHUNK else place.begin + 1
        return place

    def _end(self, place: Place) -> None:
        """Take that nothing follows, and whether all was as it was written."""
        self.found.is_complete = True
        content = self._content(place)
        told = int.from_bytes(content[:4], "little")
        if told and not self.found.damages and zlib.crc32(self._data[: place.begin].data) != told:
            self._damaged(
                f"offset {place.begin}: something in front of it is not what was written (CRC of all of it): what no "
                "other check covers, such as a schema or the name of a topic"
            )

    def _damaged(self, what: str) -> None:
        if len(self.found.damages) < _MOST_WORDS:
            self.found.damages.append(what)

    def _take(self, place: Place) -> None:
        size = place.end - place.content
        try:
            if size > _MOST_UNPACKED_BYTES:
                raise Damaged(f"a record with more than {_MOST_UNPACKED_BYTES >> 20} MB is left out")
            if place.kind == Op.CHUNK:
                self._take_chunk(place)
            elif place.kind in (Op.SCHEMA, Op.CHANNEL, Op.MESSAGE):
                self._take_record(self._data, place, self._chunk)
                if self._chunk.bytes >= MOST_BYTES:
                    self._write_single()
            elif place.kind == Op.ATTACHMENT:
                self._writer.attach(AttachedFile.of(self._content(place)))
            elif place.kind == Op.METADATA:
                told = Metadata.of(self._content(place))
                self._writer.tell(told.name, told.values)
        except (Damaged, Unpackable) as error:
            self._damaged(f"offset {place.begin}: {error}")

    def _take_chunk(self, place: Place) -> None:
        head = ChunkHead.of(self._content(place))
        try:
            data = self._unpacked(place, head)
        except (Damaged, Unpackable) as error:
            within = duration(max(head.last_ns - head.first_ns, 0) + LONGEST_NS)
            raise Damaged(f"{error}; what came within {within} at most is lost with it") from error
        self._write_single()
        chunk = Chunk()
        for inner in places(data, 0, head.unpacked_bytes):
            self._take_record(data, inner, chunk)
        self._writer.write(chunk)

    def _unpacked(self, place: Place, head: ChunkHead) -> U8:
        """Return the records of a chunk, with room behind them."""
        if head.unpacked_bytes > _MOST_UNPACKED_BYTES:
            raise Damaged(f"a chunk with more than {_MOST_UNPACKED_BYTES >> 20} MB is left out")
        begin = place.content + head.at
        data = np.zeros(head.unpacked_bytes + PAD_BYTES, np.uint8)
        records = data[: head.unpacked_bytes]
        unpack_into(records.data, head.compression, self._data[begin : begin + head.packed_bytes].tobytes())
        if head.crc and zlib.crc32(records.data) != head.crc:
            raise Damaged("a chunk is not what was written (CRC)")
        return data

    def _take_record(self, data: U8, place: Place, chunk: Chunk) -> None:
        if place.kind == Op.SCHEMA:
            schema = Schema.of(data[place.content : place.end].tobytes())
            if self._schemas.setdefault(schema.id, schema) is schema:
                self._writer.keep_schema(schema)
        elif place.kind == Op.CHANNEL:
            channel = Channel.of(data[place.content : place.end].tobytes())
            if self._channels.setdefault(channel.id, channel) is channel:
                self._writer.keep_channel(channel)
        elif place.kind == Op.MESSAGE:
            if place.end - place.content < MESSAGE_HEAD_BYTES:
                raise Damaged("a message without its begin")
            number, sequence, log_ns, publish_ns = struct.unpack_from("<HIQQ", data.data, place.content)
            begin = place.content + MESSAGE_HEAD_BYTES
            if not self._knows(number):
                self._orphans += 1
                return
            chunk.add(number, sequence, log_ns, publish_ns, data[begin : place.end].tobytes())
            channel_of = self._channels.get(number)
            if channel_of is None or channel_of.encoding != ENCODING:
                self.found.messages += 1
            else:
                self._count(data, begin, place.end, sequence)

    def _count(self, data: U8, begin: int, end: int, sequence: int) -> None:
        """Count the packets of a message, and those that should have been in front of it."""
        batch, found = packets_in(data, begin, end), self.found
        missing = 0 if self._next_packet is None else (sequence - self._next_packet) & 0xFFFFFFFF
        if missing and len(batch):
            found.lost_packets += missing
            if found.last_ns is not None:
                found.gaps_ns.append((found.last_ns, int(batch.ts_ns[0])))
        self._next_packet = sequence + len(batch)
        found.packets += len(batch)
        found.last_ns = int(batch.ts_ns[-1]) if len(batch) else found.last_ns

    def _write_single(self) -> None:
        """Write the messages that were in no chunk."""
        chunk, self._chunk = self._chunk, Chunk()
        self._writer.write(chunk)

    def _content(self, place: Place) -> bytes:
        return self._data[place.content : place.end].tobytes()
