"""Chronicle: what happened to each list, when, so that it can be drawn as a strip of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64
from nvscope.causes.case import PAUSE_PERCENT, Case
from nvscope.causes.mark import Mark
from nvscope.causes.silent_spans import SilentSpans, within_ns
from nvscope.causes.spans import joined
from nvscope.causes.symptoms import code_number
from nvscope.engine.runs import rows_by
from nvscope.findings.answers import NEGATIVE_ACKNOWLEDGEMENT, NO_ACKNOWLEDGEMENT
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.consistency import SEVERAL_SENDERS
from nvscope.findings.facts import AnyList
from nvscope.findings.kind import FindingKind
from nvscope.findings.loss import SENDER_RESTART, TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE, TORN_CYCLE
from nvscope.findings.unusual_intervals import AnyStream
from nvscope.tracker.evidence.long_pauses import PauseColumns
from nvscope.tracker.silences import Silence

_MARKS: Mapping[FindingKind, Mark] = {
    TELEGRAM_GAP: Mark.LOST,
    SENDER_RESTART: Mark.RESTARTED,
    NO_ACKNOWLEDGEMENT: Mark.UNANSWERED,
    NEGATIVE_ACKNOWLEDGEMENT: Mark.UNANSWERED,
    LATE: Mark.LATE,
    JITTER: Mark.LATE,
    TORN_CYCLE: Mark.LATE,
    INCOMPLETE_CYCLE: Mark.LATE,
}
_BY_VALUE = tuple(Mark)
_VALUES = np.array(_BY_VALUE)[:, np.newaxis]
_Span = tuple[int, int]


class Chronicle(Struct, frozen=True, dict=True):
    """What happened to lists from ``start_ns`` to ``end_ns``; all of it is a copy of what was known then.

    ``lists`` are by number. ``marks`` are the columns list, since, until and ``Mark``, int64 of shape (n,), by list.
    """

    start_ns: int
    end_ns: int
    lists: Mapping[int, AnyList]
    marks: tuple[I64, I64, I64, I64]
    pauses: PauseColumns
    silences: Mapping[int, Sequence[Silence]]

    def strips(self, keys: Sequence[str], cells: int) -> list[list[Mark]]:
        """Return the worst marks of lists, told by the texts of their keys, in each of so many equal parts of the time.

        Many at once take little longer than one.
        """
        numbers = [self.numbers[key] for key in keys]
        length_ns = max(self.end_ns - self.start_ns, 1)
        edge = self.start_ns + np.arange(cells + 1) * length_ns // cells
        found = np.zeros((len(keys), cells), np.int64)
        part_ns = np.maximum(np.diff(edge), 1)
        for place, (since_ns, until_ns) in self._silent(numbers).items():
            found[place, within_ns(since_ns, until_ns, edge) >= part_ns] = Mark.SILENT
        lists, since_ns, until_ns, mark = self.marks
        begins, ends = (lists.searchsorted(np.array(numbers, np.int64) + at).tolist() for at in (0, 1))
        for place, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            if begin == end:
                continue
            first, last = (
                (edge.searchsorted(times_ns[begin:end], "right") - 1).clip(0, cells - 1)
                for times_ns in (since_ns, until_ns)
            )
            # A row for each mark: how many stretches with it each cell is in.
            row, size = mark[begin:end] * (cells + 1), len(Mark) * (cells + 1)
            begun = np.bincount(row + first, minlength=size) - np.bincount(row + last + 1, minlength=size)
            is_in = begun.reshape(len(Mark), -1).cumsum(axis=1)[:, :-1] > 0
            np.maximum(found[place], (is_in * _VALUES).max(axis=0), out=found[place])
        return [[_BY_VALUE[one] for one in row] for row in found.tolist()]

    def up_to(self, now_ns: int) -> Chronicle:
        """Return what happened up to a time, which is before the end where the clock was set back.

        What began by the clock before that seems to begin later: it was there all the time.
        """
        if now_ns >= self.end_ns:
            return self
        length_ns = self.end_ns - self.start_ns
        start_ns = self.start_ns if self.start_ns < now_ns else now_ns - max(length_ns, 1)
        return replace(self, start_ns=start_ns, end_ns=now_ns)

    def last(self, length_ns: int) -> Chronicle:
        """Return what happened in the last so many nanoseconds."""
        start_ns = max(self.start_ns, self.end_ns - length_ns)
        if start_ns == self.start_ns:
            return self
        kept = self.marks[2] >= start_ns
        lists, since_ns, until_ns, mark = (column[kept] for column in self.marks)
        return replace(self, start_ns=start_ns, marks=(lists, np.maximum(since_ns, start_ns), until_ns, mark))

    def outlined(self, cells: int) -> Chronicle:
        """Return one whose strips of at most so many cells are the same, in as few stretches of time as that takes.

        Stretches with the same mark of a list that lie closer together than any cell is long are one.
        """
        near_ns = max(self.end_ns - self.start_ns, 1) // cells
        lists, since_ns, until_ns, mark = self.marks
        place, since_ns, until_ns = joined(lists * len(Mark) + mark, since_ns, until_ns, near_ns)
        marks = place // len(Mark), since_ns, until_ns, place % len(Mark)
        own = self.pauses.time_ns >= self.start_ns
        return replace(self, marks=marks, pauses=PauseColumns(*(column[own] for column in self.pauses)))

    @cached_property
    def numbers(self) -> Mapping[str, int]:
        """The numbers of lists by the text of their keys."""
        return {str(entry.key): number for number, entry in self.lists.items()}

    def _silent(self, numbers: Sequence[int]) -> Mapping[int, tuple[I64, I64]]:
        """Return when none of the streams of lists was heard, of those that were silent so, by place in ``numbers``."""
        every = [
            (place, number, one)
            for place, number in enumerate(numbers) for one in self.lists[number].streams if one.telegrams
        ]  # fmt: skip
        spans = self._silences([(number, one) for _, number, one in every])
        group = np.array([place for place, _, _ in every], np.int64)
        found = spans.of_groups(group, len(numbers), self.start_ns, self.end_ns)
        return {place: (found.since_ns[own], found.until_ns[own]) for (place,), own in rows_by((found.stream,))}

    def _silences(self, streams: Sequence[tuple[int, AnyStream]]) -> SilentSpans:
        """Return when streams of lists, told by number, were silent: before and behind them, and their pauses."""
        first_ns, last_ns, usual_ns = (
            np.array([(one.first_ns, one.last_ns, _usual_ns(one)) for _, one in streams], np.int64).reshape(-1, 3).T
        )
        before = np.flatnonzero((first_ns <= self.end_ns) & (first_ns - self.start_ns > usual_ns))
        behind = np.flatnonzero(self.end_ns - last_ns > usual_ns)
        parts = [
            SilentSpans(before, np.full(len(before), self.start_ns), first_ns[before]),
            SilentSpans(behind, last_ns[behind], np.full(len(behind), self.end_ns)),
        ]
        unheard = [
            (place, one.since_ns, one.until_ns)
            for place, (_, stream) in enumerate(streams) for one in self.silences.get(stream.stream, ())
        ] if self.silences else []  # fmt: skip
        parts.append(SilentSpans(*np.array(unheard, np.int64).reshape(-1, 3).T))
        for place, (number, stream) in enumerate(streams):
            row = self._pauses_of.get((number, -1 if stream.node is None else stream.node, stream.subindex))
            if row is not None:
                parts.append(SilentSpans(np.full(len(row), place), self.pauses.since_ns[row], self.pauses.time_ns[row]))
        whole = SilentSpans(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
        long = whole.until_ns - whole.since_ns > usual_ns[whole.stream]
        return SilentSpans(*(column[long] for column in whole))

    @cached_property
    def _pauses_of(self) -> Mapping[tuple[int, ...], I64]:
        """Where the pauses of each stream are, by list, node and SubIndex."""
        return dict(rows_by((self.pauses.list, self.pauses.node, self.pauses.subindex)))


def _usual_ns(stream: AnyStream) -> int:
    """Return up to how long nothing of a stream is usual."""
    intervals = stream.intervals
    return intervals.nominal * PAUSE_PERCENT // 100 if intervals.nominal else (intervals.p99 or 0)


def chronicle_of(case: Case) -> Chronicle:
    """Return what happened to each list of a case."""
    symptoms = case.symptoms
    mark = np.zeros(max(map(code_number, _MARKS)) + 1, np.int64)
    for kind, value in _MARKS.items():
        mark[code_number(kind)] = value
    of_symptom = np.where(symptoms.code < len(mark), mark[np.minimum(symptoms.code, len(mark) - 1)], Mark.USUAL)
    row = np.flatnonzero((of_symptom > Mark.USUAL) & (symptoms.list >= 0))
    since_ns, until_ns = symptoms.since_ns[row], symptoms.time_ns[row]
    # What was late is told when it came, what was not answered when it was sent.
    since_ns = np.where(of_symptom[row] == Mark.LATE, until_ns, since_ns)
    until_ns = np.where(of_symptom[row] == Mark.UNANSWERED, since_ns, until_ns)
    lost = of_symptom[row] == Mark.LOST
    between_ns = (until_ns - since_ns) // (symptoms.amount[row] + 1)
    since_ns, until_ns = (
        np.where(lost, since_ns + between_ns, since_ns),
        np.where(lost, until_ns - between_ns, until_ns),
    )
    since_ns = np.where(of_symptom[row] == Mark.RESTARTED, until_ns, since_ns)
    until_ns = np.maximum(since_ns, until_ns)  # a clock may have stepped back in between
    several = _several_senders(case)
    columns = symptoms.list[row], since_ns, until_ns, of_symptom[row]
    whole = [np.append(column, several[:, place]) for place, column in enumerate(columns)]
    order = np.argsort(whole[0], kind="stable")
    lists, since_ns, until_ns, marks = (column[order] for column in whole)
    silences = case.facts.state.senders.timing.silences.by_stream()
    return Chronicle(
        case.start_ns, case.end_ns, case.lists, (lists, since_ns, until_ns, marks),
        case.witness.long_pauses.columns(), silences,
    )  # fmt: skip


def _several_senders(case: Case) -> I64:
    """Return when lists had several senders at once: rows of list, since, until and mark."""
    rows = []
    for finding in case.findings:
        if finding.kind is not SEVERAL_SENDERS or finding.list_number is None:
            continue
        of_node: dict[int | None, _Span] = {}
        for stream in case.lists[finding.list_number].streams:
            first_ns, last_ns = of_node.get(stream.node, (stream.first_ns, stream.last_ns))
            of_node[stream.node] = min(first_ns, stream.first_ns), max(last_ns, stream.last_ns)
        spans = sorted(of_node.values())
        # Of malformed telegrams alone, there is no stream.
        until_ns = spans[0][1] if spans else 0
        for since_ns, last_ns in spans[1:]:
            if since_ns < until_ns:
                rows.append((finding.list_number, since_ns, min(until_ns, last_ns), Mark.SEVERAL_SENDERS.value))
            until_ns = max(until_ns, last_ns)
    return np.array(rows, np.int64).reshape(len(rows), 4)
