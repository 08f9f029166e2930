"""Tables of changes judged: counters against values, each variable by itself."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U64, Bool
from dissectors.datalogger.records import Form
from dissectors.datalogger.tables import LogTable
from nvscope.datalogger.audit import topics
from nvscope.datalogger.audit.chunk import Chunk
from nvscope.datalogger.audit.counts import steps_of
from nvscope.datalogger.audit.finding import Notes, Topic
from nvscope.datalogger.audit.odd_counts import Counted, OddCounts
from nvscope.datalogger.audit.restarts import Start, Zero, ZeroRow
from nvscope.datalogger.audit.stored import Stored, stored_of
from nvscope.datalogger.audit.sums import total
from nvscope.datalogger.audit.unknown_rows import UnknownRows
from nvscope.datalogger.audit.values import Values
from nvscope.datalogger.audit.zero_rows import ZeroRows

_REAL_WORDS = ("REAL", "FLOA", "DOUB")
_UNKNOWN = -1
_NO_ROWS: I64 = np.zeros(0, np.int64)


class ChangeJudge:
    """Judges the changes of one table, chunk by chunk; ``restarts`` are those since it was asked last."""

    def __init__(self, table: LogTable, values: Values) -> None:
        self._variables = [one for one in table.variables if one.counter is not None]
        self._is_real = [any(word in one.declared.upper() for word in _REAL_WORDS) for one in self._variables]
        count = len(self._variables)
        self._values = values
        self._unknown = UnknownRows(values.figures)
        self._odd = OddCounts(count)
        self._count = np.zeros(count, np.int64)
        self._stretch = np.full(count, _UNKNOWN, np.int64)
        self._losses = np.zeros(count, np.int64)
        self._alone = np.zeros(count, np.int64)
        self._back = np.zeros(count, np.bool_)
        self._before_back = np.zeros(count, np.int64)
        self._in_file = np.zeros(count, np.bool_)
        self._ever = np.zeros(count, np.bool_)
        self._lost = 0
        self._start: Start | None = None
        self._undecided: Notes | None = None
        """Where to tell of the start, if it is one: in a table of one variable, the next count says so."""
        self._begun = False
        self._seen_beginning = False
        self._zeros = ZeroRows(self._is_real)
        self.restarts: list[Start] = []
        self._last_ns: int | None = None

    def forget(self) -> None:
        """Let nothing be concluded from the rows so far."""
        self._decide(is_odd=False)
        self._stretch[:] = _UNKNOWN
        self._start = None
        self._odd.end()
        self._values.forget()
        self._unknown.forget()

    def begin_file(self, notes: Notes) -> None:
        """Say that a file ends here, whose ``notes`` these are, and that another one of the series begins."""
        if self._undecided is None:
            self._close(notes)
        self._in_file[:] = False

    def take(self, chunk: Chunk, notes: Notes) -> None:
        """Judge some rows."""
        own = [self._stored(number, chunk, notes) for number in range(len(self._variables))]
        self._zeros.take(own, chunk)
        losses = self._lost + np.cumsum(chunk.lost)
        self._lost = int(losses[-1])
        found: dict[int, dict[int, Zero]] = {row: {} for row in np.flatnonzero(self._zeros.found).tolist()}
        for number, one in enumerate(own):
            if one is None:
                self._unknown.take(number, chunk, _NO_ROWS, _NO_ROWS.astype(np.bool_))
            elif not len(one.rows):
                self._alone[number] += np.count_nonzero(one.are_alone)
                self._take_values(number, chunk, np.flatnonzero(one.valued))
            elif self._counts_on(number, one, chunk):
                self._take_counted(number, one, chunk, notes)
            else:
                self._judge(number, one, chunk, losses, found, notes)
        first_known = self._begun
        self._begun = True
        if not first_known:
            self._seen_beginning = bool(self._zeros.found[0])
        self._look_for_restarts(chunk, own, found, notes)
        for number, one in enumerate(own):
            self._ever[number] |= one is not None and len(one.rows) > 0
        self._last_ns = self._time_before(chunk, len(chunk))

    def _time_before(self, chunk: Chunk, row: int) -> int | None:
        """Return the time of the last row in front of one that has one."""
        timed = np.flatnonzero(chunk.times.valid[:row])
        return int(chunk.time_ns[timed[-1]]) if len(timed) else self._last_ns

    def end(self, notes: Notes) -> None:
        """Judge what is still open when all rows were read."""
        self._decide(is_odd=False)
        self._close(notes)
        self._odd.end()

    def _stored(self, number: int, chunk: Chunk, notes: Notes) -> Stored | None:
        own = stored_of(self._variables[number], chunk)
        if own is not None:
            _note(notes, topics.HALF, number, chunk, own.uncounted)
            _note(notes, topics.NO_COUNT, number, chunk, own.no_count)
        return own

    def _counts_on(self, number: int, own: Stored, chunk: Chunk) -> bool:
        """Return whether each value is counted as one change more, with nothing open: as it is in most chunks."""
        return (
            own.is_paired
            and chunk.is_one_stretch
            and self._stretch[number] == chunk.stretch[0]
            and self._losses[number] == self._lost
            and not chunk.lost.any()
            and not self._alone[number]
            and self._undecided is None
            and not self._odd.is_open(number)
            and own.counts_on(int(self._count[number]))
        )

    def _take_counted(self, number: int, own: Stored, chunk: Chunk, notes: Notes) -> None:
        """Take the values of a variable that is counted on: what is left to judge is whether they are others."""
        same, _, bits = self._take_values(number, chunk, own.rows)
        same = self._without_zeros(same, self._is_real[number], bits)
        if same.any():
            _note(notes, topics.EQUAL, number, chunk, own.rows[same])
        self._count[number] = own.counts[-1]
        self._back[number], self._before_back[number] = False, own.counts[-1] - 1
        self._odd.count_on(number, int(own.counts[-1]) - 1)
        self._in_file[number] = True

    def _judge(
        self, number: int, own: Stored, chunk: Chunk, losses: I64, found: dict[int, dict[int, Zero]], notes: Notes
    ) -> None:  # fmt: skip
        zeros = self._zeros
        rows, counts = own.rows, own.counts
        stretch = chunk.stretch[rows]
        before = np.concatenate([self._count[number : number + 1], counts[:-1]])
        known = stretch == np.concatenate([self._stretch[number : number + 1], stretch[:-1]])
        lost_before = np.concatenate([self._losses[number : number + 1], losses[rows[:-1]]])
        steps = np.where(known, steps_of(counts, before), 0)
        follows = known & (losses[rows] == lost_before)
        if self._alone[number] or own.are_alone.any():
            # A value without its counter is a change that was stored.
            alone = self._alone[number] + np.cumsum(own.are_alone)
            between = np.diff(alone[rows], prepend=0)
            steps = np.where((steps > 1) & (between > 0), np.maximum(steps - between, 1), steps)
            follows &= between == 0
            self._alone[number] = alone[-1] - alone[rows[-1]]
        valued = own.valued[rows]
        same, value_known, is_null = self._values_at(number, own, chunk, steps, known)
        # One of 32 bits that begins again is at 0, too.
        at_zero = zeros.found[rows] & ~(known & (steps == 1) & (before > 0))
        # A file may begin with what was known already.
        goes_on = np.zeros(len(rows), np.bool_)
        goes_on[0] = not self._in_file[number]
        stuck = known & (steps == 0) & valued & ~goes_on & value_known & ~same
        is_alone = len(self._variables) == 1
        # Of a variable alone, a 0 may be a new start or a counter that is wrong: how it counts on, tells.
        starts = zeros.whole[rows]
        doubtful = follows & ((steps < 0) | ((steps > 1) & ~at_zero) | stuck) & (~starts | (is_alone & (before > 0)))
        doubtful &= ~at_zero | (before > 0) | (rows >= zeros.whole_from)
        cells = Counted(counts, before, follows, doubtful, starts, valued, is_null)
        odd, behind_odd, right_steps = self._odd.find(number, cells)
        if is_alone:
            self._decide(is_odd=bool(behind_odd[0]))
            at_zero &= ~odd
            if at_zero[-1] and doubtful[-1] and not behind_odd[-1]:
                self._undecided = notes
        steps = np.where(behind_odd, right_steps, steps)
        usual = known & ~at_zero
        explained = losses[rows] > lost_before
        if usual.any():
            back = usual & (steps < 0)
            jumped = usual & (steps > 1)
            if jumped.any():
                amount = self._missed(number, steps, counts, before, back)
                jumped &= amount > 0
                _note(notes, topics.AHEAD, number, chunk, rows[jumped & odd])
                jumped &= ~odd
                if jumped[-1] and doubtful[-1]:
                    self._odd.wait(number, notes, _places(chunk, rows[-1:]), amount[-1:])
                    jumped[-1] = False
                _note(notes, topics.MISSED, number, chunk, rows[jumped & ~explained], amount[jumped & ~explained])
                notes.of(topics.LOST).total += total(amount[jumped & explained])
            if back.any():
                _note(notes, topics.BACK, number, chunk, rows[back])
            stood = usual & (steps == 0) & valued & ~goes_on
            stuck &= stood
            if stuck.any():
                _note(notes, topics.STUCK, number, chunk, rows[stuck])
            equal = same & ((usual & (steps == 1)) | stood)
            if equal.any():
                _note(notes, topics.EQUAL, number, chunk, rows[equal])
        self._back[number], self._before_back[number] = usual[-1] and steps[-1] < 0, before[-1]
        negative = ~known & (counts < 0)
        if negative.any():
            _note(notes, topics.NO_COUNT, number, chunk, rows[negative])
        if not valued.all():
            # A real number that is none is NULL, with a counter that counts it.
            half = ~valued & ~zeros.partly[rows]
            if is_null:
                half &= known & (steps == 0) & ~at_zero
            if half.any():
                _note(notes, topics.HALF, number, chunk, rows[half])
        # In the style of the document a counter is repeated without its value: that tells of nothing new.
        none = zeros.beside_none[rows] & ~valued
        repeated = known & (steps == 0) & ~valued & ~zeros.partly[rows] & ~none
        for place in np.flatnonzero(at_zero & ~repeated).tolist():
            if not known[place] or (none[place] and not steps[place]):
                says = Zero.UNKNOWN
            elif steps[place] < 0:
                says = Zero.BACK
            elif steps[place] > 0:
                says = Zero.COUNTED
            elif valued[place] and value_known[place] and not same[place]:
                says = Zero.STUCK
            else:
                says = Zero.EQUAL
            found[int(rows[place])][number] = says
        self._count[number], self._stretch[number] = counts[-1], stretch[-1]
        self._losses[number] = losses[rows[-1]]
        self._in_file[number] = True

    def _missed(self, number: int, steps: I64, counts: I64, before: I64, back: Bool) -> I64:
        """Return how many changes lack in front of each count; one that went back is none to count from."""
        was_back = np.concatenate([self._back[number : number + 1], back[:-1]])
        since = np.concatenate([self._before_back[number : number + 1], before[:-1]])
        # Over two steps: that to the count which went back, and that away from it.
        return np.where(was_back, np.minimum(steps - 1, steps_of(counts, since) - 2), steps - 1)

    def _values_at(
        self, number: int, own: Stored, chunk: Chunk, steps: I64, known: Bool
    ) -> tuple[Bool, Bool, bool]:  # fmt: skip
        """Take the values of a chunk; return, of rows with a counter, where the value is the one before, and where that
        one is known; and whether NULL may be a number that is none."""
        is_real = self._is_real[number]
        if own.is_paired:
            same, value_known, bits = self._take_values(number, chunk, own.rows)
            return self._without_zeros(same, is_real, bits), value_known, is_real
        # A change to what is not there: a number that is none, or a value that somebody took away.
        begins = (self._zeros.partly | self._zeros.beside_none)[own.rows]
        none = own.rows[~own.valued[own.rows] & ((steps != 0) | ~known | begins)]
        rows = np.union1d(np.flatnonzero(own.valued), none)
        same_at, known_at = np.zeros(len(chunk), np.bool_), np.zeros(len(chunk), np.bool_)
        unknown = self._zeros.partly[rows] & ~own.valued[rows]
        same, value_known, bits = self._take_values(number, chunk, rows, unknown if unknown.any() else None)
        same_at[rows] = self._without_zeros(same, is_real, bits)
        known_at[rows] = value_known
        return same_at[own.rows], known_at[own.rows], is_real

    def _take_values(
        self, number: int, chunk: Chunk, rows: I64, unknown: Bool | None = None
    ) -> tuple[Bool, Bool, U64]:  # fmt: skip
        """Take what is in some rows, NULL too; return where it is as before, where that is known, and its bits."""
        column = self._variables[number].column
        cells = chunk.rows.cells(column, rows)
        known = cells.form != Form.NULL
        whole = self._zeros.whole
        begun = np.flatnonzero(whole & ~chunk.rows.filled(column)) if whole.any() else _NO_ROWS
        if len(begun):
            every = np.union1d(rows, begun)
            self._unknown.take(number, chunk, every, np.isin(every, rows[known], assume_unique=True))
        else:
            self._unknown.take(number, chunk, rows, known)
        if not len(rows):
            return known, known, cells.bits
        same, value_known = self._values.take(number, chunk, rows, cells, unknown)
        return same, value_known, cells.bits

    @staticmethod
    def _without_zeros(same: Bool, is_real: bool, bits: np.ndarray) -> Bool:
        """Return where values are the same: SQLite keeps no sign of a zero, so that may have changed."""
        return same & (bits << np.uint64(1) != 0) if is_real and same.any() else same

    def _look_for_restarts(
        self, chunk: Chunk, own: list[Stored | None], found: dict[int, dict[int, Zero]], notes: Notes
    ) -> None:
        row_before = -1
        for row, variables in found.items():
            if not variables:
                continue
            if self._start is not None and self._goes_on(own, row_before, row):
                self._close(notes)
            if self._start is not None and not self._start.variables.isdisjoint(variables):
                self._close(notes)
            if self._start is None:
                self._start = Start()
            self._start.take(
                ZeroRow(
                    int(chunk.rowid[row]), int(chunk.time_ns[row]), self._time_before(chunk, row),
                    bool(chunk.times.stamp[row]), row == 0 and chunk.begins_file, variables,
                )
            )  # fmt: skip
            row_before = row
            is_last = row == max(one.rows[-1] for one in own if one is not None and len(one.rows))
            if self._undecided is not None and is_last:
                continue
            if self._is_whole(self._start, own, row):
                self._tell_start(self._start, notes)
                self._start = None
        if self._start is not None and self._goes_on(own, row_before, len(chunk)):
            self._close(notes)

    def _goes_on(self, own: list[Stored | None], first: int, last: int) -> bool:
        """Return whether a variable that has not started anew is counted on between two rows."""
        assert self._start is not None
        for number, one in enumerate(own):
            if one is None or number in self._start.variables:
                continue
            between = one.rows[(one.rows > first) & (one.rows < last)]
            if len(between) and not self._zeros.found[between].all():
                return True
        return False

    def _is_whole(self, start: Start, own: list[Stored | None], row: int) -> bool:
        """Return whether every variable has started, up to a row; of one that never was stored, nobody waits for it."""
        missing = [number for number in range(len(self._variables)) if number not in start.variables]
        if not missing:
            return True
        if not self._seen_beginning or self._ever[missing].any():
            return False
        return not any((one := own[number]) is not None and (one.rows < row).any() for number in missing)

    def _decide(self, *, is_odd: bool) -> None:
        """Say of a start that waits whether its counter is wrong."""
        notes, self._undecided = self._undecided, None
        if notes is None or self._start is None:
            return
        if is_odd:
            self._close(notes)
            return
        self._tell_start(self._start, notes)
        self._start = None

    def _tell_start(self, start: Start, notes: Notes) -> None:
        if not start.was_known:
            return
        if start.begins_file:
            return
        self.restarts.append(start)
        notes.of(topics.RESTART).add(*_of(start.rows[0]))

    def _close(self, notes: Notes) -> None:
        """Judge rows that turned out to be no start."""
        start, self._start = self._start, None
        if start is None:
            return
        of_zero = {Zero.BACK: topics.BACK, Zero.STUCK: topics.STUCK, Zero.EQUAL: topics.EQUAL}
        for row in start.rows:
            for number, says in row.variables.items():
                if says in of_zero and not (row.begins_file and says is Zero.EQUAL):
                    notes.of(of_zero[says], number).add(*_of(row))


def _note(notes: Notes, topic: Topic, variable: int | None, chunk: Chunk, rows: I64, amount: I64 | None = None) -> None:
    if len(rows):
        notes.of(topic, variable).add(*_places(chunk, rows), amount)


def _places(chunk: Chunk, rows: I64) -> tuple[I64, I64, Bool]:
    return chunk.rowid[rows], chunk.time_ns[rows], chunk.times.stamp[rows] != 0


def _of(row: ZeroRow) -> tuple[I64, I64, Bool]:
    return np.array([row.rowid]), np.array([row.time_ns]), np.array([row.timed])
