"""What a capture source and a sink are: an iterable of packet batches, and something that takes them.

Whatever stands above capture knows these contracts, and not who fulfils them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType, TracebackType
from typing import Any, NamedTuple, Protocol, Self, runtime_checkable

from msgspec import Struct

from dissectors.batch import PacketBatch
from dissectors.stretches import NOTHING, Uncopied


class DropsPart(Enum):
    """Where packets were lost while capturing: the keys of ``SourceInfo.drops_by``."""

    label: str

    def __new__(cls, name: str, label: str) -> DropsPart:
        part = object.__new__(cls)
        part._value_ = name
        part.label = label
        return part

    INTERFACE = "interface", "in the interface, before the operating system had them (isb_ifdrop)"
    KERNEL = "kernel", "in the operating system (isb_osdrop, the queue of a socket)"
    QUEUE = "queue", "in a queue between the reading and what looks at it"
    RING = "ring", "in the ring of a capture that was full"


class Truncation(Struct, frozen=True):
    """Where a file stops in the middle of a record, or from where on something of it is missing.

    ``is_whole`` where all of its frames were read, and they lack what a recording should have: times, a date.
    """

    offset: int
    message: str
    is_whole: bool = False


class Attachment(Struct, frozen=True):
    """A file that a recording brings with it, such as a definition; ``read`` returns its bytes each time it is called.

    ``media_type`` tells its kind (``text/plain``), ``time_ns`` when it was last changed, None where nobody says.
    """

    name: str
    media_type: str
    read: Callable[[], bytes]
    time_ns: int | None = None


class LostSpan(NamedTuple):
    """From when to when so many packets were lost while capturing; None where nobody says.

    ``at_packet``: the packet that came then says so itself.
    """

    since_ns: int | None
    until_ns: int | None
    packets: int
    at_packet: bool = False

    def touches(self, since_ns: int, until_ns: int) -> bool:
        """Tell whether it may be within a time."""
        begins = self.since_ns is None or self.since_ns <= until_ns
        return begins and (self.until_ns is None or self.until_ns >= since_ns)


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What is known of a source apart from its packets, at one moment.

    ``bytes`` is the size on disk (of a stream: the bytes read from it so far). ``drops`` counts the packets that the
    capturing side says it lost, None where it cannot know; ``drops_by`` are its parts by the values of ``DropsPart``,
    as far as they are told, each lost packet in one of them at most. ``clock_steps`` counts how often the clock was set
    while it was watched. ``comments`` are those of a pcapng file, as (frame number within the file or None, text).
    ``start_ns`` and ``end_ns`` are the times of the first and the last packet that was passed on, None before the
    first. ``is_live``: it takes packets while they are sent; ``failure`` is why it ended though nobody had said so, ''
    where it did not. ``without_carrier`` are the times in which its interface had no cable, as (begin, end or None
    where it is still so). Without ``hears_answers``, it gets what is for everybody and for this machine: what others
    answer to each other is unknown. ``topics`` are those of a recording in which there is nothing else. ``lost`` says
    when packets were lost, as far as that is told. ``notes`` are sentences on the state in which a file was, of which
    nothing is missing.
    """

    path: str
    format: str
    bytes: int = 0
    frames: int = 0
    drops: int | None = 0
    drops_by: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    clock_steps: int = 0
    truncation: Truncation | None = None
    comments: tuple[tuple[int | None, str], ...] = ()
    start_ns: int | None = None
    end_ns: int | None = None
    is_live: bool = False
    failure: str = ""
    without_carrier: tuple[tuple[int, int | None], ...] = ()
    hears_answers: bool = True
    topics: tuple[str, ...] = ()
    lost: tuple[LostSpan, ...] = ()
    notes: tuple[str, ...] = ()


class Circumstances(Struct, frozen=True):
    """Under which circumstances packets are recorded: what a recording tells of itself beside them.

    ``drops`` and ``clock_steps`` are those so far, None where nobody knows. ``capture_filter`` is what was asked for,
    "" where nothing was. Of the recording of an event, ``event`` is what happened at ``event_ns``, and ``trigger`` is
    what was waited for.
    """

    host: str = ""
    interface: str = ""
    capture_filter: str = ""
    drops: int | None = None
    clock_steps: int = 0
    event_ns: int | None = None
    event: str = ""
    trigger: str = ""


def any_live(infos: Iterable[SourceInfo]) -> bool:
    """Tell whether one of some sources is live: time goes on there by itself, and may do so for weeks."""
    return any(info.is_live for info in infos)


class Source(Protocol):
    """Packets in batches.

    ``infos`` are frozen values, one a file or interface; they are made anew each time, and may be asked for at any
    time, from any thread. ``channels`` are the names of the channels of the packets, by number; it grows as packets
    come. ``attachments`` are what a recording brings with it, none of other sources. A batch is valid until the next
    one is asked for.
    """

    @property
    def infos(self) -> Sequence[SourceInfo]: ...

    @property
    def channels(self) -> Sequence[str]: ...

    @property
    def attachments(self) -> Sequence[Attachment]: ...

    def __iter__(self) -> Iterator[PacketBatch]: ...

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        """Return the packets whose time lies between two, both included, None for no bound; in the same order.

        It takes the place of this source. ``infos`` stay those of what was read for it.
        """
        ...

    def stop(self) -> None:
        """Let the iteration end after the batch in hand, and close what is open; for any thread, also repeatedly.

        What is iterated after that has no packets.
        """
        ...


class Done(NamedTuple):
    """What was done with packets, as it is handed over: ``value`` can be pickled; ``data`` are bytes beside it."""

    value: Any
    data: Uncopied = NOTHING


class AheadWork(Protocol):
    """What can be done with packets where they are read, by a process that is ahead of this one.

    Of each object there are two then, which were the same when that process was made.
    """

    def is_worth_it(self, packets: PacketBatch) -> bool:
        """Tell whether it is to be done there, by what the source begins with: some of that has been told here."""
        ...

    def share(self) -> None:
        """Take that there are two now, and that what one does is taken by the other one; before either goes on."""
        ...

    def work(self, packets: PacketBatch) -> Iterator[Done]:
        """Yield what is done with packets that follow those before, in parts; the columns of values may be kept."""
        ...

    def take(self, done: Any, data: memoryview) -> PacketBatch:
        """Return the packets of one such part, in turn; ``data`` is valid until the next one is asked for."""
        ...

    @property
    def stand_ins(self) -> Sequence[object]:
        """Objects of which each process has its own: in what is handed over, one stands for the other."""
        ...


@runtime_checkable
class WorksAhead(Source, Protocol):
    """A source that may have something done with its packets where they are read."""

    def work_ahead(self, work: AheadWork) -> None:
        """Let it be done when the source is iterated next, if a process reads ahead: it takes the place of packets."""
        ...


@runtime_checkable
class FileSource(Source, Protocol):
    """A source that reads files; ``position_bytes`` of ``size_bytes`` have been read, None where a size is not known.

    Of compressed files these are the compressed bytes. Regular files can be iterated again.
    """

    @property
    def size_bytes(self) -> int | None: ...

    @property
    def position_bytes(self) -> int: ...

    def between(self, start_ns: int | None, end_ns: int | None) -> FileSource: ...

    def first_ts_ns(self) -> int | None:
        """Return the time of the first packet of the files, or None where there is none; it is read again later."""
        ...

    def first_batches(self) -> Iterator[PacketBatch]:
        """Yield what each file begins with, if anything; it is read again later."""
        ...


class Sink(Protocol):
    """Something that packets are written to, of whatever link types they say; closed at the end of a ``with``.

    Raises UsageError for what it cannot hold, and CaptureError where it cannot be written.
    """

    @property
    def packets(self) -> int:
        """How many packets have been written, whole; after a failure these are the ones that are there."""
        ...

    @property
    def bytes(self) -> int:
        """How large the file is by now."""
        ...

    def write(self, batch: PacketBatch) -> None:
        """Write packets, in their order; they may be gathered until ``flush`` or ``close``."""
        ...

    def comment(self, number: int, text: str) -> None:
        """Put a comment to the packet of a number in the file, from 1, before it is written; where the format can."""
        ...

    def describe(self, circumstances: Circumstances) -> None:
        """Tell under which circumstances it is written, as far as the format can; the last ones hold."""
        ...

    def attach(self, attachment: Attachment) -> None:
        """Put a file beside the packets; UsageError where the format holds none (``holds_attachments`` in FORMATS)."""
        ...

    def flush(self, *, to_disk: bool = False) -> None:
        """Hand all that was written to the operating system, and wait until it is on the disk where that is asked."""
        ...

    def close(self) -> None:
        """Write what is left, and close; also after a failure, so that what is there is a whole file."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
