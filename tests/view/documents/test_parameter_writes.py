"""Writes of parameters as data: values by the types that the project gives, by their bytes where it gives none."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from nvscope.definition.parameters import ParameterDefinition, Parameters
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Array, Enumeration, Member, String, Structure
from nvscope.tracker.parameter.values import Value
from nvscope.tracker.parameter.writes import Outcome, Write
from nvscope.view.documents.parameter_writes import sdo_write_rows

STATE = Enumeration("E_State", SCALARS["INT"], {"eOff": 0, "eRun": 5})
REALS = Array(((1, 2),), SCALARS["REAL"])
KNOWN = Parameters(
    (
        ParameterDefinition(0x2000, 1, "rSpeed", SCALARS["REAL"], "10.0.0.2"),
        ParameterDefinition(0x2000, 1, "of others"),
        ParameterDefinition(0x2001, 0, "", SCALARS["INT"]),
        ParameterDefinition(0x2002, 0, "sName", String(4)),
        ParameterDefinition(0x2003, 0, "tRun", SCALARS["TIME"]),
        ParameterDefinition(0x2004, 0, "stAxis", Structure("Axis", (Member("nState", STATE), Member("arPos", REALS)))),
    )
)
AXIS = struct.pack("<hff", 5, 1.5, -2)
LONG = bytes(range(256))


def value(data: bytes, items: int = 1, size_bytes: int | None = None) -> Value:
    return Value(data, len(data) if size_bytes is None else size_bytes, items)


def write(index: int, subindex: int, new: Value, old: Value | None = None, partner: str = "10.0.0.2") -> Write:
    return Write(5, 7, "10.0.0.1", partner, 1202, index, subindex, old, new)


@pytest.mark.parametrize(
    ("one", "name", "kind", "new", "text"),
    [
        (write(0x2000, 1, value(struct.pack("<f", 12.5))), "rSpeed", "REAL", 12.5, "12.5"),
        (write(0x2000, 1, value(struct.pack("<f", float("inf")))), "rSpeed", "REAL", None, "inf"),
        (write(0x2000, 1, value(b"\1\2"), partner="10.0.0.3"), "of others", None, "0102", "01 02"),
        (write(0x2001, 0, value(b"\1\0\xfe\xff", 2)), None, "INT", [1, -2], "[0] = 1, [1] = -2"),
        (write(0x2001, 0, value(b"\1\0" * 8, 8)), None, "INT", [1] * 8,
         "[0] = 1, [1] = 1, [2] = 1, [3] = 1, [4] = 1, [5] = 1, … (8 elements)"),
        # What does not fit its type is told by its bytes.
        (write(0x2001, 0, value(b"\1\0\0")), None, "INT", "010000", "01 00 00"),
        (write(0x2001, 0, value(b"\1\0", 0)), None, "INT", "0100", "01 00"),
        (write(0x2001, 0, value(b"")), None, "INT", "", "no bytes"),
        (write(0x2001, 0, value(b"", size_bytes=2)), None, "INT", "", "… (2 bytes)"),
        (write(0x2001, 0, value(LONG, 150, 300)), None, "INT", LONG.hex(), "00 01 02 03 04 05 06 07 … (300 bytes)"),
        (write(0x2002, 0, value(b"ab\x1b\0x")), "sName", "STRING(4)", "ab\x1b", "'ab\x1b'"),
        (write(0x2003, 0, value(b"\xe8\3\0\0")), "tRun", "TIME", 1_000_000_000, "T#1s"),
        (write(0x2004, 0, value(AXIS)), "stAxis", "Axis", [5, 1.5, -2.0],
         "nState = eRun (5), arPos[1] = 1.5, arPos[2] = -2"),
        (write(7, 0, value(bytes(9))), None, None, "00" * 9, "00 00 00 00 00 00 00 00 … (9 bytes)"),
    ],
)  # fmt: skip
def test_a_value(one: Write, name: str | None, kind: str | None, new: Any, text: str) -> None:
    (row,) = sdo_write_rows([one], KNOWN)
    assert (row["name"], row["type"], row["new"], row["new_text"]) == (name, kind, new, text)
    assert row["new_bytes"] == one.new.size_bytes
    assert (row["old"], row["old_text"], row["old_bytes"]) == (None, None, None)


def test_a_row_says_who_and_what_became_of_it() -> None:
    one = Write(
        1_700_000_000_000_000_001, 7, "10.0.0.1", "10.0.0.2", 1203, 0x2000, 1, value(b"\1"), value(b"\2"),
        Outcome.REFUSED, "ODErrorReplyAccess", 9,
    )  # fmt: skip
    assert list(sdo_write_rows([one], None, {"10.0.0.2": "press"})) == [
        {
            "time_ns": "1700000000000000001", "frame": 7, "requester": "10.0.0.1", "requester_name": None,
            "partner": "10.0.0.2", "partner_name": "press", "port": 1203, "index": 0x2000, "subindex": 1, "name": None,
            "type": None, "old": "01", "new": "02", "old_text": "01", "new_text": "02", "old_bytes": 1, "new_bytes": 1,
            "outcome": "refused", "error": "ODErrorReplyAccess", "answer_frame": 9,
        }
    ]  # fmt: skip
