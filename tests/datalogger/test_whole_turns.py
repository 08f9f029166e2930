"""Losses of about as many telegrams as a Counter counts: it seems to go on, stand still or run back, and time tells."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.datalogger.recording import record_in_batches, rows_in

BEFORE, BEHIND = 300, 100
TURNS = {
    65536: [65533, 65534, 65535, 65536, 65537, 32766, 32767, 65472],
    65535: [65532, 65533, 65534, 65535, 65536],
    256: [254, 255, 256, 257, 511, 512, 513],
}
"""After so many values a sender begins at 0 again, and how many telegrams are lost."""


def telegrams(turn: int, lost: int) -> list[Packet]:
    """Return what a list sends each 10 ms, of which so many in the middle do not come, and another one that goes on."""
    numbers = [*range(BEFORE), *range(BEFORE + lost, BEFORE + lost + BEHIND)]
    own = [
        Packet(START_NS + 10 * MS * one, "10.0.0.1", 1, 0, 1, (1 + one) % turn, (one % 60_000).to_bytes(2, "little"))
        for one in numbers
    ]
    step = max(numbers[-1] // 2000, 1)
    others = [
        Packet(START_NS + 10 * MS * one + 3 * MS, "10.0.0.2", 2, 0, 1, place % 65536, (place % 9).to_bytes(2, "little"))
        for place, one in enumerate(range(0, numbers[-1], step))
    ]
    return sorted([*own, *others], key=lambda one: one.time_ns)


def is_gap(before: int, counter: int) -> bool:
    """Return whether a Counter shows that telegrams are missing in front of it (diagnosis.md, section 4)."""
    distance = (counter - before) % 65536
    wraps = counter == 0 and before in (255, 65534)
    begins = counter in (0, 1) and before < 65534
    return 2 <= distance < 32768 and not wraps and not begins


@pytest.mark.parametrize("is_cyclic", [True, False])
@pytest.mark.parametrize(("turn", "lost"), [(turn, lost) for turn, every in TURNS.items() for lost in every])
def test_the_row_behind_such_a_loss_says_so(tmp_path: Path, turn: int, lost: int, is_cyclic: bool) -> None:
    """Of a list that is sent on change, no time is too long: what its Counter does not show, nobody knows."""
    lists = [
        DefinedList("axis", 1, (("VarA", "UINT"),), 10 * MS if is_cyclic else None),
        DefinedList("press", 2, (("VarB", "UINT"),), None),
    ]
    made = Plant(lists, telegrams(turn, lost), Session({"VarA": (1, "VarA")}, task=1), "axis")
    record_in_batches(tmp_path, made.write(tmp_path), made, 100_000)
    rows = rows_in(tmp_path / "log.db")
    assert len(rows) == BEFORE + BEHIND
    shows = is_gap(BEFORE % turn, (BEFORE + lost + 1) % turn)
    wanted = [(BEFORE + lost) % 60_000] if is_cyclic or shows else []
    assert [row.columns[0] for row in rows if not row.consistent] == wanted
