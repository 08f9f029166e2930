"""What became of requests that were asked while something was so, by who asked whom."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from dissectors import address
from dissectors.batch import I64, Bool
from dissectors.keys import KeyTable
from nvscope.check.check import Evidence, Setting
from nvscope.check.kept_frames import KeptFrames
from nvscope.check.while_so import WhileSo, while_so
from nvscope.check.who_asks import SDO, VISU, Pair, refuse_lists
from nvscope.engine.events import EventBatch
from nvscope.engine.runs import distinct, runs_of
from nvscope.engine.told import Told
from nvscope.tracker.latency import Latencies
from nvscope.tracker.parameter.events import ParameterEvent

if TYPE_CHECKING:  # most plants have none, and then nothing of it is imported
    from nvscope.tracker.events import EventLog
    from nvscope.tracker.parameter.transactions import Transactions
    from nvscope.tracker.visu.leaving import LeavingClients
    from nvscope.tracker.visu.messages import VisuBatch

_MAXIMUM = 100


class Came(Enum):
    """What came of a request."""

    REPLY = "reply"
    REFUSED = "refused"
    BUSY = "busy"
    UNANSWERED = "unanswered"


_OF_EVENTS = {
    ParameterEvent.REPLIED: Came.REPLY, ParameterEvent.ERROR_REPLY: Came.REFUSED, ParameterEvent.BUSY: Came.BUSY,
    ParameterEvent.TIMEOUT: Came.UNANSWERED,
}  # fmt: skip
_WITH_LATENCY = (Came.REPLY, Came.REFUSED)


class Tally:
    """What came of the requests of one pair: how many, the first frames of each kind, and replies that are ``slow``.

    ``asked`` are those of WebVisu, whatever came of them; ``cut`` are requests and replies of which bytes are missing;
    of so many replies nobody knows how long they took (``unmeasured``).
    """

    __slots__ = ("asked", "counts", "cut", "frames", "slow", "slow_frames", "unmeasured")

    def __init__(self) -> None:
        self.asked = self.cut = self.unmeasured = 0
        self.counts = dict.fromkeys(Came, 0)
        self.frames: Mapping[Came, KeptFrames] = {one: KeptFrames() for one in (Came.REFUSED, Came.UNANSWERED)}
        self.slow = 0
        self.slow_frames = KeptFrames()

    def with_unanswered(self, frame: I64, time_ns: I64) -> Tally:
        """Return the same with further requests that nobody answered."""
        found, came = copy(self), Came.UNANSWERED
        found.counts = {**self.counts, came: self.counts[came] + len(frame)}
        kept = KeptFrames()
        kept.kept = self.frames[came].kept
        kept.add(frame, time_ns)
        found.frames = {**self.frames, came: kept}
        return found

    @property
    def requests(self) -> int:
        """How many requests something came of."""
        return sum(self.counts.values())

    @property
    def replies(self) -> int:
        """How many replies there are that have a latency, known or not."""
        return sum(self.counts[one] for one in _WITH_LATENCY)


class Tallies:
    """Tallies by the number of pairs; replies that took longer than ``most_ns`` are slow."""

    def __init__(self, most_ns: int | None) -> None:
        self._most_ns = most_ns
        self._latencies = Latencies()
        self.of: dict[int, Tally] = defaultdict(Tally)

    def take(
        self, came: Came, pair: I64, frame: I64, time_ns: I64, took_ns: I64, timed: Bool | None = None
    ) -> None:  # fmt: skip
        """Take what came of some requests; only what is ``timed`` has a latency, None where all of it has."""
        if not len(pair):
            return
        order = np.argsort(pair, kind="stable")
        for start, stop in zip(*(one.tolist() for one in runs_of(pair[order])), strict=True):
            row = order[start:stop]
            tally = self.of[int(pair[row[0]])]
            tally.counts[came] += len(row)
            if came in tally.frames:
                tally.frames[came].add(frame[row], time_ns[row])
            if came in _WITH_LATENCY and timed is not None:
                tally.unmeasured += int(np.count_nonzero(~timed[row]))
            if came in _WITH_LATENCY and self._most_ns is not None:
                late = row[took_ns[row] > self._most_ns]  # what is not timed took nothing
                tally.slow += len(late)
                tally.slow_frames.add(frame[late], time_ns[late])
        if came in _WITH_LATENCY:
            own = np.ones(len(pair), np.bool_) if timed is None else timed
            self._latencies.observe(pair[own], took_ns[own], int(pair.max()) + 1)

    def with_unanswered(self, pair: I64, frame: I64, time_ns: I64) -> Tallies:
        """Return the same with further requests that nobody answered."""
        found = copy(self)
        found.of = self.of.copy()
        for one in distinct(pair).tolist():
            own = pair == one
            found.of[one] = found.of[one].with_unanswered(frame[own], time_ns[own])
        return found

    def percentile_ns(self, pair: int, percent: int) -> int | None:
        """Return a percentile of what replies of a pair took, within 0.5 %; None without any."""
        found = self._latencies.percentiles((percent,))
        place = int(np.searchsorted(found.stream, pair))
        if place == len(found.stream) or found.stream[place] != pair:
            return None
        return int((found.most_ns if percent == _MAXIMUM else found.at_ns[percent])[place])


class AskedWhile:
    """An observer, and a listener of the state's events, of what was asked while something ``holds``, None for always.

    It goes by when something was asked: its reply may come when it holds no more. ``left_out`` tells whether there was
    no room for some pairs of WebVisu.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, holds: WhileSo | None, most_ns: int | None) -> None:
        self.holds, self._setting = holds, setting
        self._heard: list[EventBatch] = []
        self._sdo, self._visu = Tallies(most_ns), Tallies(most_ns)
        self._pairs: dict[int, Pair] = {}
        self._leaving: LeavingClients | None = None
        self._disorder: EventLog | None = None
        self._senders = KeyTable(2)
        self._first_judged: int | None = None if setting.since_ns is not None else 0
        self.left_out = False

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind, of the batch that is observed next."""
        if events.kind in _OF_EVENTS and isinstance(events.kind, ParameterEvent):
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; its events were heard."""
        if self.holds is not None:
            self.holds.see(told)
        heard, self._heard = self._heard, []
        for events in heard:
            self._take_events(events)
        part = told.parts.get(VISU)
        if part is None and self._leaving is not None:
            self._leaving.observe(told, None)
        if not len(told):
            return
        if self._first_judged is None:
            behind = np.flatnonzero(self._setting.rows.latest_ns(told) >= (self._setting.since_ns or 0))
            if len(behind):
                self._first_judged = int(behind[0]) + told.first_frame
        segments = told.batch.segments
        if len(segments):
            self._senders.numbers_within(told.max_streams, segments.source_hi, segments.source_lo)
        if part is not None:
            self._take_messages(told, part)  # type: ignore[arg-type]

    def _take_events(self, events: EventBatch) -> None:
        assert events.pair is not None
        judged = np.ones(len(events), np.bool_) if self.holds is None else self.holds.spans.at(events.since_ns)
        if self._setting.since_ns is not None:
            judged &= events.since_ns >= self._setting.since_ns
        own = np.flatnonzero(judged)
        took_ns = events.time_ns[own] - events.since_ns[own]
        came = _OF_EVENTS[events.kind]  # type: ignore[index]
        self._sdo.take(came, events.pair[own], events.frame[own], events.time_ns[own], took_ns)

    def _take_messages(self, told: Told, part: VisuBatch) -> None:
        from nvscope.tracker.visu.leaving import LeavingClients  # noqa: PLC0415
        from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind, Outcome  # noqa: PLC0415

        self._leaving = self._leaving or LeavingClients()
        self._leaving.observe(told, part.leaving)
        self._disorder = part.disorder
        messages, known_ns = part.messages, part.known_ns(told.packets.ts_ns)
        for number in distinct(messages.pair).tolist():
            if number in self._pairs:
                continue
            if len(self._pairs) >= told.max_streams:
                self.left_out = True
                continue
            self._pairs[number] = pair_in(part, number)
        if self.left_out:
            own = np.array([number in self._pairs for number in messages.pair.tolist()], np.bool_)
            messages, known_ns = messages.take(own), known_ns[own]
        refused = (messages.outcome == Outcome.REFUSED) | (messages.outcome == Outcome.STATUS)
        is_reply, judged = messages.kind == Kind.REPLY, self._judged(messages.asked_frame)
        asks = (messages.kind == Kind.READ) | (messages.kind == Kind.WRITE)
        asks &= self._judged(messages.row + told.first_frame)
        for number, count in enumerate(np.bincount(messages.pair[asks]).tolist()):
            if count:
                self._visu.of[number].asked += count
        for number, count in enumerate(np.bincount(messages.pair[messages.kind == Kind.CUT]).tolist()):
            if count:
                self._visu.of[number].cut += count
        for came, own in (
            (Came.REPLY, is_reply & ~refused), (Came.REFUSED, is_reply & refused),
            (Came.UNANSWERED, messages.kind == Kind.UNANSWERED), (Came.REFUSED, messages.kind == Kind.REFUSED),
        ):  # fmt: skip
            row = np.flatnonzero(own & judged)
            packet = messages.row[row]
            frame = messages.asked_frame[row] if came is Came.UNANSWERED else packet + told.first_frame
            latency_ns = messages.latency_ns[row]
            is_measured = is_reply[row] & (latency_ns != UNMEASURED_NS)
            self._visu.take(came, messages.pair[row], frame, known_ns[row], latency_ns, is_measured)

    def _judged(self, asked: I64) -> Bool:
        """Tell of the frames of requests which of them are judged."""
        if self._first_judged is None:
            return np.zeros(len(asked), np.bool_)
        found: Bool = asked >= self._first_judged
        return found if self.holds is None else found & self.holds.spans.at_frames(asked)

    def sends(self, node: str) -> bool:
        """Tell whether a node has sent anything over the ports of WebVisu."""
        high, low = (np.array([half], np.uint64) for half in address.halves(node))
        return bool(self._senders.find(high, low)[0] >= 0)

    def in_disorder(self) -> set[Pair]:
        """Return the pairs of WebVisu that were captured in another order than that of the wire."""
        if self._disorder is None:
            return set()
        words = zip(*(word.tolist() for word in self._disorder.keys.words), strict=True)
        return {pair_of(one) for one in words}

    def _of_pages(self) -> Tallies:
        """Return what came of the requests of WebVisu; of some that clients gave up, nothing but time tells."""
        given_up = [] if self._leaving is None else self._leaving.given_up()
        table = [(one.pair, one.asked_frame, one.over_ns) for one in given_up if one.pair in self._pairs]
        pair, frame, time_ns = np.array(table, np.int64).reshape(-1, 3).T
        judged = self._judged(frame)
        return self._visu.with_unanswered(pair[judged], frame[judged], time_ns[judged])

    def pairs(self, known: Evidence) -> Iterator[tuple[Pair, int, Tallies]]:
        """Yield all pairs that spoke, whether they are judged or not, each with its number among tallies."""
        for number, pair in enumerate(pairs_of(known.parameters)):
            yield pair, number, self._sdo
        of_pages = self._of_pages()
        for number, pair in self._pairs.items():
            yield pair, number, of_pages


def pairs_of(known: Transactions | None) -> list[Pair]:
    """Return the pairs of the Parameter Manager, by number."""
    if known is None:
        return []
    words = zip(*(word.tolist() for word in known.pairs.words), strict=True)
    return [Pair(SDO, address.text(*ends[:2]), address.text(*ends[2:]), int(port)) for *ends, port in words]


def asks_beyond(known: Evidence, *names: str) -> bool:
    """Tell whether there was no room for something that the Parameter Manager said: members of ``Beyond``, by name."""
    if known.parameters is None:
        return False
    from nvscope.tracker.parameter.transactions import Beyond  # noqa: PLC0415

    words = {int(Beyond[name]) for name in names}
    return not words.isdisjoint(known.parameters.left_out.keys.high.tolist())


def pair_in(part: VisuBatch, number: int) -> Pair:
    """Return a pair of WebVisu by its number."""
    return pair_of(tuple(int(word[number]) for word in part.pairs))


def pair_of(words: Sequence[int]) -> Pair:
    """Return a pair of WebVisu by halves of the addresses of client and server, and port."""
    *ends, port = words
    return Pair(VISU, address.text(*ends[:2]), address.text(*ends[2:]), port)


def watch_asked(setting: Setting, told: Mapping[str, Any]) -> AskedWhile:
    """Return what watches, one for all rules that are judged alike."""
    refuse_lists(setting.lists)
    most_ns = told["max_latency"]
    name = ("asked", setting.when, most_ns)
    return setting.shared(name, lambda: AskedWhile(setting, while_so(setting), most_ns))
