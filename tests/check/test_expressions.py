"""Rules with expressions: what follows, always holds, never happens, happens once, happens so often."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.check.plants import Sending, of_plant

Series = list[tuple[int, bool, int, bool]]


def plant(stop_at: int | None, closed_at: int | None, *, mode: int = 3, until: int = 6000) -> list[Sending]:
    """Send both lists every 100 ms: from a time on the stop, and from another one that the valve is closed."""
    found: list[Sending] = []
    for at in range(0, until, 100):
        found.append((at, 7, [stop_at is not None and at >= stop_at, mode]))
        found.append((at + 50, 8, [closed_at is not None and at + 50 >= closed_at, at / 10]))
    return found


IMPLIES = 'check = "implies"\nif = "rose(var.safety.bStop)"\nthen = "var.valve.bClosed"\nwithin = "200ms"'


@pytest.mark.parametrize(
    ("stop", "closed", "rule", "verdict", "worst", "reason"),
    [
        (2000, 2150, IMPLIES, "pass", 0.15, ""),
        (2000, 2250, IMPLIES, "fail", 0.25, "1 of 1 time"),
        (2000, None, IMPLIES, "fail", 3.95, "1 of 1 time"),
        # It held before, so nothing is waited for.
        (2000, 1000, IMPLIES, "pass", 0.0, ""),
        (None, None, IMPLIES, "inconclusive", None, "if never became true"),
        # A state counts when it begins, and not where nobody knows when it did.
        (2000, 2150, IMPLIES.replace("rose(var.safety.bStop)", "var.safety.bStop"), "pass", 0.15, ""),
        (0, None, IMPLIES.replace("rose(var.safety.bStop)", "var.safety.bStop"), "inconclusive", None, "if never"),
        (2000, None, f'{IMPLIES}\nwhen = "var.nMode == 3"', "fail", 3.95, ""),
        (2000, None, f'{IMPLIES}\nwhen = "var.nMode == 4"', "inconclusive", None, "if never became true"),
        (2000, None, f'{IMPLIES}\nwhen = "var.nMode == 4"\noptional = true', "pass", None, "if never became true"),
        # The last telegrams come at 5.9 s: nobody knows what would have come.
        (5900, None, IMPLIES, "inconclusive", None, "the capture is shorter than the rule needs"),
    ],
)
def test_what_has_to_follow(
    stop: int | None, closed: int | None, rule: str, verdict: str, worst: float | None, reason: str, tmp_path: Path
) -> None:
    told, subject = of_plant(tmp_path, plant(stop, closed), rule)
    assert (told, subject["worst"]) == (verdict, pytest.approx(worst) if worst is not None else None)
    assert subject["reason"].startswith(reason)
    if verdict == "fail":
        # Frame 41 brings the stop at 2 s: two telegrams each 100 ms.
        assert (subject["frames"], subject["count"]) == ([41], 1)


def test_what_has_to_follow_does_not_where_nobody_knows(tmp_path: Path) -> None:
    only = [one for one in plant(2000, None) if one[1] == 7]
    told, subject = of_plant(tmp_path, only, IMPLIES)
    assert (told, subject["reason"]) == ("inconclusive", "nobody knows whether then was so: what it names never came")


@pytest.mark.parametrize(
    ("rule", "verdict", "worst", "frames"),
    [
        ('check = "always"\nexpr = "!var.bStop"', "fail", 1.0, [41]),
        ('check = "always"\nexpr = "!var.bStop"\nfor = "1s"', "pass", 1.0, []),
        ('check = "always"\nexpr = "!var.bStop"\nfor = "900ms"', "fail", 1.0, [41]),
        ('check = "never"\nexpr = "var.bStop"\nfor = "900ms"', "fail", 1.0, [41]),
        ('check = "never"\nexpr = "var.bStop && var.bClosed"', "fail", 0.45, [52]),
        ('check = "never"\nexpr = "var.bStop && var.bClosed"\nwhen = "var.nMode == 4"', "inconclusive", None, []),
        ('check = "always"\nexpr = "var.nMode == 3"', "pass", 0.0, []),
        ('check = "always"\nexpr = "nv.items == 2"\nlist = "safety"', "pass", 0.0, []),
        ('check = "always"\nexpr = "nv.items == 2"', "fail", 0.05, [2, 4, 6, 8, 10, 12, 14, 16, 18, 20]),
        ('check = "never"\nexpr = "held(var.bStop, 800ms)"', "fail", 0.2, [57]),
        ('check = "never"\nexpr = "cause.kind == \\"second-sender\\""', "pass", 0, []),
        ('check = "eventually"\nexpr = "var.bStop"', "pass", 2.0, [41]),
        ('check = "eventually"\nexpr = "var.bStop"\nwithin = "1.5s"', "fail", 2.0, [41]),
        ('check = "eventually"\nexpr = "var.nMode == 4"', "fail", None, []),
        ('check = "eventually"\nexpr = "var.nMode == 4"\nwithin = "1min"', "inconclusive", None, []),
    ],
)
def test_what_has_to_hold(rule: str, verdict: str, worst: float | None, frames: list[int], tmp_path: Path) -> None:
    """The stop is on from 2 s to 3 s, the valve closes at 2.5 s."""
    sendings: list[Sending] = []
    for at in range(0, 6000, 100):
        sendings.append((at, 7, [2000 <= at < 3000, 3]))
        sendings.append((at + 50, 8, [at + 50 >= 2500]))
    told, subject = of_plant(tmp_path, sendings, rule)
    assert (told, subject["frames"]) == (verdict, frames), subject
    assert subject["worst"] == (None if worst is None else pytest.approx(worst))


SEQUENCE = 'check = "sequence"\nsteps = ["rose(var.bStop)", "rose(var.bClosed)", "var.fPos > 100"]\nwithin = "2s"'


@pytest.mark.parametrize(
    ("closed", "moved", "verdict", "worst", "reason"),
    [
        (2050, 3050, "pass", 1.05, ""),
        (2050, 4150, "fail", 2.15, "step 3 did not come in time, 1 of 1 run"),
        (2050, None, "fail", 3.95, "step 3 did not come in time, 1 of 1 run"),
        (3050, 2550, "fail", None, "step 3 came before step 2, 1 of 1 run"),
    ],
)
def test_steps_follow_each_other(
    closed: int, moved: int | None, verdict: str, worst: float | None, reason: str, tmp_path: Path
) -> None:
    sendings: list[Sending] = []
    for at in range(0, 6000, 100):
        sendings.append((at, 7, [at >= 2000, 3]))
        now = at + 50
        sendings.append((now, 8, [now >= closed, 200.0 if moved is not None and now >= moved else 0.0]))
    told, subject = of_plant(tmp_path, sendings, SEQUENCE)
    assert (told, subject["worst"], subject["reason"]) == (verdict, pytest.approx(worst), reason)


@pytest.mark.parametrize(
    ("rule", "verdict", "worst", "limit"),
    [
        ('check = "occurrence"\nlist = "safety"\nper = "1s"\nmin = 10\nmax = 10', "pass", 10, 10),
        ('check = "occurrence"\nlist = "safety"\nper = "1s"\nmin = 11', "fail", 10, 11),
        ('check = "occurrence"\nlist = "safety"\nper = "1s"\nmax = 9', "fail", 10, 9),
        ('check = "occurrence"\nexpr = "var.bStop"\nper = "5s"\nmax = 1', "pass", 1, 1),
        ('check = "occurrence"\nexpr = "var.bStop"\nper = "5s"\nmin = 2', "fail", 1, 2),
        ('check = "occurrence"\nexpr = "changed(var.fPos)"\nper = "1s"\nmin = 9', "pass", 9, 9),
        ('check = "occurrence"\nlist = "safety"\nper = "7s"\nmax = 9', "inconclusive", None, None),
    ],
)
def test_how_often_something_happens(
    rule: str, verdict: str, worst: int | None, limit: int | None, tmp_path: Path
) -> None:
    told, subject = of_plant(tmp_path, plant(2000, None), rule)
    assert (told, subject["worst"], subject["limit"]) == (verdict, worst, limit)


def test_figures_of_windows(tmp_path: Path) -> None:
    """Between 2 s and 3 s every other telegram of the valve is lost."""
    sent = [one for one in plant(None, None) if not (one[1] == 8 and 2000 <= one[0] < 3000)]
    rule = 'check = "never"\nexpr = "list.rate < 5"\nwindow = "1s"'
    told, subject = of_plant(tmp_path, sent, rule + '\nlist = "valve"')
    assert (told, subject["list"], subject["worst"], subject["count"]) == ("fail", "udp/1202/8", 1.0, 1)
    assert of_plant(tmp_path, sent, rule + '\nlist = "valve"\nfor = "1s"')[0] == "pass"
    assert of_plant(tmp_path, sent, rule + '\nlist = "safety"')[0] == "pass"
    assert of_plant(tmp_path, sent, 'check = "always"\nexpr = "list.lost == 0"\nwindow = "1s"')[0] == "pass"
