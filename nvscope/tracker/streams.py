"""Streams: the bytes of TCP connections over claimed ports, in their order, with holes where bytes are missing.

Source: RFC 9293. What was captured need not be what arrived: segments may be missing, twice, in another order, or cut
short, and connections may have begun before the capture. A hole is data: nothing is made up for it, and what lies
behind it waits until it is sure that the missing bytes do not come any more (``nvscope.tracker.segments_in_turn``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8, Bool, PacketBatch
from dissectors.headers import ACK, FIN, RST, SYN
from dissectors.transport import SegmentBatch
from nvscope.engine.runs import runs_of, stable_order
from nvscope.tracker.connections import Connections
from nvscope.tracker.pieces import ANEW, IN_STEP, ORDER_BITS, Brought, Order, PieceKind, Pieces, no_pieces
from nvscope.tracker.segments_in_turn import FAR, FORGOTTEN_NS, Segments, SegmentsInTurn, StreamColumns

_FEW = 128
"""So many segments take as long one after the other as at once."""

_MOST_PARTS = 8

MOST_CONNECTIONS = 1 << 16
ENOUGH = 1 << 10
"""Fewer connections are not worth while to be forgotten."""

_APART = 1 << 34
_WRAP, _HALF = 1 << 32, 1 << 31
_NEVER = int(np.iinfo(np.int64).max)


class Outlived(NamedTuple):
    """The connections that are kept, by the numbers that they had; and whether only those go that have ended."""

    kept: I64
    only_ended: bool


class Streams:
    """The connections over some ports, from one batch to the next.

    Connections in which nothing is missing, late or begun anew are put in order all at once, as columns; the others a
    segment at a time. Of more than ``enough`` connections those that have ended may be forgotten, and of more than
    ``most`` others, too (``outlived``).
    """

    def __init__(self, ports: Sequence[int], enough: int = ENOUGH, most: int = MOST_CONNECTIONS) -> None:
        self.connections = Connections(ports)
        self._streams = StreamColumns()
        self._in_turn = SegmentsInTurn(self._streams)
        self._latest_ns = 0
        self._enough = self._least = enough
        self._most = most

    def outlived(self) -> Outlived | None:
        """Forget connections where there are many; return None where all are kept.

        Those that have ended go, sooner where there are too many of all, and of too many others those of which nothing
        came for the longest time. Those kept are numbered anew, in their order.
        """
        if len(self.connections) <= self._enough:
            return None
        column = self._streams.column
        latest_ns = np.maximum(column("latest_ns")[0::2], column("latest_ns")[1::2])
        stays = ~(column("ended")[0::2] & column("ended")[1::2])
        recent = np.flatnonzero(stays | (latest_ns >= self._latest_ns - FORGOTTEN_NS))
        kept = recent if len(recent) <= self._most else np.flatnonzero(stays)
        only_ended = len(kept) <= self._most
        if not only_ended:
            newest = np.argpartition(latest_ns[kept], -self._most)[-self._most :]
            kept = np.sort(kept[newest])
        self._enough = max(self._least, min(2 * len(kept), self._most))
        if len(kept) == len(self.connections):
            return None
        self.connections.keep(kept)
        streams = np.stack([2 * kept, 2 * kept + 1], axis=1).ravel()
        self._streams = self._streams.rows(streams)
        self._in_turn.keep({old: new for new, old in enumerate(streams.tolist())}, self._streams)
        return Outlived(kept, only_ended)

    def forget(self) -> None:
        """Forget where all connections are: what comes next of them begins in the middle."""
        self._streams.reset()
        self._in_turn.forget()

    def observe(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> Brought:
        """Take the segments of a batch, which follows those observed so far; ``first_frame`` is that of its row 0."""
        if not len(segments):
            return Brought(no_pieces())
        rows, carrying = self._numbered(packets, segments, first_frame)
        if not len(rows):
            return Brought(no_pieces())
        self._latest_ns = max(self._latest_ns, int(rows.time_ns.max()))
        self._streams.resize(2 * len(self.connections))
        found: list[Pieces] = []
        self._in_turn.begin()
        self._put_in_order(packets.data, rows, carrying, found)
        pieces = Pieces.stacked(found)
        pieces = pieces.take(stable_order(pieces.stream, 2 * len(self.connections)))
        return Brought(pieces, self._in_turn.kept)

    def _put_in_order(self, data: U8, rows: Segments, carrying: Bool, found: list[Pieces]) -> None:
        """Add what segments bring to ``found``: where something is peculiar, in parts, and few of them in turn."""
        if len(rows) <= _FEW:
            found.append(self._in_turn.observe(data, rows))
            return
        is_plain, pieces = self._plain(rows, carrying)
        found.append(pieces)
        if is_plain.all():
            return
        rest, carrying = rows.take(~is_plain), carrying[~is_plain]
        parts = min(max(-(-len(rest) // _FEW), 2), _MOST_PARTS)
        bounds = [len(rest) * part // parts for part in range(1, parts)]
        part_of = np.searchsorted(np.partition(rest.frame, bounds)[bounds], rest.frame, side="right")
        for number in range(parts):
            part = part_of == number
            self._put_in_order(data, rest.take(part), carrying[part], found)

    def _numbered(
        self, packets: PacketBatch, segments: SegmentBatch, first_frame: int
    ) -> tuple[Segments, Bool]:  # fmt: skip
        """Return the segments of connections by stream, and which of them carry something: data, SYN or FIN.

        Whoever resets a connection begins none.
        """
        carrying = (segments.payload_bytes > 0) | ((segments.flags & (SYN | FIN)) != 0)
        carrying &= (segments.flags & RST) == 0
        stream = self.connections.streams_of(segments, carrying)
        own = np.flatnonzero(stream >= 0)
        stream = stream[own]
        in_order = stable_order(stream, 2 * len(self.connections) + 1)
        order = own[in_order]
        row = segments.row[order]
        rows = Segments(
            stream[in_order], segments.sequence[order].astype(np.int64),
            segments.acknowledgement[order].astype(np.int64), segments.flags[order].astype(np.int64),
            segments.payload[order], segments.payload_bytes[order], segments.captured_bytes[order],
            row + first_frame, packets.ts_ns[row],
        )  # fmt: skip
        return rows, carrying[order]

    def _plain(self, rows: Segments, carrying: Bool) -> tuple[Bool, Pieces]:
        """Put the segments of connections in order in which nothing is peculiar.

        Return which segments these are, with those that carry nothing, and what they bring.
        """
        streams = self._streams
        whole = rows if carrying.all() else rows.take(carrying)
        peculiar = np.zeros(len(self.connections), np.bool_)
        peculiar[rows.stream[(rows.flags & RST) != 0] >> 1] = True
        peculiar |= streams.column("waits")[0::2] | streams.column("waits")[1::2]
        self._mark_forgotten(whole, peculiar)
        start, stop = runs_of(whole.stream)
        stream, connection = whole.stream[start], whole.stream >> 1
        peculiar[connection[whole.captured_bytes < whole.payload_bytes]] = True
        first_frame = np.full(len(streams), _NEVER)
        first_frame[stream] = whole.frame[start]
        syn, fin = (whole.flags & SYN) >> 1, whole.flags & FIN
        self._mark_begins(whole, np.flatnonzero(syn), first_frame, peculiar)
        # Distances from where each stream was, along it.
        base = np.where(streams.begun[stream], streams.next[stream], whole.sequence[start])
        step = np.empty(len(whole), np.int64)
        step[1:] = np.diff(whole.sequence)
        step[start] = whole.sequence[start] - base
        step = (step + _HALF) % _WRAP - _HALF
        length = stop - start
        along = np.cumsum(step)
        along -= np.repeat(along[start] - step[start], length)
        peculiar[connection[(np.abs(step) >= FAR) | (np.abs(along) >= FAR)]] = True
        apart = np.repeat(np.arange(len(start)) * _APART, length)
        end = np.clip(along, -FAR, FAR) + syn + whole.payload_bytes + fin
        top = np.maximum.accumulate(np.maximum(end, 0) + apart) - apart
        before = np.empty(len(whole), np.int64)
        before[1:] = top[:-1]
        before[start] = 0
        peculiar[connection[along > before]] = True
        reached = top[stop - 1]
        peculiar[stream[(streams.ended[stream] & (reached > 0))] >> 1] = True
        ends = np.flatnonzero(fin)
        run = np.repeat(np.arange(len(start)), length)
        peculiar[connection[ends[end[ends] < reached[run[ends]]]]] = True
        is_plain = ~peculiar[rows.stream >> 1]
        own = ~peculiar[connection]
        was_begun = streams.column("begun")[0::2] | streams.column("begun")[1::2]
        since = np.where(was_begun, 0, np.minimum(first_frame[0::2], first_frame[1::2]))
        self._note_acknowledged(rows.take(is_plain & (rows.frame >= since[rows.stream >> 1])))
        if not own.any():
            return is_plain, no_pieces()
        new_run = np.flatnonzero(~streams.begun[stream] & own[start])
        partner = stream[new_run] ^ 1
        anew = ~streams.begun[partner] & (first_frame[partner] > whole.frame[start[new_run]])
        ended = ends[own[ends] & (end[ends] > before[ends])]
        brings = (end > before) & ((whole.payload_bytes > 0) | (fin > 0))
        latest = self._latest(whole.stream, np.where(brings, whole.time_ns, 0), start, stop)
        begin = np.maximum(along + syn, before)
        size = along + syn + whole.payload_bytes - begin
        data = np.flatnonzero(own & (size > 0))
        order = whole.frame << ORDER_BITS | int(Order.OWN)

        def made(kind: PieceKind, place: I64, start: I64 | int, size: I64 | int) -> Pieces:
            kinds, starts, sizes = (
                np.full(len(place), one) if isinstance(one, int) else one for one in (int(kind), start, size)
            )
            return Pieces(whole.stream[place], kinds, starts, sizes, order[place], latest[place])

        pieces = Pieces.stacked([
            made(PieceKind.BEGIN, start[new_run], 0, syn[start[new_run]] * IN_STEP | anew * ANEW),
            made(PieceKind.DATA, data, (whole.payload + begin - along - syn)[data], size[data]),
            made(PieceKind.END, ended, 0, 0),
        ]) if len(new_run) or len(ended) else made(
            PieceKind.DATA, data, (whole.payload + begin - along - syn)[data], size[data]
        )  # fmt: skip
        if len(new_run) or len(ended):
            pieces = pieces.take(stable_order(pieces.stream, len(streams)))
        mine = own[start]
        moved = stream[mine]
        begins_at = whole.sequence[start[new_run]]
        streams.first[stream[new_run]] = (begins_at + syn[start[new_run]]) % _WRAP
        streams.next[moved] = (base[mine] + reached[mine]) % _WRAP
        streams.begun[moved] = True
        streams.latest_ns[moved] = latest[stop[mine] - 1]
        streams.ended[whole.stream[ended]] = True
        return is_plain, pieces

    def _mark_forgotten(self, rows: Segments, peculiar: Bool) -> None:
        """Mark connections of which something comes long after they have ended."""
        ended, latest_ns = self._streams.column("ended"), self._streams.column("latest_ns")
        ended = ended[0::2] & ended[1::2]
        if ended.any():
            connection = rows.stream >> 1
            end_ns = np.maximum(latest_ns[0::2], latest_ns[1::2])[connection]
            peculiar[connection[ended[connection] & (rows.time_ns > end_ns + FORGOTTEN_NS)]] = True

    def _mark_begins(self, rows: Segments, syn: I64, first_frame: I64, peculiar: Bool) -> None:
        """Mark connections with a SYN that is not the first thing of them."""
        streams, stream, flags = self._streams, rows.stream[syn], rows.flags[syn]
        is_first = (rows.frame[syn] == first_frame[stream]) & ~streams.begun[stream]
        answers = (flags & ACK) != 0
        by_server = (stream & 1) == 1
        alone = ~streams.begun[stream ^ 1] & (first_frame[stream ^ 1] > rows.frame[syn])
        good = is_first & (by_server == answers) & (answers | alone)
        peculiar[stream[~good] >> 1] = True

    def _latest(self, stream: I64, time_ns: I64, start: I64, stop: I64) -> I64:
        """Return the latest time of what streams bring, up to each of their segments; 0 is the time of no such one."""
        known = np.where(self._streams.begun[stream[start]], self._streams.latest_ns[stream[start]], 0)
        falls = np.zeros(len(stream), np.bool_)
        falls[1:] = time_ns[1:] < time_ns[:-1]
        falls[start] = time_ns[start] < known
        if not falls.any():
            return time_ns
        latest = time_ns.copy()
        runs = np.searchsorted(start, np.flatnonzero(falls), side="right") - 1
        for run in sorted(set(runs.tolist())):
            own = slice(int(start[run]), int(stop[run]))
            latest[own] = np.maximum(np.maximum.accumulate(time_ns[own]), known[run])
        return latest

    def _note_acknowledged(self, rows: Segments) -> None:
        """Note what the receivers of streams have acknowledged."""
        streams = self._streams
        own = (rows.flags & ACK) != 0
        stream, told = rows.stream[own] ^ 1, rows.acknowledgement[own]
        start, _ = runs_of(stream)
        if not len(start):
            return
        known = streams.acknowledged[stream[start]]
        first = np.where(known < 0, told[start], known)
        base = np.repeat(first, np.diff(np.append(start, len(stream))))
        ahead = (told - base + _HALF) % _WRAP - _HALF
        most = np.maximum(np.maximum.reduceat(ahead, start), 0)
        streams.acknowledged[stream[start]] = (first + most) % _WRAP
