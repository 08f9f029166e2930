"""Rules that captures teach: kept by what they were learnt from, and by the same plant at another time."""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from nvscope.analysis.inquiry import Inquiry
from nvscope.check.learning import Learnt, Lesson, learn
from nvscope.check.learnt_file import text
from nvscope.check.learnt_limits import percent_with_room, round_interval, share_with_room, time_with_room
from nvscope.check.rules import read_rules
from nvscope.check.run import checked
from nvscope.check.verdict import Verdict
from nvscope.definition.project import Project
from nvscope.schemas.schema_files import schema_text
from tests.check.plants import captured, definitions, judged, ruled
from tests.check.scenario_captures import capture_of
from tests.program_here import run_text
from tests.schemas.corpus import SCENARIOS as EVERY_SCENARIO
from tests.simulate.simulation import simulated


def learnt(capture: Path, folder: Path) -> Path:
    path = folder / "learnt.rules.toml"
    path.write_text(text(learn(Inquiry([str(capture)], Project())), [str(capture)], 0), encoding="utf-8")
    return path


def verdicts(capture: Path, rules: Path) -> dict[str, Verdict]:
    found = checked(Inquiry([str(capture)], Project()), read_rules([str(rules)]))
    return {one.rule.id: one.verdict for one in found.decided}


@pytest.mark.parametrize("scenario", EVERY_SCENARIO, ids=[path.stem for path in EVERY_SCENARIO])
def test_a_capture_keeps_what_it_taught(scenario: Path, tmp_path: Path) -> None:
    capture = simulated(scenario).write(tmp_path / "x.pcapng")
    rules = learnt(capture, tmp_path)
    assert Counter(verdicts(capture, rules).values()).keys() == {Verdict.PASS}
    schema = json.loads(schema_text("rules"))
    assert list(Draft202012Validator(schema).iter_errors(tomllib.loads(rules.read_text()))) == []


@pytest.mark.parametrize("name", ["plant-clean", "jitter", "on-change", "acknowledgement-missing", "can-plant-clean"])
@pytest.mark.parametrize("seed", [5, 6, 7])
def test_so_does_the_plant_at_another_time(name: str, seed: int, tmp_path: Path) -> None:
    rules = learnt(capture_of(name, tmp_path, seed=4), tmp_path)
    assert Verdict.FAIL not in verdicts(capture_of(name, tmp_path, seed=seed), rules).values()


def test_what_was_seen_is_told_with_each_rule(tmp_path: Path) -> None:
    capture = capture_of("plant-clean", tmp_path, seed=4)
    done = run_text("baseline", capture.name, "-w", "press.rules.toml", "-q", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    told = (tmp_path / "press.rules.toml").read_text()
    assert """
[[rule]]
id = "list-7-cycle"
check = "cycle"
list = 7
interval = "50ms"
tolerance = "10%"
""" in told  # fmt: skip
    assert "95 % sure" in told


def test_an_edited_file_stays(tmp_path: Path) -> None:
    capture = capture_of("plant-clean", tmp_path)
    (tmp_path / "x.rules.toml").write_text("# ours")
    done = run_text("baseline", capture.name, "-w", "x.rules.toml", cwd=tmp_path)
    assert (done.returncode, (tmp_path / "x.rules.toml").read_text()) == (2, "# ours")
    assert "exists already" in done.stderr
    assert run_text("baseline", capture.name, "-w", "x.rules.toml", "--force", cwd=tmp_path).returncode == 0
    assert "[[rule]]" in (tmp_path / "x.rules.toml").read_text()


@pytest.mark.parametrize(("words", "told"), [
    (["-w", "x.toml"], "end with .rules.toml"), ([], "-w FILE.rules.toml"), (["-w", "x.rules.toml"], "no telegram"),
])  # fmt: skip
def test_what_cannot_be_learnt_is_told(words: list[str], told: str, tmp_path: Path) -> None:
    capture = captured(tmp_path, [])
    done = run_text("baseline", capture, *words, cwd=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.pcap"]


def test_what_no_rule_can_ask_for_is_not_learnt(tmp_path: Path) -> None:
    done = run_text("baseline", capture_of("second-sender", tmp_path), "-w", "-", cwd=tmp_path)
    assert done.returncode == 0
    assert "not learnt: list 7 is sent by 192.168.1.10, 192.168.1.99" in done.stderr
    assert "# - list 7 is sent by" in done.stdout


def test_a_rule_stands_for_all_that_was_learnt(tmp_path: Path) -> None:
    good = capture_of("plant-clean", tmp_path, seed=4)
    learnt(good, tmp_path)
    rules = ruled(tmp_path, 'check = "baseline"\nfile = "learnt.rules.toml"')
    (kept,) = judged(good, rules)["rules"]
    assert (kept["verdict"], "rules of the file are kept" in kept["subjects"][0]["reason"]) == ("pass", True)
    slower = capture_of("plant-clean", tmp_path, ('interval = "50ms"', 'interval = "60ms"'), seed=5)
    (broken,) = judged(slower, rules)["rules"]
    assert broken["verdict"] == "fail"
    assert {one["reason"].partition(":")[0] for one in broken["subjects"]} == {"list-7-cycle"}


def test_mistakes_of_the_file_are_told_where_they_are(tmp_path: Path) -> None:
    (tmp_path / "learnt.rules.toml").write_text('[[rule]]\nid = "x"\ncheck = "los"\n')
    (tmp_path / "nested.rules.toml").write_text('[[rule]]\nid = "x"\ncheck = "baseline"\nfile = "x.rules.toml"\n')
    rules = ruled(tmp_path, *(f'check = "baseline"\nfile = "{name}.rules.toml"' for name in ("learnt", "nested", "no")))
    done = run_text("check", captured(tmp_path, []), "--rules", rules)
    assert done.returncode == 2
    told = [line.removeprefix("nvscope: ").partition(": ")[0] for line in done.stderr.splitlines() if "toml" in line]
    assert [one.removeprefix(f"{tmp_path}/") for one in told] == [
        "learnt.rules.toml, line 3, column 1", "nested.rules.toml, line 4, column 1", "no.rules.toml",
    ]  # fmt: skip


def test_names_of_definitions_are_texts(tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, 7, [0, number]) for number in range(40)])
    (path,) = definitions(tmp_path)[:1]
    odd = path.rename(tmp_path / 'a"b\x1b\u202e.gvl')
    done = run_text("baseline", capture, "--gvl", odd, "-w", "x.rules.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stderr
    document = tomllib.loads((tmp_path / "x.rules.toml").read_text(encoding="utf-8"))
    assert [one["list"] for one in document["rule"] if one["check"] == "cycle"] == ['a"b\x1b\u202e']
    assert run_text("check", capture, "--gvl", odd, "--rules", "x.rules.toml", cwd=tmp_path).returncode == 0


_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@given(_TEXTS, st.lists(_TEXTS, max_size=30), _TEXTS)
def test_whatever_rules_say_is_toml(name: str, lists: list[str], told: str) -> None:
    lesson = Lesson()
    lesson.add(told, [Learnt(name, "loss", {"list": lists, "max": "1%", "optional": True}, told)])
    (rule,) = tomllib.loads(text(lesson, [told], 1))["rule"]
    assert rule == {"id": name, "check": "loss", "list": lists, "max": "1%", "optional": True}


@given(st.integers(1, 10**18), st.floats(1, 10))
def test_limits_of_time_have_room_but_not_too_much(seen_ns: int, times: float) -> None:
    found = time_with_room(seen_ns, times)
    assert seen_ns * times * (1 - 1e-6) <= found <= seen_ns * times * 1.35 + 2


@given(st.floats(0, 1), st.floats(1, 4))
def test_limits_of_shares_have_room(share: float, times: float) -> None:
    found = percent_with_room(share, times)
    assert (found is None) == (100 * share * times > 100 + 1e-9)
    assert found is None or found >= 100 * share * times - 1e-6


@given(st.integers(0, 1000), st.integers(1, 10**6))
def test_what_was_lost_once_may_be_lost_again(count: int, of: int) -> None:
    count = min(count, of)
    assert count / of <= share_with_room(count, of) / 100 <= 1


@given(st.integers(1, 10**12))
def test_round_intervals_are_near(interval_ns: int) -> None:
    assert abs(round_interval(interval_ns) - interval_ns) <= interval_ns / 100
