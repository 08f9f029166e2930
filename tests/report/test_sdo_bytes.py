"""Bytes of parameters that take several lines: a line is broken between bytes, never within one."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.report.sdo import render


def document(data: bytes) -> dict[str, object]:
    """Return what was read of a parameter of which nobody knows the type."""
    return {
        "verb": "read", "outcome": "read", "name": None, "index": 0x2000, "subindex": 1, "type": None,
        "value": {"bytes": data.hex(), "items": 1, "elements": None}, "exchanges": [{"latency_ns": 1_000_000}],
    }  # fmt: skip


@pytest.mark.parametrize("width", [20, 47, 80])
@given(data=st.binary(min_size=1, max_size=600))
def test_lines_break_between_bytes(width: int, data: bytes) -> None:
    text = render(document(data), width=width)
    assert max(map(len, text.splitlines())) <= width
    shown = " ".join(line.strip() for line in text.splitlines()).partition(" = ")[2]
    assert shown.startswith(data.hex(" "))
    assert re.fullmatch(r"(?:[0-9a-f]{2} )+ *[0-9]+ bytes?, after 1\.0 ms", shown)
