"""The controller that tests of its server ask, and how they read its replies."""

from __future__ import annotations

VARIABLES = """
"PLC_PRG.sText" = { address = "4,0,6,8", value = "abcde" }
"PLC_PRG.nByte" = { address = "0,6,1,2", value = 3 }
"PLC_PRG.rReal" = { address = "4,160,4,6", value = 3.5 }
"PLC_PRG.nFixed" = { address = "4,10,2,1", value = -7, access = "ro" }
"PLC_PRG.late" = { address = "4,12,2,1", delay = "50ms" }
"PLC_PRG.mute" = { address = "4,14,2,1", silent = true }
"PLC_PRG.drop" = { address = "4,16,2,1", drop = true }
"PLC_PRG.gone" = { address = "4,18,2,1", unreadable = true }
"PLC_PRG.broken" = { address = "4,20,2,1", status = 503 }
"PLC_PRG.more" = { address = "4,22,2,1", surplus = 2 }
"PLC_PRG.less" = { address = "4,24,2,1", surplus = -1 }
".OUT0" = { address = "2,29,0,0", value = true }
".CurrentPassword" = { address = "4,100,41,8", value = "geheim" }
"""
KEPT = "keep_alive = true"
READ, READ_REPLY = b"|0|1|0|0|6|1|2|", b"|3|"


def content(reply: bytes) -> bytes:
    """Return the body of a reply of status 200 that ends with its connection."""
    head, _, body = reply.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200 OK\r\n"), reply
    return body


def statuses(replies: bytes) -> list[int]:
    return [int(part[2:5]) for part in replies.split(b"HTTP/1.")[1:]]
