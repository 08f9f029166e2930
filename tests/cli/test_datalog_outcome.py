"""``nvscope datalog``: what it says at its end is what is there, and why there is nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_source
from nvscope.cli.datalog import _logged
from nvscope.datalogger.configuration_file import read_configuration
from nvscope.datalogger.plan import Targets, plan
from nvscope.definition.project_file import read_project
from tests.datalogger.drawn_plants import START_NS, frame_of, write_pcap
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plants import configuration, gvl, plant, rows_of, simulated
from tests.packets import Batches
from tests.program_here import run_text

CYCLES = 'taskContext="list1"'
FULL = 'writeInterval="10" maxFileSize="12000"'


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder with a capture of a hundred cycles of a list, and its definition."""
    simulated(tmp_path, plant())
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    return tmp_path


def told(folder: Path, general: str, sink: str, *words: str) -> str:
    """Log the capture as a configuration says, and return what is told of it at the end."""
    (folder / "c.xml").write_text(configuration(["a/dwFirst"], general, sink), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    return next(line for line in done.stderr.splitlines() if line.startswith("nvscope: session: "))


def test_rows_that_were_deleted_are_told(here: Path) -> None:
    assert told(here, CYCLES, FULL) == (
        "nvscope: session: 100 rows of 1 variable, of which none is left in log.db: 100 rows deleted, the oldest ones "
        "(maxFileSize 12.0 kB)."
    )
    assert rows_of(here / "log.db") == []


def test_what_is_left_is_told(here: Path) -> None:
    general = 'samplingInterval="10ms" publishInterval="1s" bufferCapacity="100"'
    line = told(here, general, 'writeInterval="10" maxFileSize="20000" deleteRatio="50"')
    left = len(rows_of(here / "log.db"))
    assert 0 < left < 496
    assert f", of which {left} are left in log.db: {496 - left} rows deleted, the oldest ones (" in line
    assert line.startswith("nvscope: session: 496 rows of 1 variable, ")


def test_full_files_that_were_removed_are_told(here: Path) -> None:
    line = told(here, CYCLES, f'{FULL} rollover="true" maxFiles="3"')
    assert line == (
        "nvscope: session: 100 rows of 1 variable, of which 20 are left in log.db and 2 closed files: "
        "8 full files removed, the oldest ones (maxFiles 3)."
    )
    assert [len(rows_of(path)) for path in sorted(here.glob("log.db*"))] == [0, 10, 10]


@pytest.mark.parametrize("option", ["", "-w"])
def test_what_is_volatile_is_kept_where_a_file_is_named(option: str, here: Path) -> None:
    line = told(here, CYCLES, 'type="volatile"', *([option, "v.db"] if option else []))
    assert (" in memory; gone with the end of the session" in line) == (not option)
    assert (" in v.db." in line) == bool(option)
    assert (here / "v.db").exists() == bool(option)
    if option:
        assert len(rows_of(here / "v.db")) == 100


@pytest.mark.parametrize(("sink", "each"), [(FULL, "is deleted as soon"), (f'{FULL} rollover="true"', "fills a file")])
def test_a_size_below_that_of_an_empty_database_is_a_warning(sink: str, each: str, here: Path) -> None:
    told(here, CYCLES, sink)
    words = ("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".")
    for option in ("--force", "--dry-run"):
        done = run_text(*words, option, cwd=here)
        assert done.returncode == 0
        assert "nvscope: c.xml, line 1, column " in done.stderr
        assert f"an empty database of these variables has 12288; each block of rows {each}" in done.stderr
    told(here, CYCLES, FULL.replace("12000", "12289"), "--force")
    assert "empty database" not in run_text(*words, "--force", cwd=here).stderr


def test_a_forecast_tells_a_folder_that_is_not_there(here: Path) -> None:
    told(here, CYCLES, "")
    done = run_text(
        "datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "-w", "no/x.db", "--dry-run", cwd=here
    )  # fmt: skip
    assert "  Its folder does not exist, and none is made: no" in done.stdout.splitlines()


def lines(folder: Path, *words: str | Path) -> tuple[int, list[str]]:
    done = run_text("datalog", *words, "--config", "c.xml", "--gvl", ".", cwd=folder)
    return done.returncode, done.stderr.splitlines()


def test_a_list_that_never_came_is_told_and_no_file_is_left(here: Path) -> None:
    (here / "list2.gvl").write_text(gvl(2, ["dwSecond"]), encoding="utf-8")
    (here / "c.xml").write_text(configuration(["a/dwSecond"]), encoding="utf-8")
    code, told = lines(here, "plant.pcap")
    assert (code, told[0]) == (0, "nvscope: session: 0 rows of 1 variable, and no file was made.")
    assert told[1].startswith("nvscope: session: no telegram of udp/1202/2 came in 5.0 s, among 100 frames; ")
    assert not (here / "log.db").exists()
    (here / "c.xml").write_text(configuration(["a/dwFirst", "a/dwSecond"], 'samplingInterval="1s"'), encoding="utf-8")
    code, told = lines(here, "plant.pcap")
    assert (code, told[0]) == (0, "nvscope: session: 5 rows of 2 variables in log.db.")
    assert told[-1].startswith("nvscope: session: no telegram of udp/1202/2 came")
    assert "; 1 variable of it is NULL in all rows; " in told[-1]
    assert [row[-1] for row in rows_of(here / "log.db")] == [None] * 5


def test_telegrams_of_another_shape_are_told(here: Path) -> None:
    (here / "list1.gvl").write_text(gvl(1, ["dwFirst", "dwMore"]), encoding="utf-8")
    (here / "c.xml").write_text(configuration(["a/dwFirst"]), encoding="utf-8")
    told = lines(here, "plant.pcap")[1]
    assert told[1].startswith(
        "nvscope: session: 100 telegrams of udp/1202/1 came, of another shape than the definition"
    )


def test_an_interval_that_was_not_over_is_told(here: Path) -> None:
    (here / "c.xml").write_text(configuration(["a/dwFirst"], 'samplingInterval="1h"'), encoding="utf-8")
    told = lines(here, "plant.pcap", "--from-time", "1s")[1]
    assert told[1:] == [
        "nvscope: session: telegrams came in 4.0 s, among 80 frames, but no sampling was due: samplingInterval is "
        "1 h 00 min."
    ]


def test_a_file_that_was_there_stays_though_nothing_came(here: Path) -> None:
    (here / "list2.gvl").write_text(gvl(2, ["dwSecond"]), encoding="utf-8")
    told(here, CYCLES, "")
    (here / "c.xml").write_text(configuration(["a/dwSecond"]), encoding="utf-8")
    assert lines(here, "plant.pcap", "--append")[1][0] == "nvscope: session: 0 rows of 1 variable in log.db."
    assert (here / "log.db").exists()


def test_databases_are_no_source_of_rows(here: Path) -> None:
    told(here, CYCLES, "")
    (here / "log.db").rename(here / "old.db")
    code, said = lines(here, "old.db")
    assert code == 2
    assert said[0] == "nvscope: old.db: rows of databases are not logged again, and no capture is given"
    code, said = lines(here, "old.db", "plant.pcap")
    assert (code, said[0]) == (0, "nvscope: old.db: rows of databases are not logged again.")
    assert len(rows_of(here / "log.db")) == 100


@pytest.mark.parametrize(("ending", "verb"), [("csv", "export"), ("parquet", "export"), ("pcapng", "record")])
@pytest.mark.parametrize("option", ["--dry-run", "--force"])
def test_a_database_is_not_called_like_another_file(option: str, ending: str, verb: str, here: Path) -> None:
    (here / "c.xml").write_text(configuration(["a/dwFirst"]), encoding="utf-8")
    code, said = lines(here, "plant.pcap", "-w", f"x.{ending}", option)
    assert (code, said[0]) == (2, f"nvscope: x.{ending}: a database is written, and .{ending} is no ending of one")
    assert f" {verb} " in said[1]
    assert not (here / f"x.{ending}").exists()


def test_the_first_row_in_the_style_of_the_document_is_behind_no_loss(tmp_path: Path) -> None:
    simulated(tmp_path, plant())
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    sink = 'storeChangesOnly="true"'
    (tmp_path / "c.xml").write_text(configuration(["a/dwFirst"], 'taskContext="list1"', sink), encoding="utf-8")
    words = ["datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--document-style"]
    done = run_text(*words, cwd=tmp_path)
    assert rows_of(tmp_path / "log.db")[0][2] == 0
    assert done.stderr == "nvscope: session: 100 rows of 1 variable in log.db.\n"


@pytest.mark.parametrize("more", ["", ', "a/dwThird"'])
def test_a_telegram_of_a_list_that_never_came_is_told(tmp_path: Path, more: str) -> None:
    simulated(tmp_path, plant(telegrams=1))
    names = ["dwFirst", "dwSecond", *(["dwThird"] if more else [])]
    (tmp_path / "list1.gvl").write_text(gvl(1, names, pack=False), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration([f"a/{name}" for name in names]), encoding="utf-8")
    code, said = lines(tmp_path, "plant.pcap")
    assert code == 0
    which = "SubIndexes 1, 2" if more else "SubIndex 1"
    variables = "2 variables are" if more else "1 variable is"
    assert said[-1].startswith(
        f"nvscope: session: no telegram of udp/1202/1 with {which} came in 5.0 s, among 100 frames, though others of "
        f"it did; {variables} NULL in all rows: a/dwSecond"
    )
    assert {row[4] for row in rows_of(tmp_path / "log.db")} == {None}


def test_a_variable_that_any_telegram_had_is_known(tmp_path: Path) -> None:
    simulated(tmp_path, plant(telegrams=2))
    (tmp_path / "list1.gvl").write_text(gvl(1, ["dwFirst", "dwSecond"], pack=False), encoding="utf-8")
    (tmp_path / "c.xml").write_text(configuration(["a/dwFirst", "a/dwSecond"]), encoding="utf-8")
    assert "no telegram" not in "".join(lines(tmp_path, "plant.pcap")[1])


@pytest.mark.parametrize(
    ("sink", "line"),
    [
        ("", "One file grows without end: maxFileSize is not said"),
        (
            'maxFileSize="20000"',
            "At 20.0 kB, first after 50.0 s, 30 % of the rows are deleted, those of earlier runs first",
        ),
        (
            'maxFileSize="9000"',
            "At 9.0 kB, first after the first block, 30 % of the rows are deleted, those of earlier",
        ),
        (
            'maxFileSize="20000" rollover="true"',
            "At 20.0 kB, first after 50.0 s, every 50.0 s, another file is begun; all",
        ),
        (
            'maxFileSize="9000" rollover="true" maxFiles="3"',
            "At 9.0 kB, first after the first block, every 50.0 s, another file is begun; 3 are kept",
        ),
    ],
)
def test_a_forecast_knows_what_is_there(here: Path, sink: str, line: str) -> None:
    told(here, CYCLES, "")
    (here / "c.xml").write_text(configuration(["a/dwFirst"], CYCLES, sink), encoding="utf-8")
    words = ("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--dry-run")
    before = (here / "log.db").read_bytes()
    said = run_text(*words, "--append", cwd=here).stdout.splitlines()
    assert "  12.3 kB are there, which it goes on with" in said
    assert any(one.startswith(f"  {line}") for one in said), said
    assert not any("are there" in one for one in run_text(*words, cwd=here).stdout.splitlines())
    assert (here / "log.db").read_bytes() == before


def test_of_a_capture_without_a_frame_no_list_is_blamed(here: Path) -> None:
    whole = (here / "plant.pcap").read_bytes()
    (here / "plant.pcap").write_bytes(whole[:24])
    (here / "c.xml").write_text(configuration(["a/dwFirst"], CYCLES), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", cwd=here)
    assert done.returncode == 0
    assert done.stderr.splitlines() == [
        "nvscope: session: 0 rows of 1 variable, and no file was made.",
        "nvscope: session: there was not one frame to read: capture while the controller sends, or ask for another "
        "time.",
    ]  # fmt: skip


STOPPED = '[[pause]]\nlist = "list1"\nat = "2s"\nby = "4s"\n'
LOST = '[[capture_loss]]\nat = ["2s"]\nlasting = "120ms"\ndrops = 3\n'
LOST_EARLY = '[[loss]]\nlist = "list1"\ntelegrams = [10]\n'
BACK = '[[clock_step]]\nat = "2s"\nby = "-{}"\n'
SAMPLES = 'samplingInterval="50ms" publishInterval="1s" bufferCapacity="20"'


def run_over(folder: Path, scenario: str, general: str, capture: str = "plant.pcap") -> list[str]:
    """Return all that is told of a session over a plant."""
    folder.mkdir(exist_ok=True)
    simulated(folder, scenario, capture)
    (folder / "list1.gvl").write_text(gvl(1, ["dwFirst"]), encoding="utf-8")
    (folder / "c.xml").write_text(configuration(["a/dwFirst"], general, ""), encoding="utf-8")
    done = run_text("datalog", capture, "--config", "c.xml", "--gvl", ".", cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stderr.splitlines()


@pytest.mark.parametrize("general", [CYCLES, SAMPLES])
def test_a_list_that_has_stopped_for_good_is_told(tmp_path: Path, general: str) -> None:
    told = run_over(tmp_path, plant(STOPPED, lists=2), general)
    assert len(told) == 2
    assert told[1].startswith("nvscope: session: udp/1202/1 sent nothing any more for the last 3.0 s: it has stopped")
    assert len(run_over(tmp_path / "other", plant(lists=2), general)) == 1


def test_the_only_list_that_stops_live_is_told(here: Path) -> None:
    """Nothing else comes that would show how long it has been silent; only that time passes does."""
    (here / "c.xml").write_text(configuration(["a/dwFirst"], SAMPLES, ""), encoding="utf-8")
    batches = list(open_source([str(here / "plant.pcap")]))
    last_ns = int(batches[-1].ts_ns[-1])
    source = Batches([*batches, *(PacketBatch.nothing(last_ns + silent * 10**9) for silent in (1, 7))])
    inquiry = Inquiry(source, read_project(None, [str(here / "list1.gvl")]))
    session = read_configuration(str(here / "c.xml")).session
    targets = Targets(str(here / "log.db"), None)
    planned = plan([session], inquiry.defined_layouts(), inquiry.project.datalogger, targets, partly=False)
    log = _logged(inquiry, source, planned, quiet=True, append=False, document_style=False)
    (silent_ns,) = log.heard.silent_ns.values()
    assert silent_ns == 7 * 10**9


@pytest.mark.parametrize(
    ("scenario", "general", "consistent"),
    [
        ("", 'samplingInterval="10ms" publishInterval="7h" bufferCapacity="2"', [0, 1]),
        ("", 'samplingInterval="10ms" publishInterval="7h" bufferCapacity="2000"', [1, 1]),
        (LOST_EARLY, 'samplingInterval="1700ms" publishInterval="1700ms"', [0, 1]),
        ("", 'samplingInterval="1700ms" publishInterval="1700ms"', [1, 1]),
    ],
)
def test_what_is_lost_in_front_of_the_first_row_is_told_by_it(
    scenario: str, general: str, consistent: list[int], tmp_path: Path
) -> None:
    run_over(tmp_path, plant(scenario), general)
    assert [row[2] for row in rows_of(tmp_path / "log.db")][:2] == consistent


def test_senders_of_one_list_are_named(here: Path) -> None:
    sent = [
        Packet(START_NS + at * 10**7, f"10.0.0.{1 + at % 3}", 1, 0, 1, at, bytes([at, 0, 0, 0])) for at in range(30)
    ]
    (here / "plant.pcap").write_bytes(write_pcap([frame_of(one) for one in sent], [0] * len(sent)))
    (here / "c.xml").write_text(configuration(["a/dwFirst"], CYCLES, ""), encoding="utf-8")
    done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", cwd=here)
    assert (
        "nvscope: session: telegrams of udp/1202/1 came from 3 senders, 10.0.0.1, 10.0.0.2 and 10.0.0.3: they are in "
        "one table, and no row says whose it is; `nvscope report` tells of each."
    ) in done.stderr.splitlines()


def test_what_a_capture_says_that_it_dropped_is_told(tmp_path: Path) -> None:
    told = run_over(tmp_path, plant(LOST), CYCLES, "plant.pcapng")
    assert "1 row says that something is missing in front of it (ConsistentDataSeries 0)." in told[0]
    assert told[1].startswith("nvscope: plant.pcapng: the capture says 3 packets dropped while capturing; ")


@pytest.mark.parametrize(("back", "sets"), [("20ms", 0), ("40ms", 0), ("400ms", 6), ("900ms", 16), ("3s", 0)])
def test_samples_that_a_clock_leaves_no_time_for_are_told_in_the_next_row(tmp_path: Path, back: str, sets: int) -> None:
    told = run_over(tmp_path, plant(BACK.format(back)), SAMPLES)
    lost = [row for row in rows_of(tmp_path / "log.db") if not row[2]]
    assert len(lost) == (sets > 0)
    assert (
        f"nvscope: session: at least {sets} data sets not taken: the clock of the capture went back" in "\n".join(told)
    ) == (sets > 0)


def test_a_ring_that_is_too_small_makes_a_database_smaller(here: Path) -> None:
    told = []
    for capacity in (10, 3):
        general = f'samplingInterval="10ms" publishInterval="100ms" bufferCapacity="{capacity}"'
        (here / "c.xml").write_text(configuration(["a/dwFirst"], general, ""), encoding="utf-8")
        done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--dry-run", cwd=here)
        told += [line for line in done.stdout.splitlines() if " rows a day" in line]
    assert told[0].startswith("  8640000 rows a day, ")
    assert told[1].startswith("  2592000 rows a day, ")
