"""What WebVisu says: bodies of requests and replies, queries of older pages, names in pages.

Readings, where the rules leave a choice:

- where a target has both READPI? and WRITEPI?, the first one counts
- parameters of a query have names in any case, are taken in their order, as often as they are there; of several VALUEs
  of one number the last one counts; a `+` is a plus
- a body to the grammar of a request may have more behind its entries: only the number of these is compared
- numbers are compared as numbers: 07 is 7, and so is `+7` with blanks around it, in an entry; what a body declares is
  digits, of any number
- of a write of one STRING without a trailing `|`, the last field belongs to the value
- CR and LF beside a `|` are taken out of requests, and only at the ends of replies
- a variable is a password where it has a byte in common with one that a list calls so, whatever its own name and type
- a cut body that was compressed is looked at as it came
- names are known by the server's address alone, its ports aside; an ADR has no name
- values written are seen, whatever they are; an empty value read is one. Of an ambiguous reply, those are seen that are
  no `???` however the fields are shared out to the texts
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote_to_bytes
from xml.etree import ElementTree

from tests.oracle.rules.visu_write import Write

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Message

MOST_ENTRIES = 10_000
STRING = 8

REQUEST = re.compile(rb"\|[01]\|\d+\|")
BEGIN_OF_REQUEST = re.compile(rb"\|([01](\|(\d+(\|.*)?)?)?)?", re.DOTALL)
QUERY = re.compile(rb"(READ|WRITE)PI\?", re.IGNORECASE)
NUMBER = re.compile(rb"[ \t]*\+?\d{1,10}[ \t]*")
PASSWORD = re.compile(r"(?:.*\.)?\s*currentpasswords?\s*(?:\[[\d\s,]*\]\s*)?", re.IGNORECASE | re.DOTALL)

Address = tuple[int, int, int, int] | str
"""Ref, offset, size, type; or the text of an ADR."""

Listed = list[tuple[str, Address]]
"""Names and where they lie."""


class Entry(NamedTuple):
    address: Address
    value: bytes | None
    """What is to be written; None: nobody knows, or an older page does not say it."""


class Asked(NamedTuple):
    """What a request asks for; ``declared`` is None in queries."""

    write: bool
    query: bool
    declared: int | None
    entries: tuple[Entry, ...]
    ambiguous: bool = False
    """Whether nobody knows all that is written: texts have a `|` in them."""

    @property
    def miscounted(self) -> bool:
        return self.declared is not None and self.declared != len(self.entries) and not self.ambiguous

    def text(self, entry: Entry) -> str | None:
        """Return what is written: what an older page does not say is nothing, of others None is what nobody knows."""
        return None if entry.value is None and not self.query else (entry.value or b"").decode("latin-1")


class Answered(NamedTuple):
    """What a reply says: one value for each of the first entries, None where there is none, and which ones it shows."""

    values: tuple[bytes | None, ...] = ()
    seen: tuple[bool, ...] = ()
    refused: bool = False
    miscounted: bool = False
    ambiguous: bool = False


def straight(body: bytes) -> bytes:
    """Return a body without the CR and LF that stand beside a `|` and at its ends."""
    return re.sub(rb"[\r\n]*\|[\r\n]*", b"|", body.strip(b"\r\n"))


def asked(method: bytes, target: bytes, body: bytes) -> Asked | None:
    """Return what a whole request asks for; None where it is none of WebVisu's."""
    if method == b"POST" and REQUEST.match(straight(body)):
        return asked_by_body(straight(body))
    query = QUERY.search(target)
    if method == b"GET" and query:
        return asked_by_query(query[1].upper() == b"WRITE", target[query.end() :])
    return None


def is_whole(asked: Asked | None, body: bytes) -> bool:
    """Whether a body, of which more might have come, has all that it says it has."""
    return asked is not None and not (asked.miscounted or asked.ambiguous) and straight(body)[-1:] == b"|"


def may_be_asked(seen: bytes, target: bytes, *, had_request: bool) -> bool:
    """Whether what is seen of a body is how a request begins, or the begin of that.

    What nothing is seen of is one on the page's address, and where requests went before it.
    """
    if not straight(seen):
        return had_request or target.split(b"?")[0].lower().split(b"/")[-1] == b"webvisu.htm"
    return BEGIN_OF_REQUEST.fullmatch(straight(seen)) is not None


def fields_of(body: bytes) -> list[bytes]:
    """Return what stands behind each `|`; behind a trailing one stands nothing."""
    fields = body.split(b"|")[1:]
    return fields[:-1] if fields and fields[-1] == b"" else fields


def asked_by_body(body: bytes) -> Asked:
    command, count, *rest = fields_of(body)
    if command == b"1":
        found, ambiguous = Write(rest, number(count), MOST_ENTRIES).told()
        return Asked(True, False, number(count), tuple(Entry(*one) for one in found), ambiguous)
    entries: list[Entry] = []
    while len(entries) < MOST_ENTRIES and len(rest) >= 5 and all(NUMBER.fullmatch(field) for field in rest[:5]):
        _, ref, offset, bytes_, type_ = map(int, rest[:5])
        entries.append(Entry((ref, offset, bytes_, type_), None))
        rest = rest[5:]
    return Asked(False, False, number(count), tuple(entries))


def number(digits: bytes) -> int:
    """Return a number; of one so long that Python would not read it, its first digits."""
    return int(digits.lstrip(b"0")[:30] or b"0")


def asked_by_query(write: bool, query: bytes) -> Asked:
    addresses: list[tuple[str, str]] = []
    values: dict[str, bytes] = {}
    for part in query.split(b"&"):
        name, _, content = part.partition(b"=")
        found = re.fullmatch(rb"(ADR|VALUE)(\d*)", name, re.IGNORECASE)
        if found is None:
            continue
        place = found[2].decode()
        if found[1].upper() == b"ADR":
            addresses.append((place, unquote_to_bytes(content).decode("latin-1")))
        else:
            values[place] = unquote_to_bytes(content)
    entries = [Entry(address, values.get(place) if write else None) for place, address in addresses[:MOST_ENTRIES]]
    return Asked(write, True, None, tuple(entries))


def answered(request: Asked, status: int, body: bytes) -> Answered:
    """Return what a whole reply says."""
    if request.query:
        return Answered(refused=request.write and status != 200)
    if request.write:
        return Answered(refused=status != 200 or body.strip() != b"|0|")
    if status != 200:
        return Answered()
    body = body.strip(b"\r\n")
    fields = fields_of(body) if body.startswith(b"|") else []
    strings = [place for place, entry in enumerate(request.entries) if entry.address[3] == STRING]
    surplus = len(fields) - len(request.entries)
    if surplus > 0 and len(strings) > 1:
        return Answered((), tuple(seen_anyway(fields, strings, len(request.entries))), ambiguous=True)
    if surplus > 0 and strings:
        at = strings[0]
        fields[at : at + surplus + 1] = [b"|".join(fields[at : at + surplus + 1])]
        surplus = 0
    values = tuple(None if field == b"???" else field for field in fields[: len(request.entries)])
    return Answered(values, tuple(value is not None for value in values), miscounted=surplus != 0)


def fit(request: Asked, response: Message) -> bool | None:
    """Tell whether a response may be the one to a request; None where nothing in it tells."""
    if response.status != 200 or response.body is None or request.miscounted or request.ambiguous:
        return None
    told = answered(request, 200, response.body)
    if request.write and told.refused:
        body = response.body.strip(b"\r\n")
        return False if body.startswith(b"|") and len(fields_of(body)) > 1 else None
    return None if told.ambiguous else not told.miscounted


def seen_anyway(fields: Sequence[bytes], strings: Sequence[int], entries: int) -> Iterator[bool]:
    """Yield of each entry whether it is no `???`, however many fields each text has."""

    def may_share(count: int, first: int, behind: int) -> bool:
        more = count - (behind - first)
        return more == 0 or (more > 0 and any(first <= place < behind for place in strings))

    for place in range(entries):
        yield not any(
            field == b"???" and may_share(at, 0, place) and may_share(len(fields) - at - 1, place + 1, entries)
            for at, field in enumerate(fields)
        )


def is_password(name: str | None) -> bool:
    return name is not None and PASSWORD.fullmatch(name) is not None


def shows_password(address: Address, lists: Iterable[Listed]) -> bool:
    """Tell whether what is asked for has a byte in common with a variable that lists call like a password."""
    if isinstance(address, str):
        return is_password(address)
    own = octets(address)
    for listed in lists:
        for name, other in listed:
            if is_password(name) and not isinstance(other, str) and other[0] == address[0]:
                theirs = octets(other)
                if own.start in theirs or theirs.start in own:
                    return True
    return False


def adds_password(listed: Listed, lists: Iterable[Listed]) -> bool:
    """Tell whether a list has a password that lists before have not: of several names of a place, one alone is kept."""
    said = {address for before in lists for name, address in before if is_password(name)}
    return any(is_password(name) and address not in said for name, address in listed)


def octets(address: tuple[int, int, int, int]) -> range:
    """Return which bytes of its area a variable is in: of an input or output bit, the one that has it."""
    ref, offset, size, kind = address
    if ref in (1, 2) and (kind == 0 or size == 0):
        offset >>= 3
    return range(offset, offset + (size or 1))


def is_page(method: bytes, target: bytes) -> bool:
    """Whether a request is for a page that may name variables."""
    return method == b"GET" and target.split(b"?")[0].lower().endswith(b".xml")


def listed_in(page: bytes) -> Listed | None:
    """Return the names that a page gives to addresses; None where it is not XML."""
    try:
        root = ElementTree.fromstring(page)
    except (ElementTree.ParseError, ValueError):
        return None
    except LookupError:  # what it says of its encoding is not known: it is that of Windows
        return listed_in(re.sub(rb"encoding=\S*?([\"'])[^\"']*\1", b'encoding="cp1252"', page, count=1))
    listed: Listed = []
    for variables in root.iter("variablelist"):
        for variable in variables.findall("variable"):
            name = variable.get("name")
            parts = (variable.text or "").strip().split(",")
            if name is not None and len(parts) == 4 and all(re.fullmatch("[0-9]{1,10}", part) for part in parts):
                ref, offset, size, type_ = map(int, parts)
                listed.append((name, (ref, offset, size, type_)))
    return listed


def contradict(before: Listed, now: Listed) -> bool:
    """Tell whether a variable of two lists begins at other places; names are the same in any case."""
    places: tuple[dict[str, set[Any]], ...] = (defaultdict(set), defaultdict(set))
    for known, listed in zip(places, (before, now), strict=True):
        for name, address in listed:
            assert isinstance(address, tuple)
            ref, offset, size, _ = address
            known[name.casefold()].add((ref, offset, size == 0))
    return any(name in places[0] and not places[0][name] & here for name, here in places[1].items())


def text_of(value: bytes | None) -> str:
    return (value or b"").decode("latin-1")
