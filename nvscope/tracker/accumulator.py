"""Accumulators: what is counted of traffic, each by a key along which it may be split.

Several cores or machines can share one timeline that way: batches are recognised once, their telegrams are dealt out by
an accumulator's key, each part is folded apart, and the parts are joined to the state that folding all at once gives.
"""

from __future__ import annotations

from enum import Enum


class SplitBy(Enum):
    """What an accumulator's telegrams may be dealt out by."""

    NOTHING = "all frames have to be seen in turn"
    LIST = "by list: whoever sends or reads it"
    SENDER = "by who sends: a node with all its lists, on CAN a channel"
    BUS = "by CAN channel"
