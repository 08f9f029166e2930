"""Several captures at once: what nobody captured in between breaks no rule."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.check.plants import BEGIN_NS, Sending, captured, definitions, judged, ruled

HOLE_MS = 300_000

RULES = (
    'check = "cycle"\nlist = [7, 8]\ninterval = "100ms"',
    'check = "jitter"\nlist = [7, 8]\nmax = "5ms"',
    'check = "silence"\nmax = "1s"',
    'check = "present"\nlist = [7, 8]\nwithin = "1s"',
    'check = "occurrence"\nper = "1s"\nmin = 8\nmax = 12',
    'check = "occurrence"\nexpr = "rose(var.safety.bStop)"\nper = "2s"\nmin = 1',
    'check = "loss"',
    'check = "gap"',
    'check = "restarts"',
    'check = "overtaken"',
    'check = "monotonic"\nvariable = "valve.nCount"\nstrict = true',
    'check = "rate_of_change"\nvariable = "valve.fPos"\nmax = 200.0',
    'check = "frozen"\nvariable = "valve.fPos"\nmax = "1s"',
    'check = "implies"\nif = "rose(var.safety.bStop)"\nthen = "var.valve.bClosed"\nwithin = "500ms"',
    'check = "sequence"\nsteps = ["var.safety.bStop", "var.valve.bClosed", "not var.safety.bStop"]\nwithin = "2s"',
    'check = "never"\nexpr = "var.safety.bStop and not var.valve.bClosed"\nfor = "500ms"',
    'check = "never"\nexpr = "held(var.safety.bStop, 1500ms)"',
    'check = "never"\nexpr = "age(var.safety.bStop) > 1s"',
    'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"',
    'check = "hops"\nfrom = "safety.nMode"\nto = "valve.nCount"\nmax_delay = "150ms"',
    'check = "causes"',
    'check = "findings"',
)  # fmt: skip


def plant(begin_ms: int, counted: int) -> list[Sending]:
    """Return 5.9 s of a plant that ends in the middle of everything: while it stops, before the valve is closed."""
    found: list[Sending] = []
    for number in range(60):
        now, stops = begin_ms + number * 100, (number % 20 >= 10 and number < 50) or number >= 58
        count = counted + number
        found.append((now, 7, [stops, count % 1000]))
        found.append((now + 40, 8, [number % 20 >= 12 and number < 56, float(number), count % 1000]))
    return found


@pytest.mark.parametrize("rule", RULES)
def test_what_nobody_captured_breaks_no_rule(rule: str, tmp_path: Path) -> None:
    files = [
        captured(tmp_path, plant(0, 1), "monday.pcap"),
        captured(tmp_path, plant(HOLE_MS, 500), "other-day.pcap"),
    ]
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    rules = ruled(tmp_path, rule)
    for paths in ((files[0],), (files[1],), files, files[::-1]):
        (one,) = judged(paths[0], rules, *options, *paths[1:])["rules"]
        assert one["verdict"] == "pass", (len(paths), one)


_SILENCE = 'check = "silence"\nlist = 7\nmax = "1s"'


def without_stop(sendings: list[Sending]) -> list[Sending]:
    """Return the same without list 7 in its last two seconds."""
    end_ms = sendings[-1][0]
    return [one for one in sendings if one[1] != 7 or one[0] < end_ms - 2000]


@pytest.mark.parametrize("stopped", [0, 1])
def test_a_silence_within_one_of_them_does(stopped: int, tmp_path: Path) -> None:
    plants = [plant(0, 1), plant(HOLE_MS, 500)]
    plants[stopped] = without_stop(plants[stopped])
    files = [captured(tmp_path, one, name) for one, name in zip(plants, ("a.pcap", "other.pcap"), strict=True)]
    (one,) = judged(files[0], ruled(tmp_path, _SILENCE), files[1])["rules"]
    (subject,) = one["subjects"]
    assert (one["verdict"], subject["worst"]) == ("fail", 2.04)
    assert subject["first_ns"] == str(BEGIN_NS + (stopped * HOLE_MS + 3900) * 10**6)


def test_where_a_capture_begins_later_nobody_knows_what_was_before(tmp_path: Path) -> None:
    files = [
        captured(tmp_path, [one for one in plant(begin, 1) if one[1] == index], name)
        for index, begin, name in ((8, 0, "first.pcap"), (7, 3000, "later.pcap"))
    ]
    rules = ruled(tmp_path, _SILENCE, 'check = "present"\nlist = 7\nwithin = "1s"')
    for one in judged(files[0], rules, files[1])["rules"]:
        (subject,) = one["subjects"]
        assert (one["verdict"], "began later" in subject["reason"]) == ("inconclusive", True)


def test_behind_the_end_of_its_capture_nobody_knows_of_a_list(tmp_path: Path) -> None:
    files = [
        captured(tmp_path, [one for one in plant(0, 1) if one[1] == index and one[0] <= end_ms], name)
        for index, end_ms, name in ((8, 9999, "long.pcap"), (7, 2000, "short.pcap"))
    ]
    (one,) = judged(files[0], ruled(tmp_path, _SILENCE), files[1])["rules"]
    assert (one["verdict"], one["subjects"][0]["worst"]) == ("pass", 0.1)
