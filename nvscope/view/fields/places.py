"""Of which list, and from whom, telegrams are: what figures, findings and causes are looked up by."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.carried import Carrier
from nvscope.list_key import ListKey
from nvscope.view.rows.frames import IP, FrameRows

NodeKey = tuple[int, int]
"""The halves of the address of a node."""


def senders_and_lists(rows: FrameRows) -> tuple[list[tuple[NodeKey, ListKey]], I64]:
    """Return the (sender, list) pairs that occur, and which of them each frame is of."""
    carried = rows.carried
    key = np.empty(
        len(rows), [("high", "u8"), ("low", "u8"), ("transport", "u1"), ("port", "u4"), ("identifier", "u4")]
    )
    key["high"], key["low"] = rows.senders
    key["transport"], key["port"], key["identifier"] = carried.carrier, carried.port, carried.identifier
    found, code = np.unique(key, return_inverse=True)
    return [
        ((high, low), ListKey.of(Carrier(carrier), port, identifier, rows.channel))
        for high, low, carrier, port, identifier in found.tolist()
    ], code


def in_list(rows: FrameRows) -> Bool:
    """Tell which frames belong to a list: telegrams but for those of the Parameter Manager, and data frames of CAN."""
    return rows.carried.of_list


def on_udp(rows: FrameRows) -> Bool:
    """Tell which frames belong to a list on UDP."""
    own: Bool = rows.carried.of_list & (rows.carried.carrier == Carrier.UDP)
    return own


def on_can(rows: FrameRows) -> Bool:
    """Tell which rows are CAN frames, of any kind."""
    own: Bool = rows.carried.carrier == Carrier.CAN
    return own


def sent_by_node(rows: FrameRows) -> Bool:
    """Tell which frames have a sender: nobody knows it on CAN."""
    return rows.have(IP)
