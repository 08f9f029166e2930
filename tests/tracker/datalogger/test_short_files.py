"""Series whose files have a few rows each: what a file had that is gone is unknown, however little is usual before."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.open import open_sink
from tests.laws import crossed, examples
from tests.packets import batch_of
from tests.tracker.datalogger.logs import as_changes, write_log
from tests.tracker.datalogger.test_holes import LATE, Plant, write_stored
from tests.tracker.datalogger.test_logged_hops import VARIABLES, logged
from tests.tracker.visu.shown_and_carried import GVL, plant


class ShortFiles(Plant):
    """A list that changes each 50 ms, and a series whose files have so many rows each; nothing is missed."""

    def __init__(self, folder: Path, every_ms: int, sizes: Sequence[int], *, only_changes: bool) -> None:
        self.folder, self.times = folder, range(0, every_ms * sum(sizes), every_ms)
        self.files = [folder / name for name in [*(f"x.db.{number}" for number in range(len(sizes) - 1)), "x.db"]]
        with open_sink(str(folder / "plant.pcap")) as sink:
            sink.write(batch_of(plant(self.times, [])))
        (folder / "plant.gvl").write_text(GVL)
        rows = [logged(at + LATE, at) for at in self.times]
        counted = as_changes([row.values for row in rows])
        full = [list(row) for row in counted]
        for before, row in pairwise(full):
            row[:] = [old if new is None else new for old, new in zip(before, row, strict=True)]
        begin = 0
        for path, size in zip(self.files, sizes, strict=True):
            own, begin = slice(begin, begin + size), begin + size
            if not only_changes:
                write_log(path, VARIABLES, rows[own])
                continue
            # Each file has all values in its first row.
            stored = zip(rows[own], [full[own][0], *counted[own][1:]], strict=True)
            write_stored(path, [(row, values) for row, values in stored if any(one is not None for one in values)])


@pytest.mark.parametrize(("only_changes", "every_ms", "size"), crossed([False, True], [10, 50, 100], [1, 2, 3, 4, 5]))
def test_what_the_newest_closed_file_had_is_not_missed(
    tmp_path: Path, size: int, every_ms: int, only_changes: bool
) -> None:  # fmt: skip
    made = ShortFiles(tmp_path, every_ms, [size] * 4, only_changes=only_changes)
    whole = made.compared()
    (tmp_path / "x.db.2").unlink()
    assert_nothing_is_missed(whole, made.compared())


@pytest.mark.parametrize("size", [2, 3, 4])
def test_files_that_are_all_there_hide_nothing(tmp_path: Path, size: int) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "one").mkdir()
    parts = ShortFiles(tmp_path / "parts", 50, [size] * 4, only_changes=False).compared()
    whole = ShortFiles(tmp_path / "one", 50, [size * 4], only_changes=False).compared()
    assert {name: row["changes"] for name, row in parts.items()} == {n: row["changes"] for n, row in whole.items()}


@examples(6)
@given(
    sizes=st.lists(st.integers(1, 6), min_size=2, max_size=7), every_ms=st.sampled_from([10, 30, 50, 70, 100]),
    only_changes=st.booleans(), packets=st.integers(1, 60), data=st.data(),
)  # fmt: skip
def test_whichever_file_is_gone_nothing_of_it_is_missed(
    tmp_path_factory: pytest.TempPathFactory, sizes: list[int], every_ms: int, only_changes: bool, packets: int,
    data: st.DataObject,
) -> None:  # fmt: skip
    folder = tmp_path_factory.mktemp("plant")
    made = ShortFiles(folder, every_ms, sizes, only_changes=only_changes)
    whole = made.compared()
    made.files[data.draw(st.integers(0, len(sizes) - 1))].unlink()
    found = made.compared()
    assert made.compared(packets) == found
    assert_nothing_is_missed(whole, found)


def assert_nothing_is_missed(whole: dict[str, dict[str, object]], found: dict[str, dict[str, object]]) -> None:
    for name, row in found.items():
        assert row["missed"] == whole[name]["missed"] == 0, name
        assert latest(row) <= latest(whole[name]), name


def latest(row: dict[str, object]) -> int:
    delay_ns = row["delay_ns"]
    assert isinstance(delay_ns, dict)
    return int(delay_ns["max"] or 0)
