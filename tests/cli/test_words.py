"""What people write instead of what the program expects: no verb, options in front of it, names nearly right."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

from nvscope.cli.completion import expressions
from nvscope.cli.help import EXAMPLES, GROUPS, group_of
from nvscope.cli.program import VERBS, program
from nvscope.cli.words import in_order
from nvscope.errors import UsageError
from tests import program as process
from tests.program_here import run, run_text

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "captures" / "peers"
PLANT = ROOT / "captures" / "plant.pcapng.gz"


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("report x", "report x"),
        ("x.pcap", "report x.pcap"),
        ("-", "report -"),
        ("./x", "report ./x"),
        ("*.pcap", "report *.pcap"),
        ("can:socketcan:can0", "report can:socketcan:can0"),
        ("-v x.pcap", "report -v x.pcap"),
        ("-r x.pcap --json", "report -r x.pcap --json"),
        ("--color never vars x", "vars --color never x"),
        ("-q --gvl=plc packets x", "packets -q --gvl=plc x"),
        ("help", "--help"),
        ("help gvl lint", "gvl lint --help"),
        ("--version", "--version"),
        ("", ""),
    ],
)
def test_words_are_put_into_order(given: str, meant: str) -> None:
    assert in_order(given.split(), VERBS) == meant.split()


def test_a_file_is_reported_whatever_it_is_called(tmp_path: Path) -> None:
    shutil.copy(PEERS / "peers.pcap", tmp_path / "monday")
    assert run("monday", cwd=tmp_path).stdout == run("report", "monday", cwd=tmp_path).stdout
    # A verb is a verb, also where a file has its name.
    shutil.copy(PEERS / "peers.pcap", tmp_path / "keys")
    assert run_text("keys", cwd=tmp_path).stdout.startswith("Views")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("reprot", "no verb and no file is called 'reprot'\n  perhaps nvscope report, nvscope export\n"),
        ("mondy", "no verb and no file is called 'mondy'\n  perhaps monday\n"),
        ("zzz", "no verb and no file is called 'zzz'\n  `nvscope --help` lists the verbs\n"),
        ("help lnt", "no verb is called 'lnt'\n"),
        ("report plant.pcap", "plant.pcap: No such file or directory\n  perhaps plant.pcapng\n"),
        ("plant.pcap", "plant.pcap: No such file or directory\n  perhaps plant.pcapng\n"),
        ("report sub/plant.pcap", "sub/plant.pcap: No such file or directory\n  perhaps sub/plan.pcap\n"),
        ("gvl layout axs.gvl", "axs.gvl: cannot be read: No such file or directory\n  perhaps axis.gvl\n"),
        ("report gone/x.pcap", "gone/x.pcap: No such file or directory\n  check the path and the permissions\n"),
    ],
)
def test_names_that_are_nearly_right_are_offered(words: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for name in ("monday", "plant.pcapng", "sub/plan.pcap", "axis.gvl"):
        (tmp_path / name).touch()
    done = run_text(*words.split(), cwd=tmp_path)
    assert done.returncode in (2, 4)
    assert done.stderr.startswith(f"nvscope: {said}")


def test_variables_are_offered_in_their_own_spelling() -> None:
    words = ("vars", PEERS / "peers.pcap", PEERS / "axis.gvl", PEERS / "axis_types.st", "--history")
    assert run_text(*words, "stAxs.pos").stderr.endswith("near it: stAxis.pos, stAxis, stAxis.vel\n")
    assert run_text(*words, "alimit").stderr.endswith("near it: aLimits, aLimits[3], aLimits[2]\n")


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        ('nv.service == "data"', 'nv.service is never "data"'),
        ('finding.code == "NV999"', 'finding.code is never "NV999"'),
        ('finding.code in {"NV201", "NV2O2"}', 'finding.code is never "NV2O2"'),
        ('finding.severity != "fatal"', 'finding.severity is never "fatal"'),
        ('cause.kind == "second-sendr"', 'cause.kind is never "second-sendr"'),
        ('cause.severity in {"errors"}', 'cause.severity is never "errors"'),
        ('nv.fault == "shorts"', 'nv.fault is never "shorts"'),
        ('canopen.function == "heartbeats"', 'canopen.function is never "heartbeats"'),
        ('can.direction == "rx"', 'can.direction is never "rx"'),
        ('list.sLastError == "CHEKSUM"', 'list.sLastError is never "CHEKSUM"'),
        ('node.sLastError in {"CHECKSUM", "no acknowledgement"}', 'node.sLastError is never "no acknowledgement"'),
    ],
)
def test_a_text_that_a_field_never_has_is_a_mistake(expression: str, said: str) -> None:
    done = run_text("packets", PEERS / "peers.pcap", "-Y", expression)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert "perhaps" in done.stderr or "it is one of" in done.stderr or "it may be" in done.stderr


@pytest.mark.parametrize("expression", ['finding.code contains "NV2"', 'nv.service matches "data"', 'list.name == "x"'])
def test_parts_of_texts_and_open_sets_may_be_anything(expression: str) -> None:
    assert run_text("packets", PEERS / "peers.pcap", "-Y", expression).returncode == 0


def verbs() -> list[tuple[str, ...]]:
    below = {
        "gvl": ("layout", "lint", "diff"), "sdo": ("read", "write", "serve"),
        "visu": ("read", "list", "write", "serve"),
    }  # fmt: skip
    return [*((verb,) for verb in VERBS), *((verb, one) for verb, several in below.items() for one in several)]


@pytest.mark.parametrize("verb", verbs(), ids=" ".join)
@pytest.mark.parametrize("columns", ["60", "80", "120"])
def test_help_is_whole(verb: tuple[str, ...], columns: str) -> None:
    done = run_text(*verb, "--help", environment={"COLUMNS": columns})
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == run_text("help", *verb, environment={"COLUMNS": columns}).stdout
    # A sentence that was cut ends like this.
    assert "...\n" not in done.stdout.replace("...]...\n", "...]\n").replace("ARGS]...\n", "").replace("...]\n", "")
    if EXAMPLES.get(" ".join(verb)):
        assert done.stdout.rstrip().splitlines()[-2].startswith("  nvscope ")


def test_verbs_stand_in_the_order_of_use() -> None:
    lines = run_text("--help").stdout.splitlines()
    start = lines.index("Verbs:")
    assert [line.split()[0] for line in lines[start + 1 :] if line[2:3].strip()] == list(VERBS)


def test_every_option_stands_in_a_group_that_is_its_own() -> None:
    told = [name for names in GROUPS.values() for name in names]
    assert len(told) == len(set(told))
    known = set()
    for verb in verbs():
        text = run_text(*verb, "--help", environment={"COLUMNS": "200"}).stdout
        known |= {word.strip(",") for line in text.splitlines() for word in line.split()[:2] if word.startswith("-")}
    assert set(told) - known == set()
    assert group_of(["-w", "--write"]) == "How it is told"


@pytest.mark.long
@pytest.mark.parametrize("verb", [verb for verb in EXAMPLES if not verb.startswith(("sdo ", "visu "))])
def test_examples_do_what_they_say(verb: str, tmp_path: Path) -> None:
    """Each of them runs, on a capture and definitions of these names; ``sdo`` and ``visu`` have to ask somebody."""
    (tmp_path / "plc").mkdir()
    for name in ("axis.gvl", "axis_types.st", "batch.gvl"):
        shutil.copy(PEERS / name, tmp_path / "plc" / name)
    shutil.copy(PEERS / "peers.pcap", tmp_path / "plant.pcapng")
    for side in ("sender", "reader"):
        shutil.copy(PEERS / "batch.gvl", tmp_path / f"{side}.gvl")
    # It is sent at its pace, and nobody need wait for all of it.
    scenario = (ROOT / "tests" / "scenarios" / "jitter.toml").read_text().replace('duration = "40s"', 'duration = "3s"')
    (tmp_path / "plant.toml").write_text(scenario)
    (tmp_path / "plant.rules.toml").write_text('[[rule]]\nid = "none-lost"\ncheck = "loss"\nseverity = "note"\n')
    if verb == "simulate":  # which keeps a capture that is there
        (tmp_path / "plant.pcapng").unlink()
    if verb == "baseline":  # which keeps rules that are there
        (tmp_path / "plant.rules.toml").unlink()
    shutil.copy(PEERS / "peers.pcap", tmp_path / "good.pcapng")
    for logged, name in (("genuine-5min.db", "log.db"), ("genuine-5min.config.xml", "log.xml")):
        shutil.copy(ROOT / "captures" / "datalogger" / logged, tmp_path / name)
    if verb == "datalog":
        shutil.copy(ROOT / "captures" / "datalogger" / "axis.config.xml", tmp_path / "axis.xml")
    for line, _ in EXAMPLES[verb]:
        program_name, *words = shlex.split(line)
        assert program_name == "nvscope"
        assert words[: len(verb.split())] == verb.split() or (verb == "report" and words[0] == "plant.pcapng")
        if verb == "recover":
            assert run_text("convert", "plant.pcapng", "-w", "cut.mcap", cwd=tmp_path).returncode == 0
        if verb in ("replay", "simulate") and "--to" in words:
            words += ["--port", "9", *(["--rate", "10"] if verb == "replay" else [])]  # where nobody listens
        done = process.run_text(*words, cwd=tmp_path)
        if verb == "replay" and "--to" not in words:
            assert "there is no terminal" in done.stderr
            continue
        assert done.returncode in ((0, 1) if verb in ("gvl lint", "gvl diff", "doctor") else (0,)), (line, done.stderr)
        assert done.stdout or {"-w", "--to"} & set(words) or "the filter chooses none" in done.stderr


def completed(words: str, path: Path) -> list[str]:
    environment = {
        "_NVSCOPE_COMPLETE": "complete_bash", "COMP_WORDS": f"nvscope {words}", "COMP_CWORD": str(len(words.split())),
    }  # fmt: skip
    return run_text(cwd=path, environment=environment).stdout.split()


def test_the_shell_completes_codes_fields_and_lists(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(f"definitions = ['{PEERS}/axis*']\n")
    assert completed("explain NV20", tmp_path) == [f"NV20{digit}" for digit in range(1, 8)]
    assert completed("explain second-", tmp_path) == ["second-sender"]
    assert completed("explain mirr", tmp_path) == ["mirrored-twice"]
    assert "nv.counter" in completed("packets x -e nv.c", tmp_path)
    assert "var.stAxis.pos" in completed("packets x -e var.stA", tmp_path)
    assert completed("vars x --list a", tmp_path) == ["axis"]
    assert completed("vars x -Y !nv.fl", tmp_path)[0].startswith("!nv.flags")
    (tmp_path / "nvscope.toml").write_text("definitions = 5\n")
    assert completed("vars x --list a", tmp_path) == []
    assert "nv.counter" in completed("packets x -e nv.c", tmp_path)


@pytest.mark.parametrize(
    ("begun", "text", "proposed"),
    [
        ("cause.kind == ", '"second', ["second-sender"]),
        ("cause.kind == ", "bus", ["bus-off", "bus-errors", "bus-overloaded"]),
        ("nv.index == 7 && cause.severity != ", "", ["error", "warning", "note"]),
        ('Cause.Kind in {"clock", ', '"bus-o', ["bus-off", "bus-overloaded"]),
        ("finding.code eq ", '"nv20', [f"NV20{digit}" for digit in range(1, 8)]),
        ("nv.service==", "ODBoot", ["ODBootUpRequest"]),
        ("cause.kind == ", '"nothing', []),
        ("cause.title == ", '"list', []),
        ("nobody.kind == ", '"a', []),
    ],
)
def test_the_shell_completes_texts_of_a_field_that_has_only_some(begun: str, text: str, proposed: list[str]) -> None:
    assert expressions(begun + text) == [f'{begun}"{one}"' for one in proposed]


def test_a_word_that_is_no_verb_is_a_usage_error_with_a_next_step() -> None:
    with pytest.raises(UsageError) as caught:
        in_order(["raport"], VERBS)
    assert caught.value.next_step == "perhaps nvscope report, nvscope export"


def test_one_verb_alone_is_what_it_is_in_the_whole_program() -> None:
    assert {command.name for command in program("vars").registered_commands} == {"vars"}


def test_what_explain_tells_is_there_for_programs_too() -> None:
    one = json.loads(run_text("explain", "NV201", "--json").stdout)
    assert one["schema"] == "nvscope.explain/1"
    (finding,) = one["findings"]
    assert (finding["code"], finding["name"], finding["severity"], finding["judged"]) == (
        "NV201", "telegram-gap", "error", True,
    )  # fmt: skip
    told = " ".join(run_text("explain", "NV201", environment={"COLUMNS": "90"}).stdout.split())
    assert all(" ".join(text.split()) in told for text in (finding["meaning"], *finding["next_steps"]))
    figure = json.loads(run_text("explain", "jitter", "--json").stdout)
    assert ([row["code"] for row in figure["findings"]], [row["name"] for row in figure["figures"]]) == (
        ["NV502"], ["jitter"],
    )  # fmt: skip
    whole = json.loads(run_text("explain", "--json").stdout)
    assert finding in whole["findings"]
    assert json.loads(run_text("explain", "second-sender", "--json").stdout)["causes"][0] in whole["causes"]
    assert len(whole["findings"]) > 40
    assert run_text("explain", "nothing", "--json").returncode == 2


@pytest.mark.parametrize("columns", [50, 60, 80, 100])
@pytest.mark.parametrize("verb", ["report", "packets", "vars", "export", "gvl lint", "keys", "simulate", "schema"])
def test_no_line_of_help_ends_within_an_option(verb: str, columns: int) -> None:
    done = run_text(*verb.split(), "--help", environment={"COLUMNS": str(columns), "TERMINAL_WIDTH": str(columns)})
    assert not re.search(r"(?:^|[\s(])--?[a-z-]*-$", done.stdout, re.MULTILINE)
    assert done.stdout.isascii()


@pytest.mark.parametrize("words", [("report", "--max-streams"), ("packets", "-c")])
@pytest.mark.parametrize(
    ("number", "said"),
    [("a", "'a' is no whole number"), ("1.5", "'1.5' is no whole number"), ("", "'' is no whole number"),
     ("0", "0 is too few"), ("-3", "-3 is too few")],
)  # fmt: skip
def test_what_is_no_number_of_things_is_told_with_what_is_expected(
    words: tuple[str, str], number: str, said: str
) -> None:
    verb, option = words
    done = run_text(verb, PEERS / "peers.pcap", option, number)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{said}; expected 1 or more" in done.stderr
