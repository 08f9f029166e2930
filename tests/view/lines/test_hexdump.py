"""Dumps with tones."""

from __future__ import annotations

import re

from nvscope.report.ansi import paint
from nvscope.view.lines.hexdump import dump
from nvscope.view.lines.table import Tone


def test_a_dump_can_be_toned() -> None:
    lines = list(dump(bytes(range(40)), ((10, Tone.FAINT), (20, Tone.STRONG))))
    plain = list(dump(bytes(range(40))))
    assert paint(lines, colour=False) == paint(plain, colour=False)
    strong = "".join(cell.text for line in lines for cell in line if cell.tone is Tone.STRONG)
    assert bytes.fromhex("".join(re.findall(r"\b[0-9a-f]{2}\b", strong))) == bytes(range(10, 20))
