"""DataRows: the well-formed data telegrams of a batch, or its PDOs, laid out by stream."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, U16, U64, Bool
from dissectors.layout import gather_bytes
from dissectors.sorter import SortedPackets
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import COUNTER_SHIFT, FrameKind, Keys
from nvscope.engine.runs import distinct, order_by, runs_of_lengths, spans

_COMPARE_ROWS = 8192


class StreamColumns(KeyedColumns):
    """One row a stream: how often, when, and the last telegram (its signature; its bytes are in ``StreamMemory``).

    ``heard``: it has had a telegram since somebody listens to it.
    """

    telegrams: I64
    first_ns: I64
    last_ns: I64
    signature: U64
    heard: Bool
    COLUMNS: ClassVar = {
        "telegrams": (np.int64(0), 1),
        "first_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "signature": (np.uint64(0), 1),
        "heard": (np.False_, 1),
    }


class DataRows(Struct, frozen=True):
    """Well-formed data telegrams, by stream, within a stream as captured.

    ``packet`` holds their rows in the packet batch. ``stream`` is the stream of each row; ``start`` and ``stop`` bound
    the runs of one stream, which is ``run_stream``; ``signature_before`` and ``before_ns`` are of the telegram before
    each run, and ``fresh`` where there is none, or nobody has listened since. ``several`` are the runs, by their places
    among the runs, that are of more than one variety, rising. ``wanting`` are the rows that want to be acknowledged,
    rising. ``repeated`` is None where no row is. ``others`` are the packets of the batch that hold no well-formed data
    telegram, rising; PDOs have none.
    """

    packet: I64
    stream: I64
    start: I64
    stop: I64
    run_stream: I64
    signature_before: U64
    before_ns: I64
    fresh: Bool
    several: I64
    variety: I64
    counter: U16
    time_ns: I64
    wanting: I64
    repeated: Bool | None
    others: I64

    def __len__(self) -> int:
        return len(self.packet)

    def changes(self) -> I64:
        """Return the rows, starts of runs aside, whose variety is not that of the row before, rising."""
        row = self.of_runs(self.several)
        differs = np.zeros(len(row), np.bool_)
        variety = self.variety[row]
        np.not_equal(variety[1:], variety[:-1], out=differs[1:])
        differs[np.searchsorted(row, self.start[self.several])] = False
        return row[differs]

    def of_runs(self, run: I64) -> I64:
        """Return the rows of some runs, given by their places among the runs."""
        return spans(self.start[run], self.stop[run] - self.start[run])

    def times_before(self, row: I64) -> I64:
        """Return the time of the telegram before some rows in their streams; of those that have none, their own."""
        run = np.searchsorted(self.start, row, "right") - 1
        first = row == self.start[run]
        before = np.where(self.fresh[run], self.time_ns[row], self.before_ns[run])
        times: I64 = np.where(first, before, self.time_ns[row - 1])
        return times

    def of(self, own: Bool) -> DataRows:
        """Return the rows of some streams; ``own`` is a mask over streams."""
        run = np.flatnonzero(own[self.run_stream])
        if len(run) == len(self.run_stream):
            return self
        length = self.stop[run] - self.start[run]
        row, stop = self.of_runs(run), np.cumsum(length)
        wants = np.zeros(len(self), np.bool_)
        wants[self.wanting] = True
        repeated = None if self.repeated is None else self.repeated[row]
        mixed = np.zeros(len(self.run_stream), np.bool_)
        mixed[self.several] = True
        return DataRows(
            self.packet[row], self.stream[row], stop - length, stop, self.run_stream[run], self.signature_before[run],
            self.before_ns[run], self.fresh[run], np.flatnonzero(mixed[run]), self.variety[row], self.counter[row],
            self.time_ns[row], np.flatnonzero(wants[row]),
            repeated if repeated is not None and repeated.any() else None, self.others,
        )  # fmt: skip

    def where(self, chosen: Bool, stream_of: I64) -> I64:
        """Return the rows of some varieties, rising; ``chosen`` is a mask over varieties, ``stream_of`` are theirs."""
        streams = stream_of[chosen]
        own = np.zeros(int(self.run_stream.max()) + 1, np.bool_)
        own[streams[(streams >= 0) & (streams < len(own))]] = True
        run = np.flatnonzero(own[self.run_stream])
        # Only runs of their streams have to be looked at, and few streams have what is asked for.
        row = self.of_runs(run)
        return row[chosen[self.variety[row]]]


def _no_rows() -> DataRows:
    number, word = np.empty(0, np.int64), np.empty(0, np.uint64)
    return DataRows(
        number, number, number, number, number, word, number, np.empty(0, np.bool_), number, number,
        np.empty(0, np.uint16), number, number, None, number,
    )  # fmt: skip


NO_ROWS = _no_rows()


class StreamMemory:
    """What is kept of each stream from one batch to the next, and the rows made with it."""

    def __init__(self) -> None:
        self.columns = StreamColumns()
        self.payload: dict[int, bytes] = {}

    def rows(self, batch: SortedPackets, count: I64, keys: Keys, kind: FrameKind = FrameKind.DATA) -> DataRows:
        """Lay out well-formed data telegrams by stream, and remember the last one of each; or the PDOs, if so asked.

        ``count`` says how many telegrams there are of each variety. PDOs are never ``repeated``: without a counter,
        nobody can tell a repeated one from the next one.
        """
        columns, varieties = self.columns, keys.varieties
        streams = len(keys.streams)
        columns.resize(streams)
        stream_of = varieties.column("stream")
        length = np.zeros(streams, np.int64)
        own = varieties.column("kind") == kind
        np.add.at(length, stream_of[own], count[own])
        if not length.any():
            return NO_ROWS if kind == FrameKind.PDO else replace(NO_ROWS, others=np.arange(len(batch)))
        # What is no data telegram goes behind all streams.
        packet, others = np.split(order_by(np.where(own, stream_of, streams), batch.variety, streams), [length.sum()])
        run, start, stop = runs_of_lengths(length)
        seen = np.flatnonzero(own & (count > 0))
        varieties_of = np.bincount(stream_of[seen], minlength=streams)
        several = np.flatnonzero(varieties_of[run] > 1)
        # Most runs are of one variety: there is nothing to look up.
        only = np.empty(streams, np.int64)
        only[stream_of[seen]] = seen
        variety = np.repeat(only[run], stop - start)
        # Of whole columns ``take`` takes a sixth less time than an index does.
        counter, time_ns = batch.counter.take(packet), batch.packets.ts_ns.take(packet)
        nothing = np.empty(0, np.int64)
        rows = DataRows(
            packet, np.repeat(run, stop - start), start, stop, run, columns.signature[run], columns.last_ns[run],
            ~columns.heard[run], several, variety, counter, time_ns, nothing, None,
            others if kind == FrameKind.DATA else nothing,
        )  # fmt: skip
        mixed = rows.of_runs(several)
        variety[mixed] = batch.variety[packet[mixed]]
        if varieties.column("wants").any():
            rows = replace(rows, wanting=rows.where(varieties.column("wants"), stream_of))
        if kind == FrameKind.DATA:
            rows = replace(rows, repeated=self._repeated(batch, rows, keys))
        first = columns.telegrams[run] == 0
        columns.first_ns[run[first]] = time_ns[start[first]]
        columns.heard[run] = True
        columns.last_ns[run] = time_ns[stop - 1]
        columns.telegrams[run] += stop - start
        columns.signature[run] = _signatures(rows, stop - 1, keys)
        if kind == FrameKind.DATA:
            self._remember(batch, rows)
        return rows

    def resume(self, streams: I64) -> None:
        """Let what comes next of some streams, to which nobody listens now, follow nothing."""
        self.columns.heard[self.columns.own_rows(streams)] = False

    def _repeated(self, batch: SortedPackets, rows: DataRows, keys: Keys) -> Bool | None:
        """Tell which rows equal the one before in their stream, byte for byte as far as both were captured."""
        again = np.zeros(len(rows), np.bool_)
        alike = (_signatures(rows, rows.start, keys) == rows.signature_before) & ~rows.fresh
        row = rows.start[alike]
        begin, end = (one.tolist() for one in _payloads(batch, rows.packet[row], rows.variety[row]))
        streams = rows.run_stream[alike].tolist()
        for own, stream, one, other in zip(row.tolist(), streams, begin, end, strict=True):
            again[own] = batch.packets.data[one:other].tobytes() == self.payload[stream]
        inner = np.flatnonzero(rows.counter[1:] == rows.counter[:-1]) + 1
        inner = inner[rows.stream[inner] == rows.stream[inner - 1]]
        if len(inner):
            signature, length = keys.varieties.signature, batch.varieties.carried.captured_bytes
            now, previous = rows.variety[inner], rows.variety[inner - 1]
            inner = inner[(signature[now] == signature[previous]) & (length[now] == length[previous])]
            again[inner] = _equal_payloads(batch, rows, inner)
        return again if again.any() else None

    def _remember(self, batch: SortedPackets, rows: DataRows) -> None:
        last = rows.stop - 1
        begin, end = _payloads(batch, rows.packet[last], rows.variety[last])
        # Of thousands of streams, each for itself: what is done for all of them at once must be little for one.
        data, ends = batch.packets.data.data, zip(begin.tolist(), end.tolist(), strict=True)
        payloads = [data[one:other].tobytes() for one, other in ends]
        self.payload.update(zip(rows.run_stream.tolist(), payloads, strict=True))


def _signatures(rows: DataRows, which: I64, keys: Keys) -> U64:
    """Return the signatures of some rows, with their Counter."""
    common: U64 = keys.varieties.signature[rows.variety[which]]
    return common | (rows.counter[which].astype(np.uint64) << COUNTER_SHIFT)


def _payloads(batch: SortedPackets, packet: I64, variety: I64) -> tuple[I64, I64]:
    """Return where the captured bytes of some telegrams begin and end."""
    datagram, part = batch.varieties.telegrams.datagram, batch.varieties.part[variety]
    begin: I64 = batch.packets.offset[packet] + datagram.payload[part]
    return begin, begin + datagram.captured_bytes[part]


def _equal_payloads(batch: SortedPackets, rows: DataRows, which: I64) -> Bool:
    """Tell which rows have the payload of the row before, which is as long; many of the same length at a time."""
    equal = np.zeros(len(which), np.bool_)
    datagram, part, packets = batch.varieties.telegrams.datagram, batch.varieties.part, batch.packets
    length = datagram.captured_bytes[part[rows.variety[which]]]
    payload = [
        packets.offset[rows.packet[row]] + datagram.payload[part[rows.variety[row]]] for row in (which, which - 1)
    ]
    for size in distinct(length).tolist():
        places = np.flatnonzero(length == size)
        for begin in range(0, len(places), _COMPARE_ROWS):
            some = places[begin : begin + _COMPARE_ROWS]
            now, before = (
                gather_bytes(packets.data, at[some], size).view(np.uint8).reshape(len(some), size) for at in payload
            )
            equal[some] = (now == before).all(axis=1)
    return equal
