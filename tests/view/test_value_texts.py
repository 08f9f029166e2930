"""Values as an engineer writes them."""

from __future__ import annotations

import pytest

from nvscope.definition.scalars import SCALARS
from nvscope.view.value_texts import value_text

DAY_NS = 86_400_000_000_000


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("BOOL", 0, "FALSE"),
        ("BOOL", 255, "TRUE"),
        ("LINT", 2**63, "-9223372036854775808"),
        ("TIME", 0, "T#0ms"),
        ("TIME", 90_500, "T#1m30s500ms"),
        ("TIME", 2**32 - 1, "T#49d17h2m47s295ms"),
        ("TOD", 1_500, "TOD#00:00:01.5"),
        ("DATE", 1_700_000_000, "D#2023-11-14"),
        ("DT", 1_700_000_000, "DT#2023-11-14-22:13:20"),
        ("LTIME", 0, "LTIME#0ns"),
        ("LTIME", 1, "LTIME#1ns"),
        ("LTIME", DAY_NS + 1_002_003, "LTIME#1d1ms2us3ns"),
        ("LTOD", 5_000_000_007, "LTOD#00:00:05.000000007"),
        ("LDATE", 1_700_000_000_000_000_000, "LD#2023-11-14"),
        ("LDT", 1_700_000_000_123_456_789, "LDT#2023-11-14-22:13:20.123456789"),
    ],
)
def test_scalars(name: str, value: int, text: str) -> None:
    scalar = SCALARS[name]
    assert value_text(scalar, value.to_bytes(scalar.size_bytes, "little")) == text
