"""Bodies of requests as WebVisu pages send them. None of them is malformed, whatever it is made of."""

from __future__ import annotations

from collections.abc import Sequence

from dissectors.webvisu import Place

MOST_AT_ONCE = 200
"""As many variables as one request asks for: controllers have little room."""

_FORBIDDEN = {"|": "'|'", "\r": "a line break", "\n": "a line break", "\0": "a character NUL"}


def read_body(places: Sequence[Place]) -> bytes:
    """Return what asks for the values at some places, ``MOST_AT_ONCE`` at most; ValueError for more, or none."""
    if not 0 < len(places) <= MOST_AT_ONCE:
        raise ValueError(f"a request reads 1 to {MOST_AT_ONCE} variables, not {len(places)}")
    entries = "".join(f"|{number}|{_fields(place)}" for number, place in enumerate(places))
    return f"|0|{len(places)}{entries}|".encode("ascii")


def write_body(place: Place, value: str) -> bytes:
    """Return what writes a value; ValueError for one that would be more than a value, or is not ISO-8859-1."""
    if wrong := next((one for one in value if one in _FORBIDDEN), ""):
        raise ValueError(f"a value cannot have {_FORBIDDEN[wrong]} in it: nothing in these requests can be quoted")
    try:
        text = value.encode("iso-8859-1")
    except UnicodeEncodeError as error:
        raise ValueError(f"'{value[error.start]}' is no character of ISO-8859-1 (Western Europe)") from None
    return f"|1|1|0|{_fields(place)}|".encode("ascii") + text + b"|"


def _fields(place: Place) -> str:
    return "|".join(map(str, place))
