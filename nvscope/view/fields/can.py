"""The fields of CAN frames: ``can.id``, ``can.data``, ``canopen.node``. Names are Wireshark's where it has them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dissectors.batch import Bool
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.canopen import FUNCTION_NAMES, function_of, node_of
from dissectors.can.frame import CanBatch, Fault
from nvscope.expression.columns import BytesColumn, FieldType, Numbers, TextColumn
from nvscope.view.escape import visible
from nvscope.view.fields.field import TelegramField, on_can
from nvscope.view.rows.frames import TelegramRows

_FAULTS = tuple("" if fault is Fault.NONE else fault.name.lower().replace("_", "-") for fault in Fault)


def _column(tell: Callable[[CanBatch], Any]) -> Callable[[TelegramRows], Numbers]:
    """Return what reads a column of CAN frames; of other rows it is 0."""

    def read(rows: TelegramRows) -> Numbers:
        if rows.can is None or rows.can.frames is None:
            return np.zeros(len(rows), np.int64)
        told = np.asarray(tell(rows.can.frames))
        column = np.zeros(len(rows), told.dtype)
        own = np.flatnonzero(rows.can.on_can)
        column[own] = told[rows.can.frame[own]]
        return column

    return read


def _flag(tell: Callable[[CanBatch], Bool]) -> Callable[[TelegramRows], Bool]:
    """Return what reads a column of CAN frames that is true or false; of other rows it is false."""
    read = _column(tell)
    return lambda rows: read(rows).astype(np.bool_)


def _channel(rows: TelegramRows) -> TextColumn:
    if rows.can is None or rows.can.frames is None:
        return TextColumn(np.zeros(len(rows), np.int64), ("",))
    number, code = np.unique(_column(lambda frames: frames.channel)(rows), return_inverse=True)
    return TextColumn(code, tuple(str(visible(rows.can.pdos.channel(one))) for one in number.tolist()))


def _data(rows: TelegramRows) -> BytesColumn:
    start = _column(lambda frames: frames.at)(rows)
    return BytesColumn(rows.telegrams.data, start, start + _column(lambda frames: frames.captured)(rows))


def _function(rows: TelegramRows) -> TextColumn:
    read = _column(lambda frames: function_of(frames.identifier, frames.extended | frames.error))
    return TextColumn(read(rows).astype(np.int64), FUNCTION_NAMES)


def _node(frames: CanBatch) -> Any:
    return node_of(frames.identifier, frames.extended | frames.error)


def _fault(rows: TelegramRows) -> TextColumn:
    return TextColumn(_column(lambda frames: frames.fault)(rows).astype(np.int64), _FAULTS)


_UNSIGNED, _BOOL, _TEXT = FieldType.UNSIGNED, FieldType.BOOL, FieldType.TEXT

CAN_FIELDS = tuple(
    map(
        on_can,
        (
            TelegramField("can.channel", _TEXT, "Channel", "name of the channel, such as can0", _channel),
            TelegramField(
                "can.id", _UNSIGNED, "Identifier", "of 11 or 29 bits; of an error frame its classes",
                _column(lambda frames: frames.identifier), hex_digits=3,
            ),
            TelegramField(
                "can.flags.xtd", _BOOL, "Extended", "identifier of 29 bits", _flag(lambda frames: frames.extended)
            ),
            TelegramField(
                "can.flags.rtr", _BOOL, "Remote", "asks for data, holds none", _flag(lambda frames: frames.remote)
            ),
            TelegramField(
                "can.flags.err", _BOOL, "Error", "error frame, made by the controller's driver",
                _flag(lambda frames: frames.error),
            ),
            TelegramField("can.len", _UNSIGNED, "Length", "bytes of data", _column(lambda frames: frames.length)),
            TelegramField(
                "can.dlc", _UNSIGNED, "DLC", "data length code, up to 8, of CAN FD up to 15",
                _column(lambda frames: frames.dlc),
            ),
            TelegramField("can.data", FieldType.BYTES, "Data", "captured bytes of data", _data),
            TelegramField("can.fd", _BOOL, "CAN FD", "frame of CAN FD", _flag(lambda frames: frames.fd)),
            TelegramField(
                "canfd.flags.brs", _BOOL, "Bit rate switch", "of CAN FD", _flag(lambda frames: frames.brs),
                _flag(lambda frames: frames.fd),
            ),
            TelegramField(
                "canfd.flags.esi", _BOOL, "Error state", "the sender is error passive, of CAN FD",
                _flag(lambda frames: frames.esi), _flag(lambda frames: frames.fd),
            ),
            TelegramField(
                "can.bits", _UNSIGNED, "Bits", "bits on the wire, with stuff bits",
                _column(lambda frames: sum(wire_bits(frames, Stuffing.EXACT))),
            ),
            TelegramField(
                "can.fault", _TEXT, "Fault", "what is wrong with the frame: " + ", ".join(filter(None, _FAULTS)),
                _fault, _flag(lambda frames: frames.fault != Fault.NONE),
            ),
            TelegramField(
                "canopen.function", _TEXT, "Function", "what CANopen uses the identifier for, such as heartbeat",
                _function, _flag(lambda frames: function_of(frames.identifier, frames.extended | frames.error) != 0),
            ),
            TelegramField(
                "canopen.node", _UNSIGNED, "Node", "node-ID in the identifier, by CANopen", _column(_node),
                _flag(lambda frames: _node(frames) != 0),
            ),
        ),
    )
)  # fmt: skip
