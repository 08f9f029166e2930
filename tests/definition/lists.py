"""Lists for tests: drawn at random, and as their telegrams."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from hypothesis import strategies as st

from nvscope.definition.model import ListDefinition
from nvscope.definition.position import Position
from nvscope.definition.variables import (
    Array,
    Enumeration,
    Member,
    Scalar,
    ScalarKind,
    String,
    Structure,
    Type,
    Union,
    Variable,
)
from tests.oracle.frame import Frame

BOOL = Scalar("BOOL", ScalarKind.BOOL, "u1", 1)
BYTE = Scalar("BYTE", ScalarKind.UNSIGNED, "u1", 1)
INT = Scalar("INT", ScalarKind.SIGNED, "<i2", 2)
UDINT = Scalar("UDINT", ScalarKind.UNSIGNED, "<u4", 4)
LINT = Scalar("LINT", ScalarKind.SIGNED, "<i8", 8)
REAL = Scalar("REAL", ScalarKind.REAL, "<f4", 4)
LREAL = Scalar("LREAL", ScalarKind.REAL, "<f8", 8)
TIME = Scalar("TIME", ScalarKind.DURATION, "<u4", 4, unit_ns=1_000_000)
STATE = Enumeration("eState", INT, {"eOff": 0, "eRun": 1, "eFault": -1})
UNKNOWN = Union("uAny", (Member("a", INT), Member("b", UDINT)))
HERE = Position("test.gvl", 1, 1)

SCALARS: st.SearchStrategy[Type] = st.one_of(
    st.sampled_from([BOOL, BYTE, INT, UDINT, LINT, REAL, LREAL, TIME, STATE, UNKNOWN]),
    st.builds(String, st.integers(0, 12), st.booleans()),
)
BOUNDS = st.integers(-2, 2).flatmap(lambda low: st.tuples(st.just(low), st.integers(low, low + 3)))
TYPES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.builds(Array, st.lists(BOUNDS, min_size=1, max_size=2).map(tuple), inner),
        st.lists(inner, min_size=1, max_size=4).map(
            lambda types: Structure("stAny", tuple(Member(f"m{place}", kind) for place, kind in enumerate(types)))
        ),
    ),
    max_leaves=6,
)
VARIABLES = st.lists(TYPES, min_size=1, max_size=12)


def list_of(types: Sequence[Type], *, pack: bool = True, list_id: int = 7) -> ListDefinition:
    """Return a list with a variable of each type: ``v0``, ``v1`` …"""
    variables = tuple(Variable(f"v{place}", kind, HERE) for place, kind in enumerate(types))
    return ListDefinition("test", HERE, variables, list_id=list_id, pack=pack)


def telegram(data: bytes, items: int, *, subindex: int, counter: int, ts_ns: int, list_id: int = 7) -> Frame:
    """Return a data telegram as an Ethernet frame from 10.0.0.1, broadcast."""
    header = struct.pack("<IIHHHHHBB", 0x33532D00, 0, list_id, subindex, items, 20 + len(data), counter & 0xFFFF, 0, 0)
    udp = struct.pack(">HHHH", 1202, 1202, 8 + len(header) + len(data), 0)
    ip = struct.pack(
        ">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp) + len(header) + len(data), 0, 0, 64, 17, 0, b"\x0a\0\0\1", b"\xff" * 4
    )
    frame = b"\xff" * 6 + b"\2\0\0\0\0\1" + b"\x08\0" + ip + udp + header + data
    return Frame(ts_ns, 1, frame, len(frame))
