"""What must hold for any capture with any definitions: every verb answers or refuses in words, and the answers agree.

``ask`` raises AssertionError where something does not hold; any other exception is a bug as well.
"""

from __future__ import annotations

import random
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import nvscope
from nvscope.errors import ExitCode, UsageError
from tests.fuzz.asked import READ, REFUSED, Answered, Asked, Plant
from tests.fuzz.definition_questions import ask_definitions, ask_refused
from tests.fuzz.examination import ends
from tests.fuzz.export_questions import ask_exports
from tests.fuzz.filter_questions import ask_filtered
from tests.fuzz.variable_questions import ask_variables, values_of


def ask(plant: Plant, folder: Path, rng: random.Random) -> Answered:
    """Ask all verbs; ``rng`` draws in which forms, and with which filters."""
    asked = Asked(plant, folder, rng)
    with ends():
        ask_definitions(asked)
        plain = asked.on_capture("report", "--json", defined=False)
        if plain.code not in READ:
            assert plain.code in REFUSED, plain
            assert not plain.out
            return asked.answered
        asked.answered.readable = True
        _ask_inference(asked)
        report = asked.on_capture("report", "--json")
        if report.code not in READ:
            assert report.code == ExitCode.USAGE, report
            ask_refused(asked)
            return asked.answered
        _compare_reports(plain.document(), report.document())
        asked.answered.telegrams = report.document()["capture"]["telegrams"]
        ask_filtered(asked, report.document())
        variables = ask_variables(asked, report.document())
        if variables is not None:
            ask_exports(asked, variables)
        _ask_notebook(asked, report.document(), variables)
        _ask_doctor(asked, plain.document())
    return asked.answered


def _compare_reports(plain: Any, defined: Any) -> None:
    """A definition names and judges, it never changes what was counted."""
    for name in ("frames", "telegrams", "other_frames", "start_ns", "end_ns"):
        assert plain["capture"][name] == defined["capture"][name]
    ours = {entry["key"]: (entry["diag"], entry["counters"]["lost"]) for entry in plain["lists"]}
    theirs = {entry["key"]: (entry["diag"], entry["counters"]["lost"]) for entry in defined["lists"]}
    assert ours.items() <= theirs.items()


def _ask_doctor(asked: Asked, report: Any) -> None:
    """It sees the frames that a report sees, and no more telegrams than there are."""
    ran = asked.on_capture("doctor", "--json", defined=False)
    assert ran.code in READ | {ExitCode.ASSERTION_FAILED}, ran
    told = ran.document()
    assert told["places"][0]["frames"] == report["capture"]["frames"]
    assert told["telegrams"] <= report["capture"]["telegrams"]
    asked.on_capture("doctor", "--all")


def _ask_inference(asked: Asked) -> None:
    draft = asked.folder / "draft.gvl"
    ran = asked.on_capture("vars", "--infer", "-w", str(draft), defined=False)
    assert ran.code in READ, ran
    as_json = asked.on_capture("vars", "--infer", "--json", defined=False)
    as_json.document()
    for path in sorted(asked.folder.glob("draft*.gvl"))[:10]:
        again = asked.run("vars", "-q", str(asked.capture), "--gvl", str(path), "--json")
        # A draft that cannot be declared as it was sent says so; there may be nothing in it.
        if "it does not fit the wire" not in ran.err:
            assert again.code in READ, (path.read_text(), again)
            assert any(row["sender"] is not None for row in again.document()["variables"]), path.read_text()
        lint = asked.run("gvl", "lint", str(path))
        assert lint.code in (ExitCode.GOOD, ExitCode.ASSERTION_FAILED), lint
        asked.answered.drafts += 1
    for path in asked.folder.glob("draft*.gvl"):
        path.unlink()


def _ask_notebook(asked: Asked, report: Any, rows: Sequence[Mapping[str, Any]] | None) -> None:
    opened = nvscope.open(asked.capture, definitions=asked.files or None)
    assert opened.lists.height == len(report["lists"])
    assert opened.findings.height == len(report["findings"])
    assert opened.streams.height == sum(len(entry["streams"]) for entry in report["lists"])
    capture = report["capture"]
    assert opened.telegrams().height == capture["telegrams"] + capture.get("can_frames", 0)
    wanted = sum(values_of(rows or ()).values())
    try:
        with warnings.catch_warnings(action="ignore"):  # of what was left out, it is told
            height = opened.values(form="long").height
    except UsageError:
        height = 0  # no list is defined, or none of which the sizes of all variables are known
    assert height == wanted
