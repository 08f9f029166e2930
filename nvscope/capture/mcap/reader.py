"""Reads the packets of MCAP recordings, and tells what else is in those of others."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dissectors.batch import PAD_BYTES, PacketBatch
from nvscope.capture.byte_window import MappedWindow, View, WholeWindow
from nvscope.capture.content import Content
from nvscope.capture.mcap.ahead import Ahead
from nvscope.capture.mcap.format_version import COMMENTS, FORMAT_VERSION, INTERFACES, RECORDING
from nvscope.capture.mcap.packets import ENCODING, LONGEST_NS
from nvscope.capture.mcap.records import MAGIC, AttachedFile, Channel, ChunkHead, Damaged, Metadata, Op
from nvscope.capture.mcap.unpacking import Packed, Unpacker, packets_of_message
from nvscope.capture.mcap.walk import Place, chunk_behind, is_record, place_at, places, record_at, summary_of
from nvscope.capture.reader import ReadingSizes, WindowReader
from nvscope.capture.source import Attachment, Truncation
from nvscope.errors import UnreadableInput

MOST_BYTES = 256 << 20
"""A chunk, an attachment or a message with more than that, unpacked, is not read."""

_MOST_KEPT_BYTES = 64 << 20
_MOST_COMMENTS = 10_000
_PACKET_BYTES, _MOST_WAITING_BYTES = 256, 32 << 20
_AHEAD_BYTES = 2 << 20
_CHUNK_HEAD_BYTES = 256  # with the name of its compression
_DEFINING = (Op.HEADER, Op.SCHEMA, Op.CHANNEL, Op.METADATA, Op.ATTACHMENT)


class McapReader(WindowReader):
    """Reads MCAP files in the order in which they were written.

    Chunks without packets are not unpacked, as far as their indexes tell, nor are those outside the span that is
    wanted. What is damaged in a chunk is that chunk alone. ``topics`` are those of other messages.
    """

    copies_ahead = False

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._known: dict[int, Channel] = {}
        self._damages = 0
        self._first_damage = 0
        self._complete = False
        self._search_from = len(MAGIC)
        self._waiting: list[Packed] = []
        self._waiting_bytes = 0
        self._unpacker = Unpacker()
        self._ahead: Ahead[PacketBatch | None] = Ahead(in_thread=(content.size_bytes or 0) >= _AHEAD_BYTES)
        self._most_waiting_bytes = min(sizes.batch_packets * _PACKET_BYTES, _MOST_WAITING_BYTES)
        # What is still written has to be waited for, and tells of itself when it comes.
        self.attachments: Sequence[Attachment] = () if content.pauses else self._begun(content.window().view(0))

    @property
    def topics(self) -> list[str]:
        """The topics of the messages that hold no packets, as far as they are known."""
        return sorted({one.topic for one in self._known.values() if one.encoding != ENCODING})

    def _begun(self, view: View) -> list[Attachment]:
        """Look at what the file begins with, and at its summary, and return the attachments that are there."""
        begin = view.start + len(MAGIC)
        header = place_at(view.data, begin, view.end)
        if view.ends_file and (header is None or header.end > view.end):
            raise UnreadableInput(
                "an MCAP file that is cut short in its header", where=self.content.path,
                next_step="there is nothing to be read in it",
            )  # fmt: skip
        found: dict[int, bytes] = {}
        for place in places(view.data, begin, view.end):
            if place.kind not in _DEFINING:
                break
            if place.kind == Op.METADATA:
                self._check_version(_content(view, place))
            if place.kind == Op.ATTACHMENT:
                found[place.begin] = b""
        if isinstance(self.content.window(), MappedWindow | WholeWindow):
            kinds = (Op.CHANNEL, Op.ATTACHMENT_INDEX)
            for place in summary_of(view.data, view.end, kinds) if view.origin == 0 else ():
                self._take_from_summary(view, place, found)
        return self._attachments(view, sorted(found))

    def _take_from_summary(self, view: View, place: Place, found: dict[int, bytes]) -> None:
        try:
            if place.kind == Op.CHANNEL:
                channel = Channel.of(_content(view, place))
                self._known[channel.id] = channel
            elif place.kind == Op.ATTACHMENT_INDEX and place.end - place.content >= 8:
                (begin,) = struct.unpack_from("<Q", view.data.data, place.content)
                found[begin] = b""
        except Damaged:
            pass  # a summary repeats what is known anyway

    def _attachments(self, view: View, begins: list[int]) -> list[Attachment]:
        kept, kept_bytes = [], 0
        for begin in begins:
            place = place_at(view.data, begin, view.end) if len(MAGIC) <= begin < view.end else None
            if place is None or place.end > view.end or place.kind != Op.ATTACHMENT:
                continue
            kept_bytes += place.end - place.begin
            if kept_bytes > _MOST_KEPT_BYTES:
                self._damage(view.origin + begin, f"attachments beyond {_MOST_KEPT_BYTES >> 20} MB are not read")
                break
            try:
                file = AttachedFile.of(_content(view, place))
            except Damaged as error:
                self._damage(view.origin + begin, str(error))
                continue
            kept.append(Attachment(file.name, file.media_type, _bytes_of(file.data), file.changed_ns or None))
        return kept

    def _check_version(self, content: bytes) -> None:
        try:
            metadata = Metadata.of(content)
        except Damaged:
            return
        version = metadata.values.get("format", "") if metadata.name == RECORDING else ""
        if version.isdecimal() and int(version) > FORMAT_VERSION:
            raise UnreadableInput(
                f"a recording of format {version[:10]}; this version of nvscope knows those up to {FORMAT_VERSION}",
                where=self.content.path, next_step="read it with the version that wrote it, or a later one",
            )  # fmt: skip

    def batches(self) -> Iterator[PacketBatch]:
        with self._ahead:
            yield from super().batches()

    def read(self, view: View) -> Iterator[PacketBatch]:
        data, at = view.data, view.start
        if self.position < len(MAGIC):
            at += len(MAGIC) - self.position
        cut: Place | None = None
        while at < max(view.stop, view.start) and not self.finished:
            place = record_at(view.data, at, view.end)
            if place is not None and place.kind == Op.FOOTER and not view.ends_file:
                place = place if place.end + len(MAGIC) <= view.end else None
            if place is None:
                begin = (
                    chunk_behind(data, max(self._search_from - view.origin, 0), view.end) if view.ends_file else None
                )
                if begin is None:
                    cut = place_at(data, at, view.end) or Place(0, at, at, at)
                    break
                self._damage(view.origin + at, "there is no record where one should begin")
                at = begin
                self._search_from = view.origin + at + 1
                continue
            yield from self._take(view, place)
            # Where bytes are gone from a chunk, the next one begins in front of where this one seems to end.
            self._search_from = view.origin + (place.content if place.kind == Op.CHUNK else place.begin + 1)
            at = place.end
            self.position = view.origin + at
            if place.kind == Op.FOOTER:
                self._complete = data[at : at + len(MAGIC)].tobytes() == MAGIC and at + len(MAGIC) <= view.end
                self.finished = self._complete or view.ends_file
        yield from self._unpack()
        if view.ends_file and (cut or self.finished or at >= view.end):
            self._end(view, at, cut)

    def _take(self, view: View, place: Place) -> Iterator[PacketBatch]:
        """Take a record that is whole; yield the packets that are complete with it."""
        kind = place.kind
        if place.end - place.content > MOST_BYTES and kind in (Op.CHUNK, Op.MESSAGE):
            self._damage(view.origin + place.begin, f"a record with more than {MOST_BYTES >> 20} MB is not read")
        elif kind == Op.CHUNK:
            yield from self._take_chunk(view, place)
        elif kind in (Op.CHANNEL, Op.METADATA, Op.MESSAGE):
            try:
                yield from self._take_single(view, place)
            except Damaged as error:
                self._damage(view.origin + place.begin, str(error))

    def _take_single(self, view: View, place: Place) -> Iterator[PacketBatch]:
        if place.kind == Op.CHANNEL:
            channel = Channel.of(_content(view, place))
            self._known[channel.id] = channel
        elif place.kind == Op.METADATA:
            metadata = Metadata.of(_content(view, place))
            self._check_version(_content(view, place))
            if metadata.name == INTERFACES:
                yield from self._unpack()
                _take_names(self.channels, metadata)
            elif metadata.name == COMMENTS:
                room = max(_MOST_COMMENTS - len(self.progress.comments), 0)
                self.progress.comments += _comments_in(metadata)[:room]
            elif metadata.name == RECORDING and (drops := metadata.values.get("drops", "")).isdecimal():
                self.progress.drops = int(drops[:18])
        else:
            yield from self._unpack()
            size = place.end - place.content
            data = np.zeros(size + PAD_BYTES, np.uint8)
            data[:size] = view.data[place.content : place.end]
            batch = packets_of_message(data, 0, size, self._known)
            yield from self._told(batch)

    def _take_chunk(self, view: View, place: Place) -> Iterator[PacketBatch]:
        try:
            head = ChunkHead.of(view.data[place.content : min(place.content + _CHUNK_HEAD_BYTES, place.end)].tobytes())
            if place.content + head.at + head.packed_bytes > place.end:
                raise Damaged("a chunk that ends within its records")
            if head.unpacked_bytes > MOST_BYTES:
                raise Damaged(f"a chunk with more than {MOST_BYTES >> 20} MB is not read")
        except Damaged as error:
            self._damage(view.origin + place.begin, str(error))
            return
        if self._has_none(view, place):
            return
        span = self.content.span
        if head.last_ns < span.start_ns or head.first_ns - LONGEST_NS > span.end_ns:
            yield from self._unpack()
            yield PacketBatch.nothing(min(head.last_ns, (1 << 62) - 1))
            return
        if self._waiting and self._waiting_bytes + head.unpacked_bytes > self._most_waiting_bytes:
            yield from self._unpack_ahead()
        begin = place.content + head.at
        self._waiting.append(
            Packed(view.origin + place.begin, head, view.data[begin : begin + head.packed_bytes].tobytes())
        )
        self._waiting_bytes += head.unpacked_bytes

    def _has_none(self, view: View, chunk: Place) -> bool:
        """Tell whether a chunk surely holds no packets: indexes follow it, all of channels that have others."""
        count, at = 0, chunk.end
        while (index := place_at(view.data, at, view.end)) is not None and index.kind == Op.MESSAGE_INDEX:
            if index.end > view.end or index.end - index.content < 2:
                return False
            (number,) = struct.unpack_from("<H", view.data.data, index.content)
            channel = self._known.get(number)
            if channel is None or channel.encoding == ENCODING:
                return False
            count, at = count + 1, index.end
        # Where the file is cut within its indexes, another one may have been the one that counts.
        return bool(count) and index is not None

    def _unpack(self) -> Iterator[PacketBatch]:
        """Yield what is in all chunks that were taken."""
        yield from self._unpack_ahead()
        yield from self._told(self._ahead.last())

    def _unpack_ahead(self) -> Iterator[PacketBatch]:
        """Have the chunks unpacked that wait, and yield what is in those before meanwhile."""
        waiting, self._waiting, self._waiting_bytes = self._waiting, [], 0
        if waiting:
            yield from self._told(
                self._ahead.next(lambda: self._unpacker.packets_of(waiting, self._known, self._damage))
            )

    def _told(self, batch: PacketBatch | None) -> Iterator[PacketBatch]:
        if batch is not None:
            self.progress.frames += len(batch)
            for begin in range(0, len(batch), self.sizes.batch_packets):
                yield batch[begin : begin + self.sizes.batch_packets]

    def _damage(self, position: int, what: str) -> None:
        if not self._damages:
            self._first_damage, self._first = position, what
        self._damages += 1
        more = "" if self._damages == 1 else f"; {self._damages} such places"
        self.progress.left_out = f"{self._first}{more}; the rest is read"

    def _end(self, view: View, at: int, cut: Place | None) -> None:
        self.finished = True
        if not self.progress.frames and not self._damages and (cut is None or is_record(cut)):
            self.progress.topics = tuple(self.topics)
        left_out = self.progress.left_out
        if self._complete:
            if left_out:
                self.progress.truncation = Truncation(self._first_damage, left_out)
            return
        what = f"the last record has only {view.end - cut.begin} bytes left of it" if cut else "it has no end"
        message = f"cut short: {what}"
        if cut is not None and not is_record(cut):
            message = f"damaged: the last {view.end - cut.begin} bytes are no record"
        if left_out:
            message += f"; before that, {left_out}"
        self.progress.truncation = Truncation(view.origin + at, message)


def _content(view: View, place: Place) -> bytes:
    return view.data[place.content : place.end].tobytes()


def _bytes_of(data: bytes) -> Callable[[], bytes]:
    return lambda: data


def _take_names(channels: list[str], metadata: Metadata) -> None:
    numbered = {int(number): name for number, name in metadata.values.items() if number.isdecimal() and len(number) < 6}
    count = min(max(numbered, default=-1) + 1, 1 << 16)
    channels[:] = [numbered.get(number, "") for number in range(count)]


def _comments_in(metadata: Metadata) -> list[tuple[int | None, str]]:
    """Return comments with the numbers of their packets, in the order of these."""
    found = []
    for key, text in metadata.values.items():
        number, _, further = key.partition(".")
        if all(part.isdecimal() and len(part) < 19 for part in (number, further or "0")):
            found.append((int(number), int(further or 0), text))
    return [(number, text) for number, _, text in sorted(found)]
