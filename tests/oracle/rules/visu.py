"""WebVisu: requests and replies brought together, counted and judged: section 9.

Readings, where the rules leave a choice:

- a direction whose SYN was not seen began before the capture, whether that of the other was seen or not
- a response answers the first request that waits when it is whole, or is dropped as cut
- where the client's direction loses step, a response that is being received then answers nobody; it stays in step.
  Where the server's does, a request that is being received then stays what it is
- a message in malformed chunks is one that nobody reads, and NV804; a response of that kind is one to the first request
  that waits
- a hole in the server's direction, while that is in step, is in the response to the first request that waits, whatever
  of it was seen. What is not whole at the end, though no byte is missing, is no reply
- a cut request counts in `cut` and makes its connection count, and that is all: what becomes of it counts nowhere
- a POST whose body is not known counts as a cut one, but is no NV808; a reply is one that tells no more than its status
- a request that does not say where it ends is whole where something comes that answers a request, and none waits: with
  the frame of that, and the time at which the latest of it came. A response that is whole or cut is such a thing, a
  hole in the server's direction while that is in step, and the end of that in order
- a response that comes while none waits, and the head of a request is there that says where it ends, answers that: with
  the frame with which it is whole, as far as it ever is; what came first has no latency
- requests that become whole behind the server's end are unanswered if RST or a new connection made that, else nothing
- a reply whose time is before that of its request has no latency
- events of a finding are in order of what happened: first and last are times, the first ten are told by their frames
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator
from typing import Any

from tests.oracle.frame import Address as Node
from tests.oracle.frame import Frame
from tests.oracle.rules import visu_body, visu_lists, visu_others, visu_pages, visu_turns, visu_unseen
from tests.oracle.rules.http_message import Lost, Message
from tests.oracle.rules.keys import node_order
from tests.oracle.rules.streams import SECOND, Delivery, Ending, Event, Others, Streams
from tests.oracle.rules.streams_state import Connection
from tests.oracle.rules.visu_body import Answered, Asked
from tests.oracle.rules.visu_figures import Row, disordered, findings_of, percentiles
from tests.oracle.rules.visu_late import doubt
from tests.oracle.rules.visu_leaving import forget_missed, forget_unknown, given_up
from tests.oracle.rules.visu_old import Values
from tests.oracle.rules.visu_one_way import OneWay
from tests.oracle.rules.visu_part import ask_in_part, settle, writes
from tests.oracle.rules.visu_talk import Home, Pair, Talk, Told, Waiting, Written
from tests.oracle.rules.visu_turns import asked_behind, begin, has_early, keep, lose_client, wait

COUNTED = ("reads", "writes", "entries", "replies", "refused", "unanswered", "cut", "miscounted", "ambiguous")


class Visu:
    """All of WebVisu in a capture, one frame after the other."""

    def __init__(self, ports: Collection[int] = (80, 8080)) -> None:
        self.happened: Counter[str] = Counter()
        """How often each thing happened that traffic should show."""
        self.messages: list[Told] = []
        self.streams = Streams(ports, self.happened)
        self.talks: dict[Connection, Talk] = {}
        self.one_way = OneWay()
        self.known: dict[Pair, Row] = defaultdict(Row)
        self.found: dict[tuple[str, Node, str], list[tuple[int, int]]] = defaultdict(list)
        self.lists: dict[Home, list[visu_body.Listed]] = defaultdict(list)
        self.names: dict[Home, dict[visu_body.Address, str]] = defaultdict(dict)
        self.pages = visu_pages.Pages()
        self.writes: list[Written] = []
        self.values = Values()
        self.number = self.now = 0

    def observe(self, frame: Frame) -> None:
        self.number += 1
        self.now = frame.ts_ns
        for time, talk in given_up(frame, self.talks.values(), self.streams.ports, self.streams.servers):
            self.now = time
            self.happened["given up"] += 1
            self.over(talk, is_known=forget_unknown(talk))
        self.now = frame.ts_ns
        self.one_way.look_at(frame)
        for talk in list(self.talks.values()):
            if talk.connection in self.streams.connections.values() and (size := self.one_way.reply_bytes(talk)):
                self.happened["reply of a server that nobody heard"] += 1
                talk.gap_bytes[False] += size
                self.lost(talk, False, Lost(in_step=True))
        for event in self.delivered(frame):
            talk = self.talks.setdefault(event.connection, Talk(event.connection, self.happened))
            begin([visu_pages.placed(self, talk)])  # it may have begun with this very event
            if isinstance(event, Others):
                if visu_others.note(talk, event):
                    self.known[talk.pair].counts["asked by others"] += 1
                continue
            reader = talk.reader(event.from_client)
            talk.broken_off = isinstance(event, Ending) and event.reset and event.by_client
            if isinstance(event, Delivery):
                talk.gap_bytes[event.from_client] += event.missing
                if event.missing and event.from_client and visu_unseen.is_of_page(self.talks.values(), talk.pair):
                    self.values.miss(talk.home)
                heard = reader.take(event)
            else:
                heard = reader.end(event.reset, event.time)
            for one in heard:
                if isinstance(one, Lost):
                    self.lost(talk, event.from_client, one)
                elif event.from_client:
                    self.request(talk, one)
                else:
                    self.response(talk, one)
            if not isinstance(event, Delivery) and not event.from_client:
                if not event.reset and not talk.waiting:
                    self.end_open_request(talk)
                forget_missed(talk)
                self.over(talk, is_known=not event.replaced)
            elif not isinstance(event, Delivery) and not event.reset:
                talk.closed = event.time

    def delivered(self, frame: Frame) -> Iterator[Event]:
        """Yield what a frame delivers; what begins with it is known before."""
        events = self.streams.observe(self.number, frame)
        while True:
            event = next(events, None)
            self.one_way.note_begin(self.streams.connections.values())
            begin(self.talks.values())
            if event is None:
                return
            yield event

    def lost(self, talk: Talk, from_client: bool, what: Lost) -> None:
        self.happened["client lost step" if from_client else "server lost step"] += 1
        self.happened["waiting forgotten"] += (waited := len(talk.waiting))
        if from_client:
            is_known = (what.dropped is not None and self.cut_request(talk, what.dropped)) or bool(talk.waiting)
            lose_client(talk, what)
            for _ in range(visu_unseen.answered_before(talk, what, is_known=is_known)):
                self.unseen_request(talk)
            talk.forgotten = False in talk.readers and talk.readers[False].receiving
        else:
            later = asked_behind(talk, what)
            if what.in_step and not (later and len(later) == len(talk.waiting)):
                waited += self.end_open_request(talk) if not (talk.forgotten or talk.waiting) else 0
                self.response(talk, what.response())
            talk.forgotten = False
            visu_turns.lose_server(talk, what, later, waited)
        talk.waiting[:] = [] if from_client else later

    def cut_request(self, talk: Talk, message: Message) -> bool:
        """Count a cut request, if it is one of a page; return whether it is."""
        is_asked = visu_body.may_be_asked(message.seen, message.target, had_request=talk.had_request)
        if of_page := message.method == b"POST" and is_asked:
            self.happened["cut request"] += 1
            self.miss_request(talk, message)
            if message.malformed:
                self.note_unbounded(talk, message)
        return of_page

    def unseen_request(self, talk: Talk) -> None:
        self.happened["request that was not seen"] += 1
        self.miss_request(talk, Message())

    def miss_request(self, talk: Talk, message: Message) -> None:
        talk.had_request = True
        self.values.miss(talk.home)
        self.cut(talk, message)

    def cut(self, talk: Talk, message: Message) -> None:
        self.known[talk.pair].counts["cut"] += 1
        if not message.unread:
            self.known[talk.pair].counts["lacks bytes"] += 1
            self.find("NV808", talk)

    def request(self, talk: Talk, message: Message) -> None:
        """Take a request that is whole, or dropped as cut; it may have been answered before."""
        settle(message)
        talk.unseen = None
        if message.part:
            if ask_in_part(talk, message, self.number, self.one_way.told_by(talk.connection, client=True)):
                self.known[talk.pair].counts["part"] += 1
                self.note_unbounded(talk, message)
        else:
            self.ask(talk, message)
        if has_early(talk, message) and talk.waiting:
            early, forgotten = visu_turns.take_early(talk), talk.forgotten
            early.early, talk.forgotten = True, False
            self.response(talk, early)
            talk.forgotten = forgotten

    def ask(self, talk: Talk, message: Message) -> None:
        asked = None
        if message.cut or (message.unread and message.method == b"POST"):
            self.cut_request(talk, message)
        elif message.body is not None or message.unread:
            message.body = message.body or b""
            asked = visu_body.asked(message.method, message.target, message.body)
        had = self.one_way.told_by(talk.connection, client=True)
        written = self.written(talk, asked)
        at = self.values.ask(talk.home, asked) if asked is not None and asked.write else 0
        wait(talk, Waiting(asked, message, self.number, written, acknowledged=had, asked_at=at, home=talk.home))
        self.happened["several wait"] += len(talk.waiting) > 1
        if asked is None or message.body is None:
            self.happened["other request"] += 1
            return
        talk.had_request = True
        ends, kind = (talk.connection.client, talk.connection.server), "query" if asked.query else "request"
        self.messages.append(Told(self.number, *ends, kind, message.body))
        row = self.known[talk.pair]
        row.counts["writes" if asked.write else "reads"] += 1
        row.counts["entries"] += len(asked.entries)
        row.variables |= {entry.address for entry in asked.entries}
        self.note_unbounded(talk, message)
        if asked.miscounted:
            row.counts["miscounted"] += 1
            self.find("NV804", talk)
        if asked.ambiguous:
            self.happened["ambiguous write"] += 1
            row.counts["ambiguous"] += 1
            self.find("NV804", talk)
        if asked.write:
            for entry in asked.entries:
                self.find("NV801", talk, entry.address)
                if (entry.value is not None or not asked.query) and self.is_password(talk, entry.address):
                    self.happened["password written"] += 1
                    self.find("NV803", talk, entry.address)
        else:
            same = b"?" + message.target if asked.query else b"|" + message.body
            if same in row.last_reads:
                row.pollings.append(max(self.now - row.last_reads[same], 0))
            row.last_reads[same] = self.now

    def written(self, talk: Talk, asked: Asked | None) -> list[Written]:
        """Note what a request writes."""
        if asked is None or not asked.write:
            return []
        found = [
            Written(
                self.now, self.number, talk.pair, self.called(talk.home, entry.address),
                *visu_pages.texts_of(self, talk, entry.address, asked.text(entry)),
            )
            for entry in asked.entries
        ]  # fmt: skip
        self.writes += found
        return found

    def learn(self, talk: Talk, waiting: Waiting, asked: Asked, status: int, answer: Answered) -> None:
        if asked.write:
            for one in waiting.writes:
                one.outcome, one.answer, one.status = "refused" if answer.refused else "confirmed", self.number, status
            if not answer.refused:
                self.values.confirm(talk.home, asked)
            elif status == 200:
                self.values.refuse(waiting.home, asked, waiting.asked_at)
        elif not asked.query and not answer.ambiguous and status == 200:
            self.values.read(talk.home, asked, answer.values)

    def response(self, talk: Talk, message: Message) -> None:
        """Take a response that is whole, or dropped as cut; one of 1xx answers nothing."""
        forgotten, talk.forgotten = talk.forgotten, False
        if visu_turns.passes_by(talk, message, forgotten=forgotten):
            return
        if message.part:
            if talk.waiting and not forgotten:
                visu_lists.take(self, talk, talk.waiting[0].message, message)
            return
        if not (forgotten or talk.waiting or 100 <= message.status < 200):
            self.end_open_request(talk)
        if 100 <= message.status < 200:
            self.happened["1xx"] += 1
            return
        if not forgotten and (size := self.one_way.request_bytes(talk, message)):
            self.happened["request of a client that nobody heard"] += 1
            talk.gap_bytes[True] += size
            self.miss_request(talk, message)
        if not (forgotten or talk.waiting) and visu_unseen.is_answered(talk, message):
            self.unseen_request(talk)
        if not (forgotten or talk.waiting) and keep(talk, message):
            return
        if forgotten or not talk.waiting:
            self.happened["response to a forgotten request" if forgotten else "response to nobody"] += 1
            return
        if not visu_turns.answers_first(talk, message):
            return
        self.happened["may answer what was not captured"] += doubt(talk, message)
        waiting = talk.waiting.pop(0)
        visu_lists.take(self, talk, waiting.message, message)
        if waiting.asked is None and not waiting.part:
            return
        row = self.known[talk.pair]
        self.note_unbounded(talk, message)
        if message.cut:
            self.happened["cut reply"] += 1
            self.cut(talk, message)
            return
        if waiting.asked is None:
            if message.status != 200:
                self.happened["part of a request refused"] += 1
                row.counts["refused"] += writes(waiting.message)
                self.find("NV802", talk)
            return
        body = message.body or b""
        self.messages.append(Told(self.number, talk.connection.server, talk.connection.client, "reply", body))
        row.counts["replies"] += 1
        latency = message.arrival - waiting.message.arrival
        if not message.early and latency >= 0:
            row.latencies.append(latency)
            if latency > SECOND:
                self.happened["slow"] += 1
                self.find("NV805", talk)
        if message.body is None and message.status == 200 and not waiting.asked.query:
            return
        answer = visu_body.answered(waiting.asked, message.status, body)
        self.learn(talk, waiting, waiting.asked, message.status, answer)
        self.judge(talk, row, waiting.asked, message, answer)

    def note_unbounded(self, talk: Talk, message: Message) -> None:
        if message.unbounded or message.malformed:
            self.known[talk.pair].counts["ambiguous"] += 1
            self.find("NV804", talk)

    def end_open_request(self, talk: Talk) -> int:
        """Take an open request for whole, where one is being received; return how many wait then."""
        if True in talk.readers and talk.readers[True].open:
            self.request(talk, talk.readers[True].answered())
        return len(talk.waiting)

    def judge(self, talk: Talk, row: Row, asked: Asked, message: Message, answer: Answered) -> None:
        row.counts.update(refused=answer.refused, miscounted=answer.miscounted, ambiguous=answer.ambiguous)
        for entry in asked.entries if answer.refused else ():
            self.find("NV802", talk, entry.address)
        if not asked.write and message.status != 200:
            self.happened["read with an HTTP error"] += 1
            self.find("NV802", talk)
        self.happened["no value"] += None in answer.values
        if answer.miscounted or answer.ambiguous:
            self.find("NV804", talk)
        for entry, seen in zip(asked.entries, answer.seen, strict=False):
            if seen and self.is_password(talk, entry.address):
                self.happened["password read"] += 1
                self.find("NV803", talk, entry.address)

    def over(self, talk: Talk, *, is_known: bool) -> None:
        for waiting in talk.waiting if is_known else []:
            if waiting.asked is not None or waiting.part:
                self.known[talk.pair].counts["unanswered"] += 1
                self.find("NV805", talk, frame=waiting.frame)
                for one in waiting.writes:
                    one.outcome = "unanswered"
        talk.waiting.clear()

    def is_password(self, talk: Talk, address: visu_body.Address) -> bool:
        return visu_body.shows_password(address, self.lists[talk.home])

    def find(self, code: str, talk: Talk, address: visu_body.Address | None = None, frame: int | None = None) -> None:
        client, server, _ = talk.pair
        variable = f"visu/{server}" + ("" if address is None else f"/{self.called(talk.home, address)}")
        self.found[code, client, variable].append((self.now, self.number if frame is None else frame))

    def called(self, home: Home, address: visu_body.Address) -> str:
        return self.names[home].get(address, address if isinstance(address, str) else ",".join(map(str, address)))

    def latencies(self, row: dict[str, Any]) -> list[int]:
        """Return the latencies of a row, in order."""
        return sorted(self.row_of(row).latencies)

    def pollings(self, row: dict[str, Any]) -> list[int]:
        """Return the times between reads of a row, in order."""
        return sorted(self.row_of(row).pollings)

    def row_of(self, row: dict[str, Any]) -> Row:
        own = row["client"], row["server"], row["port"]
        (found,) = [known for (*ends, port), known in self.known.items() if (*map(str, ends), port) == own]
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of the report."""
        talks, rows = [talk for talk in self.talks.values() if talk.had_request], []
        for pair in sorted(self.known, key=lambda pair: (node_order(pair[0]), node_order(pair[1]), pair[2])):
            known, own = self.known[pair], [talk for talk in talks if talk.pair == pair]
            latencies, pollings = sorted(known.latencies), sorted(known.pollings)
            rows.append({
                "client": str(pair[0]), "server": str(pair[1]), "port": pair[2], "connections": len(own),
                **{name: known.counts[name] for name in COUNTED},
                "variables": len(known.variables), "gap_bytes": visu_unseen.gap_bytes(self.talks.values(), pair),
                "other_bytes": visu_others.other_bytes(self.talks.values(), pair),
                "latency_ns": {"count": len(latencies), **percentiles(latencies),
                               "max": latencies[-1] if latencies else None},
                "polling_ns": percentiles(pollings),
            })  # fmt: skip
        return rows

    def events(self) -> dict[tuple[str, Node, str], list[tuple[int, int]]]:
        return self.found | disordered(self.known, self.streams)

    def findings(self) -> list[dict[str, Any]]:
        """Return the findings, sorted by code, client and variable."""
        return findings_of(self.events(), self.known)
