"""One capture file as a source of packets, told by its content."""

from __future__ import annotations

import os
import sys
from collections.abc import Generator, Iterator, Sequence
from weakref import ReferenceType, ref

from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from nvscope.capture.between import Between
from nvscope.capture.byte_window import CHUNK_BYTES, SMALL_FILE_BYTES
from nvscope.capture.content import STDIN, Content, ContentSizes
from nvscope.capture.datalogger.names import closed_files, told_of_closed
from nvscope.capture.pieces import READ_ONLY, Stopped
from nvscope.capture.reader import Place, Progress, Reader, ReadingSizes, WindowReader, reader_of
from nvscope.capture.source import AheadWork, Attachment, SourceInfo
from nvscope.capture.stoppable import StoppableBatches
from nvscope.capture.time_span import TimeSpan
from nvscope.errors import NvscopeError, UnreadableInput
from nvscope.near_files import perhaps
from nvscope.resources import NO_DESCRIPTORS, too_many_open

_PEEK_SIZES = ReadingSizes(batch_packets=1, stride_bytes=4096)
_PEEK_BYTES = 64 << 10
_FEWEST_PACKETS, _FEWEST_BYTES = 1024, 256 << 10


class _Opened(Struct, frozen=True):
    """A file that is being read."""

    format_name: str
    content: Content
    reader: Reader

    @property
    def position(self) -> int:
        return self.content.position_bytes(self.reader.position)


class CaptureFile:
    """The packets of one file; "-" is stdin.

    The file is told by its first bytes at once, and read when iterated; a regular file can be iterated again.
    Raises UnreadableInput where it cannot be opened or is no capture file. ``place`` is the one that it has in a
    series, to be set before it is read. ``copy`` is open, and a copy to be read in place of what can be read only once
    (``nvscope.capture.streams``). ``small_file_bytes`` and ``chunk_bytes`` are those of MappedWindow and
    StreamWindow.
    """

    def __init__(
        self,
        path: str,
        *,
        sizes: ReadingSizes | None = None,
        copy: int | None = None,
        small_file_bytes: int = SMALL_FILE_BYTES,
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        self.path = path
        self.place = Place()
        self._copy = copy
        self._sizes = sizes or ReadingSizes()
        self._content_sizes = ContentSizes(small_file_bytes, chunk_bytes)
        self._position = 0
        self._progress = Progress()
        self._channels: Sequence[str] = ()
        self._stopped = False
        self._opened: _Opened | None = None
        # Weak, so that who forgets a reading closes its file, without waiting for the collector of cycles.
        self._running: ReferenceType[StoppableBatches] | None = None
        self._once: StoppableBatches | None = None
        self._work: AheadWork | None = None
        opened = self._open()
        self.size_bytes = opened.content.size_bytes
        self._format_name = opened.format_name
        self._attachments = opened.reader.attachments
        if opened.content.regular:
            # What can be opened again is not kept open: there may be more files than descriptors.
            opened.content.close()
        else:
            self._opened = opened
            self._once = StoppableBatches(self._read(opened=opened), lambda: self._end(opened))
            self._running = ref(self._once)

    @property
    def info(self) -> SourceInfo:
        """What is known of the file now; complete when it has been read."""
        progress = self._progress
        return SourceInfo(
            self.path,
            self._format_name,
            self.position_bytes if self.size_bytes is None else self.size_bytes,
            progress.frames,
            progress.drops,
            progress.drops_by,
            truncation=progress.truncation,
            comments=tuple(progress.comments),
            start_ns=progress.start_ns,
            end_ns=progress.end_ns,
            topics=progress.topics,
            lost=progress.lost,
            notes=progress.notes,
        )

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return (self.info,)

    @property
    def channels(self) -> Sequence[str]:
        """The names of the channels of the packets read so far, by number; empty where the file tells none."""
        return self._channels

    @property
    def attachments(self) -> Sequence[Attachment]:
        return self._attachments

    @property
    def position_bytes(self) -> int:
        """How much of ``size_bytes`` has been read; of a compressed file the compressed bytes."""
        opened = self._opened
        return opened.position if opened else self._position

    def work_ahead(self, work: AheadWork) -> None:
        """Let work be done by a process that reads ahead, if there will be one, when the file is iterated next."""
        self._work = work

    def __iter__(self) -> Iterator[PacketBatch]:
        work, self._work = self._work, None
        return self._batches_read(1, TimeSpan(), work)

    def between(self, start_ns: int | None, end_ns: int | None) -> Between:
        """Return the packets whose time lies between two, both included, None for no bound."""
        return Between(self, TimeSpan.of(start_ns, end_ns))

    def stop(self) -> None:
        """Let the iteration end after the batch in hand, and close the file; for any thread, also repeatedly."""
        self._stopped = True
        running = None if self._running is None else self._running()
        if running is not None:
            running.stop()

    def first_ts_ns(self) -> int | None:
        """Return the time of the first packet, or None where there is none."""
        if self._once is not None:
            first = self._once.peek()
        else:
            few = CaptureFile(
                self.path, sizes=_PEEK_SIZES, copy=self._copy, small_file_bytes=0, chunk_bytes=_PEEK_BYTES
            )
            first = next(iter(few), None)
        return None if first is None else int(first.ts_ns[0])

    def first_batches(self) -> Iterator[PacketBatch]:
        """Yield what the file begins with, if anything; it is read again later."""
        first = (
            self._once.peek() if self._once is not None else next(iter(CaptureFile(self.path, copy=self._copy)), None)
        )
        if first is not None:
            yield first

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        """Return the packets as ``nvscope.capture.between.Spanned.read`` says; those of a pipe only once."""
        return self._batches_read(share, span, None)

    def _batches_read(self, share: int, span: TimeSpan, work: AheadWork | None) -> Iterator[PacketBatch]:
        if self._once is not None:
            return self._once
        batches = StoppableBatches(self._read(share, span, work=work))
        self._running = ref(batches)
        if self._stopped:
            batches.stop()
        return batches

    def _read(
        self, share: int = 1, span: TimeSpan | None = None, opened: _Opened | None = None,
        work: AheadWork | None = None,
    ) -> Generator[PacketBatch, None, None]:  # fmt: skip
        self._opened = opened = opened or self._open(share, span or TimeSpan())
        self._progress, self._channels = opened.reader.progress, opened.reader.channels
        try:
            for batch in self._batches(opened.reader, share, work):
                if len(batch):
                    progress = self._progress
                    progress.start_ns = int(batch.ts_ns[0]) if progress.start_ns is None else progress.start_ns
                    progress.end_ns = int(batch.ts_ns[-1])
                yield batch
        except Stopped:
            pass
        except OSError as error:
            raise self._unreadable(error) from error
        finally:
            self._end(opened)

    @staticmethod
    def _batches(reader: Reader, share: int, work: AheadWork | None) -> Iterator[PacketBatch]:
        """Return the batches of a reader; a large file that is read alone is read ahead."""
        size = reader.content.size_bytes
        if share > 1 or not isinstance(reader, WindowReader) or not reader.copies_ahead:
            return reader.batches()
        if size is None or size < reader.sizes.ahead_bytes:
            return reader.batches()
        from nvscope.capture.read_ahead import batches_of  # noqa: PLC0415  # not for small files

        return batches_of(reader, work)

    def _end(self, opened: _Opened) -> None:
        """Close a file, and say why it ended where it did; also repeatedly."""
        if self._opened is opened:
            self._position, self._opened = opened.position, None
            opened.reader.tell_failure()
        opened.content.close()

    def _open(self, share: int = 1, span: TimeSpan | None = None) -> _Opened:
        try:
            if self.path == STDIN and sys.stdin is None:
                raise UnreadableInput("stdin is closed", where=self.path, next_step="name a file instead")
            return self._tell(self._descriptor(), share, span or TimeSpan())
        except OSError as error:
            raise self._unreadable(error) from error

    def _descriptor(self) -> int:
        if self._copy is not None:
            return os.dup(self._copy)
        return sys.stdin.fileno() if self.path == STDIN else os.open(self.path, READ_ONLY)

    def _unreadable(self, error: OSError) -> NvscopeError:
        if error.errno in NO_DESCRIPTORS:
            return too_many_open(self.path)
        next_step = "check the path and the permissions"
        if isinstance(error, FileNotFoundError):
            closed = closed_files(self.path)
            next_step = told_of_closed(closed) if closed else perhaps(self.path, next_step)
        return UnreadableInput(error.strerror or str(error), where=self.path, next_step=next_step)

    def _tell(self, descriptor: int, share: int, span: TimeSpan) -> _Opened:
        """Find out what the file is, and get ready to read it with a ``share``-th of the memory."""
        sizes, content_sizes = self._sizes, self._content_sizes
        if share > 1:
            packets, chunk_bytes = sizes.batch_packets, content_sizes.chunk_bytes
            sizes = replace(sizes, batch_packets=max(packets // share, min(_FEWEST_PACKETS, packets)))
            chunk_bytes = max(chunk_bytes // share, min(_FEWEST_BYTES, chunk_bytes))
            content_sizes = replace(content_sizes, chunk_bytes=chunk_bytes)
        try:
            content = Content(self.path, descriptor, content_sizes, span, lambda: self._stopped)
        except BaseException:
            if descriptor > 2:
                os.close(descriptor)
            raise
        try:
            name, reader = reader_of(content, sizes)
            reader.place = self.place
            return _Opened(name, content, reader)
        except BaseException:
            content.close()
            raise
