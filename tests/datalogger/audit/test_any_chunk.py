"""An audit tells the same however many rows are looked at together."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit.audit import audited
from nvscope.datalogger.audit.document import document
from tests.datalogger.audit.built import Row, write
from tests.laws import some

DECLARED = {"a": "FLOAT", "b": "FLOAT", "c": "INT", "d": "INT"}
AT_ONCE = (16_000, 40, 7)
"""Among few rows, some tasks have none, or all of them have no value."""


def drawn(chance: random.Random) -> list[Row]:
    """Return runs with tasks of their own, with rows that are missing, told or not, and rows without any value."""
    blank, no_number = chance.choice([0, 0.05, 0.3]), chance.choice([0, 0.1])
    lost, missing = chance.choice([0, 0.01, 0.05]), chance.choice([0, 0.02, 0.1])
    rows, begin_ms = list[Row](), 0
    for run in range(chance.randint(1, 4)):
        tasks: list[list[str]] = [[] for _ in range(chance.randint(1, 3))]
        for name in DECLARED:
            chance.choice(tasks).append(name)
        span_ms, own = chance.choice([300, 1_000, 4_000]), list[tuple[int, dict[str, Any]]]()
        for place, names in enumerate(filter(None, tasks)):
            for at_ms in range(place, span_ms, chance.choice([10, 20, 50, 100])):
                if chance.random() < missing:
                    continue
                is_blank = chance.random() < blank
                values = {name: None if is_blank or chance.random() < no_number else 1 for name in names}
                own.append((at_ms, values))
        for number, (at_ms, values) in enumerate(sorted(own, key=lambda one: one[0])):
            is_lost = (run > 0 and not number) or chance.random() < lost
            skipped = int(chance.random() < 1 / 300)
            rows.append(Row(begin_ms + at_ms, values, consistent=int(not is_lost), skipped=skipped))
        begin_ms += span_ms + chance.choice([0, 5, 3_000]) - chance.choice([0] * 9 + [200])
    return rows


@pytest.mark.parametrize("seed", some(range(60)))
def test_figures_and_findings_are_the_same_however_many_rows_are_looked_at_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    path = str(write(tmp_path / "x.db", drawn(random.Random(seed)), DECLARED, changes=False))
    found = []
    for rows in AT_ONCE:
        monkeypatch.setattr(table_rows, "_ROWS", rows)
        found.append(document(audited([path])))
    assert all(one == found[0] for one in found)
