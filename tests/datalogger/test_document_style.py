"""In the style of the document, counters are repeated where values have not changed; no row of it is a new start."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.datalogger.audit.audit import audited
from tests.datalogger.audit.test_planted import told
from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.program_here import run_text

REPEATED = ("NV957", "note")


def recorded(folder: Path, *words: str) -> None:
    """Record two lists, of which the second comes 10 ms behind the first, in cycles of the first."""
    for index, name in ((1, "dwFirst"), (2, "dwSecond")):
        (folder / f"list{index}.gvl").write_text(gvl(index, [name]), encoding="utf-8")
    general = 'samplingInterval="5ms" publishInterval="5ms"'
    text = configuration(["a/dwFirst", "a/dwSecond"], general, 'storeChangesOnly="true"')
    (folder / "c.xml").write_text(text, encoding="utf-8")
    done = run_text(
        "datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--document-style", *words, cwd=folder
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_value_that_comes_late_is_no_new_start(tmp_path: Path) -> None:
    simulated(tmp_path, plant(lists=2))
    recorded(tmp_path)
    # As the document shows it: what is not known has no counter, and what has not changed has that of before.
    assert [row[2:] for row in rows_of(tmp_path / "log.db")[:4]] == [
        (0, 0, 0, None, None), (1, None, 0, 0, 0), (1, 1, 1, None, 0), (1, None, 1, 1, 1),
    ]  # fmt: skip
    audit = audited([str(tmp_path / "log.db")])
    assert {one[:2] for one in told(audit)} == {REPEATED}
    assert audit.tables[0].audit.restarts == 0


@pytest.mark.parametrize("runs", [2, 3])
def test_each_run_that_goes_on_is_one_new_start(tmp_path: Path, runs: int) -> None:
    for minute in range(runs):
        simulated(tmp_path, plant(lists=2).replace("seed = 3", f"start = 2024-01-01T00:0{minute}:00+00:00"))
        recorded(tmp_path, "--append")
    audit = audited([str(tmp_path / "log.db")])
    # The first row of each run says in this style that data was lost before it.
    assert {one[:2] for one in told(audit)} == {REPEATED, ("NV951", "note"), ("NV954", "note")}
    assert audit.tables[0].audit.restarts == runs - 1
