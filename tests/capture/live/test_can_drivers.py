"""Drivers of python-can that fail, hang, and tell wrong times, as foreign ones do."""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterator
from typing import Any

import can
import pytest
from can.interfaces import BACKENDS

from dissectors.can.error import error_details
from dissectors.can.frame import CanBatch
from nvscope.capture.live import queue
from nvscope.capture.live.can import bus as can_bus
from nvscope.capture.live.can.bus_clock import BusClock
from nvscope.capture.live.can.drivers import DRIVERS, Clock, remark_on
from nvscope.capture.source import SourceInfo
from nvscope.errors import CaptureError
from tests.capture.live.buses import SCRIPTS, SECOND_NS, forever, frames_of, message, opened


def played(script: Any, count: int, options: str = "", seconds: float = 10) -> tuple[list[CanBatch], SourceInfo]:
    """Return the frames of a driver that plays a script, as many as are waited for, and what is known of the source."""
    SCRIPTS["a"] = script
    source = opened(f"can:playing:a{options}", seconds=seconds)
    heard = frames_of(source, lambda heard: sum(map(len, heard)) >= count)
    return heard, source.infos[0]


def test_states_that_a_driver_tells_are_error_frames() -> None:
    def script(bus: can.BusABC) -> Iterator[Any]:
        for state in ("ACTIVE", "PASSIVE", "PASSIVE", "ERROR", "ACTIVE"):
            bus.state = can.BusState[state]
            for _ in range(25):
                yield None

    heard, _ = played(script, 3)
    told = [error_details(frames) for frames in heard]
    assert [one for frames in heard for one in frames.identifier.tolist()] == [4, 0x40, 4]
    assert [one for error in told for one in error.controller.tolist()] == [0x10, 0, 0x40]
    assert [one for error in told for one in error.recovered.tolist()] == [False, False, True]


def test_error_frames_of_other_drivers_tell_no_class() -> None:
    heard, _ = played([message(0x40, bytes(8), is_error_frame=True)], 1)
    assert (heard[0].error.tolist(), heard[0].identifier.tolist()) == ([True], [0])


def test_a_driver_that_was_told_to_listen_only_is_not_passive() -> None:
    def script(bus: can.BusABC) -> Iterator[Any]:
        yield from (None for _ in range(40))
        yield message()

    def passive(bus: can.BusABC) -> Iterator[Any]:
        bus.state = can.BusState.PASSIVE
        return script(bus)

    heard, _ = played(passive, 1)
    assert [one.error.tolist() for one in heard] == [[False]]


def test_what_cannot_be_read_is_counted_and_the_rest_is_there() -> None:
    broken = [can.CanOperationError("could not unpack"), ValueError("what?")]
    wrong = message()
    wrong.arbitration_id = 0x12345  # of more bits than a standard frame has
    heard, info = played([message(), *broken, wrong, message()], 2)
    assert sum(map(len, heard)) == 2
    assert (info.drops, dict(info.drops_by), info.failure) == (3, {"interface": 3}, "")


def test_a_driver_that_only_fails_ends_it_with_what_came() -> None:
    def script(_: can.BusABC) -> Iterator[Any]:
        yield message()
        while True:
            yield can.CanOperationError("the adapter has a fever")

    heard, info = played(script, 99)
    assert sum(map(len, heard)) == 1
    assert "the adapter has a fever" in info.failure


def test_an_adapter_that_is_unplugged_ends_it() -> None:
    heard, info = played([message(), OSError(19, "No such device")], 99)
    assert (sum(map(len, heard)), info.failure) == (1, "the interface is gone")


def test_a_driver_that_does_not_come_back_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_bus, "HANG_S", 0.5)
    monkeypatch.setattr(can_bus, "CLOSE_S", 0.2)
    monkeypatch.setattr(can_bus, "_MOST_LOOKS", 1)

    def script(_: can.BusABC) -> Iterator[Any]:
        yield message()
        forever()

    heard, info = played(script, 99)
    assert sum(map(len, heard)) == 1
    assert "has not answered" in info.failure


def test_a_driver_that_does_not_close_is_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_bus, "CLOSE_S", 0.2)
    heard, info = played([message()], 1, ",shutdown=hangs")
    assert (sum(map(len, heard)), info.failure) == (1, "")


def test_what_nobody_takes_in_time_is_dropped_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue, "MOST_PACKETS", 10)
    SCRIPTS["a"] = [message()] * 30
    source = opened("can:playing:a", seconds=1)
    time.sleep(0.3)
    assert sum(map(len, frames_of(source))) == 10
    assert dict(source.infos[0].drops_by) == {"queue": 20}


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (can.CanInterfaceNotImplementedError("no DLL"), "the driver of playing is missing: no DLL"),
        (OSError(19, "No such device"), "there is no such channel"),
        (PermissionError(13, "Permission denied"), "no permission"),
        (TypeError("unexpected keyword"), "its driver cannot be told this: unexpected keyword"),
        (can.CanInitializationError("\nnot\ntoday"), "it cannot be opened: not"),
        (SystemExit("whatever"), "it cannot be opened: whatever"),
    ],
)
def test_a_bus_that_cannot_be_opened(error: BaseException, said: str) -> None:
    SCRIPTS["a"] = [error]
    with pytest.raises(CaptureError, match=said) as raised:
        opened("can:playing:a,opening=1")
    assert raised.value.next_step


def test_a_driver_that_hangs_while_it_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_bus, "OPEN_S", 0.2)
    monkeypatch.setattr(can_bus, "CLOSE_S", 0.1)
    SCRIPTS["a"] = [None]
    with pytest.raises(CaptureError, match="has not answered"):
        opened("can:playing:a,opening=1")


def test_near_names_of_an_interface_that_is_none() -> None:
    with pytest.raises(CaptureError) as raised:
        opened("can:socketcn:can0")
    assert "perhaps can:socketcan:can0" in raised.value.next_step


def test_each_driver_is_told_what_it_knows() -> None:
    """The words for "listen only" are parameters of the drivers of python-can that can be loaded here."""
    looked_at = 0
    for interface, driver in DRIVERS.items():
        try:
            kind = can.interface._get_class_for_interface(interface)
        except NotImplementedError:
            continue
        parameters = inspect.signature(kind.__init__).parameters
        source = inspect.getsource(kind)
        for key in driver.options:
            assert key in parameters or f'"{key}"' in source, (interface, key)
            looked_at += 1
    assert looked_at >= 4
    assert set(DRIVERS) <= set(BACKENDS)


def test_who_does_not_only_listen_is_told() -> None:
    assert remark_on("can:slcan:/dev/ttyUSB0") == remark_on("can:virtual:a") == ""
    assert "acknowledged" in remark_on("can:slcan:/dev/ttyUSB0,listen_only=no")
    assert "acknowledged" in remark_on("can:gs_usb:0")


_NOW_NS = 1_800_000_000 * SECOND_NS


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ([1_800_000_000.25, 1_800_000_000.35], [0.25, 0.35]),  # this machine's clock
        ([77.5, 77.6, 77.8], [0.0, 0.1, 0.3]),  # a device that was plugged in: the first one came now
        ([4294.9, 0.1, 0.2], [0.0, 0.2, 0.3]),  # 32 bits of microseconds begin anew; the second one came 0.2 s later
        ([0.0, 0.0, 0.0], [0.0, 0.2, 0.3]),  # a driver that tells none
        ([float("nan"), float("inf"), -1.0], [0.0, 0.2, 0.3]),
        ([1000.0, 2000.0, 3000.0], [0.0, 0.2, 0.3]),  # milliseconds that are told as seconds
    ],
)
def test_times_of_clocks_of_all_kinds(told: list[float], expected: list[float]) -> None:
    clock = BusClock(Clock.OWN)
    arrived = [0, 200_000_000, 300_000_000]
    found = [clock.ns(one, _NOW_NS + at) for one, at in zip(told, arrived, strict=False)]
    assert [round((one - _NOW_NS) / 1e9, 6) for one in found] == expected
