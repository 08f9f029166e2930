"""What is said of the size of a database in front is what it becomes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dissectors.datalogger.leaves import Block, NumberColumns, TextColumn
from dissectors.datalogger.timestamps import ISO_BYTES, iso_texts, raw_of
from nvscope.datalogger.configuration_file import read_configuration
from nvscope.datalogger.database import Database, table_of
from nvscope.datalogger.growth import growth
from nvscope.datalogger.logged import resolve
from nvscope.datalogger.plan import Planned
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.project_datalogger import DataLoggerSettings
from tests.datalogger.plants import configuration, gvl

NAMES = ["dwA", "dwB", "dwC", "dwD", "dwE", "dwF"]
ROWS = 6_000


def planned(folder: Path, sink: str) -> Planned:
    (folder / "a.gvl").write_text(gvl(1, NAMES), encoding="utf-8")
    (folder / "c.xml").write_text(configuration(NAMES, "", sink), encoding="utf-8")
    session = read_configuration(str(folder / "c.xml")).session
    layouts = Layouts(load_definitions([str(folder / "a.gvl")]))
    path = str(folder / "log.db")
    return Planned(session, resolve(session, layouts, DataLoggerSettings()).logged, (), path)


def random_rows(rows: int, *, raw: bool) -> list[Block]:
    """Return rows of DWORDs that may be anything."""
    time_ns = np.arange(rows)
    start = ISO_BYTES * np.arange(rows)
    times = raw_of(time_ns)[:, np.newaxis]
    return [
        NumberColumns(times) if raw else TextColumn(iso_texts(time_ns).reshape(-1), start, start + ISO_BYTES),
        NumberColumns(np.ones((rows, 1), np.int64)),
        NumberColumns(np.random.default_rng(1).integers(0, 1 << 32, (rows, len(NAMES)))),
    ]


@pytest.mark.parametrize("style", ["Raw", "Iso8601"])
@pytest.mark.parametrize("block", [1, 10, 1000])
def test_it_is_as_large_as_it_was_said(style: str, block: int, tmp_path: Path) -> None:
    own = planned(tmp_path, f'tsfmt="{style}" writeInterval="{block}"')
    database = Database(own.session, table_of(own.session, own.logged), own.path, durable=False)
    database.open(append=False)
    grows = growth(own)
    assert database.size_bytes == grows.empty_bytes
    database.write(random_rows(ROWS, raw=style == "Raw"), ROWS)
    size_bytes = database.size_bytes
    database.close()
    assert 0.99 < (grows.empty_bytes + ROWS * grows.row_bytes) / size_bytes < 1.06
    assert 0.94 < grows.rows_until(size_bytes) / ROWS < 1.01


def test_what_is_full_at_once_takes_a_row(tmp_path: Path) -> None:
    grows = growth(planned(tmp_path, ""))
    assert [grows.rows_until(size) for size in (1, grows.empty_bytes)] == [1, 1]
    # Of what was not measured, as of what was.
    far = grows.sizes[-1] * 100
    assert grows.rows_until(far) == pytest.approx(float(far / grows.row_bytes), rel=0.01)
