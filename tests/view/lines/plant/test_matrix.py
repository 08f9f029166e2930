"""The matrix of lists and nodes: its marks are what scenarios put in, and a healthy plant shows calm ones alone."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, scene_at
from nvscope.definition.project_file import read_project
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.plant.matrix import Matrix
from nvscope.view.lines.plant.matrix_details import list_lines, node_lines
from nvscope.view.lines.plant.roles import BAD, Facts, Mark
from nvscope.view.lines.table import Line
from tests.simulate.simulation import simulated

SCENARIOS = Path(__file__).parents[3] / "scenarios"
WIDE = 200


def scene_of(name: str, directory: Path, at_s: float | None = None) -> Scene:
    """What is known of a scenario at a time, else at its end."""
    inquiry = simulated(SCENARIOS / f"{name}.toml").inquiry(directory)
    found = scene_at(inquiry, None)
    assert found is not None
    if at_s is not None:
        found = scene_at(inquiry, (found.snapshot.summary.start_ns or 0) + round(at_s * 1e9))
    assert found is not None
    return found


def matrix_of(scene: Scene) -> Matrix:
    known, project = scene.snapshot, scene.inquiry.project
    assert known.happened
    causes = known.happened.causes
    return Matrix(Facts(known.summary, scene.contacts, causes, project.node_names, {}, project.readers))


def drawn(matrix: Matrix, width: int = WIDE, first: int = 0, chosen: int = 0) -> str:
    """The matrix as text, without what is at the ends of lines."""
    span = matrix.span(width, first)
    lines = [*matrix.heading(span, chosen)]
    for group in matrix.groups:
        lines.append(matrix.group_line(group))
        lines += [matrix.row_line(place, span) for place in group.lists]
    return "\n".join(told(line) for line in lines)


def told(line: Line) -> str:
    return "".join(cell.text for cell in line).rstrip()


def text(expected: str) -> str:
    return dedent(expected).strip("\n")


def test_a_reader_that_stops_answering(tmp_path: Path) -> None:
    now = matrix_of(scene_of("causes/reader-silent", tmp_path, 18))
    assert drawn(now) == text("""
           list  to  […1] …2  …3  …20
                      ●   ●   ●    ✗
        10.0.0.1
        ●  1     all  ▲   ·   ·    ·
        ●  2     all  ▲   ·   ·    ·
        ✗  6     …20  ▲   ·   ·    ✗
        10.0.0.2
        ●  3     all  ·   ▲   ·    ·
        ●  4     all  ·   ▲   ·    ·
        ✗  7     …20  ·   ▲   ·    ✗
        10.0.0.3
        ●  5     all  ·   ·   ▲    ·
    """)
    over = matrix_of(scene_of("causes/reader-silent", tmp_path))
    assert drawn(over) == drawn(now).replace("✗", "!")


def test_a_silent_node(tmp_path: Path) -> None:
    matrix = matrix_of(scene_of("causes/node-silent", tmp_path))
    assert {(matrix.names[place], matrix.mark(place, node)) for place, node in of_mark(matrix, Mark.SILENT)} == {
        ("1", Mark.SILENT), ("2", Mark.SILENT),
    }  # fmt: skip
    (silent,) = {node for _, node in of_mark(matrix, Mark.SILENT)}
    lines = node_lines(matrix, silent, Clock(None, True), 0, WIDE)
    assert "sends 1, 2; hardware 02:00:00:00:00:01; last heard at" in told(lines[0])
    assert told(lines[1]).startswith("  ✗ Node 10.0.0.1 is silent since")


def test_a_second_sender(tmp_path: Path) -> None:
    matrix = matrix_of(scene_of("causes/second-sender", tmp_path))
    shared = of_mark(matrix, Mark.SHARES)
    assert {(matrix.names[place], matrix.name_of(node)) for place, node in shared} == {
        ("1", "10.0.0.1"), ("1", "10.0.0.99"),
    }  # fmt: skip
    # The list stands with its first sender.
    assert matrix.name_of(matrix.groups[0].sender or 0) == "10.0.0.1"
    gone = matrix_of(scene_of("causes/second-sender-gone", tmp_path))
    assert {gone.name_of(node) for _, node in of_mark(gone, Mark.LEFT)} == {"10.0.0.99"}
    assert not [*of_mark(gone, Mark.SHARES)]


def test_two_devices_of_one_address(tmp_path: Path) -> None:
    matrix = matrix_of(scene_of("causes/duplicate-address", tmp_path))
    (node,) = {node for _, node in of_mark(matrix, Mark.SHARES)}
    assert len(matrix.facts.contacts.hardware_of(node)) == 2


def test_a_reader_without_program(tmp_path: Path) -> None:
    now = matrix_of(scene_of("causes/reader-without-program", tmp_path, 20))
    assert {(now.names[place], now.name_of(node)) for place, node in of_mark(now, Mark.NOBODY_THERE)} == {
        ("6", "10.0.0.20"), ("7", "10.0.0.20"),
    }  # fmt: skip
    over = matrix_of(scene_of("causes/reader-without-program", tmp_path))
    assert {*over.marks()} & BAD == {Mark.ANSWERED_NOT}


def test_a_reader_that_rejects_answers_others(tmp_path: Path) -> None:
    matrix = matrix_of(scene_of("causes/reader-rejects", tmp_path))
    (place, node) = next(iter(of_mark(matrix, Mark.REJECTS)))
    assert matrix.names[place] == "6"
    assert {matrix.names[other] for other, one in of_mark(matrix, Mark.ANSWERS) if one == node} == {"7"}


def test_boot_up_requests(tmp_path: Path) -> None:
    vain = matrix_of(scene_of("causes/boot-up-unanswered", tmp_path))
    assert [(vain.names[place], vain.name_of(node)) for place, node in of_mark(vain, Mark.ASKED_IN_VAIN)] == [
        ("8", "10.0.0.21")
    ]
    got = matrix_of(scene_of("causes/healthy", tmp_path))
    assert [got.name_of(node) for _, node in of_mark(got, Mark.ASKED)] == ["10.0.0.21"]


@pytest.mark.parametrize("name", ["causes/healthy", "plant-clean"])
@pytest.mark.parametrize("at_s", [None, 3.0])
def test_a_healthy_plant_shows_calm_marks(name: str, at_s: float | None, tmp_path: Path) -> None:
    matrix = matrix_of(scene_of(name, tmp_path, at_s))
    marks = [*matrix.marks()]
    assert Mark.ANSWERS in marks
    assert not {*marks} & BAD
    assert {matrix.known.light_of_node(node) for node in matrix.nodes} == {None}


def test_what_the_project_says_of_nodes(tmp_path: Path) -> None:
    capture = simulated(SCENARIOS / "causes/healthy.toml").write(tmp_path / "healthy.pcapng")
    settings = tmp_path / "nvscope.toml"
    settings.write_text('[nodes]\n"10.0.0.2" = { name = "saw", reads = [1] }\n"10.0.0.50" = { reads = [5] }\n')
    scene = scene_at(Inquiry([str(capture)], read_project(settings)), None)
    assert scene is not None
    matrix = matrix_of(scene)
    assert [(matrix.names[place], matrix.name_of(node)) for place, node in of_mark(matrix, Mark.READS)] == [
        ("1", "saw"), ("5", "10.0.0.50"),
    ]  # fmt: skip
    assert "saw" in matrix.titles.values()
    assert [told(matrix.group_line(group)) for group in matrix.groups] == ["10.0.0.1", "saw  10.0.0.2", "10.0.0.3"]


def test_a_reader_is_told_with_what_was_counted(tmp_path: Path) -> None:
    scene = scene_of("causes/reader-silent", tmp_path)
    matrix = matrix_of(scene)
    lines = list_lines(matrix, matrix.names.index("6"), Clock(scene.snapshot.summary.start_ns, True), WIDE)
    entry = next(one for one in scene.snapshot.summary.lists if one.key.identifier == 6)
    row = told(lines[-1]).split()
    missing = entry.counters["missing_acknowledgements"]
    assert row[:3] == ["!", "10.0.0.20", str(entry.diagnosis.nAcknowledges)]
    assert row[7] == str(missing) == "60"
    assert entry.diagnosis.nSendCount == entry.diagnosis.nAcknowledges + 60


def test_more_nodes_than_columns(tmp_path: Path) -> None:
    matrix = matrix_of(scene_of("causes/five-at-once", tmp_path))
    width = matrix.margin + 2 + 5 * 3
    seen = set()
    for chosen in range(len(matrix.nodes)):
        first = matrix.first_for(width, 0, chosen)
        span = matrix.span(width, first)
        assert span.first <= chosen < span.stop
        for line in drawn(matrix, width, first, chosen).splitlines():
            assert len(line) <= width + 2
        names, _ = matrix.heading(span, chosen)
        assert f"[{matrix.titles[matrix.nodes[chosen]]}]" in told(names)
        assert ("‹" in told(names), "›" in told(names)) == (span.first > 0, span.stop < len(matrix.nodes))
        seen |= {*range(span.first, span.stop)}
    assert seen == {*range(len(matrix.nodes))}


def test_each_mark_has_its_own_sign_and_words() -> None:
    for of in ("sign", "ascii", "words"):
        assert len({getattr(mark, of) for mark in Mark}) == len(Mark)
    assert all(mark.ascii.isascii() and len(mark.ascii) == 1 for mark in Mark)


def test_names_of_a_project_stand_above_columns(tmp_path: Path) -> None:
    matrix = matrix_of(scene_of("causes/healthy", tmp_path))
    named = Matrix(matrix.facts._replace(names={"10.0.0.1": "press", "10.0.0.20": "x\x1b[31m"}))
    titles = [named.titles[node] for node in named.nodes]
    assert titles[0] == "press"
    assert "x\\x1b[31m" in titles
    assert all(title.isprintable() for title in titles)


def of_mark(matrix: Matrix, mark: Mark) -> list[tuple[int, int]]:
    """The places and nodes that have a mark."""
    every = ((place, node) for place in range(len(matrix.lists)) for node in matrix.nodes)
    return [(place, node) for place, node in every if matrix.mark(place, node) is mark]
