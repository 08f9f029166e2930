"""Every check can be judged only while something is so: always is as if nothing was said, and halves make a whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.catalogue import CATALOGUE
from nvscope.check.deciding import Decided
from nvscope.check.rules import read_rules
from nvscope.check.run import checked
from nvscope.check.verdict import Verdict
from nvscope.simulate.scenario_file import load_scenario
from tests.check.plants import ruled
from tests.check.scenario_captures import SCENARIOS
from tests.laws import examples, some
from tests.simulate.simulation import Simulation

RULES = [
    'check = "cycle"\ninterval = "50ms"', 'check = "jitter"\nmax = "5ms"', 'check = "min_gap"\nmin = "40ms"',
    'check = "silence"\nmax = "300ms"', 'check = "present"\nwithin = "1s"', 'check = "absent"', 'check = "loss"',
    'check = "gap"', 'check = "duplicates"', 'check = "overtaken"', 'check = "restarts"', 'check = "malformed"',
    'check = "single_sender"', 'check = "known_nodes"\nnodes = "nobody"', 'check = "acknowledged"\nwithin = "20ms"',
    'check = "transaction"\nmax_latency = "50ms"\npercentile = 80', 'check = "transaction"\nmax_errors = 0',
    'check = "writes"\nonly_by = "10.0.0.1"', 'check = "writes"\nonly_to = "0x2000:*"',
    'check = "boot_up"', 'check = "coherence"\nskew = "5ms"', 'check = "coherence"', 'check = "definition"',
    'check = "findings"\nseverity = "note"', 'check = "causes"\nseverity = "note"', 'check = "bus_load"\nmax = "30%"',
    'check = "occurrence"\nper = "1s"\nmin = 3', 'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"',
    'check = "always"\nexpr = "list.interval_p99 > 0"\nwindow = "1s"', 'check = "never"\nexpr = "cause.kind"',
]  # fmt: skip
"""A rule of each check that is about telegrams, and not about variables."""

NAMES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
ALWAYS = 'when = "frame.number > 0"'


def decided(name: str, folder: Path, *rules: str, defaults: str = "") -> list[Decided]:
    """Return the verdicts of rules on a scenario, with its definitions."""
    inquiry = Simulation(load_scenario(SCENARIOS / f"{name}.toml")).inquiry(folder)
    return list(checked(inquiry, read_rules([str(ruled(folder, *rules, defaults=defaults))])).decided)


def test_only_what_is_about_the_whole_capture_has_no_when() -> None:
    refused = {name for name, check in CATALOGUE.items() if not (check.by_moment or check.at_times)}
    assert refused == {"baseline", "capture_quality"}


@pytest.mark.parametrize("name", some(NAMES))
def test_what_is_always_so_changes_nothing(name: str, tmp_path: Path) -> None:
    found = decided(name, tmp_path, *RULES, *(f"{rule}\n{ALWAYS}" for rule in RULES))
    for usual, always in zip(found[: len(RULES)], found[len(RULES) :], strict=True):
        assert (usual.rule.check.name, usual.verdict) == (always.rule.check.name, always.verdict)
        assert list(usual.subjects) == list(always.subjects)


@pytest.mark.parametrize("name", some(NAMES))
def test_what_is_never_so_leaves_nothing(name: str, tmp_path: Path) -> None:
    for one in decided(name, tmp_path, *(f'{rule}\nwhen = "frame.number < 1"' for rule in RULES)):
        assert one.verdict is Verdict.INCONCLUSIVE
        if not one.rule.check.needs_definitions:
            assert [subject.reason for subject in one.subjects] == ["when was never so"]


def counts(one: Decided) -> dict[Any, int]:
    """Return how often each subject of a rule broke it."""
    return {
        (subject.list, subject.node, subject.subindex, subject.partner, subject.port): subject.count
        for subject in one.subjects
    }


def cycles(one: Decided) -> int:
    """Return how many cycles a verdict is about."""
    words = [subject.reason.split() for subject in one.subjects if subject.count]
    return sum(int(reason[2]) for reason in words)


ADDED = [
    'check = "duplicates"', 'check = "restarts"', 'check = "malformed"', 'check = "acknowledged"',
    'check = "boot_up"', 'check = "coherence"', 'check = "absent"', 'check = "transaction"\nmax_unanswered = 0',
    'check = "writes"\nonly_by = "10.0.0.1"',
]  # fmt: skip


@given(name=st.sampled_from(NAMES), share=st.floats(0.02, 0.98))
@examples(200)
def test_halves_make_a_whole(tmp_path_factory: pytest.TempPathFactory, name: str, share: float) -> None:
    """Wherever time is cut in two: what broke a rule did so in one half or in the other."""
    folder = tmp_path_factory.mktemp("halves")
    whole = decided(name, folder, *ADDED, 'check = "absent"')
    frames = 1 + int(share * max((sum(counts(one).values()) for one in whole), default=1))
    early, late = (f'when = "frame.number {sign} {frames}"' for sign in ("<", ">="))
    halves = decided(name, folder, *(f"{rule}\n{when}" for when in (early, late) for rule in ADDED))
    for one, first, second in zip(whole, halves[: len(ADDED)], halves[len(ADDED) :], strict=False):
        told = counts(one)
        parts = {key: counts(first).get(key, 0) + counts(second).get(key, 0) for key in told}
        assert parts == told, one.rule.check.name


@pytest.mark.parametrize(
    ("name", "rule", "kept", "broken"),
    [
        ("second-sender", 'check = "single_sender"', "frame.number < 195", "frame.number > 300"),
        ("second-sender", 'check = "known_nodes"\nnodes = "192.168.1.10"', "frame.number < 195", "frame.number > 300"),
        ("second-sender", 'check = "causes"\nlist = 7', "frame.number < 195", "frame.number > 300"),
        ("second-sender", 'check = "findings"\nlist = 7', "frame.number < 195", "frame.number < 205"),
        ("second-sender", 'check = "never"\nexpr = "cause.kind"', "frame.number < 195", "frame.number > 300"),
        (
            "can-burst",
            'check = "bus_load"\nmax = "4%"\nwindow = "100ms"',
            "frame.number < 550",
            "frame.number > 550",
        ),
        ("can-missing-pdo", 'check = "coherence"\nmax = "0.2%"', "frame.number < 140", "frame.number >= 140"),
        ("acknowledgement-missing", 'check = "acknowledged"', "frame.number < 190", "frame.number < 210"),
        ("boot-up", 'check = "boot_up"', "frame.number < 20", "frame.number >= 20"),
        ("parameter-manager", 'check = "transaction"\nmax_unanswered = 0', "frame.number < 50", "frame.number > 50"),
        ("parameter-writes", 'check = "writes"\nonly_by = "*.20"', "frame.number < 71", "frame.number >= 71"),
        ("shape-change", 'check = "findings"\nseverity = "note"', "frame.number < 95", "frame.number < 105"),
    ],
)
def test_what_happened_at_other_times_breaks_nothing(
    name: str, rule: str, kept: str, broken: str, tmp_path: Path
) -> None:
    (usual,) = decided(name, tmp_path, rule)
    assert usual.verdict is Verdict.FAIL
    for when, verdict in ((kept, Verdict.PASS), (broken, Verdict.FAIL)):
        (one,) = decided(name, tmp_path, f'{rule}\nwhen = "{when}"')
        assert one.verdict is verdict, (when, one.subjects)


def test_a_finding_that_goes_on_for_longer_than_its_frames_are_kept_is_not_decided(tmp_path: Path) -> None:
    """Of 200 lost checksums, the first ten are known one by one: whether one is among the last frames, nobody knows."""
    rule = 'check = "findings"\nlist = 7\nallow = ["NV401", "NV402"]\nwhen = "frame.number > 590"'
    (one,) = decided("second-sender", tmp_path, rule)
    assert one.verdict is Verdict.INCONCLUSIVE
    assert "nobody knows" in one.subjects[0].reason


@pytest.mark.parametrize(
    "rule",
    [
        'check = "loss"',
        'check = "gap"',
        'check = "duplicates"',
        'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"',
    ],
)
def test_a_counter_that_never_moves_tells_nothing(rule: str, tmp_path: Path) -> None:
    (one,) = decided("counter-constant", tmp_path, rule)
    assert one.verdict is Verdict.INCONCLUSIVE
