"""Identifiers on CAN that no definition knows: what logs of vehicles and machines hold, and what of it is no fault."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from nvscope.definition.project import Project
from nvscope.findings.kind import Severity
from tests.causes.told import causes_of


class Line(NamedTuple):
    """A line of a candump log: when in µs, on which channel, and what is written for the frame."""

    us: int
    channel: str
    frame: str


def told(lines: Iterable[Line], directory: Path, *, by_time: bool = True) -> list[Cause]:
    path = directory / "bus.log"
    ordered = sorted(lines) if by_time else list(lines)
    path.write_text("".join(
        f"({1_700_000_000 + one.us // 1_000_000}.{one.us % 1_000_000:06}) {one.channel} {one.frame}\n"
        for one in ordered
    ))  # fmt: skip
    return causes_of(Inquiry([str(path)], Project()))[1]


def sent(
    identifier: int, every_ms: int, since_ms: int = 0, until_ms: int = 60_000, *, size: int = 8, channel: str = "can0"
) -> list[Line]:
    own_us = identifier % 97 * 31  # no two come at the same time
    return [
        Line(ms * 1000 + own_us, channel, f"{identifier:03X}#{number % 256:02X}{'00' * (size - 1)}")
        for number, ms in enumerate(range(since_ms, until_ms, every_ms))
    ]


def without(lines: Iterable[Line], since_ms: int, until_ms: int) -> list[Line]:
    return [one for one in lines if not since_ms <= one.us // 1000 < until_ms]


def faults(causes: Iterable[Cause]) -> list[str]:
    return [cause.kind.name for cause in causes if cause.severity > Severity.NOTE]


BUS = [*sent(0x0A0, 10), *sent(0x110, 20), *sent(0x120, 20), *sent(0x1F0, 100), *sent(0x2F0, 100)]


def test_a_bus_on_which_nobody_sent_for_a_while_is_one_note(tmp_path: Path) -> None:
    (cause,) = told(without(BUS, 20_000, 22_000), tmp_path)
    assert (cause.kind.name, cause.severity, len(cause.lists)) == ("sender-late", Severity.NOTE, 5)
    assert cause.title == "5 identifiers came late, 5 times from 19.9 s to 22.0 s"


def test_identifiers_that_are_late_at_different_moments_are_told_apart(tmp_path: Path) -> None:
    late = without(sent(0x110, 20), 20_000, 20_500) + without(sent(0x120, 20), 40_000, 40_500)
    causes = told([*sent(0x0A0, 10), *late], tmp_path)
    assert [cause.title for cause in causes] == [
        "Identifier 0x110 came late, at 20.0 s", "Identifier 0x120 came late, at 40.0 s",
    ]  # fmt: skip


def test_an_interval_that_breaks_two_rules_is_one_event(tmp_path: Path) -> None:
    # Each 25th interval is three and a half times as long: late, and jitter.
    times = [ms for start in range(0, 60_000, 550) for ms in range(start, start + 500, 20)]
    lines = [Line(ms * 1000, "can0", "110#00") for ms in times]
    (cause,) = (one for one in told(lines, tmp_path) if one.kind.name == "sender-late")
    assert cause.count == len(times) // 25 - 1
    assert f"{cause.count} times" in cause.title


@pytest.mark.parametrize(
    "lines",
    [
        pytest.param(sent(0x3E0, 1, 10_000, 10_200), id="a transfer in many frames"),
        pytest.param(sent(0x3E0, 250, 5_000, 25_000), id="a handshake that is over"),
        pytest.param(sent(0x3E0, 50, 0, 600), id="what wakes up a bus"),
    ],
)
def test_what_ends_because_it_is_done_is_no_fault(lines: list[Line], tmp_path: Path) -> None:
    causes = told([*BUS, *lines], tmp_path)
    assert faults(causes) == []


def test_what_came_steadily_from_the_beginning_on_and_ends_is_one(tmp_path: Path) -> None:
    causes = told([*BUS, *sent(0x3E0, 50, 0, 30_000), *sent(0x3E1, 100, 0, 30_000)], tmp_path)
    (cause,) = causes
    assert (cause.kind.name, cause.severity) == ("list-stopped", Severity.ERROR)
    assert cause.title == "Identifiers 0x3E0 and 0x3E1 are silent since 30.0 s"
    assert cause.checked == ("they ended together: one device?", "before that, they came for 30.0 s")


def test_identifiers_of_a_canopen_node_have_its_name(tmp_path: Path) -> None:
    node = [
        *[Line(ms * 1000, "can0", f"70F#{'05' if ms < 30_000 else '7F'}") for ms in range(0, 60_000, 500)],
        Line(30_000_700, "can0", "08F#3081000000000000"),
    ]
    causes = told([*BUS, *node, *sent(0x18F, 50, 0, 30_000), *sent(0x28F, 100, 0, 30_000)], tmp_path)
    (cause,) = (one for one in causes if one.kind.name == "list-stopped")
    assert cause.title == "CANopen node 15 sends identifiers 0x18F and 0x28F no more since 30.0 s"
    assert cause.checked[:2] == (
        "its emergency 8130 came at 30.0 s", "its heartbeat goes on: pre-operational since 30.0 s",
    )  # fmt: skip


def test_a_canopen_node_whose_heartbeat_ends_too_is_without_power_or_cable(tmp_path: Path) -> None:
    beats = [Line(ms * 1000, "can0", "70F#05") for ms in range(0, 30_000, 500)]
    causes = told([*BUS, *beats, *sent(0x18F, 50, 0, 30_000)], tmp_path)
    assert [fact for cause in causes for fact in cause.checked if "heartbeat" in fact] == [
        "its heartbeat ended with them: its power, cable or firmware"
    ]


def test_lengths_that_vary_are_no_fault_of_what_is_no_list(tmp_path: Path) -> None:
    sizes = (1, 6, 7, 2)
    parts = [Line(ms * 1000, "can0", f"300#{'A1' * sizes[ms // 250 % 4]}") for ms in range(0, 60_000, 250)]
    causes = told([*BUS, *parts], tmp_path)
    assert faults(causes) == []
    assert ["0x300" in cause.title for cause in causes] == [True]


def mixed(step_us: int) -> list[Line]:
    """Return frames of two channels, each in order, of which one is logged late by a step of every second block."""
    blocks = [
        sorted(
            Line(one.us - (step_us if number % 2 and one.channel == "can1" else 0), one.channel, one.frame)
            for one in [*sent(0x110, 20, channel="can0"), *sent(0x120, 20, 10, channel="can1")]
            if one.us // 1_000_000 == number
        )
        for number in range(60)
    ]
    return [one for block in blocks for one in sorted(block, key=lambda line: line.channel)]


def test_channels_that_are_mixed_are_no_clock_that_was_set(tmp_path: Path) -> None:
    (cause,) = told(mixed(0), tmp_path, by_time=False)
    assert (cause.kind.name, cause.severity) == ("clock", Severity.NOTE)
    assert cause.title == "Frames of several channels or directions are mixed, up to 969.5 ms out of order"


def test_a_clock_that_is_set_is_told_of_several_channels_too(tmp_path: Path) -> None:
    lines = [*sent(0x110, 20), *sent(0x120, 20, 10, channel="can1")]
    stepped = [one._replace(us=one.us - 5_000_000 * (one.us >= 30_000_000)) for one in sorted(lines)]
    assert "clock" in faults(told(stepped, tmp_path, by_time=False))


def test_a_clock_that_goes_back_again_and_again_is_told_once(tmp_path: Path) -> None:
    lines = [one._replace(us=one.us - one.us // 1_000_000 * 500_000) for one in sorted(BUS)]
    clock = [one for one in told(lines, tmp_path, by_time=False) if one.kind.name == "clock"]
    assert len(clock) == 1
    assert clock[0].title.startswith("The clock of the capture went back 59 times, by up to ")


@pytest.mark.parametrize(("errors", "severity"), [(3, Severity.NOTE), (30, Severity.WARNING)])
def test_a_handful_of_error_frames_is_a_note(errors: int, severity: Severity, tmp_path: Path) -> None:
    frames = [Line(number * 100_000 + 7, "can0", "20000008#0000040000000000") for number in range(errors)]
    (cause,) = (one for one in told([*BUS, *frames], tmp_path) if one.kind.name == "bus-errors")
    assert cause.severity is severity
    assert cause.title == f"Nodes of can0 reject frames from 0.0 s to {(errors - 1) / 10} s"


def test_a_log_without_times_was_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "screen.txt"
    path.write_text("".join(f"  can0  1{number % 10:02X}   [2]  00 0{number % 10:X}\n" for number in range(50)))
    (cause,) = causes_of(Inquiry([str(path)], Project()))[1]
    assert cause.severity is Severity.NOTE
    assert "no times were recorded" in cause.title
    assert "could not be read whole" not in cause.title


def late_once(at_ms: int, pause_ms: int) -> list[Line]:
    return [*BUS, *without(sent(0x130, 20), at_ms, at_ms + pause_ms)]


@pytest.mark.parametrize(
    ("lines", "severity"),
    [
        pytest.param(late_once(20_000, 200), Severity.WARNING, id="once"),
        pytest.param(late_once(20_000, 2_000), Severity.NOTE, id="so long that it was not wanted"),
        pytest.param(late_once(300, 200), Severity.NOTE, id="where the log begins"),
        pytest.param(
            [*BUS, *(one for one in sent(0x130, 20) if one.us // 20_000 % 25 not in (3, 4, 5))], Severity.NOTE,
            id="again and again",
        ),
        pytest.param([*BUS, *without(sent(0x130, 20, 4_000), 20_000, 20_200)], Severity.NOTE, id="of a late joiner"),
    ],
)  # fmt: skip
def test_what_kept_its_time_and_was_late_once_stands_out(lines: list[Line], severity: Severity, tmp_path: Path) -> None:
    (cause,) = (one for one in told(lines, tmp_path) if one.kind.name == "sender-late")
    assert (cause.severity, [str(key) for key in cause.lists]) == (severity, ["can/can0/304"])


def test_identifiers_that_stand_out_at_the_same_moment_name_each_other(tmp_path: Path) -> None:
    lines = [*BUS, *without([*sent(0x130, 20), *sent(0x140, 20)], 20_000, 20_200)]
    causes = told(lines, tmp_path)
    assert [cause.severity for cause in causes] == [Severity.WARNING] * 2
    assert {cause.checked[-1] for cause in causes} == {"1 other identifier came late at the same moment: one device?"}


@pytest.mark.parametrize(("phase_us", "severity"), [(41_000, Severity.ERROR), (500, Severity.NOTE)])
def test_parts_of_one_message_are_no_two_devices(phase_us: int, severity: Severity, tmp_path: Path) -> None:
    short = [one._replace(us=one.us + phase_us) for one in sent(0x3E0, 100, size=4)]
    causes = told([*BUS, *sent(0x3E0, 100), *short], tmp_path)
    (cause,) = (one for one in causes if one.kind.name == "identifier-collision")
    assert cause.severity is severity
