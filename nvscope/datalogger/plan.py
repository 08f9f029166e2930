"""Plan: sessions with the lists that their variables come from, the files that they go to, and when they are taken."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Hashable, Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import Bool
from dissectors.datalogger.tables import LogTable
from nvscope.capture.datalogger.names import BESIDE, LOCK, closed_files, closed_names
from nvscope.datalogger.column_names import next_step_of, taken_names
from nvscope.datalogger.configuration import Session
from nvscope.datalogger.database import IN_MEMORY, Database, table_of
from nvscope.datalogger.datalog import DataLog, interval_of
from nvscope.datalogger.existing import unlike_logger
from nvscope.datalogger.instants import Cycles, Interval
from nvscope.datalogger.judging import Judge
from nvscope.datalogger.logged import Logged, Resolved, list_of_task, near_name, resolve, task_list
from nvscope.datalogger.passed_cycles import sent_whole
from nvscope.datalogger.session_log import Schedule, SessionLog
from nvscope.datalogger.set_aside import SetAside
from nvscope.definition.layouts import Layouts
from nvscope.definition.position import Position
from nvscope.definition.project_datalogger import DataLoggerSettings
from nvscope.definition.selection import names_of_lists
from nvscope.errors import ConfigurationError, UsageError
from nvscope.list_key import ListKey
from nvscope.view.rows.defined import DefinedTelegrams
from nvscope.whole_files import identity_of

_MOST_TOLD = 10
"""So many variables that are not known are told, each with its place."""

_LEAVE_OUT = "--partly leaves out what is not known."

_APART_NS = 10_000_000
"""So far apart telegrams of one cycle may be where no interval of their list is known."""


class Planned(Struct, frozen=True):
    """A session that can be logged; ``tasks`` are lists with the columns that are taken in each of their cycles.

    Without any, all are taken in an interval; ``rest`` are those that are, beside tasks; None for none.
    """

    session: Session
    logged: tuple[Logged, ...]
    left_out: tuple[ConfigurationError, ...]
    path: str
    tasks: tuple[tuple[ListKey, Bool | None], ...] = ()
    rest: Bool | None = None

    @property
    def keys(self) -> set[ListKey]:
        """The lists that it needs."""
        return {one.key for one in self.logged} | {key for key, _ in self.tasks}

    def in_order_of(self, table: LogTable) -> Planned:
        """Return it with its variables in the order of a table, which has them all."""
        place = {one.uri: place for place, one in enumerate(self.logged)}
        order = [place[one.name] for one in table.variables]
        tasks = tuple((key, None if columns is None else columns[order]) for key, columns in self.tasks)
        rest = None if self.rest is None else self.rest[order]
        return replace(self, logged=tuple(self.logged[one] for one in order), tasks=tasks, rest=rest)

    @property
    def deletes_oldest(self) -> bool:
        """Whether rows make room where it is full, and no other file is begun; so it is in memory."""
        return self.session.files == 1 or not self.path


class Targets(Struct, frozen=True):
    """Where sessions are written: to ``path`` in place of what one says, or all to a ``folder``, by their names."""

    path: str | None = None
    folder: str | None = None

    def of(self, session: Session) -> str:
        """Return the file of a session; '' of one in memory."""
        if session.volatile and self.path is None:
            return ""
        if self.path is not None:
            path = self.path
        elif self.folder is not None:
            path = os.path.join(self.folder, re.split(r"[/\\]", session.path)[-1])
        else:
            path = session.path
        # What means memory to SQLite is a file here.
        return os.path.join(os.curdir, path) if path == IN_MEMORY else path


def plan(
    sessions: Sequence[Session], layouts: Layouts, settings: DataLoggerSettings, targets: Targets, *, partly: bool
) -> list[Planned]:  # fmt: skip
    """Return how sessions are logged.

    ``partly``: variables that no list has are left out, as a controller does. Raises ConfigurationError, with file and
    line, for the first that cannot be found otherwise, and where nothing is left; UsageError where two sessions have
    one name, or one file, and where a column has two meanings.
    """
    planned = []
    for session in sessions:
        found = resolve(session, layouts, settings)
        if found.left_out and (not partly or not found.logged):
            raise _first(found, partly=partly)
        _check_columns(session, found.logged)
        planned.append(
            _with_tasks(Planned(session, found.logged, found.left_out, targets.of(session)), layouts, settings)
        )
    _check_different(planned, "name", [one.session.name for one in planned])
    files = [os.path.realpath(one.path) if one.path else "" for one in planned]
    _check_different(planned, "file", files)
    # Two links to one file, whose writers would not know of each other.
    links = [identity_of(file) if file else None for file in files]
    _check_different(planned, "file", files, links)
    for one, file in zip(planned, files, strict=True):
        if file.endswith(LOCK):
            raise UsageError(
                f"{os.path.basename(file)}: files of such names keep loggers apart, and hold nothing",
                where=str(one.session.position), next_step="write it to a file of another name",
            )  # fmt: skip
        taken = {f"{file}{suffix}" for suffix in BESIDE} if one.path else set()
        if one.session.files != 1:
            taken |= {path for _, path in closed_names(file, files)}
        for other, path in zip(planned, files, strict=True):
            if path in taken:
                raise UsageError(
                    f"a file of the session {one.session.name} may have the name {path}",
                    where=str(other.session.position), next_step="write this one to a file of another name",
                )  # fmt: skip
    return planned


def near_tasks(sessions: Sequence[Session], settings: DataLoggerSettings) -> list[str]:
    """Return sentences on tasks of the project that no variable names, though some name a task that is near.

    These are taken in an interval, which may be meant so.
    """
    fronts = [one.uri.rpartition("/")[0].rpartition("/")[2] for session in sessions for one in session.variables]
    used = {*filter(None, fronts), *(session.task for session in sessions)}
    others = used - {task for task, _ in settings.tasks}
    near = {task: near_name(task, others) for task, _ in settings.tasks if task not in used}
    return [
        f"[datalogger.tasks] '{task}': no variable is of this task; some are of '{other}', and taken in an interval"
        for task, other in near.items() if other
    ]  # fmt: skip


def _check_columns(session: Session, logged: Sequence[Logged]) -> None:
    """Raise ConfigurationError where a variable is called like another column of its table, in any case of letters."""
    uris = [one.uri for one in logged]
    taken = taken_names(uris)
    for variable in session.variables:
        if variable.uri in uris and variable.uri.lower() in taken:
            raise ConfigurationError(
                f"Variable, attribute name: '{variable.uri}' is what another column of the database is called",
                where=str(variable.position), next_step=next_step_of(variable.uri),
            )  # fmt: skip


def _check_different(
    planned: Sequence[Planned], what: str, told: Sequence[str], known: Sequence[Hashable] | None = None
) -> None:  # fmt: skip
    """Raise UsageError where two sessions have the same, by what is told of it, or is known to be it."""
    seen: dict[Hashable, Session] = {}
    for one, text, own in zip(planned, told, told if known is None else known, strict=True):
        if own and own in seen:
            raise UsageError(
                f"two sessions have the {what} {text}", where=str(_place_of(one.session, what)),
                next_step=f"the other one is configured in {seen[own].position.file}",
            )  # fmt: skip
        seen[own] = one.session


def _place_of(session: Session, what: str) -> Position:
    """Return where a session says what its name is, or its file."""
    return session.places.get("name" if what == "name" else "path", session.position)


def _first(found: Resolved, *, partly: bool) -> ConfigurationError:
    first = found.left_out[0]
    more = len(found.left_out) - 1
    if partly:
        none = f"none of the {more + 1} variables is known" if more else "the only variable is not known"
        what = f"{none}, and nothing is left to log: {first.what}"
        return ConfigurationError(what, where=first.where, next_step=first.next_step)
    if not more:
        return first
    others = [*found.left_out[1:_MOST_TOLD]]
    last = others[-1]
    told = [f"and {more + 1 - _MOST_TOLD} more"] if more >= _MOST_TOLD else []
    next_step = " ".join([last.next_step, *(f"{one} are not known either." for one in told), _LEAVE_OUT])
    others[-1] = ConfigurationError(last.what, where=last.where, next_step=next_step)
    return ConfigurationError(first.what, where=first.where, next_step=first.next_step, others=others)


def _with_tasks(planned: Planned, layouts: Layouts, settings: DataLoggerSettings) -> Planned:
    session, logged = planned.session, planned.logged
    if session.task:
        return replace(planned, tasks=((task_list(session, logged, layouts, settings), None),))
    lists = names_of_lists(layouts)
    of_task: dict[str, list[int]] = {}
    for column, one in enumerate(logged):
        if (task := settings.task_of(one.uri)) is not None:
            of_task.setdefault(task, []).append(column)
    if not of_task:
        return planned
    found: list[tuple[ListKey, Bool | None]] = []
    rest = np.ones(len(logged), np.bool_)
    for task, columns in of_task.items():
        mask = np.zeros(len(logged), np.bool_)
        mask[columns] = True
        rest &= ~mask
        found.append((next(iter(list_of_task(task, settings, lists))), mask))
    return replace(planned, tasks=tuple(found), rest=rest if rest.any() else None)


def check_names(planned: Sequence[Planned], is_input: Callable[[str], bool]) -> None:
    """Raise UsageError where one of the files to be written is an input, or there is something else than a file."""
    for path in _existing(planned):
        if is_input(path):
            raise UsageError("the file is an input, and is not written to", where=path, next_step="name another one")
        if os.path.isdir(path):
            raise UsageError("is a directory", where=path, next_step="name a file in it, or the directory by --folder")
        if os.path.exists(path) and not os.path.isfile(path):
            raise UsageError("is no file", where=path, next_step="name one")


def check_leave(planned: Sequence[Planned], *, append: bool, force: bool) -> None:
    """Raise UsageError where there is a file without leave to write it; nobody else must be about to make one."""
    for one in planned:
        for path in _existing([one]):
            if not append and not force:
                raise UsageError(
                    "the file exists", where=path,
                    next_step="--append goes on with it, --force takes its place; or name another one with -w",
                )  # fmt: skip
            if path != one.path and (what := unlike_logger(path)):
                series = os.path.basename(one.path)
                raise UsageError(
                    f"it has the name of a closed file of {series}, and is no whole database of a DataLogger: {what}",
                    where=path, next_step=f"move it to another folder, or give it a name that does not begin with "
                    f"{series}.; or log to a file of another name with -w: closed files are gone on with, and removed "
                    "when they are too many",
                )  # fmt: skip


def set_aside(planned: Sequence[Planned]) -> SetAside:
    """Set aside the files that others take the place of, at which ``check_leave`` has looked."""
    return SetAside([one.path for one in planned if one.path], _files_of)


def _existing(planned: Sequence[Planned]) -> list[str]:
    return [path for one in planned if one.path for path in _files_of(one.path)]


def _files_of(database: str) -> list[str]:
    """Return the files of a database that there are: its own, and those that were closed."""
    paths = (database, *(own for _, own in closed_files(database)))
    return [path for path in paths if os.path.lexists(path)]


def data_log(
    planned: Sequence[Planned], layouts: Layouts, judge: Judge, *, append: bool, durable: bool, document_style: bool
) -> DataLog:
    """Return what logs sessions, with their files open.

    Raises CaptureError and UsageError where one of the files cannot be written; then none is left open.
    """
    telegrams = DefinedTelegrams(layouts, keys=sorted(set().union(*(one.keys for one in planned))))
    logs: list[SessionLog] = []
    try:
        for one in planned:
            path = one.path or IN_MEMORY
            database = Database(one.session, table_of(one.session, one.logged), path, durable=durable)
            database.open(append=append)
            own = one.in_order_of(database.table)
            logs.append(
                SessionLog(
                    own.session, own.logged, _schedules(own, telegrams, judge), telegrams.places, telegrams.keys,
                    database, document_style=document_style,
                )
            )  # fmt: skip
    except BaseException:
        for log in logs:
            log.end()
        raise
    return DataLog(telegrams, logs, judge, sent_whole(layouts, telegrams.keys))


def _schedules(planned: Planned, telegrams: DefinedTelegrams, judge: Judge) -> list[Schedule]:
    def keys_of(columns: Bool | None) -> frozenset[ListKey]:
        return frozenset(one.key for place, one in enumerate(planned.logged) if columns is None or columns[place])

    interval_ns = planned.session.sampling_ns
    if not planned.tasks:
        return [Schedule(Interval(interval_ns), keys_of(None))]
    # A telegram of its list that a task lacks is a row that it lacks, whatever list its variables come from.
    found = [Schedule(_cycles(key, telegrams, judge), keys_of(own) | {key}, own) for key, own in planned.tasks]
    if planned.rest is not None:
        found.append(Schedule(Interval(interval_ns), keys_of(planned.rest), planned.rest))
    return found


def _cycles(key: ListKey, telegrams: DefinedTelegrams, judge: Judge) -> Cycles:
    number = telegrams.keys.index(key)
    own: Collection[int] = [place for place, one in enumerate(telegrams.places) if one.number == number]
    subindexes = {telegrams.places[place].layout.subindex for place in own}
    is_open = any(telegrams.places[place].rest is not None for place in own)
    apart_ns = _APART_NS
    if len(subindexes) > 1 or is_open:
        interval_ns = judge.least_ns.get(key) or interval_of(key, judge.judged().intervals_ns)
        apart_ns = interval_ns // 2 if interval_ns else _APART_NS
    sends_all = all(telegrams.places[place].layout.list.is_sent_whole for place in own)
    return Cycles(sorted(own), subindexes, apart_ns, is_open=is_open, sends_all=sends_all)
