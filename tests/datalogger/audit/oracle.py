"""The rules of an audit a second time, row by row in plain Python, over what sqlite3 hands out.

For tables of one task, whose first row has a value of every variable or whose first rows were deleted.
"""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from contextlib import closing
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from statistics import median_low
from typing import Any

Key = tuple[str, str, str | None]
"""Code, severity and variable."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_WRAP = 1 << 32


def expected(path: Path, table: str, *, changes: bool) -> dict[Key, list[int]]:
    """Return the row ids of each finding."""
    with closing(sqlite3.connect(path)) as database:
        columns = [(name, declared) for _, name, declared, *_ in database.execute(f"PRAGMA table_info({table})")]
        rows = list(database.execute(f"SELECT rowid, * FROM {table} ORDER BY rowid"))
    found: dict[Key, list[int]] = defaultdict(list)
    _times(rows, found, changes=changes)
    if changes:
        _Changes(columns[2:], found).judge(rows)
    else:
        for row in rows[1:]:
            if row[2] == 0:
                found["NV951", "note", None].append(row[0])
    # Where rows lack by their ids, and nothing else says so.
    told = {(code, severity) for (code, severity, _), own in found.items() if own}
    if not told & {("NV952", "error"), ("NV953", "error")}:
        found["NV952", "warning", None] += [
            later[0] for earlier, later in pairwise(rows) if later[0] != earlier[0] + 1 and later[2] != 0
        ]
    found["NV951", "warning", None] += [row[0] for row in rows if row[2] not in (0, 1)]
    return {key: sorted(own) for key, own in found.items() if own}


def _ns(stamp: Any) -> int:
    if isinstance(stamp, str):
        since = datetime.fromisoformat(stamp).replace(tzinfo=UTC) - _EPOCH
        return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1_000
    return ((stamp & ((1 << 62) - 1)) - 621_355_968_000_000_000) * 100


def _times(rows: list[tuple[Any, ...]], found: dict[Key, list[int]], *, changes: bool) -> None:
    steps = [(later[0], later[2], _ns(later[1]) - _ns(earlier[1])) for earlier, later in pairwise(rows)]
    found["NV955", "warning", None] += [rowid for rowid, _, step in steps if step < 0]
    forward = [step for _, _, step in steps if step > 0]
    if not changes and forward:
        median = median_low(forward)
        # Where a loss is told, it is no wonder that a step is longer.
        usual = [step for _, told, step in steps if step > 0 and (told != 0 or step <= median * 3 // 2)]
        late = _late(steps, median if _is_regular(usual, median) else None)
        times = [_ns(row[1]) for row in rows]
        for number, interval in late.items():
            rowid, told, _ = steps[number - 1]
            if told != 0 and not _is_clock(number, times, sorted(late), interval):
                found["NV952", "error", None].append(rowid)


def _late(steps: list[tuple[int, int, int]], usual: int | None) -> dict[int, int]:
    """Return the numbers of steps that are too long, told or not, each with the interval that it is judged by.

    ``usual`` is that of the table, if it has one.
    """
    begins = [at for at, (_, told, _) in enumerate(steps) if told == 0]
    parts = [
        [step for _, _, step in steps[begin + 1 : end] if step > 0]
        for begin, end in pairwise([-1, *begins, len(steps)])
    ]  # fmt: skip
    own = [median_low(part) if part and _is_regular(part, median_low(part)) else None for part in parts]
    tells, few_tell = _tell(parts, own)
    found: dict[int, int] = {}
    place, before = 0, None
    first = next((one for one in own if one is not None), None)
    for at, (_, told, step) in enumerate(steps):
        if told == 0:
            before = own[place] or before
            place += 1
            interval = usual or ((before or first) if tells else None)
        else:
            part, interval = parts[place], own[place]
            if usual and 2 * sum(abs(one - usual) * 4 <= usual for one in part) >= len(part):
                interval = usual
            elif not (few_tell if len(part) < 36 else tells) and not (usual and step > usual * 3 // 2):
                interval = None
        if interval and step > interval * 3 // 2:
            found[at + 1] = interval
    return found


def _tell(parts: list[list[int]], own: list[int | None]) -> tuple[bool, bool]:
    """Return whether parts have intervals of their own: those of three of four steps, of those of five or more alike.

    Those of few steps, if three of four of them do, and as many of all their steps are alike as of one part have to be.
    """
    judged = [(len(part), one is not None) for part, one in zip(parts, own, strict=True) if len(part) > 5]
    tells = bool(judged) and 4 * sum(n for n, regular in judged if regular) >= 3 * sum(n for n, _ in judged)
    few = [regular for n, regular in judged if n < 36]
    short = [part for part in parts if 0 < len(part) < 36]
    others = sum(abs(step - median_low(part)) * 8 > median_low(part) for part in short for step in part)
    most = max(1, 2 * sum(map(len, short)) ** 2 // 36**2)
    return tells, tells and 4 * sum(few) >= 3 * len(few) and others <= most


def _is_regular(steps: list[int], median: int) -> bool:
    """Return whether steps are of one length but for few: of less than 36, for one, and five are of that length."""
    few = len(steps) < 36
    others = sum(abs(step - median) * (8 if few else 4) > median for step in steps)
    alike = len(steps) - others
    if few:
        return others == 0 or (others == 1 and alike >= 5)
    # Two of 36, eight of 72: their share grows with their number, up to two thirds.
    return others * 36 * 36 <= 2 * len(steps) ** 2 and 3 * alike >= len(steps)


def _is_clock(number: int, times: list[int], late: list[int], interval: int) -> bool:
    """Return whether the clock was set, if not before this row, then back again: no row is missing between the two."""
    for back in (at for at in range(1, len(times)) if times[at] < times[at - 1]):
        pairs = []
        if [at for at in late if at < back][-1:] == [number]:
            pairs.append((number, back))
        if [at for at in late if at > back][:1] == [number]:
            pairs.append((back, number))
        for first, last in pairs:
            length, count = times[last] - times[first - 1], last - first + 1
            if 0 < length <= count * interval * 21 // 20 + interval // 2:
                return True
    return False


def _following(names: list[str], rows: list[tuple[Any, ...]]) -> dict[tuple[int, str], tuple[Any, int]]:
    """Return, of the cells with a counter, the next one, if no change between may be lost or without a counter."""
    found: dict[tuple[int, str], tuple[Any, int]] = {}
    open_at: dict[str, int] = {}
    for rowid, _, consistent, *cells in rows:
        if consistent == 0:
            open_at = {}
        for place, name in enumerate(names):
            value, count = cells[2 * place : 2 * place + 2]
            if isinstance(count, int):
                if name in open_at:
                    found[open_at[name], name] = value, count
                open_at[name] = rowid
            elif value is not None or count is not None:
                open_at.pop(name, None)
    return found


class _Changes:
    def __init__(self, columns: list[tuple[str, str]], found: dict[Key, list[int]]) -> None:
        self.names = [name for name, _ in columns[::2]]
        self.real = {name for name, declared in columns[::2] if declared in ("FLOAT", "DOUBLE")}
        self.found = found
        self.count: dict[str, int] = {}
        self.value: dict[str, Any] = {}
        self.lost_at: dict[str, int] = {}
        self.stored: set[str] = set()
        self.alone: dict[str, int] = defaultdict(int)
        self.fell_from: dict[str, int] = {}
        self.is_odd: set[str] = set()
        self.seen_whole = False
        self.following: dict[tuple[int, str], tuple[Any, int]] = {}
        self.losses = 0
        self.start: list[tuple[int, dict[str, str]]] = []
        self.seen_beginning = False
        self.unknown: set[str] = set()
        self.none: set[str] = set()

    def tell(self, code: str, severity: str, name: str | None, rowid: int) -> None:
        self.found[code, severity, name].append(rowid)

    def judge(self, rows: list[tuple[Any, ...]]) -> None:
        self.following = _following(self.names, rows)
        for number, (rowid, _, consistent, *cells) in enumerate(rows):
            self.judge_row(
                number == 0,
                rowid,
                consistent == 0,
                dict(zip(self.names, zip(cells[::2], cells[1::2], strict=True), strict=True)),
            )
        self.close()

    def judge_row(self, first: bool, rowid: int, lost: bool, cells: dict[str, tuple[Any, Any]]) -> None:
        self.losses += lost
        counted = {name: count for name, (_, count) in cells.items() if isinstance(count, int)}
        zero = bool(counted) and not any(counted.values())
        unknown = {name for name in self.names if cells[name][0] is None} if zero and lost else set()
        whole = len(counted) == len(self.names)
        self.unknown = unknown if whole else set()
        # A start beside numbers that are none: only these lack of its values.
        lacking = {name for name in self.names if cells[name][0] is None}
        self.none = lacking if zero and whole and not lost and lacking < set(self.names) else set()
        if self.none - self.real:
            self.none = set()
        self.seen_whole |= whole
        if first:
            self.seen_beginning = zero
        if lost and not first:
            self.tell("NV951", "note", None, rowid)
        if not zero and self.start and set(counted) - {name for *_, own in self.start for name in own}:
            self.close()
        says: dict[str, str] = {}
        for name, (value, count) in cells.items():
            if not isinstance(count, int):
                if count is not None:
                    self.tell("NV954", "error", name, rowid)
                elif value is not None:
                    self.tell("NV957", "note", name, rowid)
                if value is not None:
                    self.value[name] = value
                self.alone[name] += value is not None or count is not None
                continue
            says[name] = self.judge_cell(name, value, count, rowid, zero=zero, anew=zero and whole)
        # A counter that is repeated without a value, as the document has it, begins nothing.
        says = {name: one for name, one in says.items() if one != "repeated"}
        if zero and says:
            self.take_zero(rowid, says)

    def judge_cell(self, name: str, value: Any, count: int, rowid: int, *, zero: bool, anew: bool) -> str:
        known = name in self.count
        step = count - self.count[name] if known else 0
        if step < 0 and 0 < step + _WRAP <= 1_000:
            step += _WRAP
        alone_before = self.alone[name]
        if step > 1 and self.alone[name]:
            step = max(step - self.alone[name], 1)
        self.alone[name] = 0
        had, before = name in self.value, self.value.get(name)
        says = "unknown" if not known else "back" if step < 0 else "counted" if step > 0 else "equal"
        if value is not None and had and value != before and known and step == 0:
            says = "stuck"
        if known and step == 0 and value is None and name not in self.unknown:
            says = "unknown" if name in self.none else "repeated"
        is_odd = ahead = False
        if name in self.is_odd:
            # The cell before was the odd one: of this one, nothing is wrong.
            step = int(value is not None or name in self.real)
            self.is_odd.discard(name)
        elif known and not alone_before and self.losses == self.lost_at[name] and not self.starts(name, anew=anew):
            is_wrong = says in ("back", "stuck") or (step > 1 and not zero)
            may_start = zero and not self.count[name] > 0 and not self.seen_whole
            is_odd = is_wrong and not may_start and self.fits_around(name, value, rowid, starts=anew)
            ahead = is_odd and step > 1
        if is_odd:
            self.is_odd.add(name)
        if ahead:
            self.tell("NV954", "error", name, rowid)
        if is_odd and anew:
            zero, says = False, "repeated"
        alike = value is not None and had and value == before and not (name in self.real and value == 0)
        fell_from = self.fell_from.pop(name, None)
        if known and not zero:
            # A count that went back is none to count changes from: the two steps around it make two changes.
            is_missed = step > 1 and (fell_from is None or count - fell_from > 2)
            if is_missed and not ahead and self.losses == self.lost_at[name]:
                self.tell("NV953", "error", name, rowid)
            if step < 0:
                self.fell_from[name] = self.count[name]
            if step < 0:
                self.tell("NV954", "error", name, rowid)
            if step == 0 and says == "stuck":
                self.tell("NV954", "error", name, rowid)
            if step in (0, 1) and alike:
                self.tell("NV958", "note", name, rowid)
        if not known and count < 0:
            self.tell("NV954", "error", name, rowid)
        if name in self.unknown:
            # A start of which this value is not known yet.
            self.value.pop(name, None)
        elif value is None:
            if name not in self.real or (known and step == 0 and not zero):
                self.tell("NV957", "note", name, rowid)
            if not known or step != 0 or name in self.none:
                self.value[name] = None
        else:
            self.value[name] = value
        self.count[name], self.lost_at[name] = count, self.losses
        self.stored.add(name)
        return says

    def starts(self, name: str, *, anew: bool) -> bool:
        """Return whether a logger starts anew; of one variable alone, the next count tells a 0 that is wrong."""
        return anew and not (len(self.names) == 1 and self.count[name] > 0)

    def fits_around(self, name: str, value: Any, rowid: int, *, starts: bool) -> bool:
        """Return whether the next cell counts on from the one before, as if the cell between had counted rightly."""
        if (rowid, name) not in self.following:
            return False
        following, count = self.following[rowid, name]
        if starts and count == 1:
            return False
        over_both = count - self.count[name]
        if over_both < 0 and 0 < over_both + _WRAP <= 1_000:
            over_both += _WRAP
        changes = (value is not None) + (following is not None)
        return over_both == changes or (name in self.real and over_both == 2)

    def take_zero(self, rowid: int, says: dict[str, str]) -> None:
        if {name for *_, own in self.start for name in own} & set(says):
            self.close()
        self.start.append((rowid, says))
        missing = set(self.names) - {name for *_, own in self.start for name in own}
        if not missing or (self.seen_beginning and not missing & self.stored):
            if any(one != "unknown" for *_, own in self.start for one in own.values()):
                self.tell("NV954", "note", None, self.start[0][0])
            self.start = []

    def close(self) -> None:
        for rowid, says in self.start:
            for name, one in says.items():
                if one in ("back", "stuck"):
                    self.tell("NV954", "error", name, rowid)
                if one == "equal":
                    self.tell("NV958", "note", name, rowid)
        self.start = []
