"""What differs between two captures: the rank test, chance, and each kind of difference."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.comparison import Difference, differences, rank_test
from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project import Project
from nvscope.tracker.histograms import Histogram
from tests.check.scenario_captures import capture_of
from tests.program_here import run_text
from tests.records import replace

_SAMPLES = st.lists(st.integers(0, 12), min_size=1, max_size=25)


def histogram(values: list[int]) -> Histogram:
    bucket, count = np.unique(np.array(values, dtype=np.int64), return_counts=True)
    return Histogram(bucket, count.astype(np.int64), min(values), max(values))


def by_definition(a: list[int], b: list[int]) -> float:
    """Return the statistic of Mann and Whitney from each pair of values, its variance from each group of ties."""
    u = sum((one < other) + (one == other) / 2 for one in a for other in b)
    both = a + b
    n = len(both)
    ties = sum(both.count(value) ** 3 - both.count(value) for value in set(both))
    variance = len(a) * len(b) / 12 * ((n + 1) - ties / (n * (n - 1)))
    return (u - len(a) * len(b) / 2) / math.sqrt(variance)


@given(_SAMPLES, _SAMPLES)
def test_the_rank_test_is_that_of_all_pairs(a: list[int], b: list[int]) -> None:
    if len(set(a + b)) == 1:
        assert rank_test(histogram(a), histogram(b)) == 0
        return
    assert rank_test(histogram(a), histogram(b)) == pytest.approx(by_definition(a, b))
    assert rank_test(histogram(b), histogram(a)) == pytest.approx(-by_definition(a, b))


def compared(*paths: Path) -> list[Difference]:
    a, b = (Inquiry([str(path)], Project()).analyze() for path in paths)
    return differences(a, b)


_LOSSY = '[[loss]]\nlist = "axis"\nprobability = 0.02\n'


@pytest.mark.parametrize(
    ("name", "more"),
    [("plant-clean", ""), ("plant-clean", _LOSSY), ("jitter", ""), ("on-change", ""), ("can-plant-clean", "")],
)
def test_two_captures_of_a_plant_differ_by_chance_alone(name: str, more: str, tmp_path: Path) -> None:
    paths = [capture_of(name, tmp_path, seed=seed, more=more) for seed in (3, 4)]
    assert paths[0].read_bytes() != paths[1].read_bytes()
    assert compared(*paths) == []


_CHANGES = {
    "a shorter interval": (('interval = "50ms"', 'interval = "40ms"'),),
    "more jitter": (('interval = "50ms"\njitter = "1ms"', 'interval = "50ms"\njitter = "9ms"'),),
    "no more cycles": (('mode = "on_change"', 'mode = "cyclic"'),),
    "another shape": (("bytes = [256, 88]", "bytes = [256, 92]"),),
    "a telegram less": (("bytes = [256, 88]", "bytes = [256]"),),
    "another address": (("192.168.1.10", "192.168.1.12"),),
    "another list": (("index = 9", "index = 10"),),
    "losses": (("[expect.findings]", f"{_LOSSY}[expect.findings]"),),
    "slower readers": (('delay = "3ms"', 'delay = "60ms"'),),
    "rarer events": (('interval = "400ms"', 'interval = "4s"'),),
    "another definition": (("checksum = 0x5A", "checksum = 0x5B"),),
    "a definition without checksum": (("checksum = 0x5A\n", ""),),
    "to all instead of one": (
        ('destination = "hmi"\nbytes = 40', "bytes = 40"),
        ("acknowledge = true\n", ""),
    ),
}

_TOLD = {
    "a shorter interval": {("interval", "median interval", 7, 0), ("interval", "median interval", 7, 1)},
    "more jitter": {("spread", "nine of ten intervals lie within", 7, number) for number in (0, 1)},
    "no more cycles": {("interval", "sent", 3, None)},
    "another shape": {("shape", "shape", 7, 1)},
    "a telegram less": {("shape", "SubIndex 1", 7, None)},
    "another address": {
        ("sender", "sent by", 3, None), ("sender", "sent by", 7, None), ("node", "node", None, None),
    },
    "another list": {("list", "the list", 9, None), ("list", "the list", 10, None)},
    "losses": {("figure", "lost", 7, None), ("cause", "loss-of-list", 7, None)},
    "slower readers": {("answer", "acknowledged within", 3, None)},
    "rarer events": {("rate", "sent", 3, None)},
    "another definition": {("checksum", "checksum of the definition", 7, None)},
    "a definition without checksum": {("checksum", "checksum of the definition", 7, None)},
    "to all instead of one": {("receiver", "sent to", 3, None)},
}  # fmt: skip


@pytest.mark.parametrize("change", _CHANGES)
def test_what_was_changed_is_told_and_nothing_else(change: str, tmp_path: Path) -> None:
    before = capture_of("plant-clean", tmp_path, seed=3)
    after = capture_of("plant-clean", tmp_path, *_CHANGES[change], seed=4)
    found = compared(before, after)
    assert {
        (one.kind, one.what, one.where.list and one.where.list.identifier, one.where.subindex) for one in found
    } == _TOLD[change]
    turned = {replace(one, a=one.b, b=one.a, why="") for one in compared(after, before)}
    assert turned == {replace(one, why="") for one in found}


def test_a_capture_does_not_differ_from_itself(tmp_path: Path) -> None:
    path = capture_of("plant-clean", tmp_path)
    done = run_text("diff", path.name, path.name, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"● no difference · {path.name} → {path.name}\n")


def test_what_differs_is_told_by_list(tmp_path: Path) -> None:
    a = capture_of("plant-clean", tmp_path, seed=3)
    changes = ("bytes = [256, 88]", "bytes = [256, 92, 8]"), ("index = 9", "index = 10")
    b = capture_of("plant-clean", tmp_path, *changes, ('interval = "50ms"', 'interval = "80ms"'), seed=4)
    done = run_text("diff", a.name, b.name, cwd=tmp_path)
    assert done.returncode == 1
    assert (
        done.stdout
        == """\
≠ 6 differences · plant-clean-3.pcapng → plant-clean-4.pcapng

list 7
  new: SubIndex 2
  shape (SubIndex 1): 22 items, 108 bytes → 23 items, 112 bytes
  median interval (SubIndex 0, 1): 49.9 ms → 80.0 ms   rank test: z = 21.6

list 9
  no more there

list 10
  new
"""
    )
