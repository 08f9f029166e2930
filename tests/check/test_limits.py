"""What rules, captures and definitions can choose has limits, and what they say stays a text."""

from __future__ import annotations

import json
import tomllib
from math import isnan
from pathlib import Path
from typing import Any

import pytest

from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import Sending, captured, definitions, judged, ruled
from tests.check.scenario_captures import capture_of
from tests.oracle.builders import data_frame, telegram
from tests.program_here import run_text


def refused(folder: Path, *words: Any) -> str:
    """Return what is said of rules that are not taken."""
    done = run_text("check", *words, cwd=folder)
    assert done.returncode == 2, done.stdout + done.stderr
    return done.stderr


def valve(value: float) -> list[Sending]:
    return [(number * 100, 8, [False, value if number == 20 else 1.0, number]) for number in range(40)]


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
@pytest.mark.parametrize("rule", [
    'check = "range"\nmin = 0\nmax = 9', 'check = "enum"\nvalues = [1.0]', 'check = "rate_of_change"\nmax = 1',
    'check = "monotonic"',
])  # fmt: skip
def test_what_is_no_finite_number_is_null(value: float, rule: str, tmp_path: Path) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    rules = ruled(tmp_path, f'{rule}\nvariable = "valve.fPos"')
    capture = captured(tmp_path, valve(value))
    (one,) = judged(capture, rules, *options)["rules"]
    assert one["verdict"] == ("pass" if "monotonic" in rule and isnan(value) else "fail")
    assert run_text("check", capture, "--rules", rules, "--md", *options).returncode in (0, 1)


@pytest.mark.parametrize(("rule", "told"), [
    (f'check = "loss"\nlist = {json.dumps([f"*a{number}" for number in range(101)])}', "patterns"),
    ('check = "gap"\nmax = 1' + "0" * 400, "a number of 0 or more"),
    ('check = "range"\nvariable = "valve.tRun"\nmin = -1e308', "no time is so long"),
    ('check = "gap"\nlist = []', "no list is in it"),
])  # fmt: skip
def test_numbers_and_lists_have_limits(rule: str, told: str, tmp_path: Path) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    assert told in refused(tmp_path, captured(tmp_path, valve(1)), "--rules", ruled(tmp_path, rule), *options)


def test_more_files_than_are_read_are_a_mistake(tmp_path: Path) -> None:
    for number in range(1005):
        (tmp_path / f"i{number}.toml").write_text(f'[[rule]]\nid = "r{number}"\ncheck = "gap"\n')
    names = ", ".join(f'"i{number}.toml"' for number in range(1005))
    (tmp_path / "x.rules.toml").write_text(f"include = [{names}]\n")
    told = refused(tmp_path, "--dry-run", "x.rules.toml")
    assert told.count("more than 1000 files of rules") == 1
    assert "i999.toml" in told


def test_rules_of_files_that_rules_name_count(tmp_path: Path) -> None:
    (tmp_path / "inner.toml").write_text("".join(f'[[rule]]\nid = "r{n}"\ncheck = "gap"\n' for n in range(3000)))
    rules = ruled(tmp_path, *['check = "baseline"\nfile = "inner.toml"'] * 5)
    told = refused(tmp_path, "--dry-run", rules)
    assert "10000 rules at most in all files" in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize(("test", "told"), [
    ('step = "1ms"\nseries = { "var.a" = "0*600000", "var.b" = "0*600000" }', "more than 1000000 steps"),
    ('step = "366d"\nseries = { "var.a" = "0*1000" }', "longer than 100 years"),
])  # fmt: skip
def test_tests_of_rules_have_limits(test: str, told: str, tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "always"\nexpr = "var.a == 0"')
    rules.write_text(rules.read_text() + f'[[test]]\nrule = "r0"\nexpect = "pass"\n{test}\n')
    assert told in refused(tmp_path, "--self-test", rules)


def test_numbers_of_a_series_may_be_as_large_as_they_are(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "always"\nexpr = "var.a >= 0"')
    test = 'step = "1ms"\nseries = { "var.a" = "99999999999999999999*3" }'
    rules.write_text(rules.read_text() + f'[[test]]\nrule = "r0"\nexpect = "pass"\n{test}\n')
    assert run_text("check", "--self-test", rules).returncode == 0


def test_nothing_of_a_capture_is_a_command_of_a_workflow(tmp_path: Path) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    text = b"::x::y"
    sendings: list[Sending] = [(number * 100, 8, [False, 1.0, number, text]) for number in range(40)]
    rule = 'check = "enum"\nvariable = "valve.sText"\nvalues = ["a"]\ndescription = "::stop-commands::x ##[error]y"'
    capture, rules = captured(tmp_path, sendings), ruled(tmp_path, rule)
    done = run_text("check", capture, "--rules", rules, "--github", *options, environment={"COLUMNS": "40"})
    lines = [line.strip() for line in done.stdout.splitlines()]
    assert [line.split()[0] for line in lines if line.startswith("::")] == ["::error"]
    assert any(line.startswith(": :stop-commands") for line in lines)
    assert not any("##[" in line for line in lines if not line.startswith("::"))
    wrong = ruled(tmp_path, 'check = "always"\nexpr = "::error::x &"')
    done = run_text("check", capture, "--rules", wrong, *options, environment={"GITHUB_ACTIONS": "true"})
    assert done.returncode == 2
    assert not any(line.strip().startswith("::") for line in done.stderr.splitlines())


@pytest.mark.parametrize("name", ["²", "007", "١٢", "*", "a b  c", '"', "7", "udp/1202/8"])
def test_lists_are_learnt_by_whatever_they_are_called(name: str, tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, index, [0]) for number in range(40) for index in (7, 8)])
    safety, other = definitions(tmp_path)
    odd = (
        safety.rename(tmp_path / "odd" / f"{name.replace('/', '-')}.gvl")
        if (tmp_path / "odd").mkdir() is None
        else safety
    )
    options = ["--gvl", odd, "--gvl", other]
    done = run_text("baseline", capture, *options, "-w", "x.rules.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(run_text("check", capture, *options, "--rules", "x.rules.toml", "--json", cwd=tmp_path).stdout)
    assert {one["verdict"] for one in found["rules"]} == {"pass"}
    cycles = [one for one in found["rules"] if one["check"] == "cycle"]
    assert sorted(subject["list"] for one in cycles for subject in one["subjects"]) == ["udp/1202/7", "udp/1202/8"]


def test_of_many_lists_the_first_are_learnt(tmp_path: Path) -> None:
    packets = []
    for number in range(2200):
        payload = telegram(list_id=number % 1100, counter=number // 1100 + 1, data=b"\0\0")
        one = data_frame(1_700_000_000 * 10**9 + number * 10**6, "10.0.0.1", "10.0.0.255", payload)
        packets.append(Packet(one.data, one.original, one.ts_ns, one.link))
    write(tmp_path / "x.pcap", packets)
    done = run_text("baseline", "x.pcap", "-w", "x.rules.toml", cwd=tmp_path)
    assert (done.returncode, "100 lists behind the first" in done.stderr) == (0, True)
    assert tomllib.loads((tmp_path / "x.rules.toml").read_text())["rule"]
    assert run_text("check", "x.pcap", "x.rules.toml", cwd=tmp_path).returncode in (0, 3)


def test_a_warm_up_is_no_time_to_learn_in(tmp_path: Path) -> None:
    capture = capture_of("plant-clean", tmp_path)
    for warmup in ("2.8s", "20h"):
        words = ["baseline", capture, "--warmup", warmup, "--to-time", "3s", "-w", "x.rules.toml", "--force"]
        done = run_text(*words, cwd=tmp_path)
        if done.returncode == 0:
            done = run_text("check", capture, "--to-time", "3s", "--rules", "x.rules.toml", cwd=tmp_path)
        assert done.returncode == (2 if warmup == "20h" else 0), done.stdout


def test_evidence_is_kept_of_some_rules(tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, 7, []) for number in range(10)])
    rules = ruled(tmp_path, *['check = "absent"\nlist = 7'] * 210)
    done = run_text("check", capture, "--rules", rules, "--evidence", tmp_path / "e")
    assert (done.returncode, "the first 200 of 210" in done.stderr) == (1, True)
    assert len(list((tmp_path / "e").iterdir())) == 200


@pytest.mark.parametrize("option", ["--junit", "--sarif", "--evidence"])
def test_a_name_that_is_empty_is_told(option: str, tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, 7, []) for number in range(10)])
    done = run_text("check", capture, "--rules", ruled(tmp_path, 'check = "gap"'), option, "")
    assert done.returncode == 2


def test_a_rule_file_whose_name_is_no_text_is_told(tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, 7, []) for number in range(10)])
    odd = tmp_path / "bad\udcff.rules.toml"
    ruled(tmp_path, 'check = "absent"\nlist = 7').rename(odd)
    done = run_text("check", capture, odd.name, "--sarif", "x.sarif", cwd=tmp_path)
    assert done.returncode == 1
    (result,) = json.loads((tmp_path / "x.sarif").read_text())["runs"][0]["results"]
    assert result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "bad%FF.rules.toml"
