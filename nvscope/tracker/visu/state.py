"""VisuCounts: what became of all requests of web visualization pages, by who asked whom."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dissectors import address
from dissectors.batch import I64, U64
from dissectors.keys import KeyTable
from dissectors.webvisu import Request, seen_in_reply
from nvscope.engine.runs import first_of_each
from nvscope.engine.told import Told
from nvscope.tracker.events import EventLog, LeftOutLog
from nvscope.tracker.latency import Latencies
from nvscope.tracker.visu.events import OK, OTHER_STATUS, VisuEvent, event_word
from nvscope.tracker.visu.leaving import LeavingClients
from nvscope.tracker.visu.limits import MOST_ENTRIES, Beyond
from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind, Outcome, VisuBatch, VisuMessages
from nvscope.tracker.visu.names import (
    Naming,
    OtherNames,
    TwoControllers,
    UnreadList,
    UnusableEncoding,
    has_password,
    name_of,
)
from nvscope.tracker.visu.pair_columns import PairColumns
from nvscope.tracker.visu.unchanging import Unchanging
from nvscope.tracker.visu.writes import Writes

MOST_WRITE_MINUTES = 10_000
"""Of so many minutes of variables it is known how often they were written; of more, that there were."""

SLOW_NS = 10**9
"""A reply that takes longer is worth a note."""

_WRONG: Mapping[int, VisuEvent] = {Outcome.MISCOUNTED: VisuEvent.MISCOUNTED, Outcome.AMBIGUOUS: VisuEvent.AMBIGUOUS}
_LATE = (VisuEvent.SLOW, VisuEvent.UNANSWERED, VisuEvent.GIVEN_UP, VisuEvent.RESET)
_WITH_STATUS = (VisuEvent.REFUSED, VisuEvent.STATUS, VisuEvent.PART_STATUS)
_ARE_WANTED = np.array([one in (Kind.UNANSWERED, Kind.WRITE, Kind.CUT, Kind.UNBOUNDED) for one in Kind])
_SAY_NOTHING = np.array([one in (Kind.LEFT, Kind.UNCLEAR, Kind.PART) for one in Kind])
_MOST_REMEMBERED, _MINUTE_NS = 1 << 14, 60 * 10**9


class _Message(NamedTuple):
    """A row of ``VisuMessages``, with its columns in their order."""

    kind: int
    row: int
    pair: int
    asked: int
    start: int
    stop: int
    status: int
    outcome: int
    fields: int
    latency_ns: int
    asked_frame: int
    gap_bytes: int
    opens: bool
    polled_ns: int
    naming: int
    spoken: int


class Spoken(NamedTuple):
    """How often a client said something in another protocol, and in which frame first."""

    first_frame: int
    times: int


class Subject(NamedTuple):
    """What a finding is about: who asked whom, and which variable; '' for what is of none."""

    client: str
    server: str
    variable: str


class VisuCounts:
    """The requests of all pages, and what became of them; an accumulator of what ``VisuFollower`` finds.

    ``pairs`` number client, server and port, as in ``VisuBatch.pairs``; ``columns``, ``latencies`` and ``pollings`` are
    by pair. ``events`` are keyed by ``event_word`` and by subject, which ``subjects`` number; ``write_minutes`` are
    the writes among them by subject and minute since 1970; ``disorder`` are connections that have shown disorder, by
    client, server and port. ``writes`` are who wrote what, ``unchanging`` what never changed, ``others`` what is spoken
    beside by pair and ``WebProtocol``, ``other_names`` the first list that
    contradicts others, by client and server, ``unread_lists`` the first one that nobody can read, ``other_encodings``
    the first one of texts that cannot be used, and ``given_up`` how long clients waited at least and at most for what
    they gave up. ``leaving`` are those of whom nothing but time may tell that they gave up: that is counted nowhere
    else. For ``left_out``, keyed by ``Beyond``, there was no room.
    """

    def __init__(self) -> None:
        self.pairs = KeyTable(5)
        self.columns = PairColumns()
        self.latencies = Latencies()
        self.pollings = Latencies()
        self.subjects: dict[Subject, int] = {}
        self.events = EventLog()
        self.write_minutes = EventLog()
        self.disorder = EventLog(5)
        self.left_out = LeftOutLog()
        self.writes = Writes()
        self.others: dict[tuple[int, int], Spoken] = {}
        self.unchanging = Unchanging()
        self.other_names: dict[Subject, OtherNames | TwoControllers] = {}
        self.given_up: dict[Subject, tuple[int, int]] = {}
        self.unread_lists: dict[Subject, UnreadList] = {}
        self.other_encodings: dict[Subject, UnusableEncoding] = {}
        self.leaving = LeavingClients()
        self._ends: dict[int, tuple[str, str]] = {}
        self._minutes: set[tuple[int, int]] = set()
        self._statuses: set[tuple[int, int]] = set()
        self._variables: set[tuple[int, str]] = set()
        self._asked: set[tuple[int, Request]] = set()
        self._asked_entries = 0
        self._secrets: dict[tuple[Request, int], Collection[int]] = {}
        self._secret_entries = 0

    def observe(self, told: Told, part: VisuBatch | None) -> None:
        """Take what a batch brings; None where that is no more than time, and what is of others."""
        if part is None:
            self.leaving.observe(told, None)
            return
        messages, known_ns = part.messages, part.known_ns(told.packets.ts_ns)
        own = self.pairs.numbers_within(told.max_streams, *part.pairs)
        pair = own[messages.pair]
        beyond = pair < 0
        if beyond.any():
            self._leave_out(Beyond.PAIR, told, messages.take(beyond))
            messages, pair, known_ns = messages.take(~beyond), pair[~beyond], known_ns[~beyond]
        self.columns.resize(len(self.pairs))
        for what, count in part.left_out.items():
            self._leave_out(what, told, part.messages.take(np.full(count, len(part.messages) - 1)))
        self.columns.count(pair, messages, part.requests)
        measured = (messages.kind == Kind.REPLY) & (messages.latency_ns != UNMEASURED_NS)
        self.latencies.observe(pair[measured], messages.latency_ns[measured], len(self.pairs))
        polled = messages.polled_ns >= 0
        self.pollings.observe(pair[polled], messages.polled_ns[polled], len(self.pairs))
        self._note_others(told, pair, messages)
        self._note_names(told, part, own)
        self._note(told, part, pair, messages, known_ns)
        self._note_writes(told, part, pair, messages)
        self.unchanging.observe(part, told.max_streams)
        leaving = [one._replace(pair=int(own[one.pair])) for one in part.leaving]
        self.leaving.observe(told, [one for one in leaving if one.pair >= 0])
        self.disorder = part.disorder or self.disorder
        for log in (self.events, self.write_minutes, self.left_out):
            log.settle()

    def _note_others(self, told: Told, pair: I64, messages: VisuMessages) -> None:
        """Note what is spoken beside."""
        rows = np.flatnonzero(messages.kind == Kind.OTHER)
        columns = pair[rows], messages.spoken[rows], messages.row[rows]
        for number, spoken, row in zip(*(column.tolist() for column in columns), strict=True):
            known = self.others.get((number, spoken))
            first_frame, times = known or (row + told.first_frame, 0)
            self.others[number, spoken] = Spoken(first_frame, times + 1)

    def _note_names(self, told: Told, part: VisuBatch, own: I64) -> None:
        """Note what there is to say of lists of variables; ``own`` numbers the pairs of the batch."""
        messages, happened = part.messages, []
        for message, flaw in part.list_flaws.items():
            pair, row = int(own[messages.pair[message]]), int(messages.row[message])
            if pair >= 0:
                subject = Subject(*self.ends(pair), "")
                event = VisuEvent.OTHER_NAMES
                if isinstance(flaw, UnusableEncoding):
                    event = VisuEvent.OTHER_ENCODING
                    self.other_encodings.setdefault(subject, flaw)
                elif isinstance(flaw, UnreadList):
                    event = VisuEvent.UNREAD_LIST
                    self.unread_lists.setdefault(subject, flaw)
                else:
                    self.other_names.setdefault(subject, flaw)
                happened.append((event, 0, int(told.packets.ts_ns[row]), row + told.first_frame, subject))
        self._log(told, happened)

    def _note(self, told: Told, part: VisuBatch, pair: I64, messages: VisuMessages, known_ns: I64) -> None:
        """Note what is a finding, and which variables are asked for."""
        happened: list[tuple[VisuEvent, int, int, int, Subject]] = []
        rows = self._worth_a_look(part, pair, messages)
        columns = (getattr(messages, name)[rows].tolist() for name in VisuMessages.__match_args__)
        own = pair[rows].tolist(), known_ns[rows].tolist(), zip(*columns, strict=True)
        for number, time_ns, row in zip(*own, strict=True):
            one = _Message(*row)
            request, names = part.requests[one.asked], part.namings[one.naming]
            frame = one.row + told.first_frame
            ends = self.ends(number)
            whole = Subject(*ends, "")
            variables: Iterable[Subject] = (Subject(*ends, name_of(entry, names)) for entry in request.entries)
            found: list[tuple[VisuEvent, Subject]] = []
            if one.kind == Kind.UNANSWERED:
                frame = one.asked_frame
                if one.outcome == Outcome.GIVEN_UP:
                    found.append((VisuEvent.GIVEN_UP, whole))
                    self._note_given_up(told, whole, one.latency_ns)
                else:
                    reset = part.is_reset_by_server(one.row, one.pair)
                    found.append((VisuEvent.RESET if reset else VisuEvent.UNANSWERED, whole))
            elif one.kind in (Kind.CUT, Kind.UNBOUNDED):
                found.append((VisuEvent.CUT if one.kind == Kind.CUT else VisuEvent.UNBOUNDED, whole))
            elif one.kind == Kind.REFUSED:
                found.append((VisuEvent.REFUSED if request.writes else VisuEvent.PART_STATUS, whole))
            elif one.kind == Kind.REPLY:
                if one.latency_ns > SLOW_NS:
                    found.append((VisuEvent.SLOW, whole))
                if wrong := _WRONG.get(one.outcome):
                    found.append((wrong, whole))
                elif one.outcome == Outcome.REFUSED or (one.outcome == Outcome.STATUS and request.writes):
                    found += [(VisuEvent.REFUSED, variable) for variable in variables]
                elif one.outcome == Outcome.STATUS:
                    found.append((VisuEvent.STATUS, whole))
                secret = self._secret(request, one.naming, names)
                if secret and one.status == OK and one.outcome != Outcome.UNREAD and not request.writes:
                    seen = seen_in_reply(request, part.data[one.start : one.stop])
                    found += [
                        (VisuEvent.PASSWORD_SEEN, variable)
                        for place, variable in enumerate(variables)
                        if place in secret and place in seen
                    ]  # fmt: skip
            else:
                self._note_variables(number, request, told, time_ns, frame)
                if request.is_miscounted:
                    found.append((VisuEvent.MISCOUNTED, whole))
                if request.ambiguous:
                    found.append((VisuEvent.AMBIGUOUS, whole))
                if one.kind == Kind.WRITE:
                    for entry, variable in zip(request.entries, variables, strict=True):
                        found.append((VisuEvent.WRITTEN, variable))
                        if has_password(entry, names):
                            found.append((VisuEvent.PASSWORD_SEEN, variable))
            happened += [
                (event, one.status if event in _WITH_STATUS else 0, time_ns, frame, subject) for event, subject in found
            ]
            if any(event in _LATE for event, _ in found):
                happened.append((VisuEvent.LATE, 0, time_ns, frame, whole))
        self._log(told, happened)

    def _note_given_up(self, told: Told, subject: Subject, waited_ns: int) -> None:
        """Note how long a client waited for what it gave up."""
        least, most = self.given_up.get(subject, (waited_ns, waited_ns))
        if subject in self.given_up or len(self.given_up) < told.max_streams:
            self.given_up[subject] = min(least, waited_ns), max(most, waited_ns)

    def _note_writes(self, told: Told, part: VisuBatch, pair: I64, messages: VisuMessages) -> None:
        times_ns, frames = told.packets.ts_ns[messages.row], messages.row + told.first_frame
        beyond = np.array(self.writes.observe(part, pair, messages, times_ns, frames), np.int64)
        self._leave_out(Beyond.WRITE, told, messages.take(beyond))

    def _worth_a_look(self, part: VisuBatch, pair: I64, messages: VisuMessages) -> I64:
        """Return the messages of which something may be said beside that they are there."""
        kind, asked, outcome = messages.kind, messages.asked, messages.outcome
        peculiar = np.array([one.writes or one.is_miscounted for one in part.requests], np.bool_)
        wanted = _ARE_WANTED[kind] | (messages.latency_ns > SLOW_NS) | (outcome > Outcome.DONE)
        wanted &= ~_SAY_NOTHING[kind]
        wanted &= (kind != Kind.CUT) | (outcome == Outcome.NONE)  # NV906 and NV804 tell of the others
        reads, replies = np.flatnonzero(kind == Kind.READ), np.flatnonzero(kind == Kind.REPLY)
        wanted[reads] |= peculiar[asked[reads]]
        # What was asked before says nothing new.
        wanted[reads[first_of_each([pair[reads], asked[reads]])]] = True
        naming = messages.naming[replies]
        for place in replies[first_of_each([asked[replies], naming])].tolist():
            request, version = part.requests[int(asked[place])], int(messages.naming[place])
            if self._secret(request, version, part.namings[version]):
                wanted[replies[(asked[replies] == asked[place]) & (naming == version)]] = True
        return np.flatnonzero(wanted)

    def _secret(self, request: Request, naming: int, names: Naming) -> Collection[int]:
        """Return which entries of a request are passwords, or lie in bytes of some."""
        if not names.passwords:
            return ()
        key = (request, naming)
        found = self._secrets.get(key)
        if found is None:
            found = {place for place, one in enumerate(request.entries) if has_password(one, names)}
            if len(self._secrets) > _MOST_REMEMBERED or self._secret_entries > MOST_ENTRIES:
                self._secrets.clear()
                self._secret_entries = 0
            self._secrets[key] = found
            self._secret_entries += len(request.entries)
        return found

    def _note_variables(self, pair: int, request: Request, told: Told, time_ns: int, frame: int) -> None:
        if (pair, request) in self._asked:
            return
        if len(self._asked) > _MOST_REMEMBERED or self._asked_entries > MOST_ENTRIES:
            self._asked.clear()
            self._asked_entries = 0
        if not request.writes:
            self._asked.add((pair, request))
            self._asked_entries += len(request.entries)
        for entry in request.entries:
            key = (pair, entry.address)
            if key in self._variables:
                continue
            if len(self._variables) >= told.max_streams:
                self.left_out.record(*_one(time_ns, frame, Beyond.VARIABLE))
                continue
            self._variables.add(key)
            self.columns.variables[pair] += 1

    def _log(self, told: Told, happened: Sequence[tuple[VisuEvent, int, int, int, Subject]]) -> None:
        for event, status, time_ns, frame, subject in happened:
            number = self.subjects.get(subject)
            if number is None:
                if len(self.subjects) >= told.max_streams:
                    self.left_out.record(*_one(time_ns, frame, Beyond.FINDING))
                    continue
                number = self.subjects[subject] = len(self.subjects)
            if status and (number, status) not in self._statuses:
                if len(self._statuses) < told.max_streams:
                    self._statuses.add((number, status))
                else:
                    status = OTHER_STATUS  # noqa: PLW2901  # a server may make up many
            times, frames, kind = _one(time_ns, frame, event_word(event, status))
            self.events.record(times, frames, kind, np.array([number], np.uint64))
            if event is VisuEvent.WRITTEN:
                self._log_minute(time_ns, frame, number)

    def _log_minute(self, time_ns: int, frame: int, number: int) -> None:
        """Log when a subject was written, as closely as hours of a day ask for it."""
        minute = time_ns // _MINUTE_NS
        if (number, minute) not in self._minutes:
            if len(self._minutes) >= MOST_WRITE_MINUTES:
                self.left_out.record(*_one(time_ns, frame, Beyond.WRITE_MINUTE))
                return
            self._minutes.add((number, minute))
        words = np.array([number], np.uint64), np.array([minute], np.int64).view(np.uint64)
        self.write_minutes.record(np.array([time_ns]), np.array([frame]), *words)

    def _leave_out(self, what: Beyond, told: Told, messages: VisuMessages) -> None:
        time_ns, frame = told.packets.ts_ns[messages.row], messages.row + told.first_frame
        self.left_out.record(time_ns, frame, np.full(len(frame), int(what), np.uint64))

    def ends(self, pair: int) -> tuple[str, str]:
        """Return the addresses of client and server of a pair, as text."""
        found = self._ends.get(pair)
        if found is None:
            client_hi, client_lo, server_hi, server_lo, _ = (int(word[pair]) for word in self.pairs.words)
            found = self._ends[pair] = address.text(client_hi, client_lo), address.text(server_hi, server_lo)
        return found

    def messages(self) -> Mapping[tuple[str, str], int]:
        """Return how many requests and replies there were, whole or not, by client and server."""
        columns = self.columns
        every = columns.reads + columns.writes + columns.replies + columns.cut
        found: dict[tuple[str, str], int] = defaultdict(int)
        for pair, number in enumerate(every[: len(self.pairs)].tolist()):
            found[self.ends(pair)] += number
        return found

    def clients(self) -> Iterator[tuple[int, int]]:
        """Yield the halves of the addresses of those who ask."""
        return zip(self.pairs.words[0].tolist(), self.pairs.words[1].tolist(), strict=True)


def _one(time_ns: int, frame: int, key: int) -> tuple[I64, I64, U64]:
    return np.array([time_ns]), np.array([frame]), np.array([int(key)], np.uint64)
