"""Told: one batch, recognised once, as every observer reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U16, Bool, PacketBatch
from dissectors.can.frame import CanBatch
from dissectors.can.pdo import PdoRules
from dissectors.dissector import Dissector, Follower, Part, Prepared
from dissectors.netvar import TelegramBatch
from dissectors.sorter import SortedPackets
from dissectors.varieties import NO_TELEGRAM, Varieties
from nvscope.engine.clock import Clock
from nvscope.engine.events import EventBatch, Listeners
from nvscope.engine.keys import Begun, Keys, Rejected
from nvscope.engine.limit import MAX_STREAMS
from nvscope.engine.parameters import ParameterRows
from nvscope.engine.rows import DataRows, StreamMemory
from nvscope.engine.watch import Unheard

if TYPE_CHECKING:  # without being asked for all frames, nothing of them is imported
    from dissectors.other_frames import OtherFrames


class Laid(Struct, frozen=True):
    """The telegrams of a batch laid out by stream.

    ``keys`` number what they are of, ``begun`` are the flows that begin here, ``count`` is how many telegrams there are
    of each variety. ``data`` are the well-formed data telegrams, ``pdos`` the data frames of CAN, ``parameters`` the
    telegrams of the Parameter Manager, ``rejected`` the telegrams that came back. ``left_out`` are the packets of what
    is beyond the limit (``Keys``), ``elsewhere`` those of streams to receivers that are, both rising. ``memory`` is
    what is known of the streams up to the end of the batch.
    """

    keys: Keys
    begun: Begun
    count: I64
    data: DataRows
    pdos: DataRows
    parameters: ParameterRows
    rejected: Rejected
    left_out: I64
    elsewhere: I64
    memory: StreamMemory


class Told:
    """A batch with what was recognised in it; observers must not change it, and must not keep what is over its buffer.

    ``batch`` tells each packet by its variety. ``first_frame`` is the number of its first packet in the capture, from
    1; ``start_ns`` the time of the capture's first frame, ``before_ns`` that of the frame before this batch (of the
    first one: its own). ``until_ns`` says that time has passed up to then, behind the packets; None where only they
    tell. ``unheard`` is what nobody listens to any more, behind the packets: what is open of it stays unknown, nothing
    is measured up to what follows, and that begins as a capture does. ``pdos`` know which lists CAN frames belong to,
    and what channels are called; ``dissectors`` read the protocols that have ports of their own; ``timeout_ns`` is how
    long an answer may take, ``parameter_timeout_ns`` how long a reply of the Parameter Manager may, ``max_streams`` how
    many streams and identifiers are told apart; ``all_frames`` says whether frames in which nothing is found are
    wanted, ``hears_answers`` whether what nodes answer to each other is to be seen at all. ``followers`` are those of
    dissectors that have one, by name, ``prepared`` what they have prepared of the batch.

    ``laid`` is there where an observer asks for it (``Observer.by_stream``).

    Events pass through it, too: what counts something tells what happened (``tell``), and those whom the state's owner
    has named hear of it (``heard_by``).
    """

    __slots__ = ("__dict__", "_listeners")

    def __init__(
        self, batch: SortedPackets, *, first_frame: int, start_ns: int, before_ns: int, pdos: PdoRules,
        timeout_ns: int, parameter_timeout_ns: int, choose: Choose | None = None, laid: Laid | None = None,
        until_ns: int | None = None,
        dissectors: Sequence[Dissector] = (), max_streams: int = MAX_STREAMS, all_frames: bool = False,
        unheard: Sequence[Unheard] = (), hears_answers: bool = True,
        followers: Mapping[str, Follower] = MappingProxyType({}),
        prepared: Mapping[str, Prepared | None] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self.batch = batch
        self.first_frame = first_frame
        self.start_ns = start_ns
        self.before_ns = before_ns
        self.until_ns = until_ns
        self.pdos = pdos
        self.dissectors = dissectors
        self.timeout_ns = timeout_ns
        self.parameter_timeout_ns = parameter_timeout_ns
        self.max_streams = max_streams
        self.all_frames = all_frames
        self.unheard = unheard
        self.hears_answers = hears_answers
        self._choose = choose
        self._followers = followers
        self._prepared = prepared
        self._laid = laid
        self._listeners: Listeners = ()

    def __len__(self) -> int:
        return len(self.batch)

    def part(self, batch: SortedPackets, laid: Laid, *, with_parts: bool) -> Told:
        """Return what is told of a part of the batch, of which the filter chooses as it does of the whole.

        ``with_parts``: it has what the protocols with ports of their own found.
        """
        chosen = self.chosen
        told = Told(
            batch, first_frame=self.first_frame, start_ns=self.start_ns, before_ns=self.before_ns, pdos=self.pdos,
            choose=None if chosen is None else lambda _: chosen, laid=laid, until_ns=self.until_ns,
            dissectors=self.dissectors, timeout_ns=self.timeout_ns, max_streams=self.max_streams,
            all_frames=self.all_frames, unheard=self.unheard, hears_answers=self.hears_answers,
            parameter_timeout_ns=self.parameter_timeout_ns,
        )  # fmt: skip
        # What follows connections has seen the batch, and must not see it again.
        told.__dict__["parts"] = self.parts if with_parts else {}
        return told.heard_by(self._listeners)

    def heard_by(self, listeners: Listeners) -> Told:
        """Return the same batch for who tells events to listeners, and to nobody else."""
        told = object.__new__(Told)
        # Nothing is found twice: whatever is looked for in one of them is found in both.
        told.__dict__ = self.__dict__
        told._listeners = listeners
        return told

    def waiting(self, timeout_ns: int) -> Told:
        """Return the same batch for who lets answers take so long."""
        told = self.heard_by(self._listeners)
        told.__dict__ = {**self.__dict__, "timeout_ns": timeout_ns}
        return told

    @property
    def is_heard(self) -> bool:
        """Whether anybody listens: what takes time to tell need not be told to nobody."""
        return bool(self._listeners)

    def tell(self, events: EventBatch) -> None:
        """Tell events to all who listen; of none, nothing is told."""
        if len(events):
            for listener in self._listeners:
                listener.hear(events)

    @property
    def is_deaf(self) -> bool:
        """Whether nobody at all listens behind the packets, until the next ones come."""
        return any(one.everything for one in self.unheard)

    @property
    def packets(self) -> PacketBatch:
        return self.batch.packets

    @property
    def variety(self) -> I64:
        """The variety of each packet, ``NO_TELEGRAM`` where it holds none. Shape (n,)."""
        return self.batch.variety

    @property
    def varieties(self) -> Varieties:
        return self.batch.varieties

    @property
    def counter(self) -> U16:
        """The Counter of each packet's telegram. Shape (n,)."""
        return self.batch.counter

    @property
    def can(self) -> CanBatch | None:
        """The CAN frames, None without any."""
        return self.batch.can

    @property
    def quoted(self) -> TelegramBatch:
        """The telegrams that ICMP messages quote as not delivered."""
        return self.batch.quoted

    @cached_property
    def clock(self) -> Clock:
        """The times of the packets."""
        return Clock(self.packets.ts_ns)

    @cached_property
    def header_counts(self) -> I64:
        """How many packets have each number of headers (``SortedPackets.header``), up to the highest that is there."""
        return np.bincount(self.batch.header)

    @cached_property
    def without_header(self) -> I64:
        """The packets whose headers have no number, rising."""
        if not len(self) or not self.header_counts[0]:
            return np.empty(0, np.int64)
        return np.flatnonzero(self.batch.header == 0)

    @cached_property
    def parts(self) -> Mapping[str, Part]:
        """What the protocols with ports of their own found in the batch, by name; only those that found something.

        A frame is of one of them alone: of the first that reads it.
        """
        found: dict[str, Part] = {}
        free = np.ones(len(self), np.bool_) if self.dissectors else None
        for dissector in self.dissectors:
            part = dissector.part_of(
                self.packets, self.batch.datagrams, self.batch.segments, self.first_frame,
                self._followers.get(dissector.name), self._prepared.get(dissector.name),
            )  # fmt: skip
            assert free is not None
            if not free[part.row].all():
                part = part.take(free[part.row])
            if len(part):
                found[dissector.name] = part
                free[part.row] = False
        return found

    @cached_property
    def chosen(self) -> Bool | None:
        """Which packets hold telegrams that the filter chooses, shape (n,); None without a filter."""
        return None if self._choose is None else self._choose(self)

    @cached_property
    def recognised(self) -> I64:
        """The packets in which something was found, a telegram, a CAN frame or what a protocol reads, rising."""
        own: Bool = self.variety != NO_TELEGRAM
        for part in self.parts.values():
            own[part.row] = True
        return np.flatnonzero(own)

    @cached_property
    def others(self) -> OtherFrames | None:
        """The frames in which nothing was found; None where they are not wanted."""
        if not self.all_frames:
            return None
        from dissectors.other_frames import read_other_frames  # noqa: PLC0415

        rest = np.ones(len(self), np.bool_)
        rest[self.recognised] = False
        return read_other_frames(self.packets, np.flatnonzero(rest))

    @property
    def wanted(self) -> I64:
        """The packets that are wanted one by one, rising: those recognised, or all."""
        return np.arange(len(self)) if self.all_frames else self.recognised

    @property
    def laid(self) -> Laid:
        """The telegrams laid out by stream."""
        assert self._laid is not None, "no observer asked for rows by stream"
        return self._laid

    @property
    def keys(self) -> Keys:
        return self.laid.keys

    @property
    def begun(self) -> Begun:
        return self.laid.begun

    @property
    def count(self) -> I64:
        """How many telegrams there are of each variety."""
        return self.laid.count


Choose = Callable[[Told], Bool]
"""A filter: tells which packets of a batch hold telegrams that are chosen, as a mask with an entry a packet."""
