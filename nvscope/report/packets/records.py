"""Telegrams as records for programs: separated fields, CSV, a JSON array, and JSON objects one a line.

All of them are written piece by piece, in constant memory. Each is a ``Face``. Separated fields are as tshark writes
them; in CSV and JSON every number is decimal, and times but dates are whole nanoseconds, with ``_ns`` behind the name
of their field: under its own name, which Wireshark has too, it would be taken for seconds. The variables of a frame are
an array in JSON, and one cell of CSV with commas in between; of several VLAN tags it is the outermost.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, Protocol

from msgspec import Struct

from nvscope.errors import UsageError
from nvscope.view.escape import csv_safe, json_text
from nvscope.view.fields.field import TelegramField
from nvscope.view.lines import cells
from nvscope.view.rows.frames import FrameRows

Quote = Literal["", "'", '"']


class Face(Protocol):
    """A form in which telegrams are written: ``begin``, then what ``render`` gives for each piece, then ``end``."""

    def begin(self) -> str: ...

    def render(self, rows: FrameRows) -> Iterator[str]: ...

    def end(self) -> str: ...


class Separation(Struct, frozen=True):
    """How separated fields are written, as tshark's option -E has it."""

    header: bool = False
    separator: str = "\t"
    quote: Quote = ""


_NAMED_SEPARATORS = {"/t": "\t", "/s": " "}
_QUOTES: dict[str, Quote] = {"n": "", "s": "'", "d": '"'}
_SWITCHES = {"y": True, "n": False}


def separation(settings: Sequence[str]) -> Separation:
    """Return what settings such as ``header=y`` and ``separator=,`` say; UsageError for one that says nothing known."""
    header, separator, quote = False, "\t", _QUOTES["n"]
    for setting in settings:
        name, _, value = setting.partition("=")
        if name == "header" and value in _SWITCHES:
            header = _SWITCHES[value]
        elif name == "quote" and value in _QUOTES:
            quote = _QUOTES[value]
        elif name == "separator" and (value in _NAMED_SEPARATORS or (len(value) == 1 and value.isprintable())):
            separator = _NAMED_SEPARATORS.get(value, value)
        else:
            raise UsageError(
                f"-E {setting}: not a setting of separated fields",
                next_step="header=y|n, separator=/t|/s|CHARACTER (/t tab, /s space), quote=d|s|n",
            )
    return Separation(header, separator, quote)


class SeparatedFields:
    """The values of some fields, a line a telegram, with what separates them in between."""

    def __init__(self, fields: Sequence[TelegramField], how: Separation) -> None:
        self._fields = fields
        self._how = how

    def begin(self) -> str:
        names = self._how.separator.join(field.name for field in self._fields)
        return f"{names}\n" if self._how.header else ""

    def render(self, rows: FrameRows) -> Iterator[str]:
        columns = [cells.texts(field, rows) for field in self._fields]
        if quote := self._how.quote:
            columns = [[f"{quote}{cell}{quote}" for cell in column] for column in columns]
        yield _lines(columns, self._how.separator)

    def end(self) -> str:
        return ""


class Csv:
    """Comma-separated values with a heading, quoted as in RFC 4180, with line feeds; safe to open in a spreadsheet."""

    def __init__(self, fields: Sequence[TelegramField]) -> None:
        self._fields = fields

    def begin(self) -> str:
        return ",".join(map(_csv_cell, _names(self._fields))) + "\n"

    def render(self, rows: FrameRows) -> Iterator[str]:
        yield _lines([_csv_cells(field, rows) for field in self._fields], ",")

    def end(self) -> str:
        return ""


def _names(fields: Sequence[TelegramField]) -> list[str]:
    """Return what fields are called beside numbers that say no unit; no two different ones alike."""
    known = {field.name for field in fields}
    names = []
    for field in fields:
        name = field.name
        if field.in_nanoseconds:
            name += "_ns"
            while name in known:
                name = f"var.{name}"  # as the columns of exported values
        names.append(name)
    return names


def _csv_cells(field: TelegramField, rows: FrameRows) -> list[str]:
    if not cells.listed(field):
        return cells.texts(field, rows, _csv_cell, raw=True)
    # All of them are one cell.
    return [_csv_cell(cell) for cell in cells.texts(field, rows, str, raw=True)]


def _csv_cell(text: str) -> str:
    safe = csv_safe(text)
    return '"' + safe.replace('"', '""') + '"' if any(mark in safe for mark in ',"\r\n') else safe


def _lines(columns: list[list[str]], separator: str) -> str:
    if len(columns) == 1:
        return "\n".join(columns[0]) + "\n"
    return "\n".join(map(separator.join, zip(*columns, strict=True))) + "\n"


class JsonLines:
    """One JSON object a line, with a member for each field, null where it does not exist."""

    def __init__(self, fields: Sequence[TelegramField]) -> None:
        self._fields = list({field.name: field for field in fields}.values())
        self._pattern = "{" + ",".join(f"{_json_name(name)}:%s" for name in _names(self._fields)) + "}"

    def begin(self) -> str:
        return ""

    def render(self, rows: FrameRows) -> Iterator[str]:
        yield "\n".join(self.objects(rows)) + "\n"

    def objects(self, rows: FrameRows) -> list[str]:
        """Return the telegrams as JSON texts."""
        columns = [cells.json_texts(field, rows) for field in self._fields]
        pattern = self._pattern
        return [pattern % row for row in zip(*columns, strict=True)]

    def end(self) -> str:
        return ""


def _json_name(name: str) -> str:
    """Return a name as JSON, for a pattern in which a percent sign stands for a value."""
    return json_text(name).replace("%", "%%")


class JsonArray:
    """One JSON array of such objects, each on its own line."""

    def __init__(self, fields: Sequence[TelegramField]) -> None:
        self._lines = JsonLines(fields)
        self._any = False

    def begin(self) -> str:
        return "["

    def render(self, rows: FrameRows) -> Iterator[str]:
        yield (",\n" if self._any else "\n") + ",\n".join(self._lines.objects(rows))
        self._any = True

    def end(self) -> str:
        return "\n]\n" if self._any else "]\n"
