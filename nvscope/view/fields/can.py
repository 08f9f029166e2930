"""The fields of CAN frames: ``can.id``, ``can.data``, ``canopen.node``. Names are Wireshark's where it has them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from msgspec.structs import replace

from dissectors.batch import DIRECTION_NAMES, U8, Bool, Direction
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.canopen import FUNCTION_NAMES, function_of, node_of
from dissectors.can.error import DETAIL, classes_of, describe_error
from dissectors.can.frame import CanBatch, Fault
from dissectors.layout import gather_bytes
from nvscope.expression.typed_columns import BytesColumn, FieldType, Numbers, TextColumn
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import CAN, FrameRows

_OF_ANY = frozenset({"can.direction", "can.fault"})
_FAULTS = tuple("" if fault is Fault.NONE else fault.name.lower().replace("_", "-") for fault in Fault)


def _channel(rows: FrameRows) -> TextColumn:
    code = np.zeros(len(rows), np.int64)
    texts: tuple[str, ...] = ("",)
    if found := rows.parts.get(CAN):
        number, own = np.unique(found.part.channel, return_inverse=True)
        code[found.positions(len(rows))] = own
        texts = tuple(rows.channel(one) for one in number.tolist())
    return TextColumn(code, texts)


def _where_told(field: TelegramField) -> Callable[[CanBatch], Bool | None]:
    """Return where a field exists: of a frame that was cut off within its header nothing is known."""
    known, of_its_state = field.known, field.name in _OF_ANY

    def told(frames: CanBatch) -> Bool | None:
        own = known(frames)
        whole: Bool = frames.fault != Fault.SHORT
        if not of_its_state and own is not None:
            whole &= own
        return own if of_its_state else whole

    return told


def _data(frames: CanBatch) -> BytesColumn:
    return BytesColumn(frames.data, frames.at, frames.at + frames.captured)


def _detail(errors: CanBatch) -> U8:
    """Return the bytes of error frames, shape (n, 8), 0 where fewer were captured."""
    detail = gather_bytes(errors.data, errors.at, DETAIL.size_bytes).view(np.uint8).reshape(len(errors), -1)
    captured: U8 = np.where(np.arange(DETAIL.size_bytes) < errors.captured[:, np.newaxis], detail, np.uint8(0))
    return captured


def _has_data(frames: CanBatch) -> Bool:
    has: Bool = ~frames.error | (classes_of(frames) != 0)
    # What a log did not record of an error is filled up with zeros, which nobody sent.
    untold = np.flatnonzero(~has)
    if len(untold):
        has[untold] = _detail(frames.take(untold)).any(axis=1)
    return has


def _error(frames: CanBatch) -> TextColumn:
    code = np.zeros(len(frames), np.int64)
    texts = [""]
    position = np.flatnonzero(frames.error)
    if len(position):
        errors = frames.take(position)
        told = np.column_stack([errors.identifier.astype("<u4").view(np.uint8).reshape(-1, 4), _detail(errors)])
        seen, which = np.unique(told, axis=0, return_inverse=True)
        code[position] = which.reshape(-1) + 1
        texts += [describe_error(int.from_bytes(one[:4], "little"), one[4:]) for one in map(bytes, seen)]
    return TextColumn(code, tuple(texts))


def _function_number(frames: CanBatch) -> Any:
    return function_of(frames.identifier, frames.extended | frames.error)


def _function(frames: CanBatch) -> TextColumn:
    return TextColumn(_function_number(frames).astype(np.int64), FUNCTION_NAMES)


def _node(frames: CanBatch) -> Any:
    return node_of(frames.identifier, frames.extended | frames.error)


def _bits(frames: CanBatch) -> Numbers:
    nominal, fast = wire_bits(frames, Stuffing.EXACT)
    return nominal + fast


def _direction(frames: CanBatch) -> TextColumn:
    return TextColumn(frames.direction.astype(np.int64), DIRECTION_NAMES)


def _fault(frames: CanBatch) -> TextColumn:
    return TextColumn(frames.fault.astype(np.int64), _FAULTS)


_UNSIGNED, _BOOL, _TEXT = FieldType.UNSIGNED, FieldType.BOOL, FieldType.TEXT

CAN_FIELDS = (
    TelegramField(
        "can.channel", _TEXT, "Channel", "name of the channel, such as can0", _channel, lambda rows: rows.have(CAN)
    ),
    *(
        replace(field, of=CAN, known=_where_told(field))
        for field in (
            TelegramField(
                "can.id", _UNSIGNED, "Identifier", "of 11 or 29 bits; an error frame has none",
                lambda frames: frames.identifier, lambda frames: ~frames.error,
            ),
            TelegramField(
                "can.flags.xtd", _BOOL, "Extended", "identifier of 29 bits", lambda frames: frames.extended
            ),
            TelegramField(
                "can.flags.rtr", _BOOL, "Remote", "asks for data, holds none", lambda frames: frames.remote
            ),
            TelegramField(
                "can.flags.err", _BOOL, "Error", "error frame, made by the controller's driver",
                lambda frames: frames.error,
            ),
            TelegramField(
                "can.error", _TEXT, "Error", "what an error frame tells, in words", _error,
                lambda frames: frames.error,
            ),
            TelegramField("can.len", _UNSIGNED, "Length", "bytes of data", lambda frames: frames.length),
            TelegramField(
                "can.dlc", _UNSIGNED, "DLC", "data length code, up to 8, of CAN FD up to 15", lambda frames: frames.dlc
            ),
            TelegramField("can.data", FieldType.BYTES, "Data", "captured bytes of data", _data, _has_data),
            TelegramField("can.fd", _BOOL, "CAN FD", "frame of CAN FD", lambda frames: frames.fd),
            TelegramField(
                "canfd.flags.brs", _BOOL, "Bit rate switch", "of CAN FD", lambda frames: frames.brs,
                lambda frames: frames.fd,
            ),
            TelegramField(
                "canfd.flags.esi", _BOOL, "Error state", "the sender is error passive, of CAN FD",
                lambda frames: frames.esi, lambda frames: frames.fd,
            ),
            TelegramField(
                "can.bits", _UNSIGNED, "Bits", "bits on the wire, with stuff bits",
                _bits,
            ),
            TelegramField(
                "can.direction", _TEXT, "Direction", "Rx received, Tx sent, where the capture was taken",
                _direction, lambda frames: frames.direction != Direction.UNKNOWN,
                texts=tuple(filter(None, DIRECTION_NAMES)),
            ),
            TelegramField(
                "can.fault", _TEXT, "Fault", "what is wrong with the frame: " + ", ".join(filter(None, _FAULTS)),
                _fault, lambda frames: frames.fault != Fault.NONE, texts=tuple(filter(None, _FAULTS)),
            ),
            TelegramField(
                "canopen.function", _TEXT, "Function",
                "what CANopen's plan has the identifier for, such as heartbeat, whether there is CANopen or not",
                _function, lambda frames: _function_number(frames) != 0, texts=tuple(filter(None, FUNCTION_NAMES)),
            ),
            TelegramField(
                "canopen.node", _UNSIGNED, "Node", "node-ID in the identifier, by CANopen's plan", _node,
                lambda frames: _node(frames) != 0,
            ),
        )
    ),
)  # fmt: skip
