"""The data of telegrams, stream by stream: for what looks at values and at nothing else of the traffic."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dissectors import address
from dissectors.batch import I64, U8, Bool, PacketBatch
from dissectors.can.pdo import PdoRules
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER, PortRules
from dissectors.varieties import NO_TELEGRAM, Choose, SortedPackets, Sorter
from nvscope.engine.flows import LENGTH_SHIFT, Flows, Kind
from nvscope.engine.rows import DataRows, StreamMemory
from nvscope.list_key import ListKey, Port

_PIECE_PACKETS = 1 << 14


@dataclass(frozen=True, slots=True)
class Stream:
    """Who sends which telegram of which list; on CAN the channel stands for the sender."""

    number: int
    port: Port
    index: int
    subindex: int
    sender: str
    order: tuple[bool, int]
    """What senders are sorted by, IPv4 before IPv6."""


@dataclass(frozen=True, slots=True)
class Telegrams:
    """Well-formed data telegrams of one stream and one shape, captured whole, in the order of the capture.

    ``data`` holds the bytes behind the header, shape (n, bytes); ``frame`` (from 1) and ``time_ns`` have shape (n,).
    ``flags`` is that of all of them, ``destination`` the address of the first one.
    """

    stream: Stream
    items: int
    data: U8
    frame: I64
    time_ns: I64
    flags: int
    destination: str


class DataTelegrams:
    """The data telegrams of packet batches that follow each other; ``ports`` as for ``dissectors.netvar.dissect``.

    ``choose`` tells of each batch which packets are wanted, None for all. ``frames`` counts those seen so far,
    ``telegrams`` the telegrams of any service and the CAN frames, ``chosen`` those of them that are wanted. ``lists``
    are those of which data telegrams came, ``chosen_lists`` those of which some were wanted. ``pdos`` say which lists
    CAN frames belong to.
    """

    def __init__(
        self, ports: PortRules | None = None, choose: Choose | None = None, pdos: PdoRules | None = None
    ) -> None:
        self._sorter = Sorter(ports, pdos)
        self._choose = choose
        self._flows = Flows(pdos)
        self._memory = StreamMemory()
        self._streams: dict[int, Stream] = {}
        self.frames = 0
        self.telegrams = 0
        self.chosen = 0
        self.lists: set[ListKey] = set()
        self.chosen_lists: set[ListKey] = set()

    def pieces(self, packets: PacketBatch) -> Iterator[list[Telegrams]]:
        """Yield the telegrams of a batch, a small piece of it at a time.

        Within a piece there is one entry for each stream and shape, so that a stream has several where its shape or
        flags change; frames of different entries interleave.
        """
        for start in range(0, len(packets), _PIECE_PACKETS):
            batch = self._sorter.sort(packets[start : start + _PIECE_PACKETS])
            found = list(self._sorted(batch))
            self.frames += len(batch)
            yield found

    def _sorted(self, batch: SortedPackets) -> Iterator[Telegrams]:
        count = self._flows.observe(batch, self.frames + 1)
        self.telegrams += len(batch) - int(count[NO_TELEGRAM])
        chosen = None
        if self._choose is not None:
            chosen = self._choose(batch)
            self.chosen += int(np.count_nonzero(chosen))
        for kind in (Kind.DATA, Kind.PDO) if batch.can else (Kind.DATA,):
            yield from self._laid_out(batch, self._memory.rows(batch, count, self._flows, kind), chosen)

    def _laid_out(self, batch: SortedPackets, rows: DataRows, chosen: Bool | None) -> Iterator[Telegrams]:
        signatures, truncated = self._flows.varieties.signature, batch.varieties.truncated
        for number, start, stop in zip(rows.run_stream.tolist(), rows.start.tolist(), rows.stop.tolist(), strict=True):
            packet, variety = rows.packet[start:stop], rows.variety[start:stop]
            stream = self._stream(number)
            self.lists.add((stream.port, stream.index))
            if chosen is not None:
                own_chosen = chosen[packet]
                packet, variety = packet[own_chosen], variety[own_chosen]
            if len(packet):
                self.chosen_lists.add((stream.port, stream.index))
            if truncated.any():
                whole = ~truncated[variety]
                packet, variety = packet[whole], variety[whole]
            for kind in np.unique(variety).tolist():
                own = packet[variety == kind]
                size = (int(signatures[kind]) >> int(LENGTH_SHIFT) & 0xFFFF) - HEADER.size_bytes
                at = batch.packets.offset[own] + (batch.varieties.datagram.payload[kind] + HEADER.size_bytes)
                data = (
                    gather_bytes(batch.packets.data, at, size).view(np.uint8).reshape(len(own), size)
                    if size
                    else (np.empty((len(own), 0), np.uint8))
                )
                datagram, header = batch.varieties.datagram, batch.varieties.header[kind]
                yield Telegrams(
                    stream, int(header["items"]), data, own + (self.frames + 1),
                    batch.packets.ts_ns[own], int(header["flags"]),
                    address.text(int(datagram.destination_hi[kind]), int(datagram.destination_lo[kind])),
                )  # fmt: skip

    def _stream(self, number: int) -> Stream:
        known = self._streams.get(number)
        if known is None:
            key = self._flows.stream_key(number)
            known = self._streams[number] = Stream(number, *key.list, key.subindex, key.sender, key.order)
        return known


def joined(piece: Iterable[Telegrams]) -> list[Telegrams]:
    """Return telegrams with those of one stream and shape together, each in the order of the capture.

    Entries are in the order of their first frames. Flags are those of any of the telegrams.
    """
    groups: dict[tuple[int, int, int], list[Telegrams]] = {}
    for telegrams in sorted(piece, key=lambda entry: int(entry.frame[0])):
        groups.setdefault((telegrams.stream.number, telegrams.items, telegrams.data.shape[1]), []).append(telegrams)
    return [parts[0] if len(parts) == 1 else _join(parts) for parts in groups.values()]


def _join(parts: list[Telegrams]) -> Telegrams:
    frame = np.concatenate([part.frame for part in parts])
    order = np.argsort(frame)
    data, time_ns = np.concatenate([part.data for part in parts]), np.concatenate([part.time_ns for part in parts])
    flags = 0
    for part in parts:
        flags |= part.flags
    first = parts[0]
    return Telegrams(first.stream, first.items, data[order], frame[order], time_ns[order], flags, first.destination)
