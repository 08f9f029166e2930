"""A table that was gone on with in another interval is judged part by part, by the rows that say that data was lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.datalogger.audit import open_part
from nvscope.datalogger.audit.audit import audited
from tests.datalogger.audit.built import Row, write
from tests.datalogger.audit.test_planted import told
from tests.datalogger.plants import configuration, gvl, plant, simulated
from tests.program_here import run_text

TOLD, GAPS = "NV951", "NV952"
STEADY = (100, 1_000)


def codes(folder: Path, *parts: tuple[int | list[int], int], asked_ns: int | None = None) -> list[str]:
    """Return the codes of what is found in rows, so many in each part, so many milliseconds apart."""
    rows, at_ms = [], 0
    for number, (steps, count) in enumerate(parts):
        for row in range(count):
            rows.append(Row(at_ms, {"a": row}, consistent=int(row > 0 or not number)))
            at_ms += steps if isinstance(steps, int) else steps[row % len(steps)]
        at_ms += 60_000
    write(folder / "x.db", rows, {"a": "INT"}, changes=False)
    return [code for code, *_ in told(audited([str(folder / "x.db")], asked_ns))]


@pytest.mark.parametrize(
    "parts",
    [
        [STEADY, (500, 100)],
        [(500, 100), STEADY],
        [STEADY, (500, 3), STEADY],
        [STEADY, (500, 2), (500, 2), (500, 1)],
        [STEADY, (500, 700), (2_000, 50), (70, 9)],
    ],
)
def test_a_part_with_an_interval_of_its_own_has_no_gaps(tmp_path: Path, parts: list[tuple[int, int]]) -> None:
    assert codes(tmp_path, *parts) == [TOLD]


@pytest.mark.parametrize(
    "part",
    [
        ([500, 500, 500, 500, 1_500], 400),
        ([500, 500, 500, 1_500, 500, 500], 7),
        ([*[70] * 9, 200], 100),
        ([100, 100, 100, 300], 100),
        ([100, 300], 3),
    ],
)
def test_a_gap_in_a_part_is_one_by_the_rhythm_of_that(tmp_path: Path, part: tuple[int | list[int], int]) -> None:
    assert codes(tmp_path, STEADY, part) == [TOLD, GAPS]


@pytest.mark.parametrize(
    "part", [(300, 2), ([200, 900, 400], 4), ([500, 500, 500, 1_500], 5), ([100, 220, 400, 700, 1_200], 60)]
)
@pytest.mark.parametrize("behind", [[], [STEADY]])
def test_of_a_part_whose_rhythm_nobody_knows_nothing_is_said(
    tmp_path: Path, part: tuple[int | list[int], int], behind: list[tuple[int, int]]
) -> None:
    """Somebody may have configured it so: two rows, few that are not alike, or telegrams on events."""
    assert codes(tmp_path, STEADY, part, *behind) == [TOLD]
    assert codes(tmp_path, STEADY, part, *behind, asked_ns=100_000_000) == [TOLD, GAPS]


def test_what_comes_less_often_all_the_time_is_asked_of_the_configuration(tmp_path: Path) -> None:
    assert codes(tmp_path, (200, 100), asked_ns=100_000_000) == [GAPS]
    assert codes(tmp_path, STEADY, (200, 100), asked_ns=100_000_000) == [TOLD, GAPS]


def test_of_what_came_less_often_before_it_is_said_that_it_may_be_of_another_configuration(tmp_path: Path) -> None:
    asked_ns = 100_000_000
    assert codes(tmp_path, (200, 50), STEADY, ([100, 100, 300], 60), asked_ns=asked_ns) == [TOLD, GAPS, GAPS]
    told_of, slower, gaps = audited([str(tmp_path / "x.db")], asked_ns).findings
    assert [one.severity.word for one in (told_of, gaps, slower)] == ["note", "error", "error"]
    assert (gaps.count, gaps.rows[0]) == (19, 1_054)
    assert (slower.count, slower.rows[0]) == (49, 2)
    assert "every 200.0 ms there by themselves" in slower.message
    assert "--config" in slower.next_step
    # Five intervals at least say so; of a rhythm of several lengths, nothing does.
    for part in ((200, 5), ([150, 220, 390, 700], 50)):
        assert codes(tmp_path, part, STEADY, asked_ns=asked_ns) == [TOLD, GAPS]
        _, only = audited([str(tmp_path / "x.db")], asked_ns).findings
        assert "by themselves" not in only.message


def test_every_second_row_that_lacks_is_no_rhythm_of_a_part(tmp_path: Path) -> None:
    assert codes(tmp_path, ([100, 100, 300], 1_000)) == [GAPS]


def test_parts_that_are_decided_piece_by_piece_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where much may be a gap, it is decided before all rows were read."""
    monkeypatch.setattr(open_part, "_MOST_KEPT", 100)
    assert codes(tmp_path, STEADY, (500, 5_000), STEADY) == [TOLD]
    assert codes(tmp_path, STEADY, ([500, 500, 500, 1_500], 5_000), STEADY) == [TOLD, GAPS]


@pytest.mark.parametrize("then", ['samplingInterval="500ms"', 'samplingInterval="20ms"', 'taskContext="list1"'])
@pytest.mark.parametrize("first", ['samplingInterval="100ms"', 'samplingInterval="1s"', 'taskContext="list1"'])
def test_a_database_that_is_gone_on_with_in_another_interval_has_no_gaps(tmp_path: Path, first: str, then: str) -> None:
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    for minute, general in enumerate((first, then, first)):
        simulated(tmp_path, plant(duration="10s").replace("seed = 3", f"start = 2024-01-01T00:0{minute}:00+00:00"))
        text = configuration(["a/dwFirst"], f'{general} publishInterval="1s" bufferCapacity="1000"')
        (tmp_path / "c.xml").write_text(text, encoding="utf-8")
        done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--append", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert [code for code, *_ in told(audited([str(tmp_path / "log.db")]))] == [TOLD]


@pytest.mark.parametrize("asked_ms", [99, 100, 101])
def test_a_configuration_says_nothing_of_cycles_though_most_of_them_are_as_long(tmp_path: Path, asked_ms: int) -> None:
    assert codes(tmp_path, (100, 300), (400, 100)) == [TOLD]
    audit = audited([str(tmp_path / "x.db")], asked_ms * 1_000_000, in_cycles=lambda name: name == "a")
    assert [code for code, *_ in told(audit)] == [TOLD]
