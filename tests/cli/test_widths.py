"""What the width of a terminal, a file or a pipe does to tables, and who sees thousands separated."""

from __future__ import annotations

import re
import sys
from itertools import product
from pathlib import Path

import pytest

from nvscope.view.lines.text_width import display_width
from tests.laws import some
from tests.program import run_on_terminal
from tests.program_here import run_text

ROOT = Path(__file__).parents[2]
PLANT, PEERS, PRESS = (str(ROOT / "captures" / name) for name in ("plant.pcapng.gz", "peers", "can/press.log"))
CAPTURE = str(ROOT / "captures" / "peers" / "peers.pcap")

VERBS: dict[str, list[str]] = {
    "report": ["report", PLANT, "-q"],
    "report --all": ["report", PLANT, "--all", "-q"],
    "report -v": ["report", PLANT, "-v", "-q"],
    "report of CAN": ["report", PRESS, str(ROOT / "captures" / "can"), "-v", "-q"],
    "vars": ["vars", CAPTURE, PEERS, "-q"],
    "history": ["vars", CAPTURE, f"{PEERS}/batch.gvl", "--history", "speed", "-q"],
    "at": ["vars", CAPTURE, PEERS, "--at", "5s", "-q"],
    "infer": ["vars", CAPTURE, "--infer", "-q"],
    "layout": ["gvl", "layout", PEERS],
    "diff": ["gvl", "diff", f"{PEERS}/axis.gvl", f"{PEERS}/batch.gvl", "--types", f"{PEERS}/axis_types.st"],
}
PLAIN = {"COLUMNS": "", "TERM": "", "TZ": "UTC", "NO_COLOR": "1"}
SEPARATED = re.compile(r"(?<![\d.,:] )\b[1-9]\d{0,2} \d{3}\b(?! \d{3}\.)")


def on_terminal(words: list[str], columns: int, encoding: str = "utf-8", stream: str = "stdout") -> str:
    """Return what a verb writes to a stream where that is a terminal of so many columns."""
    return run_on_terminal(*words, columns=columns, encoding=encoding, stream=stream, environment=PLAIN)


def in_pipe(words: list[str], columns: str = "") -> str:
    return run_text(*words, environment={"COLUMNS": columns, "TZ": "UTC"}).stdout


terminals = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")


@terminals
@pytest.mark.parametrize(("verb", "columns"), some([*product(VERBS, [40, 80, 100, 200])]))
def test_no_line_is_wider_than_the_terminal(verb: str, columns: int) -> None:
    told, plain = on_terminal(VERBS[verb], columns), on_terminal(VERBS[verb], columns, "ascii")
    assert max(map(display_width, told.splitlines())) <= columns
    assert [len(line) for line in plain.splitlines()] == [len(line) for line in told.splitlines()]


@terminals
@pytest.mark.parametrize("verb", VERBS)
def test_a_column_is_there_or_named_and_wide_brings_it_back(verb: str) -> None:
    everything = on_terminal([*VERBS[verb], "--wide"], 40)
    assert "Hidden:" not in everything
    for columns in (40, 80):
        told = " ".join(on_terminal(VERBS[verb], columns).split())
        hidden = re.findall(r"Hidden: (.+?) \(--wide shows (?:it|them)\)", told)
        assert told.count("Hidden:") == len(hidden)
        for title in {title for titles in hidden for title in titles.split(", ")}:
            assert title in everything


@pytest.mark.parametrize("verb", VERBS)
def test_in_a_file_or_pipe_nothing_is_hidden_unless_columns_says_how_wide_it_is(verb: str) -> None:
    told = in_pipe(VERBS[verb])
    assert "Hidden:" not in told
    assert told == in_pipe([*VERBS[verb], "--wide"])
    assert max(map(display_width, in_pipe(VERBS[verb], "40").splitlines())) <= 40


def test_the_columns_that_a_narrow_report_hides_are_in_a_pipe() -> None:
    narrow, whole = in_pipe(VERBS["report --all"], "40"), in_pipe(VERBS["report --all"])
    assert " ".join(narrow.split()).count(
        "Hidden: reader, interval, jitter, sent, lost, no ack, last error (--wide shows them)"
    ) == 1  # fmt: skip
    (titles,) = (line for line in whole.splitlines() if line.startswith("status"))
    assert titles.split() == [
        "status", "list", "sender", "reader", "interval", "jitter", "sent", "lost", "no", "ack", "last", "error",
    ]  # fmt: skip


def test_what_controllers_count_as_errors_is_a_detail() -> None:
    for words in (["report", PLANT, "-q"], ["report", PLANT, "-q", "--md"]):
        assert "nErrorCount" not in in_pipe(words).partition("Findings")[0]
        (titles,) = (line for line in in_pipe([*words, "-v"]).splitlines() if re.match(r"\W*status\b", line))
        assert "nErrorCount" in titles


@pytest.mark.parametrize("words", [*VERBS.values(), ["report", PLANT, "--md"], ["packets", PLANT, "-c", "1100"]])
def test_numbers_in_a_file_or_pipe_have_no_blanks(words: list[str]) -> None:
    assert not SEPARATED.findall(in_pipe(words))


@terminals
def test_people_see_thousands_separated() -> None:
    assert "1 212 frames: 1 206 telegrams" in on_terminal(VERBS["report"], 80)
    assert "1212 frames: 1206 telegrams" in in_pipe(VERBS["report"])
    assert "1212 frames: 1206 telegrams" in on_terminal([*VERBS["report"], "--md"], 80)
    assert on_terminal(["report", PLANT, "--json"], 80) == in_pipe(["report", PLANT, "--json"])


NOTICES = [
    ["export", CAPTURE, f"{PEERS}/batch.gvl", "-w", "-", "-q"],
    ["vars", CAPTURE, f"{PEERS}/axis.gvl", "-q"],
    ["vars", CAPTURE, "-q"],
    ["export", CAPTURE, f"{PEERS}/batch.gvl", "-w", "-.parquet", "-q"],
    ["report", "nowhere.pcap"],
]


@pytest.mark.skipif(sys.platform == "win32", reason="no such terminals there")
@pytest.mark.parametrize(("words", "columns"), some([*product(NOTICES, [40, 80, 500])]), ids=str)
def test_notices_end_their_lines_between_words_on_a_terminal(words: list[str], columns: int) -> None:
    told = on_terminal(words, columns, stream="stderr")
    in_a_pipe = run_text(*words).stderr
    assert in_a_pipe
    assert told.split() == in_a_pipe.split()
    assert all(len(line) < columns or len(line.split()) == 1 for line in told.splitlines())
    if columns == 500:
        assert told == in_a_pipe
    assert len(told.splitlines()) >= len(in_a_pipe.splitlines())


WITH_HELP = (
    "", "report", "vars", "packets", "export", "gvl", "gvl layout", "gvl lint", "gvl diff", "simulate", "explain",
    "keys", "schema",
)  # fmt: skip


@pytest.mark.parametrize("verb", WITH_HELP)
def test_help_fits_into_a_narrow_terminal(verb: str) -> None:
    narrow, wide = (
        run_text(*verb.split(), "--help", environment={"COLUMNS": columns}).stdout for columns in ("40", "100")
    )
    assert [line for line in narrow.splitlines() if len(line) > 40] == []
    # Nothing is left out, and what is cut of a command line is one for a shell.
    assert "".join(narrow.replace(" \\\n", " ").split()) == "".join(wide.split())


def test_what_is_said_of_a_wrong_option_fits_too() -> None:
    told = run_text("vars", "--nope", environment={"COLUMNS": "40"}).stderr
    assert all(len(line) <= 40 for line in told.splitlines()[:3])
