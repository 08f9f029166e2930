"""Error events, and which of several is the last one."""

from __future__ import annotations

from dataclasses import dataclass

from tests.oracle.frame import Address
from tests.oracle.rules.telegram import ACKNOWLEDGEMENT, BOOT_UP_REQUEST, DATA

# The errors, in the order that decides which of several at one time is the last.
NOACKNOWLEDGEMENT = "NOACKNOWLEDGEMENT"
NOTACKNOWLEDGED = "NOTACKNOWLEDGED"
CHECKSUM = "CHECKSUM"
UDPANSWERBOOTUPREQUEST = "UDPANSWERBOOTUPREQUEST"
UDPSENDATA, UDPSENDACKN, UDPSENDBOOTUPREQUEST = "UDPSENDATA", "UDPSENDACKN", "UDPSENDBOOTUPREQUEST"
ERRORS = (
    NOACKNOWLEDGEMENT,
    NOTACKNOWLEDGED,
    CHECKSUM,
    UDPANSWERBOOTUPREQUEST,
    UDPSENDATA,
    UDPSENDACKN,
    UDPSENDBOOTUPREQUEST,
)
SEND_ERRORS = {DATA: UDPSENDATA, ACKNOWLEDGEMENT: UDPSENDACKN, BOOT_UP_REQUEST: UDPSENDBOOTUPREQUEST}


@dataclass(frozen=True)
class ErrorEvent:
    """An error on a list, attributed to a node or to the list only."""

    name: str
    node: Address | None
    time: int
    at_deadline: bool
    frame: int

    @property
    def order(self) -> tuple[int, bool, int, int]:
        return self.time, not self.at_deadline, self.frame, ERRORS.index(self.name)
