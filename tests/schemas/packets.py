"""The schema of a message of packets in an MCAP recording: ``nvscope.packets/1``."""

from __future__ import annotations

from nvscope.capture.mcap.packets import COLUMNS, Column
from tests.schemas.shapes import Schema, described, headed, record, several, text, whole

_TYPES = {"<i8": "int64", "<u4": "uint32", "<u2": "uint16", "<u1": "uint8"}


def packets() -> Schema:
    """Return the schema of what a message holds, with how each part of it lies in its bytes."""
    about = "`nvscope record`: packets of an MCAP recording, many to a message"
    schema = record(
        {
            "count": whole("uint32: how many packets it has"),
            "flags": whole("uint32: the sum of the flags of its columns"),
            **{column.name: _column(column) for column in COLUMNS},
            "bytes": described(text(), "what was captured, one packet behind the other, to the end of the message"),
        },
        [column.name for column in COLUMNS if column.flag and not column.flag_is_single],
    )
    layout = (
        "Binary, little-endian, in this order, without anything between. The packets of a message come within a "
        "second, and none is later than the last one, whose time is that of the message (log_time). The sequence of "
        "a message is how many packets were recorded before it."
    )
    return headed("packets", about, {"$comment": layout} | schema)


def _column(column: Column) -> Schema:
    each = "one for each packet"
    if column.flag_is_single:
        each = f"one for all with flag {column.flag}, else {each}"
    elif column.flag:
        each = f"with flag {column.flag}, {each}"
    return several(whole(least=None if column.kind == "<i8" else 0), f"{_TYPES[column.kind]}, {each}: {column.meaning}")
