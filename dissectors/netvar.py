"""3S-0 telegrams: the header table, the services and the flags (``spec``: Network Functionality in CoDeSys V2.3, 2.4.1).

::

     0       4       8     10        12      14       16        18      19         20
    +-------+-------+-------+---------+-------+--------+---------+-------+----------+------
    |Identit| ID    | Index | SubIndex| Items | Length | Counter | Flags | Checksum | Data
    +-------+-------+-------+---------+-------+--------+---------+-------+----------+------
"""

from __future__ import annotations

from enum import IntEnum

from dissectors.layout import Bit, Field, Layout

PORT = 1202
IDENTITY = 0x33532D00  # b"\x00-S3" read as a little-endian number
IDENTITY_ASCII = 0x33532D30  # b"0-S3", as the document prints it: accepted, reported, never produced


class Service(IntEnum):
    """Kinds of telegrams, named as in the enumeration NetVarOD_Service_Udp of the document."""

    ODStateFree = 0
    ODReadRequest = 1
    ODReadRequestReply = 2
    ODWriteRequest = 3
    ODWriteRequestReply = 4
    ODAcknowledgement = 5
    ODBootUpRequest = 6
    ODErrorReplyUnknown = 20
    ODErrorReplyItems = 21
    ODErrorReplyAccess = 22
    ODErrorReplyIdx = 23
    ODErrorReplySub = 24
    ODErrorReplyLen = 25
    ODErrorWrongService = 26
    ODErrorTimeOut = 27
    ODErrorReplyCPUStopped = 28
    ODStateBusy = 100


ACKNOWLEDGE_WANTED = Bit(0, "ack", "acknowledgement wanted")
CHECKSUM_PRESENT = Bit(1, "checksum", "checksum present")
CHECKSUM_INVALID = Bit(2, "invalid", "invalid checksum: negative acknowledgement")
RESERVED_FLAGS = 0xF8

HEADER = Layout(
    "nv",
    (
        Field("identity", "<u4", "Identity", "protocol identity, 00 2D 53 33", base="hex", default=IDENTITY),
        Field("id", "<u4", "ID", "service", values={s.value: s.name for s in Service}),
        Field("index", "<u2", "Index", "list identifier (COB-ID)"),
        Field("subindex", "<u2", "SubIndex", "number of the telegram (packed) or of the variable (unpacked)"),
        Field("items", "<u2", "Items", "elementary variables in this telegram"),
        Field("length", "<u2", "Length", "header and data in bytes, the UDP payload length"),
        Field("counter", "<u2", "Counter", "number of this telegram; its scope depends on the sender"),
        Field(
            "flags", "u1", "Flags", "bits 3 to 7 are undocumented",
            bits=(ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT, CHECKSUM_INVALID), base="hex",
        ),
        Field("checksum", "u1", "Checksum", "opaque signature of the definition", base="hex"),
    ),
)  # fmt: skip
