"""The data of telegrams, stream by stream: for what looks at values and at nothing else of the traffic."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from msgspec import Struct

from dissectors import address
from dissectors.batch import I64, U8
from dissectors.carried import Carrier
from dissectors.layout import gather_bytes
from dissectors.varieties import Varieties
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import distinct
from nvscope.engine.told import Told
from nvscope.list_key import ListKey


class Stream(Struct, frozen=True):
    """Who sends which telegram of which list; on CAN the channel stands for the sender."""

    number: int
    list: ListKey
    subindex: int
    sender: str
    order: tuple[bool, int]
    """What senders are sorted by, IPv4 before IPv6."""


class Telegrams(Struct, frozen=True):
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


def _any(_: Stream) -> bool:
    return True


class DataTelegrams:
    """The data telegrams of batches that follow each other, those of ``wanted`` streams, and what else there was.

    ``frames`` counts those seen so far, ``telegrams`` the telegrams of any service and the CAN frames, ``chosen`` those
    of them that the filter chooses. ``lists`` are those of which data telegrams came, ``chosen_lists`` those of which
    some were chosen.
    """

    def __init__(self, wanted: Callable[[Stream], bool] = _any) -> None:
        self._wanted = wanted
        self._streams: dict[int, tuple[Stream, bool]] = {}
        self.frames = 0
        self.telegrams = 0
        self.chosen = 0
        self.lists: set[ListKey] = set()
        self.chosen_lists: set[ListKey] = set()

    def of(self, told: Told) -> list[Telegrams]:
        """Return the telegrams of a batch: an entry for each stream, shape and flags; their frames interleave."""
        found = [*self._laid_out(told, told.laid.data), *self._laid_out(told, told.laid.pdos)]
        self.frames += len(told)
        self.telegrams += len(told.recognised)
        if told.chosen is not None:
            self.chosen += int(np.count_nonzero(told.chosen))
        return found

    def _laid_out(self, told: Told, rows: DataRows) -> Iterator[Telegrams]:
        varieties, carried = told.varieties, told.varieties.carried
        truncated = carried.truncated
        some_truncated = bool(truncated.any())
        for number, start, stop in zip(rows.run_stream.tolist(), rows.start.tolist(), rows.stop.tolist(), strict=True):
            stream, wanted = self._stream(told, number)
            self.lists.add(stream.list)
            packet, variety = rows.packet[start:stop], rows.variety[start:stop]
            if told.chosen is not None:
                own_chosen = told.chosen[packet]
                packet, variety = packet[own_chosen], variety[own_chosen]
            if len(packet):
                self.chosen_lists.add(stream.list)
            if not wanted:
                continue
            if some_truncated:
                whole = ~truncated[variety]
                packet, variety = packet[whole], variety[whole]
            for kind, own in _by_variety(packet, variety):
                size, at = int(carried.size_bytes[kind]), told.packets.offset[own] + carried.at[kind]
                data = (
                    gather_bytes(told.packets.data, at, size).view(np.uint8).reshape(len(own), size)
                    if size
                    else (np.empty((len(own), 0), np.uint8))
                )
                flags, destination = _sent_how(varieties, kind)
                yield Telegrams(
                    stream, int(carried.items[kind]), data, own + told.first_frame, told.packets.ts_ns[own], flags,
                    destination,
                )  # fmt: skip

    def _stream(self, told: Told, number: int) -> tuple[Stream, bool]:
        known = self._streams.get(number)
        if known is None:
            key = told.keys.stream_key(number)
            stream = Stream(number, key.list, key.subindex, key.sender, key.order)
            known = self._streams[number] = stream, self._wanted(stream)
        return known


def _sent_how(varieties: Varieties, kind: int) -> tuple[int, str]:
    """Return the flags of a variety, and where it goes; on CAN there are neither."""
    if varieties.carried.carrier[kind] != Carrier.UDP:
        return 0, ""
    common, part = varieties.telegrams, int(varieties.part[kind])
    high, low = common.datagram.destination_hi[part], common.datagram.destination_lo[part]
    return int(common.header["flags"][part]), address.text(int(high), int(low))


def _by_variety(packet: I64, variety: I64) -> Iterator[tuple[int, I64]]:
    """Yield the packets of one stream by variety; mostly there is one."""
    if len(variety) and (variety[0] == variety).all():
        yield int(variety[0]), packet
        return
    for kind in distinct(variety).tolist():
        yield kind, packet[variety == kind]


def joined(telegrams: Iterable[Telegrams]) -> list[Telegrams]:
    """Return telegrams with those of one stream and shape together, each in the order of the capture.

    Entries are in the order of their first frames. Flags are those of any of the telegrams.
    """
    groups: dict[tuple[int, int, int], list[Telegrams]] = {}
    for part in sorted(telegrams, key=lambda entry: int(entry.frame[0])):
        groups.setdefault((part.stream.number, part.items, part.data.shape[1]), []).append(part)
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
