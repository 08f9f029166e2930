"""CAN logs that are texts, read line by line: a wrong line is left out and told, and reading goes on behind it.

What a line says, a format knows (``LineFormat``). How many lines are wrong, and what is wrong with the first one, is in
``progress.truncation``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from dissectors.batch import PacketBatch
from nvscope.capture.can.channel_names import ChannelNames, TooManyChannels
from nvscope.capture.can.frame import CanFrame, CanRows, FrameBatches
from nvscope.capture.can.line_fields import LineFault
from nvscope.capture.content import Content
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Truncation
from nvscope.capture.text_lines import MAX_LINE_BYTES, TextLines
from nvscope.capture.time_span import TIME_LIMIT_NS

_CHUNK_FRAMES = 4096


class LoggedFrame(NamedTuple):
    """A frame, and its channel: the number or the name that the log gives it, None where it gives none."""

    frame: CanFrame
    channel: int | str | None


UNDATED = "times count from 1970"
"""What is so where nobody knows when a log began."""


class LineFormat(Protocol):
    """What lines of a format say, asked in the order of the file: what a line says may hang on those before."""

    @property
    def remark(self) -> str:
        """What is wrong with all lines that were read, '' for nothing: none of them is left out for it."""
        ...

    def read(self, line: str) -> LoggedFrame | None:
        """Return the frame of a line without its line end, None where it tells none; raises LineFault."""
        ...

    def is_whole(self, line: str, found: LoggedFrame | None) -> bool:
        """Return whether the last line of a file without a line end, which told that frame, can lack nothing of it."""
        ...


class TextLogReader(Reader):
    """Reads a text log; ``make_format`` is for each format its own."""

    follows = True

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._format = self.make_format(content)
        self._names = ChannelNames(self.channels)
        self._wrong = 0
        self._first_fault = (0, "")

    def make_format(self, content: Content) -> LineFormat:
        """Return what reads the lines of one text."""
        raise NotImplementedError

    def batches(self) -> Iterator[PacketBatch]:
        batches = FrameBatches(self.sizes.batch_packets)
        frames: list[CanFrame] = []
        channels: list[int] = []
        chunk = min(_CHUNK_FRAMES, self.sizes.batch_packets)
        lines = TextLines(self.content.pieces())
        for line in lines:
            if not line:
                # Who writes into a pipe wants to see what is there.
                if frames:
                    yield from self._add(batches, frames, channels)
                    frames, channels = [], []
                if batches.rows:
                    yield batches.take()
                if self.content.pauses:
                    yield PacketBatch.nothing()
                continue
            self.position = lines.offset
            if self.content.failure and not lines.ended:
                # What is left of a line whose rest could not be decompressed may look like a whole one.
                break
            found = self._read(line, lines.number, ended=lines.ended)
            if found is None:
                continue
            frames.append(found.frame)
            channels.append(self._names.number(found.channel))
            if len(frames) == chunk:
                yield from self._add(batches, frames, channels)
                frames, channels = [], []
        if frames:
            yield from self._add(batches, frames, channels)
        if batches.rows:
            yield batches.take()
        if lines.too_long:
            self._fault(f"line {lines.first_too_long}: more than {MAX_LINE_BYTES} characters", lines.too_long)
        self._tell()

    def _read(self, line: str, number: int, *, ended: bool) -> LoggedFrame | None:
        text = line.rstrip("\r\n")
        try:
            found = self._format.read(text)
            if not ended and text.strip() and not self._format.is_whole(text, found):
                raise LineFault("the file ends within this line")
            if found is not None:
                if abs(found.frame.ts_ns) > TIME_LIMIT_NS:
                    raise LineFault("a time after 2116")
                self._names.number(found.channel)
        except (LineFault, TooManyChannels) as fault:
            self._fault(f"line {number}: {fault}")
            return None
        return found

    def _add(self, batches: FrameBatches, frames: list[CanFrame], channels: list[int]) -> Iterator[PacketBatch]:
        self.progress.frames += len(frames)
        yield from batches.add(CanRows.of(frames, channels))

    def _fault(self, what: str, count: int = 1) -> None:
        if not self._first_fault[1]:
            self._first_fault = self.position, what
        self._wrong += count

    def _tell(self) -> None:
        at, what = self._first_fault
        told = []
        if self._format.remark:
            at = 0
            told.append(self._format.remark)
        if what:
            told.append(what)
            told.append("the line is left out" if self._wrong == 1 else f"{self._wrong} such lines are left out")
        if told:
            self.progress.left_out = "; ".join(told)
            self.progress.truncation = Truncation(at, self.progress.left_out, is_whole=not what)
