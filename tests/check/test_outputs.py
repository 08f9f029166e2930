"""Verdicts for build servers and pull requests: JUnit's XML, annotations of GitHub, Markdown."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from defusedxml.ElementTree import fromstring

from tests.check.test_verdicts import PLANT, RULES, STEADY, ruled, sent
from tests.program import run_text

LOSSY = [one for one in STEADY if one != 50]
HOSTILE = 'a%b:c,d\\u001b[31m<x>&\\"|`*_]'


def junit(capture: Path, rules: Path, tmp_path: Path, *options: str) -> Any:
    out = tmp_path / "out.xml"
    done = run_text("check", capture, "--rules", rules, "--junit", out, "--force", *options)
    assert done.returncode in (0, 1, 3), done.stderr
    return fromstring(out.read_bytes())


def test_a_suite_a_file_and_a_case_a_rule(tmp_path: Path) -> None:
    root = junit(PLANT, RULES, tmp_path)
    (suite,) = root
    assert (root.tag, suite.tag, suite.get("name")) == ("testsuites", "testsuite", str(RULES))
    assert [suite.get(name) for name in ("tests", "failures", "errors", "skipped")] == ["10", "5", "0", "0"]
    cases = {one.get("name"): one for one in suite}
    assert [one.get("classname") for one in suite][:2] == ["nvscope.loss", "nvscope.gap"]
    assert [child.tag for child in cases["axis-complete"]] == ["failure"]
    assert list(cases["axis-in-a-row"]) == []
    failure = cases["axis-complete"][0]
    assert failure.get("message").startswith("list 7, worst 0.")
    assert failure.get("message").endswith("first at 7.0 s, frame 278")
    command = f"nvscope packets {PLANT} -Y 'frame.number >= 274 && frame.number <= 282'"
    assert failure.text.splitlines() == [
        failure.get("message"), command, "the drives stop at a second lost setpoint",
    ]  # fmt: skip


def test_each_file_of_rules_is_a_suite(tmp_path: Path) -> None:
    (tmp_path / "common.rules.toml").write_text('[[rule]]\nid = "common"\ncheck = "gap"\n')
    path = tmp_path / "own.rules.toml"
    path.write_text('include = "common.rules.toml"\n[[rule]]\nid = "own"\ncheck = "loss"\n')
    root = junit(sent(tmp_path, LOSSY), path, tmp_path)
    assert [(Path(one.get("name")).name, one.get("failures")) for one in root] == [
        ("common.rules.toml", "1"), ("own.rules.toml", "1"),
    ]  # fmt: skip


@pytest.mark.parametrize(("fail_on", "tag"), [("error", "skipped"), ("inconclusive", "failure")])
def test_what_cannot_be_decided_is_skipped_unless_it_fails_the_build(fail_on: str, tag: str, tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "loss"\nlist = "99"')
    (suite,) = junit(sent(tmp_path, STEADY), rules, tmp_path, "--fail-on", fail_on)
    (told,) = suite[0]
    assert (told.tag, told.get("message")) == (tag, "no list is called 99")
    assert (suite.get("skipped"), suite.get("failures")) == (("1", "0") if tag == "skipped" else ("0", "1"))


def test_no_output_is_written_onto_an_input(tmp_path: Path) -> None:
    capture, rules = sent(tmp_path, STEADY), ruled(tmp_path, 'check = "loss"')
    for path in (capture, rules):
        before = path.read_bytes()
        done = run_text("check", capture, "--rules", rules, "--junit", path, "--force")
        assert (done.returncode, path.read_bytes() == before) == (2, True)


def test_what_stands_in_files_cannot_break_out(tmp_path: Path) -> None:
    """Neither of XML, of an annotation nor of Markdown; and it is no control character anywhere."""
    capture, rules = sent(tmp_path, LOSSY), tmp_path / "x.rules.toml"
    rules.write_text(f'[[rule]]\nid = "{HOSTILE}"\ncheck = "loss"\ndescription = "{HOSTILE}"\n')
    (suite,) = junit(capture, rules, tmp_path)
    assert suite[0].get("name") == 'a%b:c,d\\x1b[31m<x>&"|`*_]'
    annotated = run_text("check", capture, "--rules", rules, "--github").stdout.splitlines()[0]
    assert annotated.startswith(f'::error file={rules},line=1,title=a%25b%3Ac%2Cd\\x1b[31m<x>&"|`*_]::list 7')
    told = run_text("check", capture, "--rules", rules, "--md").stdout
    assert "\x1b" not in told
    assert not re.search(r"(?<!\\)<x>", told)


def test_annotations_stand_at_the_rules_that_are_broken(tmp_path: Path) -> None:
    rules = ruled(
        tmp_path, 'check = "loss"', 'check = "gap"\nseverity = "warning"', 'check = "gap"\nseverity = "note"',
        'check = "loss"\nlist = "99"', 'check = "restarts"',
    )  # fmt: skip
    done = run_text("check", sent(tmp_path, LOSSY), "--rules", rules, "--github")
    told = [line for line in done.stdout.splitlines() if line.startswith("::")]
    assert [line.split()[0] for line in told] == ["::error", "::warning", "::notice", "::warning"]
    assert [re.search(r",line=(\d+),title=(\w+)::", line)[2] for line in told] == ["r0", "r1", "r2", "r3"]  # type: ignore[index]
    assert "✗ 3 of 5 rules failed" in done.stdout


def test_markdown_has_a_row_for_each_rule(tmp_path: Path) -> None:
    done = run_text("check", PLANT, "--rules", RULES, "--md")
    lines = done.stdout.splitlines()
    assert lines[0].startswith("**5 of 10 rules failed** · `")
    rows = [line for line in lines if line.startswith("| ✗") or line.startswith("| ●")]
    assert len(rows) == 10
    assert rows[1] == "| ● | axis-in-a-row | gap | 1 telegram | 1 telegram | 0 % |"
    assert len({line.count("|") for line in rows}) == 1
    assert run_text("check", PLANT, "--rules", RULES, "--md", "--json").returncode == 2
