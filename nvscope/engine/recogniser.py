"""Recogniser: from packet batches to what observers are told of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from dissectors.claims import Claims
from dissectors.sorter import SortedPackets, Sorter
from nvscope.engine.keys import FrameKind, Keys
from nvscope.engine.limit import ELSEWHERE
from nvscope.engine.parameters import ParameterRows
from nvscope.engine.reading import Reading
from nvscope.engine.rows import StreamMemory
from nvscope.engine.told import Laid, Told
from nvscope.engine.watch import Watch

MAX_BATCH = 1 << 17
_FOLLOWED = 1 << 15
"""Of connections, whose bytes are put together, less at a time: it stays near the processor."""


class Before(Struct, frozen=True):
    """What lies before frames that are read from the middle of a capture.

    ``frames`` is how many there are, ``start_ns`` the time of the first of them, ``last_ns`` that of the last.
    """

    frames: int
    start_ns: int
    last_ns: int


class Recogniser:
    """Recognises the batches of a capture in turn.

    ``channels`` returns the names of CAN channels by number, as far as they are known. With ``by_stream``, telegrams
    are laid out by stream.
    """

    def __init__(
        self, reading: Reading, channels: Callable[[], Sequence[str]] = lambda: (), *, by_stream: bool = True
    ) -> None:
        self._reading = replace(reading, pdos=replace(reading.pdos, names=channels))
        claims = Claims.of(dissector.claims for dissector in reading.dissectors)
        self._sorter = Sorter(reading.ports, self._reading.pdos, claims)
        self._keys = Keys(self._reading.pdos, reading.max_streams) if by_stream else None
        self._memory = StreamMemory()
        self._watch = Watch()
        self._followers = {one.name: one.begin() for one in reading.dissectors if one.begin is not None}
        self._frames = 0
        self._has_begun = False
        # Whether most packets are segments; of those that come first, that is not known yet.
        self._follows = True
        self._start_ns = self._last_ns = 0

    def go_on_behind(self, before: Before) -> None:
        """Take what is told next for frames that follow these, whatever was told so far."""
        self._has_begun = True
        self._frames, self._start_ns, self._last_ns = before.frames, before.start_ns, before.last_ns

    def tell(self, packets: PacketBatch) -> Iterator[Told]:
        """Yield what is to be told of the packets that follow those before, a limited number of them at a time.

        Of a batch that says nothing at all, nothing is told; of one without packets, that time has passed, or that
        a source has ended.
        """
        if packets.ends and len(packets):
            yield from self._tell(PacketBatch.ended(*packets.ends))
            packets = replace(packets, ends=())
        start = 0
        while start < len(packets) or not start:
            most = _FOLLOWED if self._follows else MAX_BATCH
            last = start + most >= len(packets)
            yield from self._tell(packets[start : start + most], packets.until_ns if last else None)
            start += most

    def _tell(self, packets: PacketBatch, until_ns: int | None = None) -> Iterator[Told]:
        unheard = [one for end in packets.ends for one in self._watch.end(end, self._keys)]
        for one in unheard:
            self._memory.resume(one.streams)
        if not (len(packets) or unheard or until_ns is not None):
            return
        if not self._has_begun and len(packets):
            self._has_begun = True
            self._start_ns = self._last_ns = int(packets.ts_ns[0])
        batch = self._sorter.sort(packets)
        self._follows = 2 * len(batch.segments) > len(batch)
        laid = None if self._keys is None else self._lay_out(batch, self._keys)
        self._watch.observe(batch, self._keys)
        told = Told(
            batch, first_frame=self._frames + 1, start_ns=self._start_ns, before_ns=self._last_ns,
            pdos=self._reading.pdos, choose=self._reading.choose, laid=laid, until_ns=until_ns,
            dissectors=self._reading.dissectors, timeout_ns=self._reading.timeout_ns,
            max_streams=self._reading.max_streams, all_frames=self._reading.all_frames, unheard=unheard,
            hears_answers=self._reading.hears_answers, parameter_timeout_ns=self._reading.parameter_timeout_ns,
            followers=self._followers,
        )  # fmt: skip
        self._follow(told)
        if len(batch):
            self._frames += len(batch)
            self._last_ns = int(batch.packets.ts_ns[-1])
        yield told

    def _follow(self, told: Told) -> None:
        """Let connections be followed, whether or not anybody asks: what is passed over would be a hole in them."""
        if self._followers:
            _ = told.parts
            if told.is_deaf:
                for follower in self._followers.values():
                    follower.forget()

    def _lay_out(self, batch: SortedPackets, keys: Keys) -> Laid:
        begun = keys.observe(batch)
        count = np.bincount(batch.variety, minlength=len(keys.varieties))
        data = self._memory.rows(batch, count, keys)
        pdos = self._memory.rows(batch, count, keys, FrameKind.PDO)
        parameters = ParameterRows.in_batch(batch, count, keys)
        rejected, left_out = keys.rejected(batch.quoted)
        elsewhere = np.empty(0, np.int64)
        if keys.bites:
            varieties = keys.varieties
            beyond = varieties.column("kind") == FrameKind.LEFT_OUT
            left_out = np.sort(np.append(left_out, np.flatnonzero(beyond[batch.variety])))
            elsewhere = np.flatnonzero((varieties.column("receiver") == ELSEWHERE)[batch.variety])
        return Laid(keys, begun, count, data, pdos, parameters, rejected, left_out, elsewhere, self._memory)
