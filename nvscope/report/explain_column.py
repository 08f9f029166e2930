"""What a column of reports tells that holds no figure: who or what a row is, and how it stands."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType

from nvscope.view.lines.table import Cell, Line, Tone, wrap

MEANINGS = MappingProxyType(
    {
        "status": "that of the list's worst finding, whatever a filter shows: error, warning, note or ok",
        "list": "its key: udp/PORT/LIST IDENTIFIER; on CAN can/CHANNEL/COB-ID, 8 digits for 29 bits",
        "name": "what the definition or the project calls it; on CAN, paler, what CANopen has the identifier for",
        "sender": "who sends data of the list; +1 means one more",
        "reader": "who acknowledges data of the list or asks for it at boot-up; +1 means one more",
        "node": "the sender of the stream",
        "sub": "SubIndex: which of the telegrams of a list the stream consists of",
        "items": "Items in the header of the last telegram: how many variables it has",
        "length": "Length in the header of the last telegram, in bytes with the header; on CAN the data bytes of "
        "the last frame",
        "checksum": "the checksum in the header of the last telegram, where it has one",
        "counter": "what the sender counts in Counter: each stream by itself, the telegrams or the sendings of the "
        "node, or nothing",
        "identifier": "the COB-ID of frames, 8 digits for 29 bits",
        "share": "how much of all bits that the channel carried were in frames of this identifier",
        "CANopen's plan": "what CANopen's predefined connection set has the identifier for, whether there is any "
        "CANopen or not",
        "CANopen": "a node of CANopen, by its number",
        "state": "the last known state of the node, as its heartbeats tell; commanded: as an NMT command asked for",
        "since": "when the node is first known to have been in that state",
        "last heard": "when the last heartbeat or emergency of the node came: long ago, its state is no longer known",
        "heartbeats": "how many heartbeats the node sent",
        "changes": "how often the node told of another state than before",
        "boot-ups": "how often the node said that it has started",
        "EMCY": "how many emergency messages of CANopen the node sent",
        "last EMCY": "the code of the last emergency message, and what it means",
        "register": "the bits that are set in the error register of the last emergency message",
        "at": "when the last emergency message came",
    }
)  # fmt: skip
"""By title, in the order of the tables."""


def column_called(name: str) -> str | None:
    """Return the title of the column of a name in any case, or None."""
    wanted = " ".join(name.split()).lower()
    return next((title for title in MEANINGS if title.lower() == wanted), None)


def column_lines(title: str, width: int) -> Iterator[Line]:
    """Yield what stands in a column."""
    meaning = MEANINGS[title]
    yield from wrap([Cell(title, Tone.STRONG), Cell("  "), Cell("column of reports", Tone.NOTE)], width, hanging=2)
    yield []
    yield from wrap([Cell(f"{meaning[0].upper()}{meaning[1:]}.")], width)
