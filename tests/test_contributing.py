"""What the page for contributors names is there, its floors are those of the contract, and its examples are run."""

from __future__ import annotations

import ast
import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

from tests.program import run_text

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / ".github" / "CONTRIBUTING.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
PROSE = re.sub(r"^```.*?^```", "", PAGE, flags=re.DOTALL | re.MULTILINE)
SPANS = sorted(set(re.findall(r"`([^`\n]+)`", PROSE)))
PATHS = [span for span in SPANS if re.fullmatch(r"[\w./-]*\w/|[\w.-]+/[\w./-]*\w|[\w.-]+\.(?:py|toml|md)", span)]
NAMES = [span for span in SPANS if "::" in span]
COMMANDS = [line for language, text in BLOCKS if not language for line in text.splitlines()]
PYTEST = [span for span in SPANS if "-m pytest" in span]


def block(language: str) -> str:
    (text,) = (text for known, text in BLOCKS if known == language)
    return text


@cache
def defined_in(path: str) -> frozenset[str]:
    """Return the names that a file defines, those within classes as ``Class.name``."""

    def names(body: list[ast.stmt], prefix: str) -> set[str]:
        found = set()
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found.add(prefix + node.name)
                if isinstance(node, ast.ClassDef):
                    found |= names(node.body, f"{prefix}{node.name}.")
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            found |= {prefix + target.id for target in targets if isinstance(target, ast.Name)}
        return found

    return frozenset(names(ast.parse((ROOT / path).read_text("utf-8")).body, ""))


def test_there_is_something_to_look_up() -> None:
    assert len(PATHS) > 50
    assert len(NAMES) > 50
    assert not [line for line in PAGE.splitlines() if len(line) > 120]
    assert not [line for line in PROSE.splitlines() if line.count("`") % 2]


@pytest.mark.parametrize("path", PATHS)
def test_a_path_exists(path: str) -> None:
    assert (ROOT / path).is_dir() if path.endswith("/") else (ROOT / path).is_file()


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_defined_where_the_page_says(name: str) -> None:
    path, _, wanted = name.partition("::")
    assert wanted in defined_in(path)


def test_the_floors_are_those_of_the_contract() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    (contract,) = (contract for contract in settings["contracts"] if contract["type"] == "layers")
    lines = [re.match(r"(\d+) +(\w+(?: \| \w+)*)(?:  |$)", line) for line in block("floors").splitlines()]
    shown = [(int(line[1]), line[2].split(" | ")) for line in lines if line]
    # Parentheses mark rooms that may be missing.
    layers = [re.findall(r"\w+", layer) for layer in contract["layers"]]
    assert shown == list(zip(reversed(range(len(layers))), layers, strict=True))


def test_the_walk_through_the_program(tmp_path: Path) -> None:
    for folder in ("tests", "captures"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    shown = ""
    for command in COMMANDS:
        if command.startswith("nvscope "):
            done = run_text(*command.split()[1:], cwd=tmp_path, environment={"TZ": "UTC", "COLUMNS": "100"})
            assert done.returncode == 0, done.stderr
            shown = done.stdout
    assert set(block("shown").splitlines()) <= set(shown.splitlines())


def test_the_walk_in_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = str(ROOT / "tests" / "scenarios" / "loss.toml")
    assert run_text("simulate", scenario, "-w", "loss.pcap", cwd=tmp_path).returncode == 0
    monkeypatch.chdir(tmp_path)
    exec(compile(block("python"), "CONTRIBUTING.md", "exec"), {})
    assert capsys.readouterr().out == block("output")


def test_files_that_commands_name_are_there() -> None:
    for command in [*PYTEST, *COMMANDS]:
        for path in re.findall(r"(?:tests|captures)/[\w./-]+", command):
            assert (ROOT / path).exists()


def test_the_readme_leads_to_the_page() -> None:
    assert "(.github/CONTRIBUTING.md)" in (ROOT / "README.md").read_text("utf-8")
