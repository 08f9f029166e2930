"""DataRows: the well-formed data telegrams of a batch, laid out by stream."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U16, U64, Bool
from dissectors.layout import gather_bytes
from dissectors.netvar import HEADER, TelegramBatch
from nvscope.tracker.columns import Columns, runs_of, stable_order
from nvscope.tracker.flows import Flows

# Items, Length, Counter, Flags and Checksum are looked at as one 64-bit number, the signature.
_SIGNATURE_AT = HEADER.offset_of("items")
_SIGNATURE = np.dtype(
    {"names": ["signature"], "formats": ["<u8"], "offsets": [_SIGNATURE_AT], "itemsize": HEADER.size_bytes}
)
_COMPARE_ROWS = 8192


def _shift(name: str) -> np.uint64:
    return np.uint64(8 * (HEADER.offset_of(name) - _SIGNATURE_AT))


LENGTH_SHIFT, COUNTER_SHIFT = _shift("length"), _shift("counter")
FLAGS_SHIFT, CHECKSUM_SHIFT = _shift("flags"), _shift("checksum")
SHAPE_MASK = np.uint64(0xFFFFFFFF)
"""The part of a signature that holds Items and Length."""


class StreamColumns(Columns):
    """One row a stream: how often, when, and the last telegram (its signature; its bytes are in ``StreamMemory``)."""

    telegrams: I64
    first_ns: I64
    last_ns: I64
    signature: U64
    COLUMNS: ClassVar = {
        "telegrams": (np.int64(0), 1),
        "first_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "signature": (np.uint64(0), 1),
    }


@dataclass(frozen=True, slots=True)
class DataRows:
    """Well-formed data telegrams, by stream, within a stream as captured.

    ``order`` holds their positions among the batch's data telegrams as captured, ``packet`` their rows in the packet
    batch. ``stream`` is the stream of each row; ``start`` and ``stop`` bound the runs of one stream, which is
    ``run_stream``. ``repeated`` is None where no row is.
    """

    order: I64
    stream: I64
    start: I64
    stop: I64
    run_stream: I64
    signature: U64
    before: U64
    time_ns: I64
    packet: I64
    fresh: Bool
    repeated: Bool | None
    counter: U16
    flags: U8

    def __len__(self) -> int:
        return len(self.order)

    @property
    def checksum(self) -> U8:
        return self.field(CHECKSUM_SHIFT).astype(np.uint8)

    def field(self, shift: np.uint64) -> U64:
        """Return the signatures with one field at their lower end."""
        return self.signature >> shift

    def as_captured(self, column: np.ndarray) -> np.ndarray:
        """Return a column of these rows in the order of the capture."""
        captured = np.empty_like(column)
        captured[self.order] = column
        return captured


class StreamMemory:
    """What is kept of each stream from one batch to the next, and the rows made with it."""

    def __init__(self) -> None:
        self.columns = StreamColumns()
        self.payload: dict[int, bytes] = {}

    def rows(self, telegrams: TelegramBatch, which: I64, stream: I64, flows: Flows) -> DataRows:
        """Lay out well-formed data telegrams, those at ``which``, by stream, and remember the last one of each.

        ``stream`` has one entry for each of these.
        """
        columns = self.columns
        columns.resize(len(flows.streams))
        order = stable_order(stream, len(flows.streams))
        ordered = stream[order]
        start, stop = runs_of(ordered)
        run = ordered[start]
        position = order if len(which) == len(telegrams) else which[order]
        # Copied in order first: headers lie far apart, and the order jumps.
        signature = telegrams.header.view(_SIGNATURE)["signature"].astype(np.uint64)[position]
        fresh = columns.telegrams[run] == 0
        before = np.empty_like(signature)
        before[1:] = signature[:-1]
        before[start] = columns.signature[run]
        repeated = self._repeated(telegrams, position, start, run, fresh, signature, before)
        time_ns = telegrams.ts_ns[position]
        packet = telegrams.datagram.row[position]
        columns.first_ns[run[fresh]] = time_ns[start[fresh]]
        columns.last_ns[run] = time_ns[stop - 1]
        columns.telegrams[run] += stop - start
        columns.signature[run] = signature[stop - 1]
        self._remember(telegrams, position[stop - 1], run)
        return DataRows(
            order, ordered, start, stop, run, signature, before, time_ns, packet, fresh, repeated,
            (signature >> COUNTER_SHIFT).astype(np.uint16), (signature >> FLAGS_SHIFT).astype(np.uint8),
        )  # fmt: skip

    def _repeated(
        self, telegrams: TelegramBatch, position: I64, start: I64, run: I64, fresh: Bool, signature: U64, before: U64
    ) -> Bool | None:
        """Tell which rows equal the one before in their stream, byte for byte as far as both were captured."""
        candidate = signature == before
        if not candidate.any():
            return None
        length = telegrams.datagram.captured_bytes
        first = np.flatnonzero(candidate[start])
        for place in first.tolist():
            row, stream = int(start[place]), int(run[place])
            same = not fresh[place] and telegrams.payload(int(position[row])) == self.payload[stream]
            candidate[row] = same
        begins = np.zeros(len(position), np.bool_)
        begins[start] = True
        inner = np.flatnonzero(candidate & ~begins)
        now, previous = position[inner], position[inner - 1]
        alike = length[now] == length[previous]
        candidate[inner[~alike]] = False
        inner, now, previous = inner[alike], now[alike], previous[alike]
        candidate[inner] = _equal_payloads(telegrams, now, previous, length[now])
        return candidate if candidate.any() else None

    def _remember(self, telegrams: TelegramBatch, last: I64, run: I64) -> None:
        at = telegrams.datagram.payload[last]
        end = at + telegrams.datagram.captured_bytes[last]
        data = telegrams.data.data
        for stream, first, behind in zip(run.tolist(), at.tolist(), end.tolist(), strict=True):
            self.payload[stream] = bytes(data[first:behind])


def _equal_payloads(telegrams: TelegramBatch, left: I64, right: I64, length: I64) -> Bool:
    """Compare payloads of equal captured lengths, many of the same length at a time."""
    equal = np.zeros(len(left), np.bool_)
    payload = telegrams.datagram.payload
    for size in np.unique(length).tolist():
        rows = np.flatnonzero(length == size)
        for begin in range(0, len(rows), _COMPARE_ROWS):
            part = rows[begin : begin + _COMPARE_ROWS]
            first = gather_bytes(telegrams.data, payload[left[part]], size)
            second = gather_bytes(telegrams.data, payload[right[part]], size)
            same = first.view(np.uint8).reshape(len(part), size) == second.view(np.uint8).reshape(len(part), size)
            equal[part] = same.all(axis=1)
    return equal
