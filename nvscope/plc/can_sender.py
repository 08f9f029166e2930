"""Sends the CAN frames of packets on buses, when they are due."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType, TracebackType
from typing import Any, Self

import numpy as np
from msgspec import Struct, field

from dissectors.batch import PacketBatch
from dissectors.can.frame import CanBatch, Fault, dissect_can
from dissectors.can.pdo import channel_name
from nvscope.capture.live.can.library import message_of, opened_to_send, reason
from nvscope.capture.live.can.word import CanWord
from nvscope.errors import CaptureError
from nvscope.plc.pace import Pace
from nvscope.plc.permission import is_own_bus, refuse_bus
from nvscope.units import count_of

OPEN_S = 20.0
"""How long a driver may take to open a bus, or to close it."""

_SEND_S = 1.0
_UNSENDABLE = (Fault.SHORT, Fault.XL, Fault.TOO_LONG, Fault.CLASSIC_TOO_LONG, Fault.TRUNCATED)


class CanRoute(Struct, frozen=True):
    """On which bus frames go, as a ``CanWord``: what ``words`` have for the name of their channel, else ``word``.

    UsageError, before a bus is opened, where one may have other nodes on it and ``allow_network`` is not set.
    """

    word: str
    words: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    allow_network: bool = False

    def __post_init__(self) -> None:
        for word in (self.word, *self.words.values()):
            if not is_own_bus(CanWord.of(word)) and not self.allow_network:
                raise refuse_bus(word)


class CanSender:
    """Sends each frame of the batches that it is given at its time; error frames, which are never on a bus, are not.

    ``cut`` counts those that were not captured whole, or cannot be on a bus; they are not sent. ``is_stopped`` is asked
    at least ten times a second. CaptureError where a bus cannot be opened, or a frame not be sent.
    """

    def __init__(self, route: CanRoute, pace: Pace, is_stopped: Callable[[], bool] = lambda: False) -> None:
        self._route, self._pace, self._is_stopped = route, pace, is_stopped
        self._buses: dict[str, Any] = {}
        self.cut = self._errors = self._others = 0
        self._channels: dict[str, set[str]] = {}
        self.targets: dict[str, int] = {}

    def open(self) -> Self:
        """Open all buses."""
        for word in dict.fromkeys((self._route.word, *self._route.words.values())):
            self._buses[word] = _opened(word)
        return self

    def send(self, packets: PacketBatch, channels: Sequence[str] = ()) -> None:
        """Send the frames of some packets; returns when the last one is sent, or somebody stops it."""
        frames = dissect_can(packets)
        self._others += len(packets) - len(frames)
        self._errors += int(np.count_nonzero(frames.error))
        frames = frames.take(~frames.error)
        whole = ~np.isin(frames.fault, _UNSENDABLE)
        self.cut += int(np.count_nonzero(~whole))
        frames = frames.take(whole)
        words = [self._route.words.get(name, self._route.word) for name in channels]
        for place, (ts_ns, channel) in enumerate(zip(frames.ts_ns.tolist(), frames.channel.tolist(), strict=True)):
            due_ns = self._pace.due_ns(ts_ns)
            if not self._pace.wait_until(due_ns, self._is_stopped):
                return
            word = words[channel] if channel < len(words) else self._route.word
            self._channels.setdefault(word, set()).add(channel_name(channels, channel))
            self._send(word, frames, place)
            self._pace.was_sent(time.monotonic_ns() - due_ns)
            self.targets[word] = self.targets.get(word, 0) + 1

    def _send(self, word: str, frames: CanBatch, place: int) -> None:
        try:
            self._buses[word].send(message_of(frames, place), timeout=_SEND_S)
        except Exception as error:  # drivers raise whatever they like
            raise CaptureError(
                f"a frame cannot be sent: {str(error)[:200] or type(error).__name__}", where=word,
                next_step="look at the bus: another node has to acknowledge frames, at the same bit rate; CAN FD needs "
                "a bus that knows it",
            ) from error  # fmt: skip

    def remarks(self) -> Iterator[str]:
        """Yield what a person should know of what was not sent, and of what was asked for in vain."""
        if self._errors:
            yield f"{count_of(self._errors, 'error frame')} left out: nobody sends such"
        if self._others:
            yield f"{count_of(self._others, 'other frame')} left out: frames of CAN alone are sent on a bus"
        for word, names in self._channels.items():
            if len(names) > 1:
                yield f"frames of {', '.join(sorted(names))} went to one bus, {word}; --map CHANNEL=can:… parts them"
        sent = set().union(*self._channels.values())
        for name in self._route.words:
            if name not in sent:
                yield f"--map {name}=…: no frame was on a channel of this name"

    def close(self) -> None:
        """Close all buses."""
        for bus in self._buses.values():
            _within(bus.shutdown)

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _opened(word: str) -> Any:
    """Return an open bus; drivers are foreign, and some do not come back."""
    where, found, failed = CanWord.of(word), [], []

    def opens() -> None:
        try:
            found.append(opened_to_send(where))
        except BaseException as error:
            failed.append(error)

    _within(opens)
    if failed:
        raise reason(where, word, failed[0]) from failed[0]
    if not found:
        raise CaptureError(
            f"its driver has not answered for {OPEN_S:.0f} s", where=word,
            next_step="look at the adapter: unplug it, plug it in again",
        )  # fmt: skip
    return found[0]


def _within(does: Callable[[], object]) -> None:
    """Do something of a driver, for so long as a driver may take."""

    def quietly() -> None:
        with suppress(BaseException):
            does()

    thread = threading.Thread(target=quietly, daemon=True)
    thread.start()
    thread.join(OPEN_S)
