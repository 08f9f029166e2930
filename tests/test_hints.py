"""What messages tell people to do can be done: every command in them is run, every option and field in them is one.

Taken from the source, so that a hint which no other test provokes is looked at too; and from what is printed, so that
what is filled in is right as well. Examples in ``--help`` and the README have tests of their own.
"""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest
from typer.main import get_command

from nvscope.cli.program import VERBS, program
from nvscope.findings.catalogue import CATALOGUE
from nvscope.view.fields.frame import EITHER_OF, FIELDS
from tests.once import made_once
from tests.other_frames import write_kinds
from tests.program_here import run_text

ROOT = Path(__file__).parents[1]
PEERS = ROOT / "captures" / "peers"
FILLED_IN = {
    "{definitions[0]}": "axis.gvl",
    "{' '.join(map(shlex.quote, files))}": "axis.gvl counters.gvl",
    "{_files_of(one)}": "a.pcap",
    "{shlex.quote(paths[0])}": "a.pcap",
    "{between}": "frame.number >= 3 && frame.number <= 9",
    "FILE.pcap": "new.pcap",
    "FILE.db": "log.db",
    "FILE": "a.pcap",
    "CODE": "NV201",
    "{code}": "NV201",
    "{kind}": "second-sender",
    "VERB": "report",
    "SCENARIO.toml": "loss.toml",
    "NAME…": "axis",
}
"""What is filled into commands, by a program or by the people who read them."""

OF_TOOLS = {
    "-s": ("dumpcap", "tcpdump"),
    "-B": ("dumpcap", "tcpdump"),
    "-P": ("pipx", "python"),
    "-U": ("tcpdump",),
    "--nvcapture": ("pytest",),
}
"""Options of other programs, which are named where the option is."""

TOOLS = {"editcap", "mergecap", "reordercap", "dumpcap", "tcpdump", "sqlite3"}
BACKTICKS = re.compile(r"`([^`]+)`")
COMMAND = re.compile(rf"(?<!`)\bnvscope (?:{'|'.join((*VERBS, 'help', '--help'))}|FILE)\b[^,;`]*")
OPTION = re.compile(r"(?<![\w`'\"{/.-])(--[a-z][a-z-]+|-[a-zA-Z])(?![\w-])")
FIELD = re.compile(
    rf"\b((?:{'|'.join(sorted({name.partition('.')[0] for name in FIELDS}))})\.[a-z][a-z0-9_.]*[a-z0-9])\b"
)


@cache
def texts_of(path: Path) -> list[tuple[int, str]]:
    """Return the texts in a file that are no docstrings; what is filled in stands in braces, as it is written."""
    return list(_texts_in(path))


def _texts_in(path: Path) -> Iterator[tuple[int, str]]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    passed = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            passed.add(node.value)
        if isinstance(node, ast.JoinedStr):
            passed.update(part for part in ast.walk(node) if part is not node)
    for node in ast.walk(tree):
        if node in passed:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
        elif isinstance(node, ast.JoinedStr):
            parts = (
                part.value if isinstance(part, ast.Constant) else "{" + ast.unparse(getattr(part, "value", part)) + "}"
                for part in node.values
            )
            yield node.lineno, "".join(map(str, parts))


SOURCES = [path for folder in ("nvscope", "dissectors") for path in sorted((ROOT / folder).rglob("*.py"))]
HELP = ROOT / "nvscope" / "cli" / "help.py"
IMPORTED = re.compile(r"(?:from|import) nvscope\b|\bnvscope\.")


def commands_in(text: str) -> Iterator[str]:
    """Yield the commands of nvscope in a text: those in backticks, wherever lines end, or to the end of a line."""
    yield from (one for one in BACKTICKS.findall(" ".join(text.split())) if one.startswith("nvscope"))
    for line in BACKTICKS.sub("", text).splitlines():
        yield from (match.strip(" .") for match in COMMAND.findall(line))


def commands_of(paths: Iterable[Path]) -> list[str]:
    return sorted({one for path in paths if path != HELP for _, text in texts_of(path) for one in commands_in(text)})


@made_once
def commands() -> list[str]:
    # Of files that only import from nvscope, there is no use in reading them as Python.
    return commands_of(path for path in SOURCES if "nvscope" in IMPORTED.sub("", path.read_text(encoding="utf-8")))


COMMANDS = commands()


@cache
def options_of() -> dict[str, set[str]]:
    """Return the options of each verb, and under "" those of the program."""
    command = get_command(program())
    assert isinstance(command, object)
    found = {"": {name for one in command.params for name in one.opts} | {"--help", "-h"}}
    for verb, made in command.commands.items():  # type: ignore[attr-defined]
        parts = [made, *getattr(made, "commands", {}).values()]
        found[verb] = {name for part in parts for one in part.params for name in one.opts} | {"--help", "-h"}
    return found


@pytest.fixture
def here(tmp_path: Path) -> Path:
    write_kinds(tmp_path / "kinds.pcap")
    shutil.copy(PEERS / "peers.pcap", tmp_path / "a.pcap")
    shutil.copy(ROOT / "captures" / "datalogger" / "genuine-5min.db", tmp_path / "log.db")
    for name in ("axis.gvl", "axis_types.st", "counters.gvl"):
        shutil.copy(PEERS / name, tmp_path)
    shutil.copy(ROOT / "tests" / "scenarios" / "loss.toml", tmp_path)
    return tmp_path


def completed(command: str) -> list[str]:
    """Return the words of a command behind nvscope: filled in, and with the files that people have to name."""
    for before, behind in FILLED_IN.items():
        command = command.replace(before, behind)
    assert "{" not in command, "tell FILLED_IN what stands there"
    words = shlex.split(command)[1:]
    verb = " ".join(words[: 2 if words[0] in {"gvl", "datalog"} else 1])
    given = any(word.endswith((".pcap", ".gvl", ".toml")) for word in words)
    needed = {
        "report": ["a.pcap"], "packets": ["a.pcap"], "vars": ["a.pcap", "axis.gvl", "axis_types.st"],
        "export": ["a.pcap", "axis.gvl", "axis_types.st", "-w", "out.csv"], "gvl layout": ["axis.gvl", "axis_types.st"],
        "gvl diff": ["axis.gvl", "counters.gvl"], "convert": ["a.pcap", "-w", "out.mcap"],
        "datalog config": ["--gvl", "axis.gvl", "--gvl", "axis_types.st"],
        "replay": ["a.pcap", "--to", "udp://127.0.0.1", "--rate", "1000"],
    }  # fmt: skip
    return words + ([] if given else needed.get(verb, []))


def assert_done(command: str, here: Path) -> str:
    done = run_text(*completed(command), cwd=here)
    # A difference that is found is what was asked for, and so is what is wrong with this machine.
    assert done.returncode in ((0, 1) if {"diff", "doctor"} & set(command.split()) else (0,)), done.stderr
    return done.stdout


def test_there_are_some() -> None:
    assert len(COMMANDS) > 15
    assert {"nvscope explain CODE", "nvscope gvl diff", "nvscope packets -x"} <= set(COMMANDS)
    assert commands_of(SOURCES) == COMMANDS


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_in_the_source_does_something(command: str, here: Path) -> None:
    assert_done(command, here)


def test_every_option_in_the_source_is_one() -> None:
    """Of the verb whose module says it or that the text names, where there is one; of any verb elsewhere."""
    options, wrong = options_of(), []
    for path, (line, text) in [(source, told) for source in SOURCES for told in texts_of(source)]:
        verb = path.stem if path.parent.name == "cli" and path.stem in options else ""
        named = [other for other in options if other and f"nvscope {other}" in text]
        verbs = [verb, "", *named] if verb else list(options)
        known = {option for one in verbs for option in options[one]}
        for option in OPTION.findall(text) if " " in text else []:
            if option not in known and not any(tool in text for tool in OF_TOOLS.get(option, ())):
                wrong.append(f"{path.relative_to(ROOT)}:{line}: {option} in {text[:60]!r}")
    assert wrong == []


def test_every_field_in_the_catalogue_is_one() -> None:
    """What is in commands is run; here are those in prose, and what is in commands of other verbs."""
    for kind in CATALOGUE.values():
        for text in (*kind.next_steps, *kind.causes, kind.meaning):
            for name in FIELD.findall(text):
                assert name in FIELDS or name in EITHER_OF, (kind.code, name)


def test_what_stands_in_backticks_in_the_catalogue_is_a_command_an_option_or_a_tool() -> None:
    options = set().union(*options_of().values())
    for kind in CATALOGUE.values():
        for text in (*kind.next_steps, *kind.causes):
            for quoted in BACKTICKS.findall(text):
                first = quoted.split()[0]
                tools = OF_TOOLS.get(first)
                assert (
                    first in {"nvscope", *TOOLS} or first in options or quoted.startswith("udp port ")
                    or (tools and any(tool in text for tool in tools))
                ), (kind.code, quoted)  # fmt: skip


def capture_filters() -> list[str]:
    """Return the capture filters that findings and README name."""
    said = " ".join(text for kind in CATALOGUE.values() for text in kind.next_steps)
    filters = [quoted for quoted in BACKTICKS.findall(said) if quoted.startswith("udp port ")]
    filters += re.findall(r'dumpcap .*-f "([^"]+)"', (ROOT / "README.md").read_text(encoding="utf-8"))
    return filters


def test_one_capture_filter_is_named_everywhere() -> None:
    assert len(capture_filters()) > 1
    assert len(set(capture_filters())) == 1


@pytest.mark.skipif(shutil.which("tcpdump") is None, reason="needs tcpdump")
def test_capture_filters_are_ones() -> None:
    filters = capture_filters()
    for one in filters:
        subprocess.run(["tcpdump", "-d", "-y", "EN10MB", one], check=True, capture_output=True)


@pytest.mark.parametrize("code", CATALOGUE)
def test_what_explain_tells_to_do_does_something(code: str, here: Path) -> None:
    told = " ".join(run_text("explain", code, environment={"COLUMNS": "200"}).stdout.split())
    for command in commands_in(told):
        assert_done(command, here)


def test_icmp_is_found_where_explain_says(here: Path) -> None:
    (command,) = commands_in(" ".join(CATALOGUE["NV305"].next_steps))
    (here / "kinds.pcap").replace(here / "a.pcap")
    told = assert_done(command, here)
    assert ["unreachable: " in line for line in told.splitlines()] == [True] * 3


@pytest.mark.parametrize(
    "words",
    [
        ("report", "a.pcap", "axis.gvl", "counters.gvl", "axis_types.st"),
        ("report", "a.pcap", "later.pcap"),
        ("report", "none.pcap"),
        ("report", "axis.gvl", "axis_types.st"),
        ("report", "a.pcap", "-Y", "icmp.type == 3"),
        ("report", "a.pcap", "-Y", "nv.idex == 3"),
        ("packets", "a.pcap", "-e", "nv.idex"),
        ("packets", "a.pcap", "-e", "finding.code"),
        ("packets", "a.pcap", "--gvl", "axis.gvl", "--gvl", "axis_types.st"),
        ("packets", "none.pcap"),
        ("vars", "a.pcap"),
        ("vars", "a.pcap", "axis.gvl", "axis_types.st", "--history", "stAxs.pos"),
        ("vars", "a.pcap", "axis.gvl", "axis_types.st", "--history", "zzz"),
        ("vars", "none.pcap", "axis.gvl", "axis_types.st", "--history", "*"),
        ("vars", "a.pcap", "-w", "x"),
        ("export", "a.pcap", "-e", "icmp.code", "--what", "telegrams", "-w", "x.csv"),
        ("explain",),
        ("explain", "zzzz"),
        ("simulate",),
        ("gvl", "lint", "axis.gvl", "again.gvl", "axis_types.st"),
        ("reprot",),
        ("zzz",),
    ],
    ids=" ".join,
)
def test_every_command_that_is_printed_does_something(words: tuple[str, ...], here: Path) -> None:
    for name, day in (("later.pcap", 5), ("none.pcap", 0)):
        write_kinds(here / name)
        if not day:
            shutil.copy(here / "kinds.pcap", here / name)
            (here / name).write_bytes((here / name).read_bytes()[: 24 + 16 + 42])  # an ARP request alone
    (here / "again.gvl").write_text((here / "axis.gvl").read_text().replace("nState", "nOther"))
    done = run_text(*words, cwd=here, environment={"COLUMNS": "250"})
    assert done.returncode in (0, 1, 2), done.stderr
    printed = done.stdout + done.stderr
    for command in set(commands_in(printed)):
        assert_done(command, here)
