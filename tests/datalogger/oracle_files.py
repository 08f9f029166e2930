"""The files of a series, as the rules give them: rows written block by block, into files that SQLite says are full."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tests.datalogger.oracle import (
    DECLARED,
    EPOCH_TICKS,
    SECOND_NS,
    UTC_KIND,
    DefinedList,
    Row,
    Sample,
    Session,
    Value,
    behind_late,
    count_changes,
    counts_for,
    in_cycles,
    late,
    mark_losses,
    ring,
    samples,
    tasks_of,
)
from tests.datalogger.oracle_losses import Packet, losses
from tests.datalogger.oracle_standing import standing


class Recorder:
    """Records captures one after the other into one series of files, each as a run of its own.

    ``folder`` is for files that are written to know when they are full.
    """

    def __init__(self, session: Session, lists: Sequence[DefinedList], folder: Path) -> None:
        self.session = session
        self.lists = {one.index: one for one in lists}
        self.files = Files(session, lists, folder)
        self.not_taken = 0

    def take(self, packets: Sequence[Packet]) -> dict[str, list[Row]]:
        """Record a capture; return the rows of each file: '' is the current one, '.0' and so on are closed."""
        found = samples(packets, self.lists, self.session)
        count_changes(found)
        needed = {index for sample in found for index in sample.lists}
        intervals = {index: self.lists[index].interval_ns for index in needed}
        counting = [counts_for(packet, self.lists.get(packet.index)) for packet in packets]
        lost = losses(packets, intervals, counting, in_cycles(self.lists, tasks_of(self.session)))
        for task in tasks_of(self.session):
            for place in late(packets, self.lists[task]):
                # What is missing in front of it as well, is missing in front of the next one.
                (lost.get(place) or set()).discard(task)
            for place in behind_late(packets, self.lists[task]):
                if (lists := lost.setdefault(place, set())) is not None:
                    lists.add(task)
        mark_losses(found, lost)
        sampled = [sample for sample in found if sample.ring is not None]
        own = {index for sample in sampled for index in sample.lists}
        places, self.not_taken = standing(packets, [self.lists[index] for index in own], self.session.sampling_ns)
        mark_losses(sampled, dict.fromkeys(places))
        return self.files.write(ring(found, self.session.capacity))


class Files:
    """A series of files, written block by block."""

    def __init__(self, session: Session, lists: Sequence[DefinedList], folder: Path) -> None:
        self.session, self.names, self.path = session, sorted(session.variables), folder / "oracle.db"
        self.statement = create_table("log", session, lists)
        self.closed: dict[str, list[Row]] = {}
        self.begin()

    def begin(self) -> None:
        self.path.unlink(missing_ok=True)
        self.connection = sqlite3.connect(self.path, isolation_level=None)
        self.connection.execute("PRAGMA page_size = 4096")
        self.connection.execute("PRAGMA auto_vacuum = FULL")
        self.connection.execute("PRAGMA synchronous = OFF")
        self.connection.execute(self.statement)
        self.is_first_of_file = True

    def write(self, kept: Sequence[Sample]) -> dict[str, list[Row]]:
        """Write what a run has kept: its first row has all that is known, and nothing of what was before."""
        self.stored: dict[str, int] = {}
        self.zero: dict[str, int] = {}
        self.begun: set[frozenset[str]] = set()
        self.is_first_of_file = self.is_first_of_run = True
        self.had_rows = bool(self.rows())
        self.goes_on = self.had_rows or bool(self.closed)
        block: list[tuple[Value, ...]] = []
        lossy = False
        for sample in kept:
            lossy |= sample.lossy
            row = self.row(sample, lossy=lossy)
            if row is None:
                continue
            lossy = False
            block.append(row)
            if len(block) == self.session.write_interval:
                self.store(block)
                block = []
        if block:
            self.store(block)
        return {**self.closed, "": self.rows()}

    def row(self, sample: Sample, *, lossy: bool) -> tuple[Value, ...] | None:
        """Return the columns of a row; None if it would say nothing."""
        session = self.session
        changed = {name for name in sample.values if self.stored.get(name) != sample.counts[name]}
        if session.changes_only and not changed:
            return None
        if self.is_first_of_file:
            changed = set(sample.counts)
        consistent = int(self.is_consistent(sample, lossy=lossy))
        if self.is_first_of_run:
            # Counters of 0 tell of a new beginning, also those of what nobody knows yet.
            self.zero = {name: sample.counts.get(name, -1 if self.goes_on else 0) for name in self.names}
        starts_anew = self.is_first_of_run and self.goes_on
        columns: list[Value] = []
        for name in self.names:
            if not session.changes_only:
                columns.append(sample.values.get(name))
            elif name in changed:
                columns += [sample.known[name], sample.counts[name] - self.zero[name]]
            elif starts_anew:
                columns += [None, 0]
            elif name in sample.counts and session.document_style:
                columns += [None, sample.counts[name] - self.zero[name]]
            else:
                columns += [None, None]
        self.stored.update((name, sample.counts[name]) for name in sample.values)
        self.is_first_of_file = self.is_first_of_run = False
        self.begun.add(sample.names)
        return timestamp(sample.time_ns, iso=session.iso), consistent, *columns

    def is_consistent(self, sample: Sample, *, lossy: bool) -> bool:
        """Tell whether nothing was lost before a row: between two runs, nobody recorded anything."""
        session, every = self.session, set(self.names) <= set(sample.counts)
        if self.is_first_of_run and session.document_style:
            return False
        if not self.goes_on:
            return not lossy
        if not session.changes_only:
            return sample.names in self.begun and not lossy
        # A restart with all values says it by itself, but not where a file begins, which may only go on.
        return not lossy and (not self.is_first_of_run or (every and self.had_rows))

    def store(self, block: Sequence[tuple[Value, ...]]) -> None:
        """Write a block as one transaction, and make room where the file is full."""
        session = self.session
        self.connection.execute("BEGIN")
        marks = ", ".join("?" * len(block[0]))
        self.connection.executemany(f"INSERT INTO log VALUES ({marks})", block)
        self.connection.execute("COMMIT")
        if session.max_file_size is None or os.path.getsize(self.path) < session.max_file_size:
            return
        if session.rollover and session.max_files not in (0, 1):
            number = 1 + max((int(name[1:]) for name in self.closed), default=-1)
            self.closed[f".{number}"] = self.rows()
            while 0 < session.max_files <= len(self.closed):
                del self.closed[next(iter(self.closed))]
            self.connection.close()
            self.begin()
            return
        while os.path.getsize(self.path) >= session.max_file_size:
            (rows,) = self.connection.execute("SELECT count(*) FROM log").fetchone()
            if not rows:
                return
            oldest = max(1, rows * session.delete_ratio // 100)
            self.connection.execute(
                "DELETE FROM log WHERE rowid IN (SELECT rowid FROM log ORDER BY rowid LIMIT ?)", [oldest]
            )

    def rows(self) -> list[Row]:
        return rows_of(self.connection, "log")


def rows_of(connection: sqlite3.Connection, table: str) -> list[Row]:
    found = connection.execute(f'SELECT rowid, * FROM "{table}" ORDER BY rowid')
    return [Row(rowid, time, consistent, tuple(columns)) for rowid, time, consistent, *columns in found]


def declared(kind: str) -> str:
    return "TEXT" if "STRING" in kind else DECLARED[kind]


def create_table(name: str, session: Session, lists: Sequence[DefinedList]) -> str:
    """Return the statement that a controller's database has."""
    kinds = {(one.index, leaf): kind for one in lists for leaf, kind in one.fields}
    columns = [f'"Timestamp" {"TEXT" if session.iso else "INT"}, "ConsistentDataSeries" INT']
    for variable in sorted(session.variables):
        kind = declared(kinds[session.variables[variable]])
        value, count = (one.replace('"', '""') for one in (variable, variable + "_change_count"))
        columns.append(f'"{value}" {kind} DEFAULT NULL' + (f', "{count}" DEFAULT NULL' if session.changes_only else ""))
    return f"CREATE TABLE {name}( {','.join(columns)})"


def timestamp(time_ns: int, *, iso: bool) -> int | str:
    if not iso:
        return UTC_KIND | (time_ns // 100 + EPOCH_TICKS)
    seconds, rest = divmod(time_ns, SECOND_NS)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest // 1000:06d}"


def as_it_is(value: Any) -> tuple[str, Any]:
    """Return a value so that 1 is unlike 1.0, and 0.0 unlike -0.0."""
    return type(value).__name__, repr(value)
