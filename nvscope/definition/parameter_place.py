"""Index and SubIndex of a parameter as people write them."""

from __future__ import annotations

import re

U16_MAX = 0xFFFF
_PLACE = re.compile(r"(?:(?P<node>.+)/)?(?P<index>(?:0x|16#)?[0-9a-f]{1,6}):(?P<subindex>\d{1,5})", re.ASCII | re.I)
_NUMBER = re.compile(r"(?:0x|16#)(?P<hexadecimal>[0-9a-f]{1,6})|(?P<decimal>\d{1,6})", re.ASCII | re.I)


def parameter_place(text: str) -> tuple[str, int, int] | None:
    """Return node ("" without), Index and SubIndex of ``192.168.1.10/0x2000:1``; None of what is no parameter."""
    match = _PLACE.fullmatch(text.strip())
    index = place_number(match["index"]) if match else None
    subindex = place_number(match["subindex"]) if match else None
    if match is None or index is None or subindex is None:
        return None
    return (match["node"] or "").strip(), index, subindex


def place_number(text: str) -> int | None:
    """Return an Index or SubIndex, decimal or with 0x or 16# in front; None of what is none, or beyond 65535."""
    match = _NUMBER.fullmatch(text)
    if match is None:
        return None
    number = int(match["decimal"]) if match["decimal"] else int(match["hexadecimal"], 16)
    return number if number <= U16_MAX else None
