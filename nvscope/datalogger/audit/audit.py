"""An audit: series of databases read once, file by file, and what was found in them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from statistics import median_low
from typing import NamedTuple

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64
from nvscope import units
from nvscope.capture.can import sqlite_file
from nvscope.capture.datalogger.damage import Damage, Damages
from nvscope.capture.datalogger.database import NOTHING_YET, LogDatabase, NothingYet, opened
from nvscope.capture.datalogger.names import is_newest
from nvscope.capture.datalogger.schema import StoredTable
from nvscope.capture.datalogger.table_rows import Rows
from nvscope.datalogger.audit.chunk import Chunk, chunk_of
from nvscope.datalogger.audit.finding import MOST_FINDINGS, MOST_ROWS, Finding
from nvscope.datalogger.audit.grouping import Grouping
from nvscope.datalogger.audit.series import Member, Series, series_of
from nvscope.datalogger.audit.table_audit import TableAudit
from nvscope.errors import NvscopeError
from nvscope.findings.datalogger import CHANGES_MISSED, LOSS_NOT_TOLD, SERIES_BROKEN
from nvscope.findings.kind import Severity

Progress = Callable[[int], None]
"""Is told how many bytes have been read."""


class AuditedFile(Struct):
    """A file and what became of it: ``read``, ``damaged`` (as far as that went), or ``unreadable``."""

    path: str
    series: str
    number: int | None
    status: str = "read"
    size_bytes: int | None = None
    what: str = ""
    next_step: str = ""
    notes: list[str] = field(default_factory=list)
    pages_missing: int = 0
    flaw: str = ""
    damages: list[Damage] = field(default_factory=list)
    faults: int = 0
    rows: int = 0
    tables: int = 0
    first_ns: int | None = None
    last_ns: int | None = None

    @property
    def lasts_ns(self) -> tuple[int, int]:
        """The time from its first row to that of the next file, and the mean time from a row to the next."""
        span_ns = 0 if self.first_ns is None or self.last_ns is None else self.last_ns - self.first_ns
        step_ns = span_ns // max(self.rows - 1, 1)
        return span_ns + step_ns, step_ns

    def take_times(self, time_ns: I64) -> None:
        """Take the times of some rows."""
        if len(time_ns):
            first, last = int(time_ns.min()), int(time_ns.max())
            self.first_ns = first if self.first_ns is None else min(first, self.first_ns)
            self.last_ns = last if self.last_ns is None else max(last, self.last_ns)


class AuditedTable(Struct):
    """A table of a series, with all of its files."""

    series: str
    files: list[str]
    audit: TableAudit


class Audit(Struct):
    """All that an audit tells; ``left_out`` findings are not kept, ``unfit`` is why the configuration is another's.

    ``limits`` say where more may be missing than is told.
    """

    files: list[AuditedFile] = field(default_factory=list)
    tables: list[AuditedTable] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    left_out: int = 0
    notes: list[str] = field(default_factory=list)
    unfit: list[str] = field(default_factory=list)
    limits: list[str] = field(default_factory=list)

    def name_of(self, path: str) -> str:
        """Return how a file is called here: by its name alone where no other one has that, else by its path."""
        name = os.path.basename(path)
        alike = {one.path for one in self.files if os.path.basename(one.path) == name}
        return name if len(alike) < 2 else path

    def of(self, severity: Severity) -> list[Finding]:
        """Return the findings that are so bad."""
        return [one for one in self.findings if one.severity is severity]

    @property
    def is_unreadable(self) -> bool:
        """Whether nothing at all could be read."""
        return not any(one.status != "unreadable" for one in self.files)


def audited(
    paths: Sequence[str], asked_ns: int | None = None, progress: Progress | None = None,
    in_cycles: Callable[[str], bool] | None = None,
) -> Audit:  # fmt: skip
    """Return the audit of the series that paths name.

    ``asked_ns`` is the interval by the configuration. ``in_cycles`` tells by their names which variables it is not for:
    those that are taken in cycles of lists.
    """
    asked = _Asked(asked_ns, in_cycles)
    audit = Audit()
    audit.notes += [
        f"{path}: a folder in which no file is called *.db or *.db.0: name the database itself"
        for path in paths if os.path.isdir(path) and not series_of([path])
    ]  # fmt: skip
    for series in series_of(paths):
        reading = _Reading(series, asked, progress)
        reading.read()
        # Where tasks became known too late, or that files are out of order, rows are looked at again.
        found = {key: known for key, one in reading.tables.items() if (known := one.audit.needs_another_look)}
        apart = reading.out_of_order()
        if found or apart:
            reading = _Reading(series, asked, progress, found, apart)
            reading.read()
        if closed_ns := reading.closed_ns_lacking():
            reading = _Reading(series, asked, progress, found, apart | {series.members[-1].path})
            reading.tell_of_closed(closed_ns)
            reading.read()
        audit.files += reading.files
        audit.tables += reading.tables.values()
        audit.notes += _told_of(series)
        audit.limits += reading.limits()
        for finding in reading.findings():
            if len(audit.findings) < MOST_FINDINGS:
                audit.findings.append(finding)
            else:
                audit.left_out += 1
    audit.notes += audit.limits
    return audit


_BOTH_AGAIN = "Copy the database again together with what lies beside it, while nobody writes to them."

_Key = tuple[str, tuple[str, ...]]
"""A table by its name and columns."""


class _Asked(NamedTuple):
    """What was asked for, as far as that is known."""

    interval_ns: int | None
    in_cycles: Callable[[str], bool] | None


class _Reading:
    """Reads one series."""

    def __init__(
        self, series: Series, asked: _Asked, progress: Progress | None, known: dict[_Key, Grouping] | None = None,
        apart: frozenset[str] = frozenset(),
    ) -> None:  # fmt: skip
        self._series, self._asked, self._progress = series, asked, progress
        self._known, self._apart = known or {}, apart
        self.files: list[AuditedFile] = []
        self.tables: dict[_Key, AuditedTable] = {}
        self._stretches: dict[_Key, int] = {}
        self._of_files: list[Finding] = []
        self._in_file: set[_Key] = set()

    def read(self) -> None:
        """Read all files in their order."""
        for number in self._series.missing[:1]:
            self._tell_of_missing(number)
        for place, member in enumerate(self._series.members):
            if self._series.breaks_before(place) or member.path in self._apart:
                self._break_all()
            self._read_file(member)
        for one in self.tables.values():
            one.audit.decide()

    def out_of_order(self) -> frozenset[str]:
        """Return the files that need not go on with the one before: those beside files that overlap each other.

        Of two that do, either may be in the wrong place: the first need not follow what is in front of it, nor what is
        behind the second one that.
        """
        found: set[str] = set()
        for one in self.tables.values():
            numbers = {beside for number in one.audit.overlaps for beside in (number - 1, number + 1)}
            found.update(one.files[number] for number in numbers - one.audit.overlaps.keys() if number < len(one.files))
        return frozenset(found)

    def closed_ns_lacking(self) -> int:
        """Return how long nothing was logged in front of the newest file where a closed one lacks; 0 where none does.

        No number tells it. Yet what is lost anywhere is hardly ever lost just between two files, and for as long as a
        file lasts.
        """
        *before, last = self._series.members or (Member("", None),)
        told = {one.path: one for one in self.files}
        closed = [told[one.path] for one in before]
        if not closed or last.number is not None or last.path in self._apart:
            return 0
        newest, end_ns = told[last.path], closed[-1].last_ns
        if newest.first_ns is None or end_ns is None or any(one.status != "read" for one in (closed[-1], newest)):
            return 0
        usual_ns, step_ns = median_low([one.lasts_ns for one in closed])
        length_ns = newest.first_ns - end_ns
        if not usual_ns or (length_ns - step_ns) * 10 < usual_ns * 9:
            return 0
        return length_ns if any(one.audit.lacks_in_front_of(last.path) for one in self.tables.values()) else 0

    def tell_of_closed(self, length_ns: int) -> None:
        """Tell that a closed file lacks in front of the newest one."""
        before, last = (os.path.basename(one.path) for one in self._series.members[-2:])
        number = self._series.members[-2].number or 0
        what = (
            f"A closed file behind {before} is missing: {units.duration(length_ns)} lie between it and {last}, as long "
            "as a file lasts, and nothing says so."
        )
        hint = f"Look for it on the controller. If there is none, find out why nothing was logged from {before} on."
        path = f"{self._series.path}.{number + 1}"
        self._of_files.append(Finding(SERIES_BROKEN, SERIES_BROKEN.severity, what, path, hint=hint))

    def findings(self) -> Iterator[Finding]:
        """Yield what was found: of files first, then of tables."""
        yield from self._of_files
        for one in self.tables.values():
            yield from map(self._with_doubt, one.audit.end())

    def limits(self) -> Iterator[str]:
        """Yield in which tables rows may be missing that are not told, since there were too many to keep."""
        for one in self.tables.values():
            if one.audit.may_lack:
                name = f"{os.path.basename(one.files[0])}, {one.audit.table.name}"
                yield (
                    f"{name}: so many rows came later than others that some were judged by those in front of them "
                    "alone: more may be missing there than is told"
                )

    def _with_doubt(self, finding: Finding) -> Finding:
        """Let what is missing in front of the newest file ask for a closed one: of the last one, no number tells."""
        *before, last = self._series.members or (Member("", None),)
        if not before or last.number is not None or (finding.file, finding.rows[:1]) != (last.path, (1,)):
            return finding
        if finding.kind not in (LOSS_NOT_TOLD, CHANGES_MISSED):
            return finding
        closed = os.path.basename(before[-1].path)
        doubt = f"If there was a closed file behind {closed}, it is missing: look for it first."
        return replace(finding, hint=f"{finding.next_step} {doubt}")

    def _read_file(self, member: Member) -> None:
        told = AuditedFile(member.path, self._series.path, member.number)
        self.files.append(told)
        before = sqlite_file.state(member.path)
        try:
            told.size_bytes = os.path.getsize(member.path)
            with opened(member.path) as database:
                told.notes += filter(None, [*database.notes, database.beside])
                if database.doubt:
                    self._of_files.append(
                        Finding(SERIES_BROKEN, Severity.WARNING, database.doubt, told.path, hint=_BOTH_AGAIN)
                    )
                self._read_tables(database, told)
        except OSError as error:
            self._cannot(told, error.strerror or str(error), "check the name and who may read it")
        except NothingYet as error:
            if member.number is None and is_newest(member.path):
                told.notes.append(NOTHING_YET)
            else:
                self._cannot(told, error.what, error.next_step)
        except NvscopeError as error:
            self._cannot(told, error.what, error.next_step)
        changed = sqlite_file.state(member.path) != before
        if changed:
            told.notes.append("it was written while it was read: audit it again, or a copy of it")
        if told.status == "damaged" and not changed:
            self._of_files.append(_damaged(told))

    def _cannot(self, told: AuditedFile, what: str, next_step: str) -> None:
        told.status, told.what, told.next_step = "unreadable", what, next_step
        self._break_all()
        self._of_files.append(
            Finding(SERIES_BROKEN, SERIES_BROKEN.severity, f"It cannot be read: {what}.", told.path)
        )  # fmt: skip

    def _tell_of_missing(self, number: int) -> None:
        missing = self._series.missing
        names = ", ".join(units.ranges(missing))
        what = f"File {names} of the series is" if len(missing) == 1 else f"Files {names} of the series are"
        path = f"{self._series.path}.{number}"
        self._of_files.append(
            Finding(SERIES_BROKEN, SERIES_BROKEN.severity, f"{what} missing.", path, count=len(missing))
        )  # fmt: skip

    def _break_all(self) -> None:
        for key in self._stretches:
            self._stretches[key] += 1

    def _read_tables(self, database: LogDatabase, told: AuditedFile) -> None:
        faults = len(database.damages)
        told.damages += database.damages
        for stored in database.tables:
            told.tables += 1
            damages = Damages()
            self._read_table(database, stored, damages, told)
            told.damages += damages
            faults += damages.count
        told.faults, told.pages_missing = faults, database.file.pages_missing
        told.flaw = database.file.header.flaw
        if faults or database.file.pages_missing or told.flaw:
            told.status = "damaged"
            told.faults = max(faults, 1)

    def _read_table(self, database: LogDatabase, stored: StoredTable, damages: Damages, told: AuditedFile) -> None:
        key = stored.log.name, stored.columns
        if key not in self.tables:
            asked = self._asked
            log = TableAudit(stored.log, database.encoding, asked.interval_ns, self._known.get(key), asked.in_cycles)
            self.tables[key] = AuditedTable(self._series.path, [], log)
            self._stretches[key] = 0
        table = self.tables[key]
        begins = told.path not in table.files
        if begins and table.files and table.files[-1] != self.files[-2].path:
            # What a file that has no such table should hold is not known.
            self._stretches[key] += 1
        table.files.append(told.path)
        encoding = database.encoding if stored.by_pages else "utf-8"
        table.audit.begin_file(told.path, encoding)
        waiting: list[int] = []
        for rows in database.rows(stored, damages):
            if begins and len(table.files) > 1 and isinstance(rows, Rows) and rows.rowid[0] > 1:
                # Its oldest rows were deleted, as is configured where no file follows a full one.
                self._stretches[key] += 1
            waiting += damages.breaks
            damages.breaks.clear()
            last = int(rows.rowid[-1])
            breaks: I64 = np.array([row for row in waiting if row < last], np.int64)
            waiting = [row for row in waiting if row >= last]
            chunk: Chunk = chunk_of(rows, encoding, breaks, self._stretches[key], begins)
            self._stretches[key] = int(chunk.stretch[-1])
            table.audit.take(chunk)
            told.take_times(chunk.time_ns[chunk.times.valid])
            told.rows += len(rows)
            begins = False
            if self._progress is not None:
                self._progress(len(rows.data))
        table.audit.end_file(damaged=damages.count > 0)
        if waiting or damages.breaks:
            self._stretches[key] += 1


def _damaged(told: AuditedFile) -> Finding:
    """Return what is said of a damaged file, with the rows that are lost if all of these have ids."""
    lost = sum(damage.row_count for damage in told.damages)
    named = lost and all(damage.row_count for damage in told.damages)
    rows = tuple(row for damage in told.damages for row in damage.rows)[:MOST_ROWS] if named else ()
    count = lost if named else told.faults
    return Finding(SERIES_BROKEN, SERIES_BROKEN.severity, _in_words(told), told.path, count=count, rows=rows)


def _in_words(told: AuditedFile) -> str:
    parts = [next((note for note in told.notes if note.startswith("cut short")), "damaged")]
    if told.flaw:
        parts.append(f"{told.flaw}; SQLite refuses the file")
    if told.damages:
        parts.append(told.damages[0].told(told.pages_missing))
    named = told.damages[0].pages if told.damages else 0
    more = f"; {units.count_of(told.faults, 'fault')} in all" if told.faults > max(named, 1) else ""
    sentence = f"{': '.join(parts)}{more}."
    return sentence[0].upper() + sentence[1:]


def _told_of(series: Series) -> list[str]:
    name = os.path.basename(series.path)
    if series.is_without_newest:
        last = os.path.basename(series.members[-1].path)
        why = f"its logger had only closed {last} and not begun another file yet, or somebody took it away"
        return [f"{name} is not there: {why}", *_taken_along(series, name)]
    if series.taken_along:
        return _taken_along(series, name)
    if series.left:
        others = units.count_of(series.left, "other closed file")
        return [f"{others} of its series lie{'s' if series.left == 1 else ''} beside: name {name} to have all of them"]
    return []


def _taken_along(series: Series, name: str) -> list[str]:
    return [f"{units.count_of(series.taken_along, 'closed file')} of {name} taken along"] if series.taken_along else []
