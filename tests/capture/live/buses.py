"""Buses of python-can for tests: its virtual ones, and those of a driver that does what foreign ones do."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import can
from can.interfaces import BACKENDS

from dissectors.can.frame import CanBatch, dissect_can
from nvscope.capture.live.live_source import Autostop
from nvscope.capture.live.open import LiveSettings, open_live
from nvscope.capture.source import Source

SCRIPTS: dict[str, Any] = {}
"""By channel, a generator of messages, of None where nothing comes in time, and of errors, which are raised."""

SECOND_NS = 1_000_000_000


def forever() -> None:
    """Do not come back."""
    threading.Event().wait()


class PlayingBus(can.BusABC):
    """Plays the script of its channel; sending is a mistake of whoever does it."""

    def __init__(self, channel: Any, **options: Any) -> None:
        super().__init__(channel)
        self.options = options
        self._state = can.BusState.ACTIVE
        script = SCRIPTS[channel]
        self._steps: Iterator[Any] = script(self) if callable(script) else iter(script)
        if "opening" in options:
            step = next(self._steps)
            if isinstance(step, BaseException):
                raise step
            forever()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        step = next(self._steps, None)
        if isinstance(step, BaseException):
            raise step
        if step is None:
            time.sleep(min(timeout or 0, 0.01))
        return step, True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise AssertionError("something was sent")

    @property
    def state(self) -> can.BusState:
        return self._state

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        self._state = new_state

    def shutdown(self) -> None:
        super().shutdown()
        if self.options.get("shutdown") == "hangs":
            forever()


BACKENDS["playing"] = (__name__, PlayingBus.__name__)


def message(identifier: int = 0x110, data: bytes = b"\1\2\3\4\5\6\7\x08", **more: Any) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=more.pop("extended", False), **more)


def frames_of(source: Source, until: Callable[[list[CanBatch]], bool] = lambda heard: False) -> list[CanBatch]:
    """Return the CAN frames of a source, which is stopped when they are what is waited for."""
    heard: list[CanBatch] = []
    for batch in source:
        if len(batch):
            heard.append(dissect_can(batch))
        if until(heard):
            source.stop()
    return heard


def opened(*words: str, seconds: float = 10, **settings: Any) -> Source:
    return open_live(words, LiveSettings(autostop=Autostop(duration_ns=int(seconds * SECOND_NS)), **settings))


@contextmanager
def sender(channel: str) -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=channel) as bus:
        yield bus
