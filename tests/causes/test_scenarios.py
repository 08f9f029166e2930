"""What is told of scenarios: one cause for each thing that was put in, and none where nothing is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from nvscope.analysis.inquiry import Inquiry
from tests.causes.told import causes_of
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "tests" / "scenarios"


class Told(NamedTuple):
    """A cause as a person reads it: what, where, and from when to when in seconds; None is not over."""

    kind: str
    where: str
    since_s: float
    until_s: float | None


def told(inquiry: Inquiry) -> list[Told]:
    summary, causes = causes_of(inquiry)
    start_ns = summary.start_ns or 0

    def seconds(time_ns: int | None) -> float | None:
        return None if time_ns is None else round((time_ns - start_ns) / 1e9, 1)

    found = []
    for cause in causes:
        nodes, lists = [summary.addresses[node] for node in cause.nodes], [str(key) for key in cause.lists]
        since_s = seconds(cause.since_ns)
        assert since_s is not None
        found.append(Told(cause.kind.name, " ".join([*nodes, *lists]), since_s, seconds(cause.until_ns)))
    return found


PRESS, LIST = "192.168.1.10", "udp/1202/7"

EXPECTED = {
    "stopped": [Told("list-stopped", f"{PRESS} {LIST}", 10.0, None)],
    "second-sender": [Told("second-sender", f"192.168.1.99 {PRESS} {LIST}", 10.0, None)],
    "restart": [Told("node-restart", f"{PRESS} {LIST}", 9.9, 12.0)],
    "restart-quick": [Told("node-restart", f"{PRESS} {LIST}", 10.0, 10.0)],
    "acknowledgement-silent": [Told("acknowledgement-impossible", f"192.168.1.20 {LIST}", 0.0, None)],
    "acknowledgement-negative": [Told("reader-rejects", f"192.168.1.20 {LIST}", 8.0, 9.0)],
    "boot-up": [Told("boot-up-unanswered", f"192.168.1.20 {LIST}", 31.0, 32.0)],
    "unreachable": [
        Told("reader-without-program", f"{PRESS} {LIST}", 2.0, None),
        Told("reader-without-program", f"192.168.1.20 {LIST}", 4.9, 5.0),
    ],
    "counter-byte-swapped": [Told("counter-foreign", f"{PRESS} {LIST}", 0.0, None)],
    "counter-node-telegram": [Told("loss-of-list", f"{PRESS} {LIST}", 4.9, 5.0)],
    "burst": [Told("sender-bursts", f"{PRESS} {LIST}", 10.0, 10.0)],
    "late": [Told("sender-late", f"{PRESS} {LIST}", 9.9, 10.3)],
    "mirrored-twice": [Told("mirrored-twice", LIST, 0.0, None)],
    "clock-step": [Told("clock", "", 8.0, 9.9)],
    "checksum": [Told("definition-differs", f"{PRESS} {LIST}", 5.0, None)],
    "can-canopen-collision": [Told("identifier-collision", "can/can0/383", 0.0, None)],
    "can-bus-off": [Told("bus-off", "can/can0/272", 10.0, 10.3)],
    "can-error-frames": [Told("bus-errors", "", 0.0, None)],
    "can-stopped": [Told("list-stopped", "can/can0/272", 10.0, None)],
    "can-missing-pdo": [Told("incomplete-cycles", "can/can0/272", 2.5, 15.0)],
    "can-late": [Told("sender-late", "can/can0/272", 10.0, 10.3)],
}

HEALTHY = [
    "plant-clean",
    "long-string",
    "foreign-traffic",
    "can-plant-clean",
    "can-canopen",
    "can-other-frames",
]


@pytest.mark.parametrize("name", EXPECTED)
def test_what_was_put_in_is_told_once(name: str, tmp_path: Path) -> None:
    assert told(simulated(SCENARIOS / f"{name}.toml").inquiry(tmp_path)) == EXPECTED[name]


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_plant_has_no_cause(name: str, tmp_path: Path) -> None:
    assert told(simulated(SCENARIOS / f"{name}.toml").inquiry(tmp_path)) == []


def test_five_things_at_once_are_told_as_five() -> None:
    """As a person should see them: who, since when, what was checked, what to do next (screens.md)."""
    summary, causes = causes_of(Inquiry([str(ROOT / "captures" / "plant.pcapng.gz")]))
    assert [cause.title for cause in causes] == [
        "A further node sends list 7 since 25.0 s: 192.168.1.99",
        "Node 192.168.1.12 is silent since 23.9 s (list 12)",
        "List 7 of 192.168.1.10 lost 2 telegrams, at 6.9 s and 13.9 s",
        "Node 192.168.1.20 did not answer for list 3 from 10.0 s to 13.0 s",
        "Node 192.168.1.11 started anew at 17.0 s",
    ]
    second, silent, loss, reader, restart = (cause.checked for cause in causes)
    assert second[:3] == (
        "192.168.1.10: 22 items in 108 bytes, checksum 16#5A", "192.168.1.99: 21 items in 104 bytes, checksum 16#30",
        "different hardware addresses: two devices, not one address twice",
    )  # fmt: skip
    assert silent == ("nothing of it came afterwards, ARP included", "3 other nodes go on")
    assert loss[0] == "no other sender lost any then: not the capture"
    assert reader == ("it answered the 54 others, in 3.5 ms", "it sent nothing else in that time")
    assert restart == (
        "the counter of its only stream (list 9) began anew", "it asked for list 7 at 18.0 s, answered in 945.6 µs",
        "without a pause",
    )  # fmt: skip
    assert [cause.until_ns is None for cause in causes] == [True, True, False, False, False]
    explained = [finding for cause in causes for finding in cause.findings]
    assert len(explained) == len({id(finding) for finding in explained})
    assert summary.start_ns is not None
