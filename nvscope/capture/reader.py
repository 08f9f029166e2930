"""What a reader is: it turns the content of a capture file into batches, and tells how far it has come.

A new format is a reader here or in a module of its own, and a row in ``nvscope.capture.formats``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from msgspec import Struct, field

from dissectors.batch import PacketBatch
from nvscope.capture.byte_window import View
from nvscope.capture.content import EXPECTED, Content
from nvscope.capture.formats import BEGUN, NoCapture, format_of
from nvscope.capture.source import Attachment, LostSpan, Truncation


class ReadingSizes(Struct, frozen=True):
    """How a reader cuts its work; any choice gives the same packets. ``lanes`` 0: as many as are fast.

    Of files with ``ahead_bytes`` and more to read, a second process reads ahead where it can (``read_ahead``), and
    hands over what it finds in slots of ``slot_bytes``.
    """

    batch_packets: int = 131_072
    stride_bytes: int = 2 << 20
    lanes: int = 0
    ahead_bytes: int = 128 << 20
    slot_bytes: int = 64 << 20


class Place(Struct, frozen=True):
    """The place of a file in a series of them: those of one ``part`` follow each other without one between them.

    ``missing`` says what should come before it and cannot be read, '' where nothing speaks for that.
    """

    part: int = 0
    missing: str = ""


class Progress(Struct):
    """What a reader has found so far: only it writes here, and whoever wants to know reads, at any time.

    The fields are those of ``SourceInfo``; ``left_out`` tells what could not be read before the end, '' if nothing.
    """

    frames: int = 0
    drops: int = 0
    drops_by: Mapping[str, int] = field(default_factory=dict)
    lost: tuple[LostSpan, ...] = ()
    truncation: Truncation | None = None
    comments: list[tuple[int | None, str]] = field(default_factory=list)
    left_out: str = ""
    start_ns: int | None = None
    end_ns: int | None = None
    topics: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


class Reader(ABC):
    """Reads the content of one capture file, from its begin to its end, once.

    One that ``follows`` gives out what has come where the content makes a pause, and then, if ``content.pauses``, an
    empty batch.

    ``position`` is how far the content has been read. ``channels`` are the names of the packets' channels, by number,
    as far as the file tells them; ``attachments`` what it brings with it, each of which can be read at any time.
    ``finished``: it wants to see no more, whatever may still be written. ``place`` is that of its file in a series.
    Raises UnreadableInput when it is made where nothing can be read at all; what is wrong later goes to ``progress``.
    """

    attachments: Sequence[Attachment] = ()
    follows: ClassVar[bool] = False
    finished = False
    place = Place()

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        self.content = content
        self.sizes = sizes
        self.position = 0
        self.progress = Progress()
        self.channels: list[str] = []

    @abstractmethod
    def batches(self) -> Iterator[PacketBatch]:
        """Yield the packets in the order of the file; a batch is valid until the next one is asked for.

        What lies outside ``content.span`` may be left out as ``nvscope.capture.between.Spanned.read`` says. OSError
        where reading fails.
        """

    def tell_failure(self) -> None:
        """Tell in ``progress`` what ended the content before its end, if something did."""
        if not (failure := self.content.failure):
            return
        cut = self.progress.truncation
        message = f"{failure}; frames are read up to the last whole record"
        if self.progress.left_out:
            message += f"; before that, {self.progress.left_out}"
        self.progress.truncation = Truncation(cut.offset if cut else self.position, message)


class WindowReader(Reader):
    """A reader that looks at the content through a window.

    ``copies_ahead``: of a large file, a copy of it may read ahead (``read_ahead``).
    """

    copies_ahead: ClassVar[bool] = True
    follows = True

    def batches(self) -> Iterator[PacketBatch]:
        """Yield the packets of view after view, and let go of what has been read."""
        window = self.content.window()
        while not self.finished:
            for batch in self.read(window.view(self.position)):
                yield batch
                window.release(self.position)
            if self.content.pauses:
                yield PacketBatch.nothing()

    @abstractmethod
    def read(self, view: View) -> Iterator[PacketBatch]:
        """Yield the packets whose records are whole in ``view``, and move ``position`` behind them."""


def reader_of(content: Content, sizes: ReadingSizes) -> tuple[str, Reader]:
    """Return the name of the format of a content, which its first bytes show, and its reader; NoCapture for none."""
    known = format_of(content.head) if content.head else BEGUN
    if known is None:
        raise NoCapture(f"the bytes {content.head[:4].hex(' ')}, expected {EXPECTED}", where=content.begin)
    known = known.among(content)
    make: type[Reader] = known.reader_class()
    return known.name, make(content, sizes)
