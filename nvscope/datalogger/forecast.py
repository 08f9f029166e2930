"""Forecast: what sessions would log, and how much of it a day."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dissectors.datalogger.leaves import leaves_of
from nvscope.datalogger.columns import TableColumns
from nvscope.datalogger.logged import Content
from nvscope.datalogger.plan import Planned
from nvscope.datalogger.rows import Rows
from nvscope.datalogger.texts import Texts
from nvscope.definition.variables import String
from nvscope.list_key import ListKey
from nvscope.units import count_of, data_size, duration
from nvscope.view.escape import visible

_DAY_NS = 86_400_000_000_000
_ROWS = 64
_MOST_SHOWN = 8


def forecast(planned: Sequence[Planned], intervals_ns: dict[ListKey, int]) -> Iterator[str]:
    """Yield lines that say of each session which rows it would write, where, and how large they are.

    ``intervals_ns`` are those of lists, as far as they are defined; 0 where a list has none.
    """
    for number, one in enumerate(planned):
        if number:
            yield ""
        yield from _of_session(one, intervals_ns)


def _of_session(planned: Planned, intervals_ns: dict[ListKey, int]) -> Iterator[str]:
    session = planned.session
    into = visible(planned.path or "memory")
    yield f"{visible(session.name)}: {count_of(len(planned.logged), 'variable')} into {into}"
    width = max(len(visible(one.uri)) for one in planned.logged[:_MOST_SHOWN])
    for one in planned.logged[:_MOST_SHOWN]:
        yield f"  {visible(one.uri):{width}}  {one.declared:8}  {visible(one.element)} of {one.key}"
    if len(planned.logged) > _MOST_SHOWN:
        yield f"  and {len(planned.logged) - _MOST_SHOWN} more"
    told = ["times as numbers" if session.raw else "times as texts", *["changes only"] * session.only_changes]
    row_bytes = row_size(planned)
    a_day = rows_a_day(planned, intervals_ns)
    yield f"  A row {_taken(planned)}, {row_bytes} bytes, {', '.join(told)}"
    if a_day is None:
        yield "  How many a day is not known: no definition says how often the list is sent"
    else:
        most = "At most " if session.only_changes else ""
        yield f"  {most}{count_of(a_day, 'row')} a day, {data_size(a_day * row_bytes)}"
    yield from _files(planned, row_bytes, a_day)
    lost = session.sets_a_publishing - session.capacity
    if not planned.tasks and lost > 0:
        yield (
            f"  The ring buffer is too small: {session.sets_a_publishing} data sets come in a publishInterval, and "
            f"bufferCapacity is {session.capacity}: {lost} of them are lost each time"
        )


def _taken(planned: Planned) -> str:
    every = f"every {duration(planned.session.sampling_ns)}"
    if not planned.tasks:
        return every
    cycles = f"in each cycle of {', '.join(str(key) for key, _ in planned.tasks)}"
    return cycles if planned.rest is None else f"{cycles}, and {every}"


def _files(planned: Planned, row_bytes: int, a_day: int | None) -> Iterator[str]:
    session = planned.session
    if session.max_bytes is None:
        yield "  One file that grows without end: maxFileSize is not said"
        return
    full = data_size(session.max_bytes)
    after = ""
    if a_day:
        after = f", every {duration(_DAY_NS * session.max_bytes // max(a_day * row_bytes, 1))}"
    if session.files == 1:
        yield f"  At {full}{after}, {session.delete_percent} % of the rows are deleted, the oldest ones"
    elif session.files is None:
        yield f"  At {full}{after}, another file is begun; all are kept"
    else:
        yield f"  At {full}{after}, another file is begun; {session.files} are kept"


def rows_a_day(planned: Planned, intervals_ns: dict[ListKey, int]) -> int | None:
    """Return how many rows are written a day at most, None where nobody knows how often a list is sent."""
    total = 0
    if not planned.tasks or planned.rest is not None:
        total += _DAY_NS // planned.session.sampling_ns
    for key, _ in planned.tasks:
        interval_ns = intervals_ns.get(key)
        if not interval_ns:
            return None
        total += _DAY_NS // interval_ns
    return total


def row_size(planned: Planned) -> int:
    """Return how large a row is in the file, whose numbers need all their bytes, and whose texts are half full."""
    session, logged, texts = planned.session, planned.logged, Texts()
    cells = np.zeros((_ROWS, len(logged)), np.int64)
    for column, one in enumerate(logged):
        if isinstance(one.type, String):
            half = np.full((_ROWS, one.type.size_bytes), ord("x"), np.uint8)
            half[:, one.type.size_bytes // 2 :] = 0
            cells[:, column] = texts.numbers(one.type, half)
        elif one.content is Content.REAL:
            size = one.type.size_bytes
            cells[:, column] = np.array([0.1], f"f{size}").view(f"i{size}")[0]
        else:
            cells[:, column] = (1 << 8 * one.type.size_bytes - 2) - 1
    counts = np.full(cells.shape, 1 << 16, np.int64)
    rows = Rows(np.zeros(_ROWS, np.int64), np.ones(_ROWS, np.bool_), cells, None, counts)
    columns = TableColumns(logged, texts, raw=session.raw, only_changes=session.only_changes, document_style=False).of(
        rows
    )
    leaves = leaves_of(columns, _ROWS)
    return leaves.size_bytes // _ROWS if leaves else cells.shape[1] * 8
