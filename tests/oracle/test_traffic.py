"""Random traffic: the same for a seed, and with every fault in it."""

from __future__ import annotations

from collections import Counter

from tests.oracle.builders import LINKS
from tests.oracle.reference import reference_report
from tests.oracle.rules.findings import SEVERITIES
from tests.oracle.traffic import generate, mutate


def test_a_seed_gives_the_same_frames() -> None:
    assert generate(5, 100) == generate(5, 100)
    assert generate(5, 100) != generate(6, 100)
    assert mutate(1, generate(5, 100)) == mutate(1, generate(5, 100))


def test_traffic_shows_every_fault() -> None:
    codes: Counter[str] = Counter()
    counters: Counter[str] = Counter()
    seen_scopes: set[str] = set()
    clean = 0
    for seed in range(48):
        frames = generate(seed, 300, (None, *LINKS, 1, 1, 1)[seed % 12])
        if seed % 4 == 3:
            frames = mutate(seed, frames)
        report = reference_report(frames)
        assert report["capture"]["frames"] == len(frames)
        codes.update(finding["code"] for finding in report["findings"])
        clean += not any(finding["severity"] == "error" for finding in report["findings"])
        for entry in report["lists"]:
            counters.update(name for name, value in entry["counters"].items() if value and name[0] != "_")
            seen_scopes |= {stream["counter_scope"] for stream in entry["streams"]}
    assert set(codes) == set(SEVERITIES)
    assert len(counters) == 15
    assert seen_scopes == {"stream", "node-telegram", "node-send", "unused"}
    assert clean
