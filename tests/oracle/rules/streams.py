"""TCP put together again: what each direction of each connection delivers, frame by frame.

Every byte that came and was not delivered yet is kept by itself, so that there is nothing to get wrong about overlaps.

Readings, where the rules leave a choice:

- the first segment seen of a connection is the one that creates it; an acknowledgement before it was nobody's
- a SYN seen again begins nothing; else it is a segment like any other (its acknowledgement, its data). Where the
  connection was reset before anything came, data or FIN, a client's SYN seen again begins another
- a SYN of a direction that began without one is seen again where it fits what came first (data overtook it)
- bytes that came first count wherever they are kept: also where a segment that is next in order covers them later.
  Bytes that the snap length cut came, as missing ones: a whole copy that comes later is late
- of a segment that is elsewhere data and FIN are ignored: one farther away than 2^30; one more than 1 MiB in front of
  the first byte of its direction, as long as that is no longer than 2^30; and, behind the end of a direction, one more
  than 1 MiB behind it
- what is missing by an acknowledgement: ``streams_told``
- such segments may be those of another connection, whose SYN was not captured (``streams_aside``)
- where a connection is not captured in the order in which it was sent: ``streams_held``
- a FIN that waits behind a hole is something kept, its place the first kept byte; it takes this place, and has none
  where a byte has come before it
- what the snap length cut counts where it is kept (256 KiB), and in `gap_bytes` when it is delivered
- what was kept first is what was taken first; its time is that of its frame
- bytes in an RST are no data; its acknowledgement counts, before it ends the connection
- of a connection that is reset, or that another one takes the place of, what was acknowledged behind all that is there,
  and what lies in front of the RST, is missing: up to 1 MiB, and more than one place, which may be that of a FIN
- who was the server of two ends is that of all connections between them
- what has ended stays so until another connection begins between these ends, or for 240 s; then it is forgotten: what
  comes later is of another connection, which began before the capture where there is no SYN
- the acknowledgement of a segment that begins a new connection is one of the new connection
- bytes that come again are compared with what is kept, and with the 4 KiB before the next place that were delivered
  since the last hole; a segment of one byte, at the place of the last one that was sent so far, delivered or kept, asks
  whether somebody is there (RFC 1122, 4.2.3.6), and its byte may be any. A FIN takes a place, too
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

from tests.oracle.frame import Frame
from tests.oracle.rules.streams_aside import put, told
from tests.oracle.rules.streams_held import Captured, Held, is_behind_its_acknowledgement
from tests.oracle.rules.streams_state import Carried, Connection, Direction, End, Place, begins_another
from tests.oracle.rules.streams_told import FARTHEST, NEAR, distance, hear
from tests.oracle.tcp import ACK, FIN, RST, SYN, Segment, peel_tcp

SECOND = 1_000_000_000
MOST_KEPT, LONGEST_NS, FORGOTTEN_NS = 256 * 1024, 10 * SECOND, 240 * SECOND


class Delivery(NamedTuple):
    """Bytes in order, all brought by one frame; or ``missing`` ones.

    ``time`` is that of the last frame that brought anything up to there: what was kept came before what it waited for.
    ``behind`` is the sequence number of the byte behind them; ``told`` what their segment acknowledges, or that of
    those in front of missing ones. One that acknowledges 0 says nothing.
    """

    connection: Connection
    from_client: bool
    data: bytes
    missing: int
    time: int
    behind: int = 0
    told: int | None = None


class Ending(NamedTuple):
    """A direction has ended, in order or not, by what came at ``time``."""

    connection: Connection
    from_client: bool
    reset: bool
    time: int
    by_client: bool = False
    """Who reset it, or began another one in its place."""
    replaced: bool = False
    """Whether nothing but the begin of another one shows it."""


class Others(NamedTuple):
    """So many bytes of a direction came again as others, in a segment with the data ``copy``."""

    connection: Connection
    from_client: bool
    size: int
    copy: bytes


Event = Delivery | Ending | Others


class Streams:
    """All connections of which one end has a claimed port."""

    def __init__(self, ports: Collection[int], happened: Counter[str] | None = None) -> None:
        self.ports = ports
        self.connections: dict[frozenset[End], Connection] = {}
        self.servers: dict[frozenset[End], End] = {}
        self.happened: Counter[str] = Counter() if happened is None else happened
        self.held = Held()

    def observe(self, number: int, frame: Frame) -> Iterator[Event]:
        """Yield what a frame delivers and ends, in order."""
        segment = peel_tcp(frame)
        if segment is None or not {segment.source_port, segment.destination_port} & set(self.ports):
            return
        source, destination = (segment.source, segment.source_port), (segment.destination, segment.destination_port)
        pair = frozenset((source, destination))
        captured = Captured(segment, source, frame.ts_ns, number)
        self.held.note(captured, destination)
        if (known := self.connections.get(pair)) is not None:
            known.directions[source != known.client].be_acknowledged(segment)
        for place, one in enumerate(self.held.released(pair, captured, lambda: self.connections.get(pair))):
            self.happened["taken in another order"] += one is not captured
            yield from self.take((number, place), one)

    def take(self, place: Place, captured: Captured) -> Iterator[Event]:
        """Yield what a segment delivers and ends, in order."""
        segment, source, now, _ = captured
        ends = (segment.source, segment.source_port), (segment.destination, segment.destination_port)
        pair, destination = frozenset(ends), ends[1]
        connection = self.connections.get(pair)
        ended_ns = None if connection is None else connection.ended_ns
        if ended_ns is not None and now - ended_ns > FORGOTTEN_NS:
            self.happened["forgotten"] += 1
            connection = None
        if connection is not None and begins_another(segment, connection, source == connection.client):
            self.happened["new connection in place of another"] += 1
            yield from self.reset(connection, place, now, by_client=True)
            connection = None
        proven = None if connection is None else connection.aside
        if connection is not None and proven and proven.is_proven_by(segment, source == connection.client):
            self.happened["new connection whose SYN is missing"] += 1
            yield from self.reset(connection, place, now, by_client=True)
            connection = self.connections[pair] = self.connect(segment, source, destination)
            for one, time in proven.segments:
                self.keep(connection.directions[proven.from_client], one, place, time)
            yield from self.deliver(connection, proven.from_client)
        if connection is None:
            if segment.flags & RST or not (segment.flags & (SYN | FIN) or segment.length):
                return
            connection = self.connections[pair] = self.connect(segment, source, destination)
        from_client = source == connection.client
        own, other = connection.directions[from_client], connection.directions[not from_client]
        other.be_acknowledged(segment)
        hear(own, other, segment)
        if segment.flags & ACK:
            yield from self.acknowledged(connection, not from_client)
        for speaker in (True, False):
            yield from self.waited(connection, speaker, now)
        if segment.flags & RST:
            connection.aside = None
            yield from self.reset(connection, place, now, by_client=from_client, seq=segment.seq)
            return
        if segment.flags & (SYN | FIN) or segment.length:
            if own.is_elsewhere(segment):
                self.happened["elsewhere"] += 1
                connection.aside = put(connection.aside, segment, now, from_client=from_client)
                return
            connection.aside = None
        if not own.ended:
            if is_behind_its_acknowledgement(own, segment):
                self.happened["behind its acknowledgement"] += 1
                self.held.note_disorder(pair)
            if others := self.keep(own, segment, place, now):
                yield Others(connection, from_client, others, segment.payload)
            yield from self.deliver(connection, from_client)
            yield from self.acknowledged(connection, from_client)
            yield from self.overfull(connection, from_client)

    def connect(self, segment: Segment, source: End, destination: End) -> Connection:
        claimed = [end for end in (source, destination) if end[1] in self.ports]
        if len(claimed) == 1:
            (server,) = claimed
        else:
            self.happened["both ports claimed"] += 1
            server = source if segment.flags & SYN and segment.flags & ACK else destination
        server = self.servers.setdefault(frozenset((source, destination)), server)
        return Connection(source if server == destination else destination, server)

    def keep(self, own: Direction, segment: Segment, place: Place, time: int) -> int:
        """Keep what a segment brings that had not come before; return how much came again otherwise."""
        syn, fin = bool(segment.flags & SYN), bool(segment.flags & FIN)
        if not (syn or fin or segment.length):
            return 0
        seq = (segment.seq + syn) % 2**32
        if own.begin is None:
            own.begin, own.began_with_syn = seq, syn
            own.had.begin(segment.seq)
            own.told = own.first_told = told(segment)
            self.happened["began with SYN" if syn else "began before the capture"] += 1
        begin = own.place(seq)
        if abs(begin - own.next) > FARTHEST:  # as a SYN may be
            return 0
        late, others = 0, own.others(segment, begin)
        payload = segment.payload[: segment.length]
        # One for all equal bytes of a segment: there are many, and they are looked at one by one.
        made = {byte: Carried(byte, place, time, told(segment)) for byte in {*payload, None}}
        brought = [*map(made.__getitem__, payload), *[made[None]] * (segment.length - len(payload))]
        for at, carried in enumerate(brought, begin):
            if at < own.next or at in own.kept or at in own.fins:
                late += 1
            else:
                own.kept[at] = carried
        end = begin + segment.length
        if fin and end >= own.next and end not in own.kept:
            own.fins.setdefault(end, Carried(None, place, time, told(segment)))
        self.happened["in part late"] += 0 < late < segment.length
        self.happened["late"] += 0 < late == segment.length
        self.happened["kept behind a hole"] += begin > own.next
        self.happened["cut by the snap length"] += len(segment.payload) < segment.length
        self.happened["wrapped"] += own.begin + end >= 2**32 and segment.length > 0
        self.happened["other bytes"] += others > 0
        return others

    def deliver(self, connection: Connection, from_client: bool) -> Iterator[Event]:
        """Yield what is next in order, as far as there is no hole."""
        own = connection.directions[from_client]
        run: list[Carried] = []
        while True:
            found = None if own.next in own.fins else own.kept.pop(own.next, None)
            if run and (found is None or found[1:] != run[0][1:] or (found.byte is None) != (run[0].byte is None)):
                if run[0].byte is not None:
                    own.came_at(run[0].place, run[0].time)
                data = bytes(carried.byte for carried in run if carried.byte is not None)
                own.told = run[0].told if data else own.told
                missing = len(run) - len(data)
                yield Delivery(connection, from_client, data, missing, own.latest, own.sequence, own.told)
                if data:
                    own.delivered |= dict(enumerate(data, own.next - len(run)))
                else:
                    own.delivered.clear()
                run = []
            if found is None:
                break
            run.append(found)
            own.next += 1
        fin = own.fins.get(own.next)
        if fin is not None:
            own.finished = True
            self.end(own, fin.place, fin.time)
            yield Ending(connection, from_client, False, own.latest)

    def end(self, own: Direction, place: Place, time: int) -> None:
        own.ended = True
        own.came_at(place, time)
        own.kept.clear()
        own.fins.clear()

    def holes(
        self, connection: Connection, from_client: bool, final: Callable[[int], bool], why: str
    ) -> Iterator[Event]:
        """Yield holes, as long as they are final, and what is kept behind each."""
        own = connection.directions[from_client]
        while (first := own.first_kept()) is not None and final(first):
            self.happened[f"hole final by {why}"] += 1
            missing, own.next = first - own.next, first
            own.delivered.clear()
            yield Delivery(connection, from_client, b"", missing, 0, own.sequence, own.told)
            yield from self.deliver(connection, from_client)

    def acknowledged(self, connection: Connection, from_client: bool) -> Iterator[Event]:
        own = connection.directions[from_client]

        def final(first: int) -> bool:
            assert own.begin is not None
            if own.had.up_to is None:
                return False
            return distance(own.had.up_to, own.begin + own.next) >= first - own.next

        yield from self.holes(connection, from_client, final, "acknowledgement")

    def overfull(self, connection: Connection, from_client: bool) -> Iterator[Event]:
        kept = connection.directions[from_client].kept
        yield from self.holes(connection, from_client, lambda _: len(kept) > MOST_KEPT, "what is kept")

    def waited(self, connection: Connection, from_client: bool, now: int) -> Iterator[Event]:
        own = connection.directions[from_client]

        def final(_: int) -> bool:
            first = min([*own.kept.values(), *own.fins.values()], key=lambda carried: carried.place)
            return now - first.time > LONGEST_NS

        yield from self.holes(connection, from_client, final, "time")

    def reset(
        self, connection: Connection, place: Place, now: int, *, by_client: bool, seq: int | None = None
    ) -> Iterator[Event]:  # fmt: skip
        """End a connection out of order: what is kept first, the client's direction first; ``seq``: that of an RST."""
        for from_client in (True, False):
            yield from self.holes(connection, from_client, lambda _: True, "reset")
            own = connection.directions[from_client]
            if own.begin is None or own.ended:
                continue
            known = [own.had.up_to] + [seq] * (from_client == by_client)
            ahead = [distance(one, own.begin + own.next) for one in known if one is not None]
            if missing := max((one for one in ahead if 1 < one <= NEAR), default=0):
                self.happened["missing behind all that is there"] += 1
                own.next += missing
                own.delivered.clear()
                yield Delivery(connection, from_client, b"", missing, 0, own.sequence, own.told)
        for from_client in (True, False):
            self.end(connection.directions[from_client], place, now)
            yield Ending(connection, from_client, True, now, by_client, seq is None)
