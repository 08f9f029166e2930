"""What a scenario says of pages of web visualizations: the keys of ``[[page]]``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from dissectors.webvisu import Place
from nvscope.toml_table import FLAG, LENGTH, SPAN, TEXT, ValueKind, array, integer, key, mapping
from nvscope.toml_table import Place as TomlPlace

_PLACE = re.compile(r"(\d{1,10}),(\d{1,10}),(\d{1,10}),(\d{1,10})", re.ASCII)
_PATH = re.compile(r"/[!-\"$->@-~]*", re.ASCII)
_MOST = 2**31
LONGEST = 200
"""Characters of a name, or a value."""


def _place(value: Any, place: TomlPlace) -> Place:
    found = _PLACE.fullmatch(TEXT.read(value, place))
    if found is None:
        raise place.error("an address is expected, such as '4,146,81,8'", "Area, offset, size and type, as in lists.")
    return Place(*map(int, found.groups()))


def _value(value: Any, place: TomlPlace) -> str:
    text = str(TEXT.read(value, place))
    if any(one in "|\r\n\0" for one in text):
        raise place.error("a value has no | and no line ends")
    if len(text) > LONGEST:
        raise place.error(f"a value has at most {LONGEST} characters")
    return text


def _path(value: Any, place: TomlPlace) -> str:
    path = str(TEXT.read(value, place))
    if not _PATH.fullmatch(path):
        raise place.error("a path begins with a slash, and has no blanks, ? or #", "For example /plc/webvisu.htm.")
    return path


_REQUESTS = array(integer(1, _MOST))


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page of a web visualization that asks a controller for variables again and again, and what comes of it.

    It asks when that is due, and not before it has the answer to what it asked before. Who reads the capture looks for
    pages on ports 80 and 8080, on others where the project says so.
    """

    node: str = key(TEXT, "who has the page on its screen")
    to: str = key(TEXT, "the controller that is asked")
    port: int = key(integer(1, 49_151), "its TCP port", default=80)
    path: str = key(ValueKind("path", _path), "where the page is", default="/plc/webvisu.htm")
    variables: dict[str, Place] = key(  # noqa: RUF009  # a field, not a default
        mapping(ValueKind("address", _place)), 'what each request is about, and where it lies: "PLC_PRG.n" = "4,0,2,1"'
    )
    values: tuple[str, ...] = key(
        array(ValueKind("value", _value)),
        "what is read, or written, one variable after the other, again and again; 0 if none is given",
        default=(),
    )
    write: bool = key(FLAG, "values are written, not read", default=False)
    lists: bool = key(
        FLAG, "it fetches the list of the variables first, from which their names are known", default=True
    )
    broken_list: bool = key(FLAG, "the list has a character that XML does not allow", default=False)
    encoding: str | None = key(
        TEXT,
        "it loads itself first, and says so of its texts (ENCODINGSTRING), as UTF-8; of a name that nobody knows, they "
        "are ISO-8859-1, as without it",
        default=None,
    )
    kept: bool = key(FLAG, "one connection for all requests, as long as they are answered", default=False)
    segment_bytes: int = key(integer(1, 1460), "data of a TCP segment, at most", default=1460)
    interval_ns: int = key(SPAN, "how often it asks", name="interval")
    jitter_ns: int = key(LENGTH, "and up to this much later", default=0, name="jitter")
    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")
    latency_ns: int = key(LENGTH, "how long it takes until a reply begins", default=3_000_000, name="latency")
    late: tuple[int, ...] = key(_REQUESTS, "requests, by number, whose reply takes late_by", default=())
    late_by_ns: int = key(LENGTH, "so long", default=1_500_000_000, name="late_by")
    unanswered: tuple[int, ...] = key(
        _REQUESTS, "requests without a reply: the page resets the connection after its patience", default=()
    )
    patience_ns: int = key(SPAN, "how long it waits then", default=3_000_000_000, name="patience")
    refused: tuple[int, ...] = key(
        _REQUESTS, "requests that are refused: writes by |1|, reads by status 500", default=()
    )
    overdeclared: tuple[int, ...] = key(_REQUESTS, "requests that say one variable more than they have", default=())
    shortened: tuple[int, ...] = key(_REQUESTS, "reads whose reply has a value too few", default=())
    lacking: tuple[int, ...] = key(
        _REQUESTS, "requests of whose reply the capture lacks a segment; the page has it", default=()
    )
    resent: tuple[int, ...] = key(
        _REQUESTS, "requests of whose reply the first segment is seen again, resent_after", default=()
    )
    overtaken: tuple[int, ...] = key(
        _REQUESTS, "requests of whose reply the first segment is lost before it is seen, and comes behind the others",
        default=(),
    )  # fmt: skip
    resent_after_ns: int = key(
        LENGTH, "how long until a segment is sent again", default=200_000_000, name="resent_after"
    )
