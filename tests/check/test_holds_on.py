"""Values hold on: behind a warm-up, and where nobody knows them nothing is decided."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.check.plants import Sending, captured, definitions, judged, of_plant, ruled
from tests.program_here import run_text

OTHERS: list[Sending] = [(at_ms, 8, [False]) for at_ms in range(0, 5_000, 50)]


def one_of(folder: Path, sendings: list[Sending], rule: str, warmup: str = "0s") -> dict[str, Any]:
    """Return what is told of one rule behind a warm-up."""
    options = [text for path in definitions(folder) for text in ("--gvl", path)]
    path = ruled(folder, rule, defaults=f'warmup = "{warmup}"')
    (one,) = judged(captured(folder, sendings), path, *options)["rules"]
    return {"verdict": one["verdict"], **one["subjects"][0]}


MODE_9 = [(500, 7, [False, 9]), (1_450, 7, [False, 1]), (4_000, 7, [False, 1])]


@pytest.mark.parametrize(
    ("rule", "verdict", "worst"),
    [
        ('check = "never"\nexpr = "var.safety.nMode > 5"', "fail", 0.45),
        ('check = "never"\nexpr = "var.safety.nMode > 5"\nfor = "500ms"', "pass", 0.45),
        ('check = "always"\nexpr = "var.safety.nMode < 5"\nfor = "200ms"', "fail", 0.45),
        ('check = "eventually"\nexpr = "var.safety.nMode > 5"\nwithin = "1ms"', "pass", 0),
        ('check = "never"\nexpr = "changed(var.safety.nMode) && var.safety.nMode > 5"', "pass", 0),
        ('check = "never"\nexpr = "var.safety.nMode > 5"\nwhen = "var.safety.bStop"', "inconclusive", None),
        ('check = "never"\nexpr = "var.safety.nMode > 5"\nwhen = "!var.safety.bStop"', "fail", 0.45),
    ],
)
@pytest.mark.parametrize("others", [OTHERS, OTHERS[:1]])
def test_what_holds_at_the_end_of_a_warm_up_is_judged(
    rule: str, verdict: str, worst: float | None, others: list[Sending], tmp_path: Path
) -> None:
    found = one_of(tmp_path, [*MODE_9, *others], rule, "1s")
    assert (found["verdict"], found.get("worst")) == (verdict, None if worst is None else pytest.approx(worst))


def test_what_holds_to_the_end_is_judged_though_it_is_never_sent_again(tmp_path: Path) -> None:
    sendings = [(500, 7, [False, 9]), *OTHERS]
    for rule, verdict, worst in (
        ('check = "never"\nexpr = "var.safety.nMode > 5"', "fail", 3.95),
        ('check = "never"\nexpr = "var.safety.nMode < 5"', "pass", 0),
        ('check = "eventually"\nexpr = "var.safety.nMode > 5"', "pass", 0),
        ('check = "eventually"\nexpr = "var.safety.nMode < 5"', "fail", None),
    ):
        found = one_of(tmp_path, sendings, rule, "1s")
        assert (found["verdict"], found["worst"]) == (verdict, worst), rule


def test_variables_that_differ_at_the_end_of_a_warm_up_do_so_behind_it(tmp_path: Path) -> None:
    """Mode is 9 from 0.5 s on, and the position follows at 1.45 s; then it stays behind from 3 s on."""
    follows = [(at_ms, 8, [False, float(value)]) for at_ms, value in ((0, 1), (1_450, 9), (4_900, 9))]
    modes = [(at_ms, 7, [False, value]) for at_ms, value in ((0, 1), (500, 9))]
    rule = 'check = "hops"\nfrom = "safety.nMode"\nto = "valve.fPos"\nmax_delay = "100ms"'
    for warmup, worst in (("0s", 0.95), ("1s", 0.45)):
        found = one_of(tmp_path, [*modes, *follows], rule, warmup)
        assert (found["verdict"], found["worst"]) == ("fail", pytest.approx(worst))
    assert one_of(tmp_path, [*modes, *follows], rule, "2s")["verdict"] == "inconclusive"
    never = one_of(tmp_path, [*modes, *follows[:1], (4_900, 7, [False, 9])], rule, "1s")
    assert (never["verdict"], never["worst"]) == ("fail", pytest.approx(3.9))


def test_without_a_warm_up_nothing_held_before(tmp_path: Path) -> None:
    assert one_of(tmp_path, [*MODE_9, *OTHERS], 'check = "never"\nexpr = "var.safety.nMode > 5"')["worst"] == 0.95


@pytest.mark.parametrize(
    "rule",
    [
        'check = "occurrence"\nexpr = "var.safety.nMode > 5"\nper = "1s"\nmax = 0',
        'check = "occurrence"\nexpr = "var.safety.nMode > 5"\nper = "1s"\nmin = 1',
        'check = "occurrence"\nexpr = "can.id == 5"\nper = "1s"\nmax = 0',
    ],
)
def test_of_what_nobody_knows_no_number_is_decided(rule: str, tmp_path: Path) -> None:
    assert of_plant(tmp_path, OTHERS, rule)[0] == "inconclusive"


@pytest.mark.parametrize("behind", [0, 250])
def test_windows_begin_anew_behind_a_warm_up(behind: int, tmp_path: Path) -> None:
    """When is so up to 3 s, and again from 3.5 s on: the windows of later times are not those of earlier ones."""
    modes = [(at_ms, 7, [False, 3 if 3_000 <= at_ms < 3_500 or at_ms >= 4_000 else 1]) for at_ms in range(0, 5_000, 25)]
    rule = 'check = "occurrence"\nlist = 8\nper = "200ms"\nmin = 4\nwhen = "var.safety.nMode == 1"'
    for warmup in ("0s", f"{1_000 + behind}ms"):
        found = one_of(tmp_path, [*modes, *OTHERS], rule, warmup)
        assert (found["verdict"], found["worst"], found["count"]) == ("pass", 4, 0)
    most = one_of(tmp_path, [*modes, *OTHERS], rule.replace("min = 4", "max = 3"), f"{1_000 + behind}ms")
    whole = (2_000 - behind) // 200 + 500 // 200
    assert (most["verdict"], most["reason"]) == ("fail", f"{whole} of {whole} windows")


@pytest.mark.parametrize("expression", ["x >= last(x)", "x != last(x)", "!(x < last(x))"])
def test_where_there_was_no_value_before_nothing_is_compared(expression: str, tmp_path: Path) -> None:
    rising = [(at_ms, 7, [False, at_ms // 50]) for at_ms in range(0, 2_000, 50)]
    rule = f'check = "always"\nexpr = "{expression.replace("x", "var.safety.nMode")}"'
    assert of_plant(tmp_path, rising, rule)[0] == "pass"
    falls = [*rising, (2_000, 7, [False, 3]), (2_050, 7, [False, 3])]
    assert of_plant(tmp_path, falls, rule)[0] == "fail"
    first = of_plant(tmp_path, rising[:1], rule)
    assert first[0] == "inconclusive"


@pytest.mark.parametrize(
    ("rule", "longer"),
    [
        ('check = "silence"\nlist = 8\nmax = "{}"', "1900ms"),
        ('check = "frozen"\nvariable = "valve.nCount"\nmax = "{}"', "1900ms"),
        ('check = "never"\nexpr = "var.valve.nCount == 60000"\nfor = "{}"', "1900ms"),
    ],
)
def test_what_could_not_be_broken_is_not_kept(rule: str, longer: str, tmp_path: Path) -> None:
    """When is so for 2 s at a time: nothing lasts 3 s meanwhile."""
    modes = [(at_ms, 7, [False, 1 if at_ms % 4_000 < 2_000 else 2]) for at_ms in range(0, 12_000, 50)]
    valve = [(at_ms, 8, [False, 0.0, at_ms // 50]) for at_ms in range(0, 12_000, 50)]
    when = '\nwhen = "var.safety.nMode == 1"'
    assert of_plant(tmp_path, [*modes, *valve], rule.format(longer) + when)[0] == "pass"
    verdict, subject = of_plant(tmp_path, [*modes, *valve], rule.format("3s") + when)
    assert (verdict, subject["reason"]) == ("inconclusive", "when was so for a shorter time than the rule needs")
    assert of_plant(tmp_path, [*modes, *valve], rule.format("3s"))[0] == "pass"


@pytest.mark.parametrize("check", ["findings", "causes"])
def test_a_node_that_nobody_is_keeps_no_rule(check: str, tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text('[nodes]\n"10.0.0.7" = { name = "press" }\n')
    capture = captured(tmp_path, [*MODE_9, *OTHERS])

    def told(node: str, *options: Any) -> Any:
        rules = ruled(tmp_path, f'check = "{check}"\nnode = "{node}"\nseverity = "error"')
        return run_text("check", capture, "--rules", rules, "--json", *options)

    for node, verdict in (("10.0.0.7", "pass"), ("10.0.0.70", "inconclusive"), ("10.0.0.300", "inconclusive")):
        assert json.loads(told(node).stdout)["verdict"] == verdict
    project = ("--project", tmp_path / "nvscope.toml")
    assert json.loads(told("press", *project).stdout)["verdict"] == "pass"
    assert json.loads(told("10.0.0.70", *project).stdout)["verdict"] == "inconclusive"


def test_a_name_that_no_node_has_is_a_mistake_where_definitions_are_given(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text('definitions = ["*.gvl"]\n[nodes]\n"10.0.0.7" = { name = "press" }\n')
    definitions(tmp_path)
    capture = captured(tmp_path, [*MODE_9, *OTHERS])
    rules = ruled(tmp_path, 'check = "findings"\nnode = "presss"')
    done = run_text("check", capture, "--rules", rules, "--project", tmp_path / "nvscope.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert "rule[0].node: no node is called 'presss', neither by the project nor in the capture" in done.stderr
    assert "The nearest known one is 'press'" in done.stderr
