"""Verdicts for build servers and pull requests: JUnit's XML, annotations of GitHub, Markdown."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from defusedxml.ElementTree import fromstring

from nvscope.capture.open import open_source
from tests.check.plants import captured, definitions
from tests.check.test_verdicts import BEGIN_NS, PLANT, RULES, STEADY, ruled, sent
from tests.program import COMMAND, run_text

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
    assert [suite.get(name) for name in ("tests", "failures", "errors", "skipped")] == ["10", "4", "0", "1"]
    cases = {one.get("name"): one for one in suite}
    assert [one.get("classname") for one in suite][:2] == ["nvscope.loss", "nvscope.gap"]
    assert [child.tag for child in cases["axis-complete"]] == ["failure"]
    assert list(cases["axis-in-a-row"]) == []
    failure = cases["axis-complete"][0]
    assert failure.get("message").startswith("list 7, worst 0.")
    assert failure.get("message").endswith("first at 7.0 s, frame 278")
    command = f"nvscope packets {PLANT} -Y 'frame.number >= 274 && frame.number <= 282'"
    assert cases["no-restart"][0].tag == "skipped"
    assert cases["no-restart"][0].get("message").startswith("warning: list 9, worst 1 event")
    (strict,) = junit(PLANT, RULES, tmp_path, "--fail-on", "warning")
    assert (strict.get("failures"), strict.get("skipped")) == ("5", "0")
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


@pytest.mark.parametrize("option", ["--junit", "--sarif"])
def test_no_output_is_written_onto_a_capture_of_a_directory(option: str, tmp_path: Path) -> None:
    capture, rules = sent(tmp_path, STEADY), ruled(tmp_path, 'check = "loss"')
    folder = tmp_path / "captures"
    folder.mkdir()
    own = folder / capture.name
    own.write_bytes(capture.read_bytes())
    done = run_text("check", folder, "--rules", rules, option, own, "--force")
    assert (done.returncode, own.read_bytes() == capture.read_bytes()) == (2, True), done.stderr
    # What a run before wrote beside them is no capture.
    for _ in range(2):
        assert run_text("check", folder, "--rules", rules, option, folder / "told").returncode == 0


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
    assert "✗ 1 of 5 rules failed, 1 warning, 1 note, 1 could not be decided" in done.stdout


def test_markdown_has_a_row_for_each_rule(tmp_path: Path) -> None:
    done = run_text("check", PLANT, "--rules", RULES, "--md")
    lines = done.stdout.splitlines()
    assert lines[0].startswith("**4 of 10 rules failed, 1 warning** · `")
    rows = [line for line in lines if line.startswith(("| ✗", "| !", "| ●"))]
    assert len(rows) == 10
    assert rows[1] == "| ● | axis-in-a-row | gap | 1 telegram | 1 telegram | 0 % |"
    assert len({line.count("|") for line in rows}) == 1
    assert run_text("check", PLANT, "--rules", RULES, "--md", "--json").returncode == 2


def test_sarif_has_a_result_for_each_subject_that_breaks_a_rule(tmp_path: Path) -> None:
    out = tmp_path / "out.sarif"
    run_text("check", PLANT, "--rules", RULES, "--sarif", out)
    log = json.loads(out.read_text())
    (run,) = log["runs"]
    assert (log["version"], run["tool"]["driver"]["name"]) == ("2.1.0", "nvscope")
    rules = run["tool"]["driver"]["rules"]
    assert [one["id"] for one in rules][:2] == ["axis-complete", "axis-in-a-row"]
    first = run["results"][0]
    assert (first["ruleId"], first["kind"], first["level"]) == ("axis-complete", "fail", "error")
    assert first["locations"][0]["physicalLocation"]["region"] == {"startLine": 5}
    assert all(rules[one["ruleIndex"]]["id"] == one["ruleId"] for one in run["results"])
    assert "axis-in-a-row" not in {one["ruleId"] for one in run["results"]}
    prints = [one["partialFingerprints"]["ruleAndSubject/v1"] for one in run["results"]]
    assert len(set(prints)) == len(prints)


def test_fingerprints_do_not_change_with_the_time_or_the_figures(tmp_path: Path) -> None:
    prints = []
    for name, lost in (("a", {50}), ("b", {20, 21})):
        (tmp_path / name).mkdir()
        rules = ruled(tmp_path / name, 'check = "loss"')
        capture = sent(tmp_path / name, [one for one in STEADY if one not in lost])
        out = tmp_path / name / "out.sarif"
        run_text("check", capture, "--rules", rules, "--sarif", out)
        (result,) = json.loads(out.read_text())["runs"][0]["results"]
        prints.append((result["partialFingerprints"], result["message"]["text"]))
    assert prints[0][0] == prints[1][0]
    assert prints[0][1] != prints[1][1]


def test_evidence_is_what_was_around_with_comments_at_the_frames(tmp_path: Path) -> None:
    folder = tmp_path / "evidence"
    rules = ruled(tmp_path, 'check = "loss"', 'check = "restarts"')
    done = run_text("check", sent(tmp_path, LOSSY), "--rules", rules, "--evidence", folder, "--around", "500ms")
    assert [one.name for one in folder.iterdir()] == ["r0.pcapng"]
    assert f"nvscope: 1 file of evidence in {folder}." in done.stderr
    (batch,) = (batch for batch in open_source([str(folder / "r0.pcapng")]) if len(batch))
    source = open_source([str(folder / "r0.pcapng")])
    kept = [int(time_ns) for batch in source for time_ns in batch.ts_ns]
    gap_ns = BEGIN_NS + 49 * 10**8
    # 20 frames before and behind are kept at least, and these are ten a second.
    assert kept == [gap_ns + place * 10**8 for place in range(-20, 21)]
    ((frame, text),) = source.infos[0].comments
    assert (frame, len(batch)) == (21, 41)
    assert text.startswith("r0: list 7, worst 1.0 %, limit 0.0 %")
    assert text.endswith(f"(frame 50 of {tmp_path / 'x.pcap'})")
    again = run_text("check", tmp_path / "x.pcap", "--rules", rules, "--evidence", folder)
    assert (again.returncode, "exists already" in again.stderr) == (2, True)


def test_evidence_of_what_is_read_once_comes_from_memory(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "loss"')
    capture = sent(tmp_path, LOSSY)
    done = subprocess.run(
        [*COMMAND, "check", "-", "--rules", str(rules), "--evidence", str(tmp_path / "e")],
        stdin=capture.open("rb"), capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert sum(len(batch) for batch in open_source([str(tmp_path / "e" / "r0.pcapng")])) == 41


def test_names_of_evidence_are_names_of_files(tmp_path: Path) -> None:
    rules = tmp_path / "x.rules.toml"
    ids = ["../../x", "a b/c", "A b/C", "..", "CON"]
    rules.write_text("".join(f'[[rule]]\nid = "{one}"\ncheck = "loss"\n' for one in ids))
    run_text("check", sent(tmp_path, LOSSY), "--rules", rules, "--evidence", tmp_path / "e")
    found = sorted(one.name for one in (tmp_path / "e").iterdir())
    assert found == ["A-b-C-2.pcapng", "a-b-c.pcapng", "rule-CON.pcapng", "rule.pcapng", "x.pcapng"]


def test_a_dry_run_says_what_rules_are_for(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "loss"', 'check = "gap"\nlist = "99"', 'check = "range"\nvariable = "x"')
    done = run_text("check", PLANT, "--rules", rules, "--dry-run")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "r0  loss: 3, 7, 9, 12",
        "r1  gap: no list",
        "    cannot be decided: no list is called 99",
        "r2  range: variable",
        "    cannot be decided: no definition is given",
        "",
        "3 rules, 2 of them cannot be decided here",
    ]


@pytest.mark.parametrize(("least", "code"), [("never", 0), ("error", 1), ("warning", 1), ("note", 1)])
def test_a_report_fails_a_build_too(least: str, code: int, tmp_path: Path) -> None:
    assert run_text("report", PLANT, "--fail-on", least).returncode == code
    assert run_text("report", sent(tmp_path, STEADY), "--fail-on", least).returncode == 0


def test_a_report_that_shows_nothing_bad_does_not_fail(tmp_path: Path) -> None:
    assert run_text("report", sent(tmp_path, LOSSY), "--fail-on", "warning").returncode == 1


def shown(command: str) -> list[int]:
    """Return the Counters of the telegrams that a command shows."""
    words = shlex.split(command)
    done = run_text(*words[1:], "-T", "fields", "-e", "nv.counter")
    assert done.returncode == 0, done.stderr
    return [int(line) for line in done.stdout.split()]


DAY = datetime.fromtimestamp(BEGIN_NS // 10**9 + 2, UTC).strftime("%Y-%m-%d %H:%M:%S")


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--from-time", "2s"),
        ("--to-time", "6s"),
        ("--from-time", DAY, "--utc"),
        ("--from-time", f"{DAY}Z", "--utc"),
    ],
)
def test_the_command_shows_where_it_broke(options: tuple[str, ...], tmp_path: Path) -> None:
    capture = sent(tmp_path, LOSSY).rename(tmp_path / "it's a cap.pcap")
    done = run_text("check", capture, "--rules", ruled(tmp_path, 'check = "gap"'), *options)
    (command,) = (line.strip() for line in done.stdout.splitlines() if "nvscope packets" in line)
    assert shown(command) == [46, 47, 48, 49, 51, 52, 53, 54, 55]


def test_of_several_captures_the_command_names_all(tmp_path: Path) -> None:
    captures = [
        sent(tmp_path, LOSSY).rename(tmp_path / "a.pcap"),
        sent(tmp_path, STEADY[:1]).rename(tmp_path / "b.pcap"),
    ]
    done = run_text("check", *captures, "--rules", ruled(tmp_path, 'check = "gap"\nmax = 0'))
    (command,) = (line.strip() for line in done.stdout.splitlines() if "nvscope packets" in line)
    assert {49, 51} <= set(shown(command))


def test_what_fails_no_build_is_no_failure_of_junit(tmp_path: Path) -> None:
    """Also where what could not be decided fails it: a warning does not."""
    rules = ruled(tmp_path, 'check = "loss"\nseverity = "warning"', 'check = "loss"\nlist = "99"\nseverity = "note"')
    done = run_text("check", sent(tmp_path, LOSSY), "--rules", rules, "--fail-on", "inconclusive")
    (suite,) = junit(tmp_path / "x.pcap", rules, tmp_path, "--fail-on", "inconclusive")
    assert (done.returncode, suite.get("failures"), suite.get("skipped")) == (0, "0", "2")


def test_where_the_limit_is_0_the_margin_is_told_in_its_unit(tmp_path: Path) -> None:
    told = run_text("check", sent(tmp_path, LOSSY), "--rules", ruled(tmp_path, 'check = "gap"')).stdout
    assert "worst 1 telegram   limit 0 telegrams   margin −1 telegram" in told


def test_what_an_exception_allows_is_not_the_tightest(tmp_path: Path) -> None:
    rules = ruled(
        tmp_path, 'check = "cycle"\ninterval = "100ms"\nexceptions = "5%"', 'check = "silence"\nmax = "250ms"'
    )
    capture = captured(tmp_path, [(number * 100, 7, [False, 1]) for number in range(100) if number != 50])
    told = run_text("check", capture, "--rules", rules).stdout
    assert "2 passed; the tightest is r1: worst 200.0 ms, limit 250.0 ms, margin 20 %" in told


def test_what_a_capture_lacks_is_told_in_figures(tmp_path: Path) -> None:
    capture = sent(tmp_path, STEADY)
    done = run_text(
        "check", capture, "--rules", ruled(tmp_path, 'check = "capture_quality"\nmin_duration = "10s"'), "--json"
    )
    (subject,) = json.loads(done.stdout)["rules"][0]["subjects"]
    assert (subject["worst"], subject["limit"], subject["unit"]) == (9.9, 10.0, "s")
    assert subject["margin"] == pytest.approx(-0.1)
    assert subject["reason"] == "it is 100.0 ms too short"


@pytest.mark.parametrize("other", ["", "max = 5", 'expr = "nv.indx == 1"'])
def test_mistakes_of_all_kinds_are_told_at_once(other: str, tmp_path: Path) -> None:
    """Of keys, of expressions, and lists that neither definitions nor the capture have."""
    texts = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    capture = captured(tmp_path, [(0, 7, [False, 1]), (50, 8, [])])
    rules = ruled(
        tmp_path, f'check = "implies"\nif = "rose(var.safety.bStopp)"\nthen = "nv.indx == 3"\nwithin = "1s"\n{other}',
        'check = "loss"\nlist = "axxis"', 'check = "gap"\nlist = ["safety", "valv"]',
    )  # fmt: skip
    done = run_text("check", capture, "--rules", rules, *texts)
    assert (done.returncode, done.stdout) == (2, "")
    told = [line for line in done.stderr.splitlines() if line.startswith("nvscope: ")]
    wanted = ["rule[0].if: no field", "rule[0].then: no field", "rule[1].list: no list is called 'axxis'",
              "rule[2].list: no list is called 'valv'"]  # fmt: skip
    assert [want for want in wanted if not any(want in line for line in told)] == []
    assert len(told) == len(wanted) + bool(other)


def test_an_id_is_not_empty(tmp_path: Path) -> None:
    path = tmp_path / "x.rules.toml"
    path.write_text('[[rule]]\nid = ""\ncheck = "gap"\n')
    done = run_text("check", sent(tmp_path, STEADY), "--rules", path)
    assert (done.returncode, "an id is a text that is not empty" in done.stderr) == (2, True)
