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
        "asks": "who asks a controller for parameters or variables of pages, by address or name of the project",
        "asked": "the controller that is asked",
        "port": "that of who is asked: UDP of the Parameter Manager, TCP of WebVisu",
        "requests": "how many requests there were; of the Parameter Manager, those sent again apart",
        "took p50": "how long half of the replies took at most, from the request on; p99 is for 99 of 100, max for all",
        "unanswered": "requests without a reply in time, of WebVisu none before its connection ended or was given up",
        "came back": "requests of which ICMP tells that they were not delivered",
        "repeated": "requests that were sent again while the same one was open",
        "copies": "requests and replies that the capture has once more, as of a mirror port; they count nowhere else",
        "unexpected": "replies that no open request waits for: late, second, or never asked for",
        "busy": "requests that were answered by ODStateBusy",
        "refused": "requests that were refused; of the Parameter Manager, by which service",
        "reads": "requests of pages that read",
        "every": "the median time from one request of a page to the next one for the same variables",
        "variables": "how many different variables pages asked for",
        "writes": "requests that write, whatever came of them",
        "miscounted": "requests that say another number of variables than they have, and replies with another number "
        "of values than was asked for",
        "ambiguous": "writes and replies with texts that have a | in them, of which nobody knows what belongs to which",
        "cut": "requests and replies of which the capture lacks bytes: they are not decoded",
        "bytes missing": "how many bytes of these connections the capture lacks",
        "connections": "how many connections over TCP there were on which such requests came",
        "time": "when the write was asked for",
        "who": "who wrote, or spoke, by address or name of the project",
        "whom": "the controller that was written to, or spoken to",
        "parameter": "what was written: its name in the project, else Index and SubIndex",
        "variable": "what was written: its name, else area, offset, size and type; of READPI and WRITEPI its address",
        "old": "what was there before: last seen in a reply to a read, or in a confirmed write; - if nobody knows",
        "new": "what was to be written, whatever came of it; - if nobody knows, for texts have a | in them",
        "outcome": "what came of it: confirmed, refused, busy, unanswered, or open at the end of the capture",
        "frame": "the frame of the request",
        "what": "which protocol it is that is spoken on a port of WebVisu, and is not decoded",
        "times": "how many requests or connections were of it",
        "first frame": "the frame of the first of them",
        "via": "by which conversation: sdo is the Parameter Manager, visu is WebVisu",
        "odd": "replies that no request waits for, requests that came back, wrong numbers of values, and what was cut",
        "last write": "what was written last by this pair, over which value; in front of that what came of it, "
        "unless it is confirmed",
        "ago": "how long ago that was",
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
