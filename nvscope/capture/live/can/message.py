"""Messages of python-can, and states of a bus, as SocketCAN frames."""

from __future__ import annotations

import re
from enum import Enum
from typing import Any

from dissectors.batch import Direction
from dissectors.can.error import ACTIVE, BUS_OFF, CLASSES, CONTROLLER, CONTROLLER_BITS
from nvscope.capture.can import error_frame
from nvscope.capture.can.error_frame import ErrorFrame
from nvscope.capture.can.frame import (
    BIT_RATE_SWITCH,
    ERROR,
    ERROR_STATE,
    FD_FRAME,
    MAX_DATA_BYTES,
    MAX_FD_DATA_BYTES,
    CanFrame,
)
from nvscope.capture.can.line_fields import LineFault, classic_length, remote_frame, word_of

_KNOWN_CLASSES = sum(bit.mask for bit in CLASSES)


def frame_of(message: Any, ts_ns: int, *, has_classes: bool) -> CanFrame:
    """Return a message as a frame; LineFault for one that cannot be one on a bus.

    ``has_classes``: the identifier of an error frame has SocketCAN's classes; that of others means nothing here.
    """
    try:
        identifier, dlc, data = int(message.arbitration_id), int(message.dlc), bytes(message.data or b"")
        way = Direction.RX if message.is_rx else Direction.TX
        if message.is_error_frame:
            return _error_frame(ts_ns, identifier if has_classes else 0, data, way)
        word = word_of(identifier, bool(message.is_extended_id))
        if identifier < 0 or not 0 <= dlc <= MAX_FD_DATA_BYTES or len(data) > MAX_FD_DATA_BYTES:
            raise LineFault(f"{max(dlc, len(data))} bytes of data, or an identifier of {identifier}")
        if message.is_remote_frame:
            return remote_frame(ts_ns, word, dlc)._replace(direction=way)
        if message.is_fd or len(data) > MAX_DATA_BYTES:
            flags = BIT_RATE_SWITCH * bool(message.bitrate_switch) | ERROR_STATE * bool(message.error_state_indicator)
            return CanFrame(ts_ns, word, max(len(data), dlc), FD_FRAME | flags, 0, data, way)
        length, raw_dlc = classic_length(max(len(data), dlc))
        return CanFrame(ts_ns, word, length, 0, raw_dlc, data, way)
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise LineFault(f"no message: {error}") from error


def _error_frame(ts_ns: int, identifier: int, data: bytes, way: Direction) -> CanFrame:
    classes = identifier & _KNOWN_CLASSES
    detail = data[:MAX_DATA_BYTES].ljust(MAX_DATA_BYTES, b"\0") if classes else error_frame.UNTOLD.data
    return CanFrame(ts_ns, ERROR | classes, MAX_DATA_BYTES, 0, 0, detail, way)


class State(Enum):
    """What the controller of a bus can do; each but the first is told by an error frame when it begins."""

    GOOD = ErrorFrame(CONTROLLER, controller=ACTIVE)
    WARNING = ErrorFrame(CONTROLLER, controller=CONTROLLER_BITS[2].mask)
    PASSIVE = ErrorFrame(CONTROLLER, controller=CONTROLLER_BITS[4].mask)
    OFF = ErrorFrame(BUS_OFF)

    def frame(self, ts_ns: int) -> CanFrame:
        """Return the error frame that says since when it is so."""
        return CanFrame(ts_ns, self.value.identifier, MAX_DATA_BYTES, 0, 0, self.value.data, Direction.RX)


_WORDS = (
    (re.compile(r"bus[ -]?off", re.IGNORECASE), State.OFF),
    (re.compile(r"error[ -]passive|bus[ -]?heavy|bus coupling error", re.IGNORECASE), State.PASSIVE),
    (re.compile(r"warning limit|bus[ -]?light", re.IGNORECASE), State.WARNING),
)


def state_in(text: str) -> State | None:
    """Return the state of which an error of a driver speaks: some raise it for as long as it lasts."""
    return next((state for pattern, state in _WORDS if pattern.search(text)), None)
