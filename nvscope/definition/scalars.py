"""Elementary types of IEC 61131-3, as controllers send them: little-endian, without padding."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType

from nvscope.definition.variables import Scalar, ScalarKind

_MS_NS = 1_000_000
_S_NS = 1_000_000_000


def unknown_raw(name: str, *, is_one: bool = False) -> Scalar:
    """Return a type about which nothing is known, not even its size: 0; ``is_one``: but that it is one element."""
    return Scalar(name, ScalarKind.RAW, "V0", 0, is_one=is_one)


def _scalars() -> Iterator[Scalar]:
    yield Scalar("BOOL", ScalarKind.BOOL, "u1", 1)
    for size_bytes, bits, unsigned, signed in (
        (1, "BYTE", "USINT", "SINT"),
        (2, "WORD", "UINT", "INT"),
        (4, "DWORD", "UDINT", "DINT"),
        (8, "LWORD", "ULINT", "LINT"),
    ):
        order = "<" if size_bytes > 1 else ""
        yield Scalar(bits, ScalarKind.UNSIGNED, f"{order}u{size_bytes}", size_bytes)
        yield Scalar(unsigned, ScalarKind.UNSIGNED, f"{order}u{size_bytes}", size_bytes)
        yield Scalar(signed, ScalarKind.SIGNED, f"{order}i{size_bytes}", size_bytes)
    yield Scalar("REAL", ScalarKind.REAL, "<f4", 4)
    yield Scalar("LREAL", ScalarKind.REAL, "<f8", 8)
    yield Scalar("TIME", ScalarKind.DURATION, "<u4", 4, _MS_NS)
    yield Scalar("TOD", ScalarKind.TIME_OF_DAY, "<u4", 4, _MS_NS)
    yield Scalar("DATE", ScalarKind.DATE, "<u4", 4, _S_NS)
    yield Scalar("DT", ScalarKind.DATE_AND_TIME, "<u4", 4, _S_NS)
    # LTIME and the following: inferred, no telegram of a real controller has been seen.
    yield Scalar("LTIME", ScalarKind.DURATION, "<u8", 8, 1)
    yield Scalar("LTOD", ScalarKind.TIME_OF_DAY, "<u8", 8, 1)
    yield Scalar("LDATE", ScalarKind.DATE, "<u8", 8, 1)
    yield Scalar("LDT", ScalarKind.DATE_AND_TIME, "<u8", 8, 1)
    yield Scalar("CHAR", ScalarKind.RAW, "V1", 1)
    yield Scalar("WCHAR", ScalarKind.RAW, "V2", 2)
    # How a BIT is packed, and how large an address is, depends on the controller.
    yield unknown_raw("BIT")
    for name in ("POINTER", "REFERENCE", "__XWORD", "__UXINT", "__XINT"):
        yield unknown_raw(name, is_one=True)


SCALARS = MappingProxyType({scalar.name: scalar for scalar in _scalars()})
"""All elementary types but strings, by name."""

ALIASES = MappingProxyType(
    {
        "TIME_OF_DAY": "TOD",
        "DATE_AND_TIME": "DT",
        "LTIME_OF_DAY": "LTOD",
        "LDATE_AND_TIME": "LDT",
    }
)
"""Further names of elementary types."""

_LIBRARY_BLOCKS = "TON TOF TP RTC CTU CTD CTUD R_TRIG F_TRIG SR RS SEMA LTON LTOF LTP"
LIBRARY_BLOCKS = frozenset(_LIBRARY_BLOCKS.split())
"""Function blocks of the standard library, which no file declares."""


def find_scalar(name: str) -> Scalar | None:
    """Return the elementary type of a name in any case."""
    upper = name.upper()
    return SCALARS.get(ALIASES.get(upper, upper))
