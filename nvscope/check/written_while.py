"""What was written while something was so, by whom: parameters, and variables of WebVisu."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from dissectors import address
from dissectors.batch import I64, Bool
from nvscope.check.asked_while import pair_in, pair_of, pairs_of
from nvscope.check.check import Evidence, Setting
from nvscope.check.kept_frames import KeptFrames
from nvscope.check.while_so import WhileSo, while_so
from nvscope.check.who_asks import SDO, VISU, Pair, refuse_lists
from nvscope.check.written_places import Written, refuse_nothing
from nvscope.engine.events import EventBatch
from nvscope.engine.runs import distinct, runs_of
from nvscope.engine.told import Told
from nvscope.tracker.parameter.events import ParameterEvent, parameter_name

if TYPE_CHECKING:  # most plants have none, and then nothing of it is imported
    from nvscope.tracker.visu.messages import VisuBatch

MOST_PLACES = 100_000
"""So many parameters and variables are told apart, each by whom and to whom it was written."""


class Times:
    """How often something was written, the first frames, and the value of the first time, "" where others tell it."""

    __slots__ = ("count", "frames", "value")

    def __init__(self, value: str = "") -> None:
        self.count = 0
        self.frames = KeptFrames()
        self.value = value


class WrittenWhile:
    """An observer, and a listener of the state's events, of writes while something ``holds``, None for always.

    ``left_out``: how many writes there was no room for; ``cut`` are clients of WebVisu of whose messages some are not
    whole: nobody knows whether these wrote something, nor of those that are ``unread``: a message is too long, or in an
    unknown coding. ``unclear`` are those of whose writes nobody knows all variables.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, holds: WhileSo | None) -> None:
        self.holds, self._setting = holds, setting
        self._heard: list[EventBatch] = []
        self._sdo: dict[tuple[int, int], Times] = {}
        self._unseen: dict[tuple[int, int], Times] = {}
        self._malformed: dict[tuple[Pair, int], int] = {}
        self._visu: dict[Written, Times] = {}
        self._pairs: dict[int, Pair] = {}
        self.cut: set[Pair] = set()
        self.unread: set[Pair] = set()
        self.unclear: set[Pair] = set()
        self.left_out = 0
        # The batch of messages that came last.
        self._last: VisuBatch | None = None

    def hear(self, events: EventBatch) -> None:
        """Take events of any kind, of the batch that is observed next."""
        if events.kind is ParameterEvent.WRITE_ASKED or events.kind is ParameterEvent.WRITE_UNSEEN:
            self._heard.append(events)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; its events were heard."""
        if self.holds is not None:
            self.holds.see(told)
        heard, self._heard = self._heard, []
        for events in heard:
            self._take_events(events)
        if len(told) and len(told.laid.parameters):
            self._take_malformed(told)
        part = told.parts.get(VISU) if len(told) else None
        if part is not None:
            self._take_messages(told, part)  # type: ignore[arg-type]

    def _judged(self, frame: I64, time_ns: I64) -> Bool:
        judged: Bool = np.ones(len(frame), np.bool_) if self.holds is None else self.holds.spans.at_frames(frame)
        return judged if self._setting.since_ns is None else judged & (time_ns >= self._setting.since_ns)

    def _take_events(self, events: EventBatch) -> None:
        assert events.pair is not None
        events = events.take(np.flatnonzero(self._judged(events.frame, events.time_ns)))
        assert events.pair is not None
        kept = self._sdo if events.kind is ParameterEvent.WRITE_ASKED else self._unseen
        order = np.lexsort((np.arange(len(events)), events.detail, events.pair))
        pair, detail = events.pair[order], events.detail[order]
        bounds = distinct(np.concatenate([*runs_of(pair), *runs_of(detail)])).tolist()
        # In the order in which they came, so that the first ones have room however the capture is cut.
        for row in sorted((order[start:stop] for start, stop in pairwise(bounds)), key=lambda own: int(own[0])):
            key = int(events.pair[row[0]]), int(events.detail[row[0]])
            if key not in kept:
                if len(kept) >= MOST_PLACES:
                    self.left_out += len(row)
                    continue
                kept[key] = Times()
            kept[key].count += len(row)
            kept[key].frames.add(events.frame[row], events.time_ns[row])

    def _take_malformed(self, told: Told) -> None:
        from nvscope.tracker.parameter.malformed_writes import malformed_writes  # noqa: PLC0415

        found = malformed_writes(told)
        found = found.take(self._judged(found.packet + told.first_frame, told.packets.ts_ns[found.packet]))
        for one in zip(*(getattr(found, name).tolist() for name in type(found).__match_args__[1:]), strict=True):
            *ends, port, parameter = one
            pair = Pair(SDO, address.text(*ends[:2]), address.text(*ends[2:]), port)
            if (pair, parameter) not in self._malformed and len(self._malformed) >= MOST_PLACES:
                self.left_out += 1
                continue
            self._malformed[pair, parameter] = self._malformed.get((pair, parameter), 0) + 1

    def _take_messages(self, told: Told, part: VisuBatch) -> None:
        from nvscope.tracker.visu.messages import Kind, Outcome  # noqa: PLC0415
        from nvscope.view.lines.visu_words import variables_of  # noqa: PLC0415

        messages, self._last = part.messages, part
        frame, time_ns = messages.row + told.first_frame, told.packets.ts_ns[messages.row]
        judged = self._judged(frame, time_ns)
        unread, malformed = (
            (messages.kind == Kind.CUT) & (messages.outcome == one) & judged
            for one in (Outcome.UNREAD, Outcome.MALFORMED)
        )
        cut = ((messages.kind == Kind.CUT) | (messages.gap_bytes > 0)) & judged & ~(unread | malformed)
        more = np.array([one.may_write_more for one in part.requests] + [False], np.bool_)[messages.asked]
        behind_part = np.append(False, messages.kind[:-1] == Kind.PART)
        unclear = ((messages.kind == Kind.WRITE) & more) | ((messages.kind == Kind.UNBOUNDED) & behind_part)
        unclear = (unclear | malformed | (messages.kind == Kind.OTHER_BYTES)) & judged
        for rows, pairs in ((cut, self.cut), (unread, self.unread), (unclear, self.unclear)):
            for number in distinct(messages.pair[rows]).tolist():
                if len(pairs) < MOST_PLACES:
                    pairs.add(self._pair(part, number))
        for row in np.flatnonzero((messages.kind == Kind.WRITE) & judged).tolist():
            pair = self._pair(part, int(messages.pair[row]))
            at = slice(row, row + 1)
            for one in variables_of(part, row):
                name = None if one.name == one.entry.address else one.name
                key = Written(pair, one.entry.address, name)
                if key not in self._visu:
                    if len(self._visu) >= MOST_PLACES:
                        self.left_out += 1
                        continue
                    self._visu[key] = Times(one.value or "")
                self._visu[key].count += 1
                self._visu[key].frames.add(frame[at], time_ns[at])

    def _pair(self, part: VisuBatch, number: int) -> Pair:
        if number not in self._pairs:
            if len(self._pairs) >= MOST_PLACES:
                return pair_in(part, number)
            self._pairs[number] = pair_in(part, number)
        return self._pairs[number]

    def lacking(self) -> set[Pair]:
        """Return the pairs whose clients, at the end, may have written something behind all that there is.

        When that was, nobody knows: of writes while something holds, that tells nothing.
        """
        if self._last is None or self.holds is not None:
            return set()
        return {pair_of(words) for words in self._last.lacking()}

    def written(self, known: Evidence) -> Iterator[tuple[Written, Times]]:
        """Yield all that was written by requests that are whole."""
        pairs = pairs_of(known.parameters)
        for (number, detail), times in self._sdo.items():
            yield _parameter(known, pairs[number], detail), times
        yield from self._visu.items()

    def unseen(self, known: Evidence) -> Iterator[tuple[Written, int]]:
        """Yield what replies say was written by requests that were not captured, and how often."""
        pairs = pairs_of(known.parameters)
        for (number, detail), times in self._unseen.items():
            yield _parameter(known, pairs[number], detail), times.count

    def malformed(self, known: Evidence) -> Iterator[tuple[Written, int]]:
        """Yield what requests were to write that are malformed, or whose header was cut off, and how often."""
        for (pair, detail), count in self._malformed.items():
            yield _parameter(known, pair, detail), count


def _parameter(known: Evidence, pair: Pair, detail: int) -> Written:
    """Return a parameter that was written, with its name as far as the project gives one."""
    parameters, name = known.project.definition.parameters, None
    if parameters:
        defined = parameters.of(pair.server, detail >> 16, detail & 0xFFFF)
        name = defined.name if defined else ""
    return Written(pair, parameter_name(detail), name)


def watch_writes(setting: Setting, told: Mapping[str, Any]) -> WrittenWhile:
    """Return what watches, one for all rules that are judged alike."""
    refuse_lists(setting.lists)
    refuse_nothing(told)
    return setting.shared(("written", setting.when), lambda: WrittenWhile(setting, while_so(setting)))
