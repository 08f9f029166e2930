"""Outcome: what became of sessions, in sentences for the end of a run."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.datalogger.configuration import Session
from nvscope.datalogger.database import IN_MEMORY
from nvscope.datalogger.datalog import MOST_SENDERS, Heard
from nvscope.datalogger.oldest_rows import Deleted
from nvscope.datalogger.session_log import Counted, SessionLog
from nvscope.enumeration import first_few, joined
from nvscope.list_key import ListKey
from nvscope.units import count, count_of, data_size, duration, ranges
from nvscope.view.escape import visible

_MOST_NAMED = 3


def outcome(log: SessionLog, heard: Heard) -> Iterator[str]:
    """Yield what became of a session that has ended: its rows, where they are, what was lost, and what never came."""
    counted, session, name = log.counted, log.session, visible(log.session.name)
    told = [f"{count_of(counted.rows, 'row')} of {count_of(len(log.logged), 'variable')}{_where(counted, session)}"]
    if counted.inconsistent:
        rows = "row says" if counted.inconsistent == 1 else "rows say"
        told.append(f"{counted.inconsistent} {rows} that something is missing in front of it (ConsistentDataSeries 0)")
    if counted.rows and log.other_table:
        told.append(visible(log.other_table))
    if counted.files == [IN_MEMORY]:
        told.append("gone with the end of the session: -w FILE keeps one that is volatile")
    yield f"{name}: {'; '.join(told)}."
    if counted.overwritten:
        lost = count_of(counted.overwritten, "data set")
        yield (
            f"{name}: the ring buffer had no room for {lost}; the next row tells, once for all in front of it. "
            f"bufferCapacity is {session.capacity}, and up to {session.sets_a_publishing} come in a publishInterval."
        )
    if counted.not_taken:
        sets = count_of(counted.not_taken, "data set")
        yield (
            f"{name}: at least {sets} not taken: the clock of the capture went back, by less than a second each time, "
            "and no row has a time twice; the next row tells of it."
        )
    if counted.late:
        came = count_of(counted.late, "telegram")
        yield (
            f"{name}: {came} came behind newer ones, too late for a row; the first row behind what is missing for that "
            "tells of it."
        )
    if counted.not_written:
        yield f"{name}: {count_of(counted.not_written, 'row')} not written: another program held the database."
    yield from (f"{name}: {told}." for told in _copies(log, heard))
    yield from (f"{name}: {told}." for told in _missing(log, heard))


def _copies(log: SessionLog, heard: Heard) -> Iterator[str]:
    """Yield of which lists telegrams came again, where each cycle makes a row."""
    for key in sorted(log.keys, key=str) if log.has_cycles else ():
        if copies := heard.copies.get(key):
            make = "makes no row of its own" if copies == 1 else "make no rows of their own"
            yield f"{count_of(copies, 'telegram')} of {key} came again, byte for byte, and {make}"


def _missing(log: SessionLog, heard: Heard) -> Iterator[str]:
    """Yield which lists, and which telegrams of them, sent nothing that could be logged; where all did, and there is no
    row, why."""
    if not heard.frames:
        yield "there was not one frame to read: capture while the controller sends, or ask for another time"
        return
    since = f"in {duration(heard.duration_ns)}, among {count_of(heard.frames, 'frame')}"
    for key in sorted(log.keys, key=str):
        if heard.came.get(key):
            yield from _unseen(log, heard, key, since)
            if len(senders := heard.senders.get(key, ())) > 1:
                many = "at least " if len(senders) == MOST_SENDERS else ""
                named = joined([visible(one) for one in senders])
                yield (
                    f"telegrams of {key} came from {many}{len(senders)} senders, {named}: they are in one table, and "
                    "no row says whose it is; `nvscope report` tells of each"
                )
            if key in heard.silent_ns:
                silent = duration(heard.silent_ns[key])
                yield (
                    f"{key} sent nothing any more for the last {silent}: it has stopped, and of what was lost at "
                    "the end no row can tell"
                )
            continue
        own = count_of(sum(one.key == key for one in log.logged), "variable")
        nulls = f"; {own} of it {'is' if own.startswith('1 ') else 'are'} NULL in all rows" if log.counted.rows else ""
        if left_out := heard.left_out.get(key):
            other = count_of(left_out, "telegram")
            yield (
                f"{other} of {key} came, of another shape than the definition has, or damaged{nulls}; `nvscope report` "
                "with the same definitions tells where they differ"
            )
        else:
            yield (
                f"no telegram of {key} came {since}{nulls}; `nvscope report` shows which lists came: compare "
                "identifier and port with the definition"
            )
    came = any(heard.came.get(key) for key in log.keys)
    if came and not log.counted.rows and not log.counted.not_written and not log.session.task:
        every = duration(log.session.sampling_ns)
        yield f"telegrams came {since}, but no sampling was due: samplingInterval is {every}"


def _unseen(log: SessionLog, heard: Heard, key: ListKey, since: str) -> Iterator[str]:
    """Yield which telegrams of a list that came were none of them, and which variables nobody knows for that."""
    elements = heard.unseen.get(key, {})
    own = [one for one in log.logged if one.key == key and one.element in elements]
    if not own:
        return
    places = sorted(set().union(*(elements[one.element] for one in own)))
    numbers = f"SubIndex{'' if len(places) == 1 else 'es'} {', '.join(ranges(places))}"
    named = first_few([visible(one.uri) for one in own], _MOST_NAMED)
    them = f"{count_of(len(own), 'variable')} {'is' if len(own) == 1 else 'are'}"
    nulls = f"; {them} NULL in all rows: {named}" if log.counted.rows else ""
    shape = ""
    if left_out := heard.left_out.get(key):
        came = f"{count_of(left_out, 'telegram')} of the list {'was' if left_out == 1 else 'were'}"
        shape = f"; {came} of another shape than the definition has, or damaged"
    yield (
        f"no telegram of {key} with {numbers} came {since}, though others of it did{nulls}{shape}; `nvscope report` "
        "shows which came: compare with the definition"
    )


def _deleted(deleted: Deleted) -> str:
    """Return how many rows were deleted, and whose they were."""
    others = deleted.others.most_common()
    parts = [f"{count_of(rows, 'row')} of another table ({visible(name)})" for name, rows in others[:_MOST_NAMED]]
    if more := sum(rows for _, rows in others[_MOST_NAMED:]):
        parts.append(f"{count_of(more, 'row')} of {count_of(len(others) - _MOST_NAMED, 'more table')}")
    if deleted.before:
        parts.append(f"{count_of(deleted.before, 'row')} of earlier runs")
    if deleted.own or not parts:
        parts.append(f"{count_of(deleted.own, 'row')}{' of this run' if parts else ''}")
    return joined(parts)


def _where(counted: Counted, session: Session) -> str:
    """Return where the rows are, and, of those that made room, how many and why."""
    if not counted.files:
        return ", and no file was made"
    more = len(counted.files) - 1
    path = counted.files[-1]
    files = "memory" if path == IN_MEMORY else visible(path)
    files += f" and {count_of(more, 'closed file')}" if more > 0 else ""
    went = []
    if counted.deleted.count:
        full = data_size(session.max_bytes or 0)
        went.append(f"{_deleted(counted.deleted)} deleted, the oldest ones (maxFileSize {full})")
    if counted.removed:
        before = f", {counted.removed_before} of them of earlier runs" if counted.removed_before else ""
        what = f"{count_of(counted.removed, 'full file')} removed, the oldest ones (maxFiles {session.max_files})"
        went.append(what + before)
    made_room = f": {', '.join(went)}" if went else ""
    if counted.left == counted.rows:
        told = f" in {files}{made_room}"
    elif counted.left:
        told = f", of which {count(counted.left)} {'is' if counted.left == 1 else 'are'} left in {files}{made_room}"
    else:
        told = f", of which none is left in {files}{made_room}"
    return told
