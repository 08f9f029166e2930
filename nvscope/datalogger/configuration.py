"""What a DataLogger session is configured to do: the table of all attributes, and a session as a value.

Source: the DataLogger's reference, "Attributes for file-based configuration", and ``datalogger.md`` section 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from msgspec import Struct

from nvscope.definition.position import Position
from nvscope.duration import format_duration

_UNITS_NS = {"us": 1_000, "ms": 1_000_000, "s": 1_000_000_000, "m": 60_000_000_000, "h": 3_600_000_000_000}
_LONGEST_NS = 366 * 24 * 3_600_000_000_000
_MOST_SETS, _MOST_RECORDS, _MOST_BYTES, _MOST_FILES = 1_000_000, 1_000_000, 1 << 47, 1 << 31
_RESERVED = "PCWE_"


class NotMeant(ValueError):
    """A text that an attribute cannot have; it says why."""


def _name(text: str) -> str:
    if not text.strip():
        raise NotMeant("is empty")
    if text.strip().startswith(_RESERVED):
        raise NotMeant(f"begins with {_RESERVED}, which is reserved for the logic analyzer of the firmware")
    return text.strip()


def _text(text: str) -> str:
    if not text.strip():
        raise NotMeant("is empty")
    return text.strip()


def _duration(text: str) -> int:
    digits = text.strip().rstrip("".join(sorted(set("".join(_UNITS_NS)))))
    unit = text.strip().removeprefix(digits)
    number = digits.strip()
    if unit not in _UNITS_NS or not number.isascii() or not number.replace(".", "", 1).isdigit() or len(number) > 20:
        raise NotMeant("is no duration such as 50ms: a number with us, ms, s, m or h")
    whole, _, decimals = number.partition(".")
    scaled = int(whole + decimals) * _UNITS_NS[unit]
    if scaled % 10 ** len(decimals):
        raise NotMeant("is no whole number of nanoseconds")
    duration_ns: int = scaled // 10 ** len(decimals)
    if not _UNITS_NS["us"] <= duration_ns <= _LONGEST_NS:
        raise NotMeant("is not between 1us and 366 days")
    return duration_ns


def _number(least: int, most: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        plain = text.strip()
        sign = plain[:1] in {"-", "+"}
        if not plain[sign:].isascii() or not plain[sign:].isdigit() or len(plain) > 20:
            raise NotMeant("is no whole number")
        if not least <= int(plain) <= most:
            raise NotMeant(f"is not between {least} and {most}")
        return int(plain)

    return read


def _one_of(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        found = next((word for word in words if word.lower() == text.strip().lower()), None)
        if found is None:
            raise NotMeant(f"is neither {' nor '.join(words)}")
        return found

    return read


def _flag(text: str) -> bool:
    word = text.strip().lower()
    if word not in {"true", "false", "1", "0"}:
        raise NotMeant("is neither true nor false")
    return word in {"true", "1"}


class Attribute(Struct, frozen=True):
    """An attribute of an element; ``read`` raises NotMeant. ``default`` is what holds without it, as a value.

    ``field`` is that of ``Session``, where it is kept. One that is ``required`` has no default.
    """

    element: str
    name: str
    field: str
    read: Callable[[str], Any]
    help: str
    default: Any = None
    required: bool = False

    def told(self, value: Any) -> str:
        """Return a value as a configuration has it, '' of none."""
        if value is None:
            return ""
        if isinstance(value, bool):
            return str(value).lower()
        return format_duration(value) if self.read is _duration else str(value)


ATTRIBUTES = (
    Attribute("General", "name", "name", _name, "the session's name", required=True),
    Attribute("General", "samplingInterval", "sampling_ns", _duration, "how often values are taken", 500_000_000),
    Attribute(
        "General", "publishInterval", "publish_ns", _duration, "how often the ring buffer is emptied", 500_000_000
    ),
    Attribute("General", "bufferCapacity", "capacity", _number(1, _MOST_SETS), "data sets in the ring buffer", 2),
    Attribute(
        "General", "taskContext", "task", _text, "the task in each of whose cycles values are taken; no interval counts"
    ),
    Attribute("Datasink", "type", "kind", _one_of("db", "volatile"), "a file, or memory alone", "db"),
    Attribute("Datasink", "dst", "path", _text, "the file; its folder has to exist"),
    Attribute("Datasink", "rollover", "rollover", _flag, "a new file where one is full", False),
    Attribute(
        "Datasink", "maxFiles", "max_files", _number(-_MOST_FILES, _MOST_FILES),
        "how many files there are at most; negative: any number, 0 and 1: one, of which the oldest rows are deleted",
        -1,
    ),
    Attribute(
        "Datasink", "writeInterval", "block_rows", _number(1, _MOST_RECORDS), "records that are written at once", 1000
    ),
    Attribute("Datasink", "maxFileSize", "max_bytes", _number(1, _MOST_BYTES), "bytes at which a file is full"),
    Attribute("Datasink", "storeChangesOnly", "only_changes", _flag, "unchanged values are left out", False),
    Attribute(
        "Datasink", "deleteRatio", "delete_percent", _number(1, 100), "percent of the rows that make room", 30
    ),
    Attribute("Datasink", "tsfmt", "time_format", _one_of("Raw", "Iso8601"), "how timestamps are written", "Raw"),
)  # fmt: skip
"""In the order of the reference."""

DEFAULTS: Mapping[str, Any] = {one.field: one.default for one in ATTRIBUTES if not one.required}


class NamedVariable(Struct, frozen=True):
    """A variable as the configuration names it, and where it does."""

    uri: str
    position: Position


class Session(Struct, frozen=True, kw_only=True):
    """One session; its fields are those of ``ATTRIBUTES``, times in nanoseconds.

    ``path`` is '' where nothing is said, and of one in memory; ``max_bytes`` is None where a file never is full.
    ``position`` is where the session is configured, ``places`` where each attribute is that was given, by field.
    """

    name: str
    position: Position
    places: Mapping[str, Position]
    variables: tuple[NamedVariable, ...]
    sampling_ns: int
    publish_ns: int
    capacity: int
    task: str
    kind: str
    path: str
    rollover: bool
    max_files: int
    block_rows: int
    max_bytes: int | None
    only_changes: bool
    delete_percent: int
    time_format: str

    @property
    def raw(self) -> bool:
        """Whether timestamps are numbers."""
        return self.time_format == "Raw"

    @property
    def volatile(self) -> bool:
        """Whether rows are kept in memory alone."""
        return self.kind == "volatile"

    @property
    def files(self) -> int | None:
        """How many files there are at most, the one that is written included; None for any number.

        Where it is 1, the oldest rows are deleted.
        """
        if not self.rollover or self.max_files in {0, 1}:
            return 1
        return None if self.max_files < 0 else self.max_files

    @property
    def sets_a_publishing(self) -> int:
        """How many data sets come between two publishings, at most."""
        return -(-self.publish_ns // self.sampling_ns)
