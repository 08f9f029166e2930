"""What rules watch of variables whose values come one by one: those of pages and of databases.

``visu/ADDRESS/NAME`` and ``db/FILE/NAME`` name them, with patterns. Which there are is known in the end: each gets a
watch of its own with its first value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64
from nvscope.analysis.read_values import ReadSource, meant, read_source
from nvscope.check.check import Setting
from nvscope.check.parameters import Unfit, near
from nvscope.check.variable_places import MOST_VARIABLES
from nvscope.check.variables import Values, VariableWatcher, Watch
from nvscope.definition.variables import Scalar, ScalarKind, String
from nvscope.engine.told import Told
from nvscope.expression.column_rows import picked
from nvscope.expression.typed_columns import Column, FieldType, TextColumn
from nvscope.name_patterns import fits
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.lasting import Lasted, LastingValue, RowsRead
from nvscope.tracker.readings.readings import Readings, ReadValues, ReadVariable, Wanted
from nvscope.view.fields.field import TelegramField

_OF_TYPES = ("variable", "values")
"""Keys of a rule that may fit variables of one type and not those of another."""


class ReadPlace(Struct, frozen=True):
    """A variable that is in no list; ``field`` says of what type its values are, and reads nothing."""

    name: str
    field: TelegramField
    list: None = None


def is_read(pattern: str) -> bool:
    """Tell whether a rule names variables whose values come one by one."""
    return read_source(pattern) is not None


def are_all_read(parameters: Mapping[str, Any]) -> bool:
    """Tell whether all variables of a rule are such ones, so that it needs no definitions."""
    named = parameters.get("variable") or ()
    return bool(named) and all(is_read(one) for one in named)


class RefusedWatch(Watch):
    """In place of a watch of a variable of which the rule cannot be asked, and why; ``vacuous``: there is none."""

    why: str = ""
    vacuous: bool = False

    def take(self, values: Values) -> None:
        """Judge nothing."""


class _Watched(Struct):
    """A variable and what watches it, and what it was where values last from row to row."""

    watch: Watch
    lasting: LastingValue = field(default_factory=LastingValue)


class _Reader(Struct):
    read: ReadValues
    watched: dict[int, _Watched | None] = field(default_factory=dict)


class ReadWatcher:
    """Watches such variables; ``make`` makes the watch of one.

    With ``lasting``, values of databases last from row to row, and are judged in each by their bits.
    """

    by_stream: ClassVar[bool] = False
    is_conditional = False

    def __init__(
        self, setting: Setting, patterns: Sequence[str], make: Callable[[ReadPlace], Watch], *, lasting: bool
    ) -> None:  # fmt: skip
        if setting.when:
            what = "values of pages and databases are judged at any time"
            raise Unfit(what, "when", next_step="leave when out, or name variables of lists")
        self._setting, self._make, self._lasting = setting, make, lasting
        try:
            make(ReadPlace("", _of_type(FieldType.REAL, "", "a number")))
        except Unfit as error:
            # What hangs on the type of a variable is known when that comes.
            if error.key not in _OF_TYPES:
                raise
        self._patterns = patterns
        self._wanted = _wanted(patterns)
        self._readers: dict[str, _Reader] = {}

    @property
    def watches(self) -> Sequence[Watch]:
        """What is known of each variable that came, in the order of their names, and which names nothing has."""
        known = [one for reader in self._readers.values() for one in reader.watched.values()]
        came = sorted((one.watch for one in known if one is not None), key=lambda one: one.place.name)
        return [*came, *self._nowhere()]

    def _nowhere(self) -> Iterator[RefusedWatch]:
        """Yield the names that stand for no variable, with those near to them."""
        for pattern in self._patterns:
            wanted = {source.name: one for source, one in meant(pattern).items() if one is not None}
            known = [(name, one) for name, reader in self._readers.items() for one in reader.read.known]
            if any(name in wanted and wanted[name](one) for name, one in known):
                continue
            names = dict.fromkeys(f"{one.list}/{one.name.rpartition('/')[2]}" for _, one in known)
            told = near(pattern, names)
            why = f"no variable is called so{f': {told}' if told else ''}"
            yield RefusedWatch(ReadPlace(pattern, _of_type(FieldType.REAL, "", "")), why=why, vacuous=True)

    def longest_judged_ns(self, since_ns: int, until_ns: int) -> int:
        """Return for how long it was to be judged without a break: always."""
        return until_ns - since_ns

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for source, wanted in self._wanted.items():
            part = told.parts.get(source.name)
            if part is None:
                continue
            reader = self._readers.get(source.name)
            if reader is None:
                reader = self._readers[source.name] = _Reader(source.read(wanted))
            lasts = self._lasting and isinstance(reader.read, RowsRead)
            for readings in reader.read.of(told, part):
                self._take(told, reader, readings, lasts=lasts)
            if lasts and isinstance(reader.read, RowsRead):
                self._fill(told, reader, reader.read)
        if told.is_deaf:
            for reader in self._readers.values():
                for one in reader.watched.values():
                    if one is not None:
                        one.watch.forget(None)
                        one.lasting.forget()

    def _take(self, told: Told, reader: _Reader, readings: Readings, *, lasts: bool) -> None:
        # What is unknown ends how long a value lasts, and is none that can be judged.
        told_of = readings.form != Form.NOTHING if lasts else readings.form > Form.NOTHING
        for number in np.flatnonzero(np.bincount(readings.variable)).tolist():
            own = self._watched(reader, number)
            rows = np.flatnonzero((readings.variable == number) & told_of)
            if own is None or not len(rows):
                continue
            rows = rows[np.argsort(readings.row[rows], kind="stable")]
            values = Lasted.of(readings, rows)
            if lasts:
                own.lasting.take(values)
            else:
                column = _column(own.watch.place.field.type, readings, rows)
                self._give(told, own.watch, values.row, column, values.stretch)

    def _fill(self, told: Told, reader: _Reader, read: RowsRead) -> None:
        """Give what values are in each row in which they are known: they last where only changes are stored."""
        for number, own in reader.watched.items():
            if own is None:
                continue
            known = own.lasting.fill(*read.rows_of(number))
            known = known.take(known.form > Form.NOTHING)
            if len(known.row):
                self._give(told, own.watch, known.row, known.bits.view(np.int64), known.stretch)

    def _give(self, told: Told, watch: Watch, row: I64, column: Column, stretch: I64) -> None:
        time_ns = told.packets.ts_ns[row]
        since_ns = self._setting.since_ns
        kept = np.arange(len(row)) if since_ns is None else np.flatnonzero(time_ns >= since_ns)
        if not len(kept):
            return
        watch.judged += len(kept)
        one_stream = np.zeros(len(kept), np.int64)
        # Whatever values there are: what is no number is told as that.
        with np.errstate(all="ignore"):
            watch.take(
                Values(
                    picked(column, kept), time_ns[kept], row[kept] + told.first_frame, one_stream, stretch[kept]
                )
            )  # fmt: skip

    def _watched(self, reader: _Reader, number: int) -> _Watched | None:
        """Return what watches a variable; None of one that is in no list of the rule, or beyond the limit."""
        if number in reader.watched:
            return reader.watched[number]
        variable = reader.read.known[number]
        own: _Watched | None = None
        lists = self._setting.lists
        room = sum(len(one.watched) for one in self._readers.values()) < MOST_VARIABLES
        if room and (not lists or any(fits(one, variable.list) for one in lists)):
            place = ReadPlace(f"{variable.list}/{variable.name}", _field(variable))
            try:
                own = _Watched(self._make(place))
            except Unfit as error:
                own = _Watched(RefusedWatch(place, why=error.what))
        reader.watched[number] = own
        return own


class BothWatcher:
    """Watches variables of lists, and such ones."""

    by_stream: ClassVar[bool] = True

    def __init__(self, of_lists: VariableWatcher, read: ReadWatcher) -> None:
        self._of_lists, self._read = of_lists, read

    @property
    def watches(self) -> Sequence[Watch]:
        """What is known of each variable."""
        return [*self._of_lists.watches, *self._read.watches]

    @property
    def is_conditional(self) -> bool:
        """Whether it is judged only at times."""
        return self._of_lists.is_conditional

    def longest_judged_ns(self, since_ns: int, until_ns: int) -> int:
        """Return for how long it was to be judged without a break."""
        return self._of_lists.longest_judged_ns(since_ns, until_ns)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self._of_lists.observe(told)
        self._read.observe(told)


def _wanted(patterns: Sequence[str]) -> Mapping[ReadSource, Wanted]:
    found: dict[ReadSource, list[Wanted]] = {}
    for pattern in patterns:
        for source, wanted in meant(pattern).items():
            if wanted is not None:
                found.setdefault(source, []).append(wanted)
    return {source: partial(_is_any, several) for source, several in found.items()}


def _is_any(several: Sequence[Wanted], variable: ReadVariable) -> bool:
    return any(wanted(variable) for wanted in several)


def _field(variable: ReadVariable) -> TelegramField:
    """Return a field of the type of a variable, which reads nothing."""
    kind = variable.kind_of(variable.usual_form, 0)
    if isinstance(kind, String):
        told = FieldType.TEXT
    elif not isinstance(kind, Scalar):
        told = FieldType.BYTES
    elif kind.kind is ScalarKind.REAL:
        told = FieldType.REAL
    elif kind.kind is ScalarKind.BOOL:
        told = FieldType.BOOL
    else:
        told = FieldType.SIGNED
    return _of_type(told, variable.name, variable.type or "of no type that is told")


def _of_type(told: FieldType, name: str, what: str) -> TelegramField:
    return TelegramField(name, told, name, what, _nothing)


def _nothing(_: Any) -> Column:
    raise NotImplementedError("values come one by one")


def _column(kind: FieldType, readings: Readings, rows: I64) -> Column:
    """Return values as a column of a type; what is no number in one of numbers is NaN."""
    form, bits = readings.form[rows], readings.bits[rows]
    if kind in (FieldType.TEXT, FieldType.BYTES):
        texts = [readings.text(place) for place in rows.tolist()]
        codes = {text: number for number, text in enumerate(dict.fromkeys(texts))}
        return TextColumn(np.array([codes[text] for text in texts], np.int64), tuple(codes))
    whole = form == Form.WHOLE
    if whole.all():
        numbers = bits.view(np.int64)
        return numbers.astype(np.bool_) if kind is FieldType.BOOL else numbers
    real = np.where(form == Form.REAL, bits.view(np.float64), np.nan)
    return np.where(whole, bits.view(np.int64).astype(np.float64), real)
