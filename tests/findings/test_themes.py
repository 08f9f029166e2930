"""A theme is one file: the rows of the catalogue, and the judge that yields them and nothing else."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project_file import read_project
from nvscope.findings import catalogue, header, judge
from nvscope.findings.catalogue import CATALOGUE, THEMES
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind
from nvscope.tracker.event_kinds import TELL_IN_NUMBERS, EventKind
from tests.oracle.parameter_traffic import conversations
from tests.packets import batch_of, tracked
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]
PEERS, SCENARIOS = ROOT / "captures" / "peers" / "peers.pcap", ROOT / "tests" / "scenarios"
CODE = re.compile(r"NV\d{0,3}")


def tree_of(module: ModuleType) -> ast.Module:
    assert module.__file__
    return ast.parse(Path(module.__file__).read_text("utf-8"))


def own_rows(theme: ModuleType) -> dict[str, FindingKind]:
    """Return the rows that are written in a module, by their names; not those that it takes from others."""
    names = {
        target.id
        for node in tree_of(theme).body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    return {name: row for name, row in vars(theme).items() if name in names and isinstance(row, FindingKind)}


def themes() -> list[object]:
    return [pytest.param(theme, id=theme.__name__.rpartition(".")[2]) for theme in THEMES]


def test_every_row_is_in_the_catalogue_by_one_theme() -> None:
    rows = [row for theme in THEMES for row in own_rows(theme).values()]
    assert sorted(rows, key=lambda row: row.code) == list(CATALOGUE.values())


def test_the_catalogue_knows_every_theme() -> None:
    folder = ROOT / "nvscope" / "findings"
    makers = {path.stem for path in folder.glob("*.py") if re.search(r"= FindingKind\(", path.read_text("utf-8"))}
    assert makers == {theme.__name__.rpartition(".")[2] for theme in THEMES}


def test_a_code_is_written_once() -> None:
    """In the row of its kind; all else, of the product, has it from there. Sentences for people may name codes."""
    written = defaultdict(list)
    texts = {path: path.read_text("utf-8") for path in (ROOT / "nvscope").rglob("*.py")}
    for path in (path for path, text in texts.items() if CODE.search(text)):
        for node in ast.walk(ast.parse(texts[path])):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and CODE.fullmatch(node.value):
                written[node.value].append(str(path))
    assert {code: len(paths) for code, paths in written.items()} == dict.fromkeys(CATALOGUE, 1)


def test_two_kinds_of_one_code_are_refused() -> None:
    other = FindingKind("NV101", "other", header.SHORT_TELEGRAM.severity, meaning="", causes=(), next_steps=())
    with pytest.raises(ValueError, match="NV101"):
        catalogue._gathered([header.SHORT_TELEGRAM, other])
    assert list(catalogue._gathered([header.SHORT_TELEGRAM, header.SHORT_TELEGRAM])) == ["NV101"]


def test_every_event_of_the_log_is_one_kind_of_finding() -> None:
    events = [kind.from_event for kind in CATALOGUE.values() if kind.from_event is not None]
    assert sorted(events) == [kind for kind in EventKind if kind not in TELL_IN_NUMBERS]


@pytest.mark.parametrize("theme", themes())
def test_a_judge_uses_the_rows_that_are_judged(theme: ModuleType) -> None:
    read = {
        node.id for node in ast.walk(tree_of(theme)) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    }
    assert {name for name, row in own_rows(theme).items() if row.judged} == read & own_rows(theme).keys()


Found = dict[str, set[str]]


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Found:
    """Return the codes that each module has yielded, of all that is judged from now on."""
    told: Found = defaultdict(set)

    def listened(one: Callable[[Facts], Iterator[Finding]]) -> Callable[[Facts], Iterator[Finding]]:
        def judged(facts: Facts) -> Iterator[Finding]:
            for finding in one(facts):
                told[one.__module__].add(finding.code)
                yield finding

        return judged

    monkeypatch.setattr(judge, "JUDGES", tuple(listened(one) for one in judge.JUDGES))
    return told


SOME_OF_EACH = (
    "loss", "malformed", "header-oddities", "acknowledgement-missing", "checksum", "shape-change", "late", "torn-cycle",
    "can-missing-pdo", "can-error-frames", "can-canopen-collision", "mirrored-twice",
)  # fmt: skip


def test_judges_yield_their_own_rows_alone(found: Found, tmp_path: Path) -> None:
    for name in SOME_OF_EACH:
        simulated(SCENARIOS / f"{name}.toml").report(tmp_path)
    axis = [str(PEERS.parent / name) for name in ("axis.gvl", "axis_types.st")]
    inquiry = Inquiry([str(PEERS)], read_project(None, axis))
    inquiry.report(inquiry.analyze(causes=True))
    judge.judge(tracked([batch_of(conversations(3))]))
    # What a protocol with ports of its own shows is for tests/protocols; what security is, for tests of that.
    own = {
        theme.__name__: {
            row.code for row in own_rows(theme).values() if row.judged and not row.protocol and not row.of_security
        }
        for theme in THEMES
    }
    found = {theme: codes for theme, codes in found.items() if own.get(theme) or codes}
    assert all(codes <= own[theme] for theme, codes in found.items())
    assert found.keys() == {theme for theme, codes in own.items() if codes}


def test_explaining_reads_rows_without_what_judges_need() -> None:
    code = (
        "import nvscope.report.explain as face, sys; face.render('NV201'); print({'numpy', 'lark'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "set()"


def test_a_report_without_definitions_reads_none() -> None:
    code = (
        "import sys\nfrom nvscope.analysis.inquiry import Inquiry\nfrom nvscope.definition.project import Project\n"
        f"inquiry = Inquiry([{str(PEERS)!r}], Project())\ninquiry.report(inquiry.analyze(causes=True))\n"
        "print({'lark', 'nvscope.findings.misfits', 'nvscope.findings.several_definitions'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "set()"
