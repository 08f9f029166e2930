"""What a live source tells of itself: times without a cable (NV907), a clock that was set (NV902)."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from dissectors.batch import PacketBatch
from nvscope.capture.live.system_clock import SystemClock
from nvscope.capture.source import SourceInfo
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from tests.findings.test_timing import MS, START_NS, sent
from tests.packets import batch_of, tracked
from tests.records import replace

ETH0 = SourceInfo("eth0", "interface", is_live=True)
SECOND_NS = 1_000_000_000


def told(infos: Sequence[SourceInfo], intervals_ms: Sequence[float] = (50,) * 20) -> dict[str, list[Finding]]:
    """Return the findings about the capture by code; telegrams come from ``START_NS`` on."""
    found: dict[str, list[Finding]] = {}
    for finding in judge(tracked([batch_of(sent(intervals_ms))]), infos):
        if finding.code.startswith("NV9"):
            found.setdefault(finding.code, []).append(finding)
    return found


def test_an_interface_with_its_cable_is_no_finding() -> None:
    assert told([ETH0]) == {}


def test_each_interface_tells_of_its_times_without_a_cable() -> None:
    times = ((START_NS, START_NS + 2 * SECOND_NS), (START_NS + 5 * SECOND_NS, START_NS + 5_500 * MS))
    (found,) = told([replace(ETH0, without_carrier=times), replace(ETH0, path="eth1")])["NV907"]
    assert (found.count, found.first_ns, found.last_ns) == (2, START_NS, START_NS + 5_500 * MS)
    assert found.message == "eth0 had no carrier for 2.5 s, 2 times."


def test_a_cable_that_is_out_is_out_up_to_now() -> None:
    (found,) = told([replace(ETH0, without_carrier=((START_NS, None),))])["NV907"]
    assert (found.count, found.first_ns, found.last_ns) == (1, START_NS, START_NS + 1000 * MS)
    assert found.message == "eth0 had no carrier for 1.0 s, once, and it is still so."


def test_a_cable_that_was_never_in_is_told_before_any_frame() -> None:
    (found,) = told([replace(ETH0, without_carrier=((START_NS, None),))], ())["NV907"]
    assert found.first_ns == START_NS


def test_a_clock_that_was_set_forward_is_told_though_no_time_goes_back() -> None:
    (found,) = told([replace(ETH0, clock_steps=2)])["NV902"]
    assert (found.count, found.message) == (
        2, "The clock of this machine was set 2 times while it was watched; no frame's time goes back.",
    )  # fmt: skip


def test_a_clock_that_was_set_back_is_told_once() -> None:
    (found,) = told([replace(ETH0, clock_steps=1)], (50, 50, -3_600_000, 50))["NV902"]
    assert found.message.startswith("1 frame with a time more than 1 ms before that of the frame in front: by up to ")


def test_one_clock_of_several_interfaces_was_set_once() -> None:
    (found,) = told([replace(ETH0, clock_steps=1), replace(ETH0, path="eth1", clock_steps=1)])["NV902"]
    assert found.count == 1


@pytest.mark.parametrize("silent_ms", [0, 900])
def test_a_clock_that_was_set_back_makes_nobody_silent_who_goes_on_to_send(silent_ms: int) -> None:
    frames = sent((*(50,) * 40, -3_600_000, *(50,) * 40))
    ticks = [PacketBatch.nothing(frames[-1].ts_ns + silent_ms * MS)]
    found = [one for one in judge(tracked([batch_of(frames), *ticks]), [ETH0]) if one.code == "NV504"]
    assert [one.extent for one in found] == ([900 * MS] if silent_ms else [])


def test_steps_of_the_clock_are_counted_by_one_that_nobody_can_set() -> None:
    now_ns, steady_ns = [START_NS], [7 * SECOND_NS]
    clock = SystemClock(lambda: now_ns[0], lambda: steady_ns[0])
    for set_by_ns in (0, -3_600 * SECOND_NS, 0, 500_000, 3_600 * SECOND_NS):
        now_ns[0] += SECOND_NS + set_by_ns
        steady_ns[0] += SECOND_NS
        assert clock.look() == now_ns[0]
    assert clock.steps == 2
