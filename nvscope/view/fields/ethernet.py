"""The fields of Ethernet headers: who sent a frame to whom, by hardware address."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool, LinkType
from dissectors.headers import ETHERNET
from dissectors.layout import gather_bytes
from nvscope.expression.typed_columns import BytesColumn, FieldType, Numbers
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import FrameRows

_ADDRESS_BYTES = 6
_TYPE_AT = ETHERNET.size_bytes - 2
_LEAST_TYPE = 0x600  # below it is a length (IEEE 802.3)


def _on_ethernet(rows: FrameRows) -> Bool:
    packets = rows.packets
    told: Bool = (packets.link[rows.row] == LinkType.ETHERNET) & (packets.captured[rows.row] >= ETHERNET.size_bytes)
    return told


def _address(rows: FrameRows, at: int) -> BytesColumn:
    start = rows.packets.offset[rows.row] + at
    return BytesColumn(rows.packets.data, start, start + _ADDRESS_BYTES)


def _words(rows: FrameRows, own: I64, at: int) -> Numbers:
    """Return the words of two bytes at a place in some of the frames, which have as many."""
    where = rows.packets.offset[rows.row[own]] + at
    return gather_bytes(rows.packets.data, where, 2).view(">u2").reshape(-1).astype(np.int64)


def _type(rows: FrameRows) -> Numbers:
    numbers = np.zeros(len(rows), np.int64)
    own = np.flatnonzero(_on_ethernet(rows))
    numbers[own] = _words(rows, own, _TYPE_AT)
    return numbers


def _has_type(rows: FrameRows) -> Bool:
    told: Bool = _type(rows) >= _LEAST_TYPE
    return told


ETHERNET_FIELDS = (
    TelegramField(
        "eth.src", FieldType.BYTES, "Source hardware address", "of who sent the frame on this network",
        lambda rows: _address(rows, _ADDRESS_BYTES), _on_ethernet, separator=":",
    ),
    TelegramField(
        "eth.dst", FieldType.BYTES, "Destination hardware address", "of whom it is for on this network",
        lambda rows: _address(rows, 0), _on_ethernet, separator=":",
    ),
    TelegramField(
        "eth.type", FieldType.UNSIGNED, "EtherType", "of what is inside, 0x8100 of a VLAN tag", _type, _has_type,
        hex_digits=4,
    ),
)  # fmt: skip
"""Of the frame as it was captured; what a switch took off or put on is not seen."""
