"""Plan: sessions with the lists that their variables come from, the files that they go to, and when they are taken."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dissectors.batch import Bool
from nvscope.datalogger.configuration import Session
from nvscope.datalogger.database import Database, closed_files, table_of
from nvscope.datalogger.datalog import DataLog, interval_of
from nvscope.datalogger.instants import Cycles, Interval
from nvscope.datalogger.judging import Judge
from nvscope.datalogger.logged import Logged, Resolved, list_of_task, resolve, task_list
from nvscope.datalogger.session_log import Schedule, SessionLog
from nvscope.definition.layouts import Layouts
from nvscope.definition.project_datalogger import DataLoggerSettings
from nvscope.definition.selection import names_of_lists
from nvscope.errors import ConfigurationError, UsageError
from nvscope.list_key import ListKey
from nvscope.view.rows.defined import DefinedTelegrams

_APART_NS = 10_000_000
"""So far apart telegrams of one cycle may be where no interval of their list is known."""


@dataclass(frozen=True, slots=True)
class Planned:
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


@dataclass(frozen=True, slots=True)
class Targets:
    """Where sessions are written: to ``path`` in place of what one says, or all to a ``folder``, by their names."""

    path: str | None = None
    folder: str | None = None

    def of(self, session: Session) -> str:
        """Return the file of a session; '' of one in memory."""
        if session.volatile and self.path is None:
            return ""
        if self.path is not None:
            return self.path
        name = re.split(r"[/\\]", session.path)[-1]
        return os.path.join(self.folder, name) if self.folder is not None else session.path


def plan(
    sessions: Sequence[Session], layouts: Layouts, settings: DataLoggerSettings, targets: Targets, *, partly: bool
) -> list[Planned]:  # fmt: skip
    """Return how sessions are logged.

    ``partly``: variables that no list has are left out, as a controller does. Raises ConfigurationError, with file and
    line, for the first that cannot be found otherwise, and where nothing is left; UsageError where two sessions have
    one name, or one file.
    """
    planned = []
    for session in sessions:
        found = resolve(session, layouts, settings)
        if found.left_out and (not partly or not found.logged):
            raise _first(found)
        planned.append(
            _with_tasks(Planned(session, found.logged, found.left_out, targets.of(session)), layouts, settings)
        )
    _check_different(planned, "name", [one.session.name for one in planned])
    _check_different(planned, "file", [os.path.abspath(one.path) if one.path else "" for one in planned])
    return planned


def _check_different(planned: Sequence[Planned], what: str, told: Sequence[str]) -> None:
    """Raise UsageError where two sessions have the same."""
    seen: dict[str, Session] = {}
    for one, own in zip(planned, told, strict=True):
        if own and own in seen:
            raise UsageError(
                f"two sessions have the {what} {own}", where=str(one.session.position),
                next_step=f"the other one is configured in {seen[own].position.file}",
            )  # fmt: skip
        seen[own] = one.session


def _first(found: Resolved) -> ConfigurationError:
    first = found.left_out[0]
    more = len(found.left_out) - 1
    if not more:
        return first
    told = f"{first.next_step} {more} more {'is' if more == 1 else 'are'} not known either; --partly leaves them out."
    return ConfigurationError(first.what, where=first.where, next_step=told)


def _with_tasks(planned: Planned, layouts: Layouts, settings: DataLoggerSettings) -> Planned:
    session, logged = planned.session, planned.logged
    if session.task:
        return replace(planned, tasks=((task_list(session, logged, layouts, settings), None),))
    tasks = dict(settings.tasks)
    lists = names_of_lists(layouts)
    of_task: dict[str, list[int]] = {}
    for column, one in enumerate(logged):
        front = one.uri.rpartition("/")[0].rpartition("/")[2]
        if front in tasks:
            of_task.setdefault(front, []).append(column)
    if not of_task:
        return planned
    found: list[tuple[ListKey, Bool | None]] = []
    rest = np.ones(len(logged), np.bool_)
    for task, columns in of_task.items():
        mask = np.zeros(len(logged), np.bool_)
        mask[columns] = True
        rest &= ~mask
        found.append((next(iter(list_of_task(task, tasks, lists))), mask))
    return replace(planned, tasks=tuple(found), rest=rest if rest.any() else None)


def check_files(planned: Sequence[Planned], is_input: Callable[[str], bool], *, append: bool, force: bool) -> None:
    """Raise UsageError where a file exists that may not be written, or is an input."""
    for path in _existing(planned):
        if is_input(path):
            raise UsageError("the file is an input, and is not written to", where=path, next_step="name another one")
        if os.path.isdir(path):
            raise UsageError("is a directory", where=path, next_step="name a file in it, or the directory by --folder")
        if not append and not force:
            raise UsageError(
                "the file exists", where=path,
                next_step="--append goes on with it, --force takes its place; or name another one with -w",
            )  # fmt: skip


def remove_files(planned: Sequence[Planned]) -> None:
    """Remove the files that others take the place of."""
    for path in _existing(planned):
        os.unlink(path)


def _existing(planned: Sequence[Planned]) -> list[str]:
    paths = [path for one in planned if one.path for path in (one.path, *(own for _, own in closed_files(one.path)))]
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
            path = one.path or ":memory:"
            goes_on = append and os.path.exists(path)
            database = Database(one.session, table_of(one.session, one.logged), path, durable=durable)
            database.open(append=append)
            logs.append(
                SessionLog(
                    one.session, one.logged, _schedules(one, telegrams, judge), telegrams.places, telegrams.keys,
                    database, document_style=document_style, goes_on=goes_on,
                )
            )  # fmt: skip
    except BaseException:
        for log in logs:
            log.end()
        raise
    return DataLog(telegrams, logs, judge)


def _schedules(planned: Planned, telegrams: DefinedTelegrams, judge: Judge) -> list[Schedule]:
    if not planned.tasks:
        return [Schedule(Interval(planned.session.sampling_ns))]
    found = [Schedule(_cycles(key, telegrams, judge), columns) for key, columns in planned.tasks]
    if planned.rest is not None:
        found.append(Schedule(Interval(planned.session.sampling_ns), planned.rest))
    return found


def _cycles(key: ListKey, telegrams: DefinedTelegrams, judge: Judge) -> Cycles:
    number = telegrams.keys.index(key)
    own: Collection[int] = [place for place, one in enumerate(telegrams.places) if one.number == number]
    subindexes = [telegrams.places[place].layout.subindex for place in own]
    apart_ns = _APART_NS
    if max(subindexes, default=0):
        interval_ns = judge.least_ns.get(key) or interval_of(key, judge.judged().intervals_ns)
        apart_ns = interval_ns // 2 if interval_ns else _APART_NS
    return Cycles(sorted(own), subindexes, apart_ns)
