"""Databases of DataLoggers as captures: a row is a packet, with the bytes of its record as they lie in the file.

Its time is that of its ``Timestamp``; rows of which none can be told are left out, and told. Rows of several tables
come in the order of their times.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, PAD_BYTES, U8, Bool, LinkType, PacketBatch
from dissectors.datalogger.logged import Logged, RowTable
from dissectors.datalogger.row_times import row_times
from nvscope.capture.can import sqlite_file
from nvscope.capture.can.on_disk import on_disk
from nvscope.capture.content import Content
from nvscope.capture.datalogger import database as databases
from nvscope.capture.datalogger.damage import Damage, Damages
from nvscope.capture.datalogger.database import NOTHING_YET, LogDatabase, NothingYet
from nvscope.capture.datalogger.names import is_newest, series_of, title_of
from nvscope.capture.datalogger.page_file import PageFile
from nvscope.capture.datalogger.schema import StoredTable
from nvscope.capture.datalogger.sql_records import as_records
from nvscope.capture.datalogger.table_rows import Rows
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Attachment, Source, SourceInfo, Truncation
from nvscope.capture.spans import BATCH_BYTES, stretches
from nvscope.capture.time_span import TIME_LIMIT_NS, TimeSpan
from nvscope.capture.timeline import Timeline
from nvscope.errors import UnreadableInput
from nvscope.units import count_of

_TELLING = '"ConsistentDataSeries"'
_MOST_NAMED = 5
_ROW_BYTES = 6
"""What a row takes in its page beside its record."""


def is_log(content: Content) -> bool:
    """Tell whether an SQLite file is a DataLogger's: by its tables, or, of what is not on disk, by its first bytes."""
    if not content.disk_path:
        return any(_TELLING.encode(encoding) in content.head for encoding in ("utf-8", "utf-16-le", "utf-16-be"))
    try:
        with databases.opened(content.disk_path):
            return True
    except NothingYet:
        return is_newest(content.disk_path)
    except UnreadableInput:
        return False


def tables_in(path: str) -> tuple[RowTable, ...]:
    """Return the tables of which a database holds rows, or may; none where it cannot be read."""
    try:
        with databases.opened(path) as database:
            return tuple(_row_table(path, database, table) for table in database.tables)
    except UnreadableInput:
        return ()


def _row_table(path: str, database: LogDatabase, table: StoredTable, part: int = 0) -> RowTable:
    encoding = database.encoding if table.by_pages else "utf-8"
    return RowTable(series_of(path), title_of(path), table.log, table.real, encoding, part)


class LogReader(Reader):
    """Reads one database: from its file on disk where it is one, else from a copy."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._pieces = iter(()) if content.disk_path else content.pieces()
        self._lost: list[str] = []
        self._first_at: int | None = None
        """Where the first page begins of which something cannot be read."""

    def batches(self) -> Iterator[PacketBatch]:
        """Yield the rows, those of each table in the order of their ids."""
        with on_disk(self.content.disk_path, self._pieces) as path:
            before = sqlite_file.state(path)
            try:
                yield from self._rows(path)
            except NothingYet:
                if not is_newest(self.content.disk_path):
                    raise
                self.progress.notes = (NOTHING_YET,)
                self._lost += filter(None, [self.place.missing])
            if sqlite_file.state(path) != before:
                self._lost.append("it changed while it was read: read it again when nobody writes to it")
        if self.content.disk_path:
            self.position = self.content.size_bytes or 0
        if self._lost:
            self.progress.left_out = "; ".join(self._lost)
            at = self.position if self._first_at is None else min(self.position, self._first_at)
            self.progress.truncation = Truncation(at, self.progress.left_out)

    def _rows(self, path: str) -> Iterator[PacketBatch]:
        with databases.opened(path) as database:
            self._tell_state(database, path)
            named, part = self.content.path, self.place.part
            tracks = [_Table(named, database, table, self.sizes, part) for table in database.tables]
            several = Timeline(tracks, batch_packets=self.sizes.batch_packets) if len(tracks) > 1 else tracks[0]
            for batch in several:
                if len(batch):
                    self.progress.frames += len(batch)
                    self._follow(batch)
                    yield replace(batch, ends=(), source=None, channel=None)
        for track in tracks:
            self._tell_table(track, database.file, name=track.table.log.name if len(tracks) > 1 else "")

    def _follow(self, batch: PacketBatch) -> None:
        """Tell how far the file is read: about as far as the rows that were read are long."""
        if self.content.disk_path:
            read_bytes = int(batch.captured.sum()) + _ROW_BYTES * len(batch)
            self.position = min(self.position + read_bytes, self.content.size_bytes or 0)

    def _tell_state(self, database: LogDatabase, path: str) -> None:
        """Tell what state the file is in: what is missing of it, or else what people may want to know."""
        lost = [
            *filter(None, [database.doubt.rstrip("."), database.file.header.flaw]),
            *self._told(database.damages, database.file),
        ]
        if self.place.missing:
            lost.insert(0, self.place.missing)
        if database.file.header.flaw or self.place.missing:
            self._first_at = 0
        notes = list(filter(None, [database.beside]))
        if database.file.pages_missing or (database.path == path and sqlite_file.left_beside(path)):
            lost[:0] = database.notes
        else:
            notes[:0] = database.notes
        self.progress.notes = tuple(notes)
        self._lost += lost

    def _told(self, damages: Iterable[Damage], file: PageFile) -> Iterator[str]:
        """Yield sentences on damage, and keep in mind where it begins."""
        for damage in damages:
            if 0 < damage.page <= file.pages + file.pages_missing:
                at = (damage.page - 1) * file.page_bytes
                self._first_at = at if self._first_at is None else min(at, self._first_at)
            yield damage.told(file.pages_missing)

    def _tell_table(self, track: _Table, file: PageFile, name: str) -> None:
        of = f" of table {name}" if name else ""
        self._lost += [f"{told}{of}" for told in self._told(track.damages, file)]
        if track.damages.left_out:
            self._lost.append(f"and {count_of(track.damages.left_out, 'place')} more{of} that cannot be read")
        if track.untimed:
            named = ", ".join(map(str, track.untimed_rows))
            what = count_of(track.untimed, "row")
            more = " …" if track.untimed > _MOST_NAMED else ""
            self._lost.append(f"{what}{of} without a time that can be read, left out (row id {named}{more})")


class _Table:
    """The rows of one table, as a track of a timeline."""

    channels: Sequence[str] = ()
    attachments: Sequence[Attachment] = ()
    infos: Sequence[SourceInfo] = ()

    def __init__(
        self, path: str, database: LogDatabase, table: StoredTable, sizes: ReadingSizes, part: int
    ) -> None:  # fmt: skip
        self.path = path
        self.table = table
        self.damages = Damages()
        self.untimed = 0
        self.untimed_rows: list[int] = []
        self._database = database
        self._sizes = sizes
        self._told = _row_table(path, database, table, part)
        self._breaks: list[int] = []
        """Row ids behind which rows cannot be read, and no row behind that has come yet."""
        self._is_behind_untimed = False

    def __iter__(self) -> Iterator[PacketBatch]:
        return self.read(1, TimeSpan())

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        raise NotImplementedError

    def stop(self) -> None:
        """The reader is stopped instead."""

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        """Yield the rows in the order of their ids."""
        for rows in self._database.rows(self.table, self.damages):
            if isinstance(rows, Rows):
                data, start, length = rows.data, rows.start, rows.length
            else:
                data, start, length = as_records(rows, self.table.log.columns)
            times = row_times(rows.cells(0), rows.data, self._told.encoding)
            kept = times.valid & (np.abs(times.time_ns) <= TIME_LIMIT_NS)
            unread = self._behind_unread(rows.rowid, kept)
            if not kept.all():
                self._leave_out(rows.rowid[~kept])
                start, length = start[kept], length[kept]
            if len(start):
                yield from self._batches(data, start, length, times.time_ns[kept], rows.rowid[kept], unread[kept])

    def _behind_unread(self, rowid: I64, kept: Bool) -> Bool:
        """Return in front of which rows others cannot be read: damaged ones, or such that have no time."""
        found = np.append(self._is_behind_untimed, ~kept[:-1])
        self._is_behind_untimed = not kept[-1]
        self._breaks += self.damages.breaks
        self.damages.breaks.clear()
        if self._breaks:
            places = np.searchsorted(rowid, np.array(self._breaks), "right")
            found[places[places < len(rowid)]] = True
            self._breaks = [
                row for row, place in zip(self._breaks, places.tolist(), strict=True) if place == len(rowid)
            ]
        return found

    def _leave_out(self, rowid: I64) -> None:
        self.untimed += len(rowid)
        self.untimed_rows += rowid[: _MOST_NAMED - len(self.untimed_rows)].tolist()

    def _batches(
        self, data: U8, start: I64, length: I64, time_ns: I64, rowid: I64, unread: Bool
    ) -> Iterator[PacketBatch]:  # fmt: skip
        if int((start + length).max()) + PAD_BYTES > len(data):
            data = np.concatenate([data, np.zeros(PAD_BYTES, np.uint8)])
        size = length.astype(np.int32)
        for part in stretches(length, self._sizes.batch_packets, BATCH_BYTES):
            yield PacketBatch(
                data, start[part], size[part], length[part], time_ns[part],
                PacketBatch.link_column(LinkType.DATABASE_ROW, len(rowid[part])),
                logged=Logged.of(self._told, rowid[part], unread[part]),
            )  # fmt: skip
