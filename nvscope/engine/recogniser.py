"""Recogniser: from packet batches to what observers are told of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import End, PacketBatch
from dissectors.claims import Claims
from dissectors.sorter import SortedPackets, Sorter
from nvscope.engine.keys import FrameKind, Keys
from nvscope.engine.limit import ELSEWHERE
from nvscope.engine.parameters import ParameterRows
from nvscope.engine.preparation import Preparation, PreparedBatch, PreparedPackets
from nvscope.engine.reading import Reading
from nvscope.engine.rows import StreamMemory
from nvscope.engine.told import Laid, Told
from nvscope.engine.watch import Watch


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
        sorter = Sorter(reading.ports, self._reading.pdos, claims)
        self._keys = Keys(self._reading.pdos, reading.max_streams) if by_stream else None
        self._memory = StreamMemory()
        self._watch = Watch()
        self._followers = {one.name: one.begin() for one in reading.dissectors if one.begin is not None}
        self.preparation = Preparation(sorter, reading.dissectors, self._followers)
        self._has_begun = False
        self._start_ns = self._last_ns = 0

    def go_on_behind(self, before: Before) -> None:
        """Take what is told next for frames that follow these, whatever was told so far."""
        self._has_begun = True
        self.preparation.frames = before.frames
        self._start_ns, self._last_ns = before.start_ns, before.last_ns

    def tell(self, packets: PacketBatch) -> Iterator[Told]:
        """Yield what is to be told of the packets that follow those before, a limited number of them at a time.

        Of a batch that says nothing at all, nothing is told; of one without packets, that time has passed, or that
        a source has ended.
        """
        if isinstance(packets, PreparedPackets) and packets.prepared is not None:
            yield from self._tell(packets.prepared)
            return
        if packets.ends and len(packets):
            yield from self.tell(PacketBatch.ended(*packets.ends))
            packets = replace(packets, ends=())
        behind = self.preparation.frames + len(packets) + 1
        for part in self.preparation.prepare(packets):
            is_last = part.first_frame + len(part.sorted) == behind
            yield from self._tell(part, packets.ends, packets.until_ns if is_last else None)

    def _tell(
        self, prepared: PreparedBatch, ends: Sequence[End] = (), until_ns: int | None = None
    ) -> Iterator[Told]:  # fmt: skip
        batch = prepared.sorted
        unheard = [one for end in ends for one in self._watch.end(end, self._keys)]
        for one in unheard:
            self._memory.resume(one.streams)
        if not (len(batch) or unheard or until_ns is not None):
            return
        if not self._has_begun and len(batch):
            self._has_begun = True
            self._start_ns = self._last_ns = int(batch.packets.ts_ns[0])
        laid = None if self._keys is None else self._lay_out(batch, self._keys)
        self._watch.observe(batch, self._keys)
        told = Told(
            batch, first_frame=prepared.first_frame, start_ns=self._start_ns, before_ns=self._last_ns,
            pdos=self._reading.pdos, choose=self._reading.choose, laid=laid, until_ns=until_ns,
            dissectors=self._reading.dissectors, timeout_ns=self._reading.timeout_ns,
            max_streams=self._reading.max_streams, all_frames=self._reading.all_frames, unheard=unheard,
            hears_answers=self._reading.hears_answers, parameter_timeout_ns=self._reading.parameter_timeout_ns,
            followers=self._followers, prepared=prepared.followed,
        )  # fmt: skip
        self._follow(told)
        if len(batch):
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
