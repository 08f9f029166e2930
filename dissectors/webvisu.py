"""WebVisu of CoDeSys V2.3: the bodies with which pages ask for variables, and what controllers answer.

Source: The Communication Protocol of WebVisu (document of the seeds), and ``webvisu.md`` sections 1 to 3. Total: no
bytes raise, and what is wrong with a body is told beside what could be read of it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from enum import Enum, IntEnum
from functools import cached_property
from typing import NamedTuple
from urllib.parse import unquote

from msgspec import Struct

from dissectors.webvisu_entries import divide, is_number

TYPES = (
    "BOOL", "INT", "BYTE", "WORD", "DINT", "DWORD", "REAL", "TIME", "STRING", "ARRAY", "ENUM", "USERDEF", "BITORBYTE",
    "POINTER", "SINT", "USINT", "UINT", "UDINT", "DATE", "TOD", "DT", "VOID", "LREAL", "REF", "NONE",
)  # fmt: skip
"""What type codes are called, by code."""

STRING = TYPES.index("STRING")
_BOOL = TYPES.index("BOOL")
_BIT_AREAS = (1, 2)
MOST_ENTRIES = 10_000
"""So many entries of a request are read."""

MOST_DECLARED = 10**18
"""Of more entries than that, a request says no more than that it has so many."""

MOST_ADDRESS_CHARACTERS = 256
"""Addresses of older pages, and names of variables, are cut behind so many characters."""

PAGE = "webvisu.htm"
"""What the page is called to which requests are posted, in small letters."""

UNREADABLE = "???"
"""What a controller answers in place of a value that it cannot read."""

_DONE = b"|0|"
_BREAKS = re.compile(rb"[\r\n]*\|[\r\n]*")
_REQUEST = re.compile(rb"\|([01])\|(\d+)\|")
_MAY_BECOME = re.compile(rb"\|(?:[01](?:\|\d*)?)?\Z")
_PASSWORD = re.compile(r"(?:.*\.)?\s*CurrentPasswords?\s*(?:\[[\d\s,]*\]\s*)?\Z", re.IGNORECASE | re.DOTALL)
_QUERY = re.compile(r"(READPI|WRITEPI)\?(.*)\Z", re.IGNORECASE | re.DOTALL)
_ENTRY_FIELDS = 5
_FIRST = 2


class Place(NamedTuple):
    """Where a variable lies: memory area (``ref``), offset in it, size in bytes (0: a bit), and code of its type."""

    ref: int
    offset: int
    size: int
    type: int

    @property
    def text(self) -> str:
        """What the variable is called where it has no name."""
        return f"{self.ref},{self.offset},{self.size},{self.type}"

    @property
    def span(self) -> tuple[int, int]:
        """The bytes of its area that it lies in, from the first one to that behind the last; a bit lies in one."""
        counts_bits = self.ref in _BIT_AREAS and (not self.size or self.type == _BOOL)
        start = self.offset // 8 if counts_bits else self.offset
        return start, start + max(self.size, 1)

    @property
    def type_name(self) -> str:
        """What its type is called."""
        return TYPES[self.type] if self.type < len(TYPES) else f"type {self.type}"


class Entry(NamedTuple):
    """A variable that a request is about; ``value`` is what is written, None in a read.

    In a write it is None where nobody knows how far a text goes, for it may have a separator in it. ``number`` is what
    the request numbers it, which need not be its place. In the requests of older pages, ``place`` is the address as
    text: ``MW230``.
    """

    number: int
    place: Place | str
    value: str | None = None

    @property
    def address(self) -> str:
        """What the variable is called where it has no name."""
        return self.place if isinstance(self.place, str) else self.place.text

    @property
    def is_string(self) -> bool:
        """Whether it is asked for as STRING, whose values may have anything in them."""
        return isinstance(self.place, Place) and self.place.type == STRING


class Request(Struct, frozen=True, dict=True):
    """What a request asks for: to read its entries or to write them; ``declared`` is how many it says there are.

    ``query``: it is one of the older pages, READPI or WRITEPI, whose reply is as the page wants it.
    ``ambiguous``: it writes texts with separators in them, and nobody knows what else; its entries are those that it
    has in any case. ``rest`` is how many fields behind the entries of a write are none. ``is_part``: it was never sent
    whole, and nobody knows for which variables, nor, where it does not say that it writes, whether it reads.
    """

    writes: bool
    declared: int
    entries: Sequence[Entry]
    query: bool = False
    ambiguous: bool = False
    rest: int = 0
    is_part: bool = False

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Pages ask the same again and again, and what is kept by request is looked up each time."""
        return hash((self.writes, self.declared, self.entries, self.query, self.ambiguous, self.rest, self.is_part))

    @property
    def is_miscounted(self) -> bool:
        """Whether it says another number of entries than it has."""
        return self.declared != len(self.entries) and not self.ambiguous

    @property
    def may_write_more(self) -> bool:
        """Whether it may write other variables than its entries, too."""
        return self.ambiguous or self.rest > 0

    @cached_property
    def strings(self) -> int:
        """How many of its entries are STRINGs."""
        return sum(entry.is_string for entry in self.entries)


class Answer(Enum):
    """What a reply is to its request.

    ``DONE`` holds as many values as were asked for, or says that a write is done. ``MISCOUNTED`` holds more or fewer;
    ``AMBIGUOUS`` more, and several of them may be parts of a STRING. ``REFUSED``: a write was not done.
    """

    DONE = "done"
    MISCOUNTED = "miscounted"
    AMBIGUOUS = "ambiguous"
    REFUSED = "refused"


class Reply(Struct, frozen=True):
    """What a controller answers: values by position, as text, None where it could not read one."""

    answer: Answer
    values: Sequence[str | None] = ()


def is_password(name: str) -> bool:
    """Tell whether a variable of this name holds a password: names are the same in any case."""
    return _PASSWORD.match(name) is not None


def is_request(body: bytes) -> bool:
    """Tell whether the body of a POST is a request of a WebVisu page: by that alone, for others have the same URL."""
    return _REQUEST.match(_tidy(body)) is not None


class Likeness(IntEnum):
    """Whether a message of which not all is there may be a request of a page: no, perhaps, or by all that is there.

    ``PERHAPS``: nothing is there that would tell it from those of other pages.
    """

    NO = 0
    PERHAPS = 1
    YES = 2


def likeness(body: bytes, target: str) -> Likeness:
    """Tell whether a POST may be a request of which this begin of the body is there; ``target`` is '' if that is not.

    Without anything of its body, the name of the page is all there is to tell it by.
    """
    tidy = _tidy(body)
    if tidy:
        return Likeness.YES if _REQUEST.match(tidy) or _MAY_BECOME.match(tidy) else Likeness.NO
    page = target.partition("?")[0].rpartition("/")[2].lower()
    return Likeness.YES if page == PAGE else Likeness.PERHAPS


def read_request(body: bytes) -> Request | None:
    """Read the body of a POST; None where it is no request of a WebVisu page."""
    tidy = _tidy(body)
    head = _REQUEST.match(tidy)
    if head is None:
        return None
    writes = head[1] == b"1"
    digits = head[2].lstrip(b"0")
    declared = MOST_DECLARED if len(digits) >= len(str(MOST_DECLARED)) else int(digits or b"0")
    fields = tidy.decode("latin-1").split("|")[1:]
    if fields and not fields[-1]:
        fields.pop()
    fields = fields[_FIRST:]
    if writes:
        return _write(declared, fields)
    entries = []
    for start in range(0, min(len(fields), MOST_ENTRIES * _ENTRY_FIELDS) - _ENTRY_FIELDS + 1, _ENTRY_FIELDS):
        numbers = fields[start : start + _ENTRY_FIELDS]
        if not all(map(is_number, numbers)):
            break
        entries.append(_entry(numbers, None))
    return Request(writes, declared, tuple(entries))


def _write(declared: int, fields: Sequence[str]) -> Request:
    division = divide(fields, declared, STRING, MOST_ENTRIES)
    entries = []
    for start, stop in division.pieces:
        begin = start + _ENTRY_FIELDS
        entries.append(_entry(fields[start:begin], None if stop is None else "|".join(fields[begin:stop])))
    return Request(True, declared, tuple(entries), ambiguous=division.ambiguous, rest=division.rest)


def _entry(numbers: Sequence[str], value: str | None) -> Entry:
    number, *place = map(int, numbers)
    return Entry(number, Place(*place), value)


def query_parts(target: str) -> tuple[str, Sequence[tuple[str, str]]] | None:
    """Return READPI or WRITEPI, and the names (in capitals) and texts of a URL behind it, as they are written.

    None of a URL that has neither: what stands in front of it, as of ``webvisu.htm?READPI?ADR=MW230``, is no part.
    """
    found = _QUERY.search(target)
    if found is None:
        return None
    parts = [part.partition("=") for part in found[2].split("&")[: 3 * MOST_ENTRIES]]
    return found[1].upper(), [(name.upper(), text) for name, _, text in parts]


def read_query(target: str) -> Request | None:
    """Read what an older page asks for by a URL; None where it asks for nothing."""
    found = query_parts(target)
    if found is None:
        return None
    writes = found[0] == "WRITEPI"
    addresses: list[str] = []
    values: dict[str, str] = {}
    places: list[str] = []
    for name, text in found[1]:
        if name.startswith("ADR") and (name[3:].isdecimal() or not name[3:]):
            addresses.append(unquote(text, "latin-1")[:MOST_ADDRESS_CHARACTERS])
            places.append(name[3:])
        elif name.startswith("VALUE"):
            values[name[5:]] = unquote(text, "latin-1")
    entries = [
        Entry(index, address, values.get(place, "") if writes else None)
        for index, (address, place) in enumerate(zip(addresses, places, strict=True))
    ]  # fmt: skip
    return Request(writes, len(entries), tuple(entries), query=True)


def answer_of(request: Request, body: bytes) -> Answer:
    """Tell what the reply to a request is, by the body of one with status 200."""
    if request.query:
        return Answer.DONE
    if request.writes:
        return Answer.DONE if body.strip() == _DONE else Answer.REFUSED
    surplus = fields_in_reply(body) - len(request.entries)
    if surplus > 0 and request.strings:
        return Answer.AMBIGUOUS if request.strings > 1 else Answer.DONE
    return Answer.MISCOUNTED if surplus else Answer.DONE


def read_reply(request: Request, body: bytes) -> Reply:
    """Read the body of the reply to a request, of status 200."""
    answer = answer_of(request, body)
    if request.query or request.writes or answer is Answer.AMBIGUOUS:
        return Reply(answer)
    fields = _reply_fields(body)
    asked = len(request.entries)
    surplus = len(fields) - asked
    if surplus > 0 and request.strings == 1:
        place = next(place for place, entry in enumerate(request.entries) if entry.is_string)
        fields[place : place + surplus + 1] = ["|".join(fields[place : place + surplus + 1])]
    return Reply(answer, tuple(None if text == UNREADABLE else text for text in fields[:asked]))


def seen_in_reply(request: Request, body: bytes) -> Collection[int]:
    """Return the places of the entries of a read whose values are in a reply, whichever way that is divided."""
    reply = read_reply(request, body)
    if reply.answer is not Answer.AMBIGUOUS:
        return {place for place, value in enumerate(reply.values) if value is not None}
    fields, strings = _reply_fields(body), [place for place, entry in enumerate(request.entries) if entry.is_string]
    surplus = len(fields) - len(request.entries)
    # What is there alone lies so many fields behind its place as texts in front of it may have too many.
    moves = (
        (0 if place < strings[-1] else surplus, surplus if place > strings[0] else 0)
        for place in range(len(request.entries))
    )
    return {
        place for place, (least, most) in enumerate(moves)
        if UNREADABLE not in fields[place + least : place + most + 1]
    }  # fmt: skip


def is_like_reply(body: bytes) -> bool:
    """Tell whether a body is parted as those of replies are, whatever was asked for."""
    tidy = body.strip(b"\r\n")
    return len(tidy) > 1 and tidy.startswith(b"|") and tidy.endswith(b"|")


def fields_in_reply(body: bytes) -> int:
    """Return how many fields the reply to a read has."""
    tidy = body.strip(b"\r\n")
    if not tidy.startswith(b"|"):
        return 0
    return tidy.count(b"|") - tidy.endswith(b"|")


def _reply_fields(body: bytes) -> list[str]:
    tidy = body.strip(b"\r\n")
    if not tidy.startswith(b"|"):
        return []
    fields = tidy.decode("latin-1").split("|")[1:]
    if not fields[-1]:
        fields.pop()
    return fields


def _tidy(body: bytes) -> bytes:
    if b"\n" in body or b"\r" in body:
        return _BREAKS.sub(b"|", body).strip(b"\r\n")
    return body
