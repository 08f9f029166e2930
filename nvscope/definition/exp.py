"""Lists and types as CoDeSys V2.3 exports them: ``.exp``.

Objects stand one after the other between comments that name them::

    (* @NESTEDCOMMENTS := 'Yes' *)
    (* @GLOBAL_VARIABLE_LIST := 'Drive' *)
    VAR_GLOBAL … END_VAR
    (* @OBJECT_END := 'Drive' *)
    (* @CONNECTIONS := Drive
    NUMOFCONNECTIONS : 1
    … KEY : VALUE …
    *)

The keys of a connection are documented nowhere. They are recognised by what they must contain (``PORT``, ``COBID``, …);
a value that makes no sense is left out, for the project file to supply.

With "one file for each object" each is a file of its own. Objects that declare nothing are there too: libraries, the
configurations of tasks, controller and alarms, the workspace, and the parameter manager, which is an empty file without
parameters.
"""

from __future__ import annotations

import ipaddress
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from msgspec import Struct

from nvscope.definition.comments import blank
from nvscope.definition.declarations import parse_declarations
from nvscope.definition.source import Source
from nvscope.definition.syntax import FileSyntax, GlobalBlock, ListSyntax
from nvscope.duration import parse_duration

MAX_CONNECTIONS = 4

_MARK = re.compile(
    r"\(\*\s*+@(GLOBAL_VARIABLE_LIST|OBJECT_END|NESTEDCOMMENTS)\s*+:=\s*+'?([^'\r\n*]*+)'?[^*\r\n]*+\*\)", re.IGNORECASE
)
_CONNECTIONS = re.compile(r"\(\*\s*+@CONNECTIONS\s*+:=[ \t]*+'?([^'\r\n*]*+)'?", re.IGNORECASE)
_OBJECT = re.compile(
    r"\(\*\s*+@(?i:NESTEDCOMMENTS|PATH|OBJECTFLAGS|SYMFILEFLAGS|GLOBAL_VARIABLE_LIST)\b"
    r"|^(?:TYPE|VAR_GLOBAL|FUNCTION_BLOCK|FUNCTION|PROGRAM)\b",
    re.MULTILINE,
)
_DECLARED = re.compile(r"\(\*\s*+@(?:END_DECLARATION|OBJECT_END)\b[^*\r\n]*+\*\)", re.IGNORECASE)
_EXPORT = re.compile(r"\(\*\s*@(?:GLOBAL_VARIABLE_LIST|OBJECT_END|NESTEDCOMMENTS|CONNECTIONS|PATH)\b", re.IGNORECASE)


# What an object that declares nothing begins with; a line of its own.
_OBJECT_WITHOUT_DECLARATIONS = re.compile(
    r"\s*+(?:(?:PLC_CONFIGURATION|_ALARMCONFIG|_WORKSPACE|VISUALISATION|RESOURCE|PARAMETER_MANAGER)\b"
    r"|LIBRARY[ \t]*+\r?\n)"
)


def is_export(source: Source) -> bool:
    """Return whether a text is one of CoDeSys V2.3: with the comments of an export, or beginning like an object."""
    if not source.text.strip():
        return bool(source.text) and source.file.lower().endswith(".exp")
    return _EXPORT.search(source.text) is not None or _OBJECT_WITHOUT_DECLARATIONS.match(source.text) is not None


def read_exp(source: Source) -> FileSyntax:
    """Return the lists, once for each connection, and the types of the file; neither where it holds programs only."""
    marks = list(_marks(source.text))
    # The values of a connection may hold what looks like a comment within a comment.
    text, connections = _split_connections(source)
    declared = parse_declarations(source, _blank_bodies(text), nested_comments=_nesting(marks), only_data=True)
    lists = []
    for name, offset, blocks in _by_list(declared.blocks, marks, source):
        settings = tuple(connections.get(name.upper(), ())) or ({},)
        lists.append(ListSyntax(name, offset, blocks, source, settings))
    return FileSyntax(declared.types, tuple(lists), declared.left_out)


def _blank_bodies(text: str) -> str:
    """Return the text without what follows a declaration up to the next object.

    Networks, pictures and configurations have rules of their own: an apostrophe or ``(*`` in them begins nothing.
    """
    parts: list[str] = []
    kept = 0
    while (following := _OBJECT.search(text, kept)) is not None:
        parts.append(blank(text[kept : following.start()]))
        declared = _DECLARED.search(text, following.end())
        kept = declared.end() if declared is not None else len(text)
        parts.append(text[following.start() : kept])
    parts.append(blank(text[kept:]))
    return "".join(parts)


class _Mark(Struct, frozen=True):
    kind: str
    name: str
    offset: int


def _marks(text: str) -> Iterator[_Mark]:
    for found in _MARK.finditer(text):
        yield _Mark(found[1].upper(), found[2].strip(), found.start())


def _nesting(marks: Sequence[_Mark]) -> Callable[[int], bool]:
    """Return what tells whether comments nest at an offset: as the last mark before it says of its object."""
    told = [mark for mark in marks if mark.kind == "NESTEDCOMMENTS"]
    starts = [mark.offset for mark in told]

    def nested(offset: int) -> bool:
        last = bisect_right(starts, offset) - 1
        return last < 0 or told[last].name.upper() not in {"NO", "NEIN"}

    return nested


def _by_list(
    blocks: Sequence[GlobalBlock], marks: Sequence[_Mark], source: Source
) -> Iterator[tuple[str, int, tuple[GlobalBlock, ...]]]:
    """Yield name, offset and blocks of each list; what stands outside of all is a list named like the file."""
    names = [mark for mark in marks if mark.kind != "NESTEDCOMMENTS"]
    found: dict[tuple[str, int], list[GlobalBlock]] = {}
    current: tuple[str, int] | None = None
    following = 0
    for block in blocks:
        while following < len(names) and names[following].offset < block.offset:
            mark = names[following]
            current = (mark.name, mark.offset) if mark.kind == "GLOBAL_VARIABLE_LIST" else None
            following += 1
        owner = current or next((key for key in found if key[0] == ""), ("", block.offset))
        found.setdefault(owner, []).append(block)
    for (name, _), own in found.items():
        yield name or source.stem, own[0].offset, tuple(own)


def _split_connections(source: Source) -> tuple[str, dict[str, list[dict[str, Any]]]]:
    """Return the text without blocks of connections, and what these tell, by the list's name in upper case."""
    parts: list[str] = []
    found: dict[str, list[dict[str, Any]]] = {}
    kept = 0
    while (opening := _CONNECTIONS.search(source.text, kept)) is not None:
        end = source.text.find("*)", opening.end()) + 2
        if end < 2:
            raise source.error("the connections are not closed", opening.start(), "Close them with *).")
        parts += (source.text[kept : opening.start()], blank(source.text[opening.start() : end]))
        kept = end
        known = _connections(source.text[opening.end() : end - 2])
        if known:
            found[opening[1].strip().upper()] = known
    return "".join([*parts, source.text[kept:]]), found


def _connections(text: str) -> list[dict[str, Any]]:
    """Return what is recognisable of each connection of a list; none where nothing is."""
    known: list[dict[str, Any]] = [{}]
    for line in text.splitlines():
        key, _, value = line.partition(":")
        recognised = _recognised(key, value.lstrip("=").strip(" \t;'\""))
        if recognised is None:
            continue
        field, content = recognised
        # A key that comes again begins the next connection.
        if field in known[-1] and len(known) < MAX_CONNECTIONS:
            known.append({})
        known[-1].setdefault(field, content)
    return known if any(known) else []


def _recognised(key: str, value: str) -> tuple[str, Any] | None:
    letters = re.sub(r"[^A-Z]", "", key[:60].upper())
    for words, field, read in _KEYS:
        if any(word in letters for word in words):
            try:
                return field, read(value)
            except ValueError:
                return None
    return None


def _flag(value: str) -> bool:
    words = {"1": True, "TRUE": True, "YES": True, "ON": True, "0": False, "FALSE": False, "NO": False, "OFF": False}
    if value.upper() not in words:
        raise ValueError
    return words[value.upper()]


def _number(value: str) -> int:
    number = int(value[:20])
    if not 0 < number <= 65_535:
        raise ValueError
    return number


def _duration(value: str) -> int:
    duration_ns = parse_duration(f"{value}ms" if value.isdecimal() else value)
    if duration_ns <= 0:
        raise ValueError
    return duration_ns


def _address(value: str) -> str:
    return str(ipaddress.ip_address(value))


_KEYS: tuple[tuple[tuple[str, ...], str, Callable[[str], Any]], ...] = (
    (("COBID", "LISTID", "BASEIDENTIFIER"), "list_id", _number),
    (("PORT",), "port", _number),
    (("BROADCAST", "IPADR", "IPADDR", "ADDRESS"), "address", _address),
    (("PACK",), "pack", _flag),
    (("CHECKSUM",), "checksum", _flag),
    (("ACKNOWLEDG", "CONFIRM"), "acknowledge", _flag),
    (("CYCLIC",), "cyclic", _flag),
    (("ONCHANGE",), "on_change", _flag),
    (("ONEVENT",), "on_event", _flag),
    (("INTERVAL", "CYCLETIME"), "interval_ns", _duration),
    (("MINGAP", "MINIMUMGAP", "MINTIME"), "min_gap_ns", _duration),
)
