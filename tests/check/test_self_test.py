"""The rules' own tests: series in place of captures."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.self_test import _values
from nvscope.errors import UsageError
from tests.laws import examples
from tests.program_here import run_text

RULES = """
[[rule]]
id = "stop-reaction"
check = "implies"
if = "rose(var.safety.bStop)"
then = "var.valve.bClosed"
within = "200ms"
when = "var.mode == 3"

[[rule]]
id = "pos"
check = "range"
variable = "fPos"
min = 0
max = 10

[[rule]]
id = "count"
check = "always"
expr = "var.n > 0"

[[rule]]
id = "loss"
check = "loss"
"""
STOP = 'series = { "var.safety.bStop" = "0*20 1*40", "var.valve.bClosed" = "0*43 1*17", "var.mode" = "3*60" }'


def told(tmp_path: Path, test: str) -> tuple[int, str, str]:
    rules = tmp_path / "x.rules.toml"
    rules.write_text(f'{RULES}\n[[test]]\nstep = "10ms"\n{test}\n')
    done = run_text("check", "--self-test", "--rules", rules)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("test", "wrong"),
    [
        (f'rule = "stop-reaction"\n{STOP}\nexpect = "fail"\nworst = "230ms"\nmargin = "-30ms"', ""),
        (f'rule = "stop-reaction"\n{STOP}\nexpect = "pass"', "pass was expected, and fail came: 1 of 1 time"),
        (
            f'rule = "stop-reaction"\n{STOP}\nexpect = "fail"\nworst = "240ms"',
            "as worst, 240.0 ms was expected, and 230.0 ms came",
        ),
        (f'rule = "stop-reaction"\n{STOP.replace("3*60", "2*60")}\nexpect = "inconclusive"', ""),
        ('rule = "pos"\nseries = { "axis.fPos" = "0 1 2.5 10" }\nexpect = "pass"\nmargin = 0', ""),
        ('rule = "pos"\nseries = { fPos = "1 2 - 3 12.5" }\nexpect = "fail"\nworst = 12.5', ""),
        # Of nothing but 0 and 1, and compared all the same.
        ('rule = "count"\nseries = { "var.n" = "1*3 0" }\nexpect = "fail"', ""),
    ],
)
def test_a_rule_does_what_its_test_says(test: str, wrong: str, tmp_path: Path) -> None:
    code, out, _ = told(tmp_path, test)
    assert code == bool(wrong)
    assert out.splitlines()[-1].endswith("1 test came out as expected")
    if wrong:
        assert wrong in " ".join(out.split())
        assert "line 26" in " ".join(out.split())


@pytest.mark.parametrize(
    ("test", "what"),
    [
        ('rule = "pso"\nseries = { x = "1" }\nexpect = "pass"', "no rule has the id 'pso'"),
        ('rule = "loss"\nseries = { x = "1" }\nexpect = "pass"', "'loss' is about telegrams"),
        ('rule = "count"\nseries = { x = "1" }\nexpect = "pass"', "no field is called"),
        ('rule = "pos"\nseries = { x = "1" }\nexpect = "pass"', "no variable is called 'fPos'"),
        ('rule = "pos"\nseries = { fPos = "1**3" }\nexpect = "pass"', "cannot be read from '**3' on"),
        ('rule = "pos"\nseries = { fPos = "1*9999999" }\nexpect = "pass"', "more than 1000000 steps"),
        ('rule = "pos"\nexpect = "pass"', "the key 'series' is missing"),
        ('rule = "pos"\nseries = { fPos = "1" }\nexpect = "good"', "'good' is none of the choices"),
    ],
)
def test_mistakes_in_tests_are_told_with_their_place(test: str, what: str, tmp_path: Path) -> None:
    code, out, err = told(tmp_path, test)
    assert (code, out) == (2, "")
    assert what in err
    assert f"{tmp_path / 'x.rules.toml'}, line " in err


def test_rules_without_tests_are_told(tmp_path: Path) -> None:
    rules = tmp_path / "x.rules.toml"
    rules.write_text(RULES)
    done = run_text("check", "--self-test", "--rules", rules)
    assert (done.returncode, "no rule has a test" in done.stderr) == (2, True)


@examples(100)
@given(st.lists(st.tuples(st.one_of(st.integers(-5, 5), st.booleans(), st.none()), st.integers(1, 9)), max_size=8))
def test_series_are_read_as_they_are_written(runs: list[tuple[int | bool | None, int]]) -> None:
    text = " ".join(f"{'-' if value is None else str(value).lower()}*{count}" for value, count in runs)
    assert _values("x", text, 1_000_000) == [value for value, count in runs for _ in range(count)]


@examples(200)
@given(st.text(alphabet='01*- ."x#', max_size=20))
def test_any_text_is_a_series_or_a_mistake(text: str) -> None:
    with suppress(UsageError):
        assert all(one is None or isinstance(one, int | float | str) for one in _values("x", text, 1_000_000))
