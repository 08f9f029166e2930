"""Forecast: what sessions would log, and how much of it a day."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence

from nvscope.datalogger.growth import Growth, growth
from nvscope.datalogger.plan import Planned
from nvscope.list_key import ListKey
from nvscope.units import count_of, data_size, duration
from nvscope.view.escape import visible

_DAY_NS = 86_400_000_000_000


def forecast(
    planned: Sequence[Planned], intervals_ns: dict[ListKey, int], refused: Callable[[Planned], str], *,
    append: bool = False,
) -> Iterator[str]:  # fmt: skip
    """Yield lines that say of each session which rows it would write, where, and how large they are.

    ``intervals_ns`` are those of lists, as far as they are defined; 0 where a list has none. ``refused`` says why a
    session would not begin, '' where it would. ``append``: what there is of a file takes a part of its room.
    """
    for number, one in enumerate(planned):
        if number:
            yield ""
        why = refused(one)
        yield from _of_session(one, intervals_ns, _size_of(one.path) if append and not why else 0, why)


def _size_of(path: str) -> int:
    return os.path.getsize(path) if path and os.path.isfile(path) else 0


def _of_session(planned: Planned, intervals_ns: dict[ListKey, int], there_bytes: int, why: str) -> Iterator[str]:
    session = planned.session
    into = visible(planned.path or "memory")
    yield f"{visible(session.name)}: {count_of(len(planned.logged), 'variable')} into {into}"
    if why:
        yield f"  It would be refused as it is: {visible(why)}"
    told = ["times as numbers" if session.raw else "times as texts", *["changes only"] * session.only_changes]
    grows = growth(planned)
    a_day = rows_a_day(planned, intervals_ns)
    yield f"  A row {_taken(planned)}, about {math.ceil(grows.row_bytes)} bytes, {', '.join(told)}"
    if a_day is None:
        yield "  How many a day is not known: no definition says how often the list is sent"
    else:
        most = "At most " if session.only_changes else ""
        yield f"  {most}{count_of(a_day, 'row')} a day, {data_size(math.ceil(a_day * grows.row_bytes))}"
    yield from _full(planned, grows, a_day, there_bytes)
    if folder := missing_folder(planned.path):
        yield f"  Its folder does not exist, and none is made: {visible(folder)}"
    lost = session.sets_a_publishing - session.capacity
    if not planned.tasks and lost > 0:
        yield (
            f"  The ring buffer is too small: {session.sets_a_publishing} data sets come in a publishInterval, and "
            f"bufferCapacity is {session.capacity}: {lost} of them {'is' if lost == 1 else 'are'} lost each time"
        )
    width = max(len(visible(one.uri)) for one in planned.logged)
    for one in planned.logged:
        yield f"  {visible(one.uri):{width}}  {one.declared:8}  {visible(one.element)} of {one.key}"


def missing_folder(path: str) -> str:
    """Return the folder of a file that is to be made, '' where that is there."""
    folder = os.path.dirname(path)
    return "" if os.path.isdir(folder or os.curdir) else folder


def _taken(planned: Planned) -> str:
    every = f"every {duration(planned.session.sampling_ns)}"
    if not planned.tasks:
        return every
    cycles = f"in each cycle of {', '.join(str(key) for key, _ in planned.tasks)}"
    return cycles if planned.rest is None else f"{cycles}, and {every}"


def _full(planned: Planned, grows: Growth, a_day: int | None, there_bytes: int) -> Iterator[str]:
    session = planned.session
    if there_bytes:
        yield f"  {data_size(there_bytes)} are there, which it goes on with"
    if session.max_bytes is None:
        yield f"  {'One file' if planned.path else 'It'} grows without end: maxFileSize is not said"
        return
    full = data_size(session.max_bytes)
    every = first = _time_until(planned, grows, a_day, session.max_bytes)
    if there_bytes:
        left_bytes = grows.empty_bytes + session.max_bytes - there_bytes
        is_full = there_bytes >= session.max_bytes
        first = "the first block" if is_full else _time_until(planned, grows, a_day, left_bytes)
    if planned.deletes_oldest:
        after = f", first after {first}" if first else ""
        whose = "those of earlier runs first, of whatever table" if there_bytes else "the oldest ones"
        yield f"  At {full}{after}, {session.delete_percent} % of the rows are deleted, {whose}"
        return
    when = ", ".join(
        [*([f"first after {first}"] if there_bytes and first else []), *([f"every {every}"] if every else [])]
    )
    kept = "all" if session.files is None else session.files
    yield f"  At {full}{', ' if when else ''}{when}, another file is begun; {kept} are kept"


def _time_until(planned: Planned, grows: Growth, a_day: int | None, size_bytes: int) -> str:
    """Return how long it takes until a database is so large, '' where nobody knows."""
    if not a_day:
        return ""
    # It is looked at behind each block.
    rows = -(-grows.rows_until(size_bytes) // planned.session.block_rows) * planned.session.block_rows
    return duration(_DAY_NS * rows // a_day)


def rows_a_day(planned: Planned, intervals_ns: dict[ListKey, int]) -> int | None:
    """Return how many rows are written a day at most, None where nobody knows how often a list is sent."""
    total = 0
    if not planned.tasks or planned.rest is not None:
        session = planned.session
        # Of those between two publishings, no more than the ring buffer holds become rows.
        total += min(_DAY_NS // session.sampling_ns, _DAY_NS * session.capacity // session.publish_ns)
    for key, _ in planned.tasks:
        interval_ns = intervals_ns.get(key)
        if not interval_ns:
            return None
        total += _DAY_NS // interval_ns
    return total
