"""What older pages ask for by a URL: variables by their IEC address, values in a format of C.

::

    READPI?ADR=MW230&FORMAT=%d
    WRITEPI?ADR1=MW230&VALUE1=12&FORMAT1=%d&ADR2=…

Source: ``webvisu.md``, section 4; of addresses, what The Communication Protocol of WebVisu (document of the seeds) says
of two: %MB0 is 0,0,1, and %QX3.0 is 2,48,0: bits are counted through words, words through bytes. That the other sizes
follow is inferred, and so are replies: values a line each, and nothing for a write.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from urllib.parse import unquote

from msgspec import Struct
from msgspec.structs import replace

from dissectors.webvisu import TYPES, Place, Request, query_parts, read_query
from nvscope.plc.visu.value import shown

_ADDRESS = re.compile(r"%?([MIQ])(?:X(\d{1,6})\.(\d{1,2})|([BWD])(\d{1,6}))", re.ASCII | re.IGNORECASE)
_FORMAT = re.compile(r"%(0?\d{0,2}(?:\.\d{1,2})?)l?([diuxXfeEgGs])", re.ASCII)
_REFS = {"M": 0, "I": 1, "Q": 2}
_SIZES = {"B": (1, "BYTE"), "W": (2, "WORD"), "D": (4, "DWORD")}
_WORD_BITS = 16
_WHOLE, _WITHOUT_SIGN = "diuxX", "uxX"

Bytes = tuple[int, int, int]
"""Area, offset and size of a variable, whatever its type."""


class Query(Struct, frozen=True):
    """What is asked for, by places, and in which format each value is wanted, '' where nobody said."""

    asked: Request
    formats: Sequence[str]


def is_query(target: str) -> bool:
    """Tell whether a URL is one of these."""
    return read_query(target) is not None


def name_of_query(target: str) -> str:
    """Return such a URL up to READPI or WRITEPI: what follows may hold a password that was to be written."""
    name, _ = query_parts(target) or ("", ())
    return target[: target.upper().find(f"{name}?") + len(name)]


def why_no_query(target: str) -> str:
    """Return why nothing can be asked for by such a URL; it may not be printable."""
    found = read_query(target)
    if found is None or not found.entries:
        return "it names no address (ADR)"
    wrong = [one.address for one in found.entries if direct_place(one.address) is None]
    return f"{wrong[0] or 'nothing'} is no address such as MW230" if wrong else "GET alone asks for variables"


def page_query(target: str, by_bytes: Mapping[Bytes, Place]) -> Query | None:
    """Return what a URL asks for, None where it asks for nothing, or names an address that is none.

    ``by_bytes`` has the variables that there are; what lies elsewhere has a type by its size.
    """
    found = read_query(target)
    if found is None:
        return None
    entries = []
    for entry in found.entries:
        place = direct_place(entry.address)
        if place is None:
            return None
        entries.append(entry._replace(place=by_bytes.get(place[:3], place)))
    return Query(replace(found, entries=tuple(entries)), _formats(target))


def direct_place(address: str) -> Place | None:
    """Return where an IEC address such as MW230 lies, None for what is none, and for single bits of %M."""
    found = _ADDRESS.fullmatch(address.strip())
    if found is None:
        return None
    area, word, bit, size, number = found.groups()
    ref = _REFS[area.upper()]
    if word is not None:
        if ref == 0 or int(bit) >= _WORD_BITS:
            return None  # nobody says what the offset of a bit in a byte of memory is
        return Place(ref, int(word) * _WORD_BITS + int(bit), 0, TYPES.index("BOOL"))
    size_bytes, kind = _SIZES[size.upper()]
    return Place(ref, int(number) * size_bytes, size_bytes, TYPES.index(kind))


def formatted(place: Place, raw: str, wanted: str) -> str:
    """Return a value in a format of C; as it goes onto the wire where the format is none for it."""
    found = _FORMAT.fullmatch(wanted)
    value = shown(place, raw).value
    if found is None or value is None:
        return raw
    width, kind = found.groups()
    if kind == "s":
        return f"%{width}s" % raw
    if isinstance(value, str):
        return raw
    if kind not in _WHOLE:
        return f"%{width}{kind}" % float(value)
    number = int(value)
    if number < 0 and kind in _WITHOUT_SIGN:
        number %= 1 << 8 * max(place.size, 1)
    return f"%{width}{'d' if kind == 'u' else kind}" % number


def _formats(target: str) -> Sequence[str]:
    """Return the formats of the addresses, in their order."""
    places: list[str] = []
    formats: dict[str, str] = {}
    _, parts = query_parts(target) or ("", ())
    for name, text in parts:
        if name.startswith("ADR") and (name[3:].isdecimal() or not name[3:]):
            places.append(name[3:])
        elif name.startswith("FORMAT"):
            # Pages write the % of a format as it is; %04x is none of the escapes of URLs, and %25d one.
            formats[name[6:]] = unquote(text, "latin-1") if text.startswith("%25") else text
    return [formats.get(place, "") for place in places]
