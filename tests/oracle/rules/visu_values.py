"""The values of variables of WebVisu, written a second time: one reply after the other, one value after the other.

Readings, where the rules leave a choice:

- a variable is one place of one server, whoever asks for it; ports 80 and 8080 are of one server, any other is one
- a reply to a read of status 200 that is not ambiguous says values, by position; ``???`` says none
- a write that was confirmed says its values with its reply; of an older page (WRITEPI), too
- what a value means is said by the number of the type, where the size is that of the type: see ``value_of``
- a change is another value than the one before of the same variable, whoever had asked for that
- a variable is called as it was called when it was last asked for or written, with a reply that says values or ???
- it may be a password where it has bytes of one that has a name, or where it is a STRING without a name
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from tests.oracle.rules import visu_body, visu_pages
from tests.oracle.rules.http_message import Message
from tests.oracle.rules.visu import Visu
from tests.oracle.rules.visu_talk import Home, Talk

Value = bool | int | float | str | None

INTEGERS = {
    1: (2, True), 2: (1, False), 3: (2, False), 4: (4, True), 5: (4, False), 7: (4, False), 14: (1, True),
    15: (1, False), 16: (2, False), 17: (4, False), 18: (4, False), 19: (4, False), 20: (4, False),
}  # fmt: skip
"""Size, and whether it has a sign, by the number of the type."""

BLANK = " \t\n\v\f\r\x1c\x1d\x1e\x1f\x85\xa0"


class Series(NamedTuple):
    """One value of one variable: when, in which frame, what it was called, the text, and whether it is a change."""

    time: int
    frame: int
    server: str
    name: str
    place: str
    text: str
    value: Value
    changed: bool
    secret: bool
    shown: str
    """The text as its page has it; ``text`` and ``value`` have a character for each byte."""

    @property
    def told(self) -> Value:
        return self.shown if isinstance(self.value, str) else self.value


@dataclass
class Known:
    """What is known of one variable."""

    name: str = ""
    secret: bool = False
    readings: list[Series] = field(default_factory=list)
    unreadable: int = 0
    asked: int = 0


class VisuValues(Visu):
    """The rules of WebVisu, and the values that variables had."""

    def __init__(self) -> None:
        super().__init__()
        self.series: list[Series] = []
        self.variables: dict[tuple[Home, visu_body.Address], Known] = {}

    def judge(
        self, talk: Talk, row: Any, asked: visu_body.Asked, message: Message, answer: visu_body.Answered
    ) -> None:  # fmt: skip
        super().judge(talk, row, asked, message, answer)
        if asked.write:
            nothing = b"" if asked.query else None
            values = [nothing if entry.value is None else entry.value for entry in asked.entries]
            values = [] if answer.refused else values
        else:
            values = [] if asked.query else [b"???" if one is None else one for one in answer.values]
        if asked.write and answer.refused:
            return
        if asked.query and not asked.write:
            return
        if message.status != 200 or answer.ambiguous:
            return
        self.take(talk, asked, values)

    def take(self, talk: Talk, asked: visu_body.Asked, values: list[bytes | None]) -> None:
        home = talk.home
        for place, entry in enumerate(asked.entries):
            known = self.variables.setdefault((home, entry.address), Known())
            known.name = self.called(home, entry.address)
            known.secret = self.may_be_secret(home, entry.address)
            known.asked += 1
            if place >= len(values):
                continue
            said = values[place]
            if said is None:
                continue
            if said == b"???":
                known.unreadable += 1
                continue
            text = said.decode("latin-1")
            value = value_of(entry.address, text)
            before = known.readings[-1] if known.readings else None
            changed = before is not None and not same(before, text, value)
            shown = visu_pages.text_of(self, talk, entry.address, text) or ""
            told = Series(
                self.now, self.number, visu_pages.called(*home), known.name, text_of(entry.address), text, value,
                changed, known.secret, shown,
            )  # fmt: skip
            known.readings.append(told)
            self.series.append(told)

    def may_be_secret(self, home: Home, address: visu_body.Address) -> bool:
        if visu_body.shows_password(address, self.lists[home]):
            return True
        return address[3] == visu_body.STRING and address not in self.names[home]

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a variable that replies told of."""
        return [
            {
                "server": str(server), "list": visu_pages.called(server, port),
                "name": known.name, "place": text_of(address), "secret": known.secret,
                "readings": len(known.readings), "asked": known.asked, "unreadable": known.unreadable,
                "changes": sum(one.changed for one in known.readings),
                "text": known.readings[-1].shown if known.readings else None,
                "value": known.readings[-1].told if known.readings else None,
                "last": known.readings[-1].time if known.readings else None,
                "changed": last_change(known.readings),
                "bounds": bounds([one.value for one in known.readings]),
            }
            for ((server, port), address), known in self.variables.items()
        ]  # fmt: skip


def last_change(readings: list[Series]) -> int | None:
    changes = [one.time for place, one in enumerate(readings) if one.changed or not place]
    return changes[-1] if changes else None


def bounds(values: list[Value]) -> tuple[Value, Value] | None:
    numbers = [value for value in values if isinstance(value, bool | int | float)]
    return (min(numbers), max(numbers)) if numbers else None


def same(before: Series, text: str, value: Value) -> bool:
    if value is None or before.value is None:
        return before.text == text and value is before.value
    return before.value == value


def text_of(address: visu_body.Address) -> str:
    return address if isinstance(address, str) else ",".join(map(str, address))


def value_of(address: visu_body.Address, text: str) -> Value:
    """Return what a text means, None where it is none of its type, or nobody knows that."""
    if isinstance(address, str):
        return None
    _, _, size, kind = address
    if kind == visu_body.STRING:
        return text
    if kind == 10:  # ENUM
        kind = {1: 14, 2: 1, 4: 4}.get(size, -1)
    elif kind == 12:  # BITORBYTE
        kind = {0: 0, 1: 2}.get(size, -1)
    text = text.strip(BLANK)
    if kind == 0:
        return {"0": False, "1": True}.get(text) if size in (0, 1) else None
    if kind in (6, 22):
        return real(text, size) if size == (4 if kind == 6 else 8) else None
    if kind not in INTEGERS or INTEGERS[kind][0] != size or not re.fullmatch("[-+]?[0-9]{1,20}", text):
        return None
    number, span = int(text), 256**size
    if INTEGERS[kind][1]:
        return number if -span // 2 <= number < span // 2 else None
    number += span if -span // 2 <= number < 0 else 0
    return number if 0 <= number < span else None


def real(text: str, size: int) -> float | None:
    if not re.fullmatch(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?", text) or len(text) > 100:
        return None
    number = float(text)
    if abs(number) == float("inf"):
        return None
    try:
        (number,) = struct.unpack("<f", struct.pack("<f", number)) if size == 4 else (number,)
    except OverflowError:
        return None
    return number


def never_changed(rules: VisuValues) -> list[tuple[str, int, list[str], list[str]]]:
    """Return by server: how many variables were asked for, those that never changed, those that were always ???."""
    found: dict[tuple[str, str], tuple[list[str], list[str], list[str]]] = {}
    for row in rules.rows():
        every, unchanged, unreadable = found.setdefault((row["server"], row["list"]), ([], [], []))
        every.append(row["name"])
        if not row["readings"] and row["unreadable"]:
            unreadable.append(row["name"])
        elif not row["changes"] and row["readings"] > 1:
            unchanged.append(row["name"])
    return sorted(
        (server, len(every), sorted(unchanged), sorted(unreadable))
        for (server, _), (every, unchanged, unreadable) in found.items() if unchanged or unreadable
    )  # fmt: skip
