from __future__ import annotations

import re
from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import pytest

from nvscope.causes.catalogue import BY_NAME, KINDS
from nvscope.causes.kind import CauseKind
from nvscope.errors import ExitCode, UsageError
from nvscope.findings.catalogue import CATALOGUE
from nvscope.report import explain
from nvscope.report.explain_column import MEANINGS
from nvscope.tracker.figures import FIGURES, PLACES, Figure, Of
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields.vocabulary import vocabulary
from nvscope.view.lines.plant import (
    buses,
    parameter_writes,
    parameters,
    transactions,
    visu,
    visu_others,
    visu_writes,
)
from nvscope.view.lines.plant.tables import ERRORS, INTERVALS, OVERVIEW, STREAMS
from nvscope.view.lines.text_width import display_width


def titles() -> list[str]:
    of_buses = (*buses.ALL_OF_IDENTIFIERS, *buses.NODES)
    of_pairs = (*parameters.PAIRS, *visu.PAIRS, *visu_others.ROWS, *transactions.pair_measures(0))
    of_writes = (*parameter_writes.WRITES, *visu_writes.WRITES)
    every = (*OVERVIEW, ERRORS, *STREAMS, *INTERVALS, *of_buses, *of_pairs, *of_writes)
    return [title for title in dict.fromkeys(one.column.title for one in every) if title]


@pytest.mark.parametrize("code", ["NV206", "NV301", "NV702", "NV905", "NV952", "lost", "jitter", "second-sender"])
def test_golden(code: str, golden: Callable[[str, str], None]) -> None:
    golden(f"explain-{code}.txt", explain.render(code))


def test_golden_of_the_overview(golden: Callable[[str, str], None]) -> None:
    golden("explain.txt", explain.overview())


@pytest.mark.parametrize("code", CATALOGUE)
def test_everything_of_the_catalogue_is_told_within_the_width(code: str) -> None:
    kind = CATALOGUE[code]
    for width in (40, 80, 200):
        shown = explain.render(code, width=width)
        assert max(display_width(line) for line in shown.splitlines()) <= width
        told = " ".join(shown.split())
        for text in (kind.code, kind.name, kind.severity.word, kind.meaning, *kind.causes, *kind.next_steps):
            assert text in told
        assert re.sub(r"\x1b\[[0-9;]+m", "", explain.render(code, width=width, colour=True)) == shown


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_everything_of_the_catalogue_of_causes_is_told_within_the_width(kind: CauseKind) -> None:
    for width in (40, 60, 80, 200):
        shown = explain.render(f" {kind.name.upper()} ", width=width)
        assert max(display_width(line) for line in shown.splitlines()) <= width
        told = " ".join(shown.split())
        assert told.startswith(f"{kind.name} cause ")
        for text in (kind.brief, kind.meaning, kind.evidence, kind.next_step):
            assert text in told
        assert re.sub(r"\x1b\[[0-9;]+m", "", explain.render(kind.name, width=width, colour=True)) == shown
    (row,) = explain.document(kind.name)["causes"]
    assert (row["kind"], row["at_least"], row["next"]) == (kind.name, kind.at_least.word, kind.next_step)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_the_filter_that_a_cause_is_told_with_chooses_it(kind: CauseKind) -> None:
    (expression,) = re.findall("-Y '(.*)'", explain.render(kind.name, width=60))
    assert DisplayFilter(expression, vocabulary()).judged == ["cause.kind"]


def test_how_bad_a_cause_is_at_least_is_told() -> None:
    assert "severity    error, whatever it explains" in explain.render("node-silent")
    assert "that it explains, a note where it explains none" in " ".join(explain.render("loss-of-list").split())


@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: figure.name)
def test_every_figure_is_told_within_the_width(figure: Figure) -> None:
    for width in (40, 80, 200):
        shown = explain.render(figure.name, width=width)
        assert max(display_width(line) for line in shown.splitlines()) <= width
        told = " ".join(shown.split())
        assert figure.help[1:] in told
        assert figure.joins.value in told
    for of in figure.of:
        assert f" {of.value} in " in told
        assert (of is Of.STREAM) is not (f"in expressions {of.value}.{figure.name}," in told)
        assert (of in figure.keys) is (f"in report --json {PLACES[of]}.{figure.keys.get(of)} " in told)
    assert told.count("in no report") == len(set(figure.of) - set(figure.keys))


@pytest.mark.parametrize("word", ["lost", "LOST", "list.lost", " node.lost", "stream.lost"])
def test_a_figure_may_be_written_as_in_expressions(word: str) -> None:
    assert explain.render(word) == explain.render("lost")


@pytest.mark.parametrize("word", ["bus.lost", "list.load", "lost.list", ".", "", "list."])
def test_a_word_that_expressions_do_not_have_is_no_figure(word: str) -> None:
    with pytest.raises(UsageError):
        explain.render(word)


@pytest.mark.parametrize("title", titles())
def test_columns_of_reports_are_known_by_their_titles(title: str) -> None:
    holds_a_figure = "  figure, " in explain.render(title)
    assert holds_a_figure is not (title in MEANINGS)
    if not holds_a_figure:
        assert explain.render(f" {title.upper()} ").startswith(f"{title}  column of reports\n")
        assert explain.document(title)["columns"] == [{"title": title, "meaning": MEANINGS[title]}]


def test_no_column_is_explained_that_no_report_has() -> None:
    assert [title for title in MEANINGS if title not in titles()] == []


@pytest.mark.parametrize(("title", "figure"), [("sent", "nSendCount"), ("No  Ack", "missing_acknowledgements")])
def test_they_tell_the_figure_that_stands_in_them(title: str, figure: str) -> None:
    assert explain.render(title).startswith(f"{figure}  figure, ")


def test_readme_tells_of_the_columns_of_lists() -> None:
    section = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8").partition("## Read a report")[2]
    rows = re.findall(r"^\| ([^|]+) \| .* \|$", section.partition("## ")[0], re.MULTILINE)
    told = {title for row in rows[1:] for title in row.split(", ")}
    assert {measure.column.title for measure in (*OVERVIEW, ERRORS)} == told


@pytest.mark.parametrize("name", sorted({kind.name for kind in CATALOGUE.values()} & set(BY_NAME)))
def test_a_name_of_both_tells_the_cause_and_then_the_finding(name: str) -> None:
    (code,) = (kind.code for kind in CATALOGUE.values() if kind.name == name)
    both = explain.render(name)
    assert both.startswith(f"{name}  cause\n")
    assert both.endswith("\n\n" + explain.render(code))
    document = explain.document(name)
    assert ([row["kind"] for row in document["causes"]], [row["code"] for row in document["findings"]]) == (
        [name], [code],
    )  # fmt: skip


def test_the_code_of_such_a_finding_tells_it_alone() -> None:
    assert explain.render("mirrored-twice") != explain.render("NV905")
    assert explain.render("NV905").startswith("NV905 mirrored-twice  ")
    assert explain.document("905")["causes"] == []


def test_a_name_of_both_tells_finding_and_figure() -> None:
    assert explain.render("jitter") == explain.render("NV502") + "\n" + explain.render("list.jitter")


@pytest.mark.parametrize("code", ["NV301", "nv301", "301", " Nv301 ", "no-acknowledgement", "No-Acknowledgement"])
def test_a_code_may_be_written_in_many_ways(code: str) -> None:
    assert explain.render(code) == explain.render("NV301")


@pytest.mark.parametrize(
    ("code", "nearest"),
    [
        ("second-sendr", "second-sender"),
        ("silent", "node-silent"),
        ("two senders", "second-sender"),
        ("NV310", "NV304"),
        ("no-acknowledgment", "NV301"),
        ("ack", "NV302"),
        ("jiter", "NV502"),
        ("NV999", "NV9"),
        ("lots", "lost"),
        ("list.interval_p5", "interval_p50"),
    ],
)
def test_an_unknown_code_is_answered_with_the_nearest(code: str, nearest: str) -> None:
    with pytest.raises(UsageError) as caught:
        explain.render(code)
    assert caught.value.exit_code == ExitCode.USAGE
    assert nearest in caught.value.next_step
    assert code in caught.value.what


def test_a_hostile_code_does_not_reach_the_terminal_raw() -> None:
    with pytest.raises(UsageError) as caught:
        explain.render("\x1b[2J\u202e")
    assert str(caught.value).replace("\n", "").isprintable()


def test_every_kind_is_in_the_overview() -> None:
    told = [line.split() for line in explain.overview(width=60).splitlines()]
    causes, *groups = (list(rows) for empty, rows in groupby(told, lambda row: not row) if not empty)
    assert causes[0] == ["Causes:", "what", "happened"]
    assert [row[0] for row in causes[2:]] == [kind.name for kind in KINDS]
    assert [" ".join(row[1:]) for row in causes[2:]] == [kind.brief for kind in KINDS]
    kinds = CATALOGUE.values()
    expected = {
        "Findings: what a rule saw": [kind for kind in kinds if kind.judged and not kind.of_security],
        "Security: who should not be there, or passes for somebody else": [
            kind for kind in kinds if kind.judged and kind.of_security
        ],
        "DataLogger databases: what an audit saw": [kind for kind in kinds if kind.of_databases],
        "Nothing judges these yet": [kind for kind in kinds if not kind.judged and not kind.of_databases],
    }
    assert [" ".join(rows[0]) for rows in groups] == [title for title, own in expected.items() if own]
    for rows in groups:
        assert rows[1] == ["severity", "code", "name"]
        own = expected[" ".join(rows[0])]
        assert [(code, name) for _, _, code, name in rows[2:]] == [(kind.code, kind.name) for kind in own]


def test_passwords_in_clear_stand_with_all_that_is_about_security() -> None:
    assert [kind.code for kind in CATALOGUE.values() if kind.of_security][:2] == ["NV803", "NV961"]


@pytest.mark.parametrize("code", CATALOGUE)
def test_it_is_said_what_nothing_judges(code: str) -> None:
    kind = CATALOGUE[code]
    shown = explain.render(code)
    assert ("Nothing judges it yet" in shown) is not (kind.judged or kind.of_databases)
    assert ("by `nvscope audit FILE.db`" in shown) is kind.of_databases
    (row,) = explain.document(code)["findings"]
    assert (row["judged"], row["audited"]) == (kind.judged, kind.of_databases)
