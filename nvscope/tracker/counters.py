"""The table of counters: every number that a report shows of a list, a node or a stream.

JSON keys, columns on screens, the words of rules and ``explain`` are derived from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

Unit = Literal["telegrams", "counters", "gaps", "events", "ns", ""]


@dataclass(frozen=True, slots=True)
class Counter:
    """One number: its key in reports, its unit, what it counts, and where a controller keeps it, in how many bits."""

    name: str
    unit: Unit
    help: str
    width_bits: int = 0


DIAGNOSIS = (
    Counter("nSendCount", "telegrams", "data telegrams sent, malformed ones included", 32),
    Counter("tLastSend", "ns", "time of the last of them"),
    Counter("nReceiveCount", "telegrams", "telegrams received, of any service and malformed ones included", 32),
    Counter("tLastReceive", "ns", "time of the last of them"),
    Counter("nWriteCount", "telegrams", "data telegrams that a reader would write into its variables", 32),
    Counter("sLastError", "", "name of the last error"),
    Counter("tLastError", "ns", "time of the last error"),
    Counter("nErrorCount", "events", "errors of any kind", 16),
    Counter("nAcknowledges", "telegrams", "acknowledgements sent, negative ones included", 16),
)
"""NetVarUDPDiagStruct (Network Functionality in CoDeSys V2.3, 3.4), in the order of its components."""

LIST_COUNTERS = (
    Counter("lost", "counters", "telegrams that the counters say were sent and that never came; unknown where NV207"),
    Counter("lost_claimed", "counters", "telegrams that the counters claim were sent and never came, believed or not"),
    Counter("gaps", "gaps", "places where telegrams are missing"),
    Counter("longest_gap", "counters", "most telegrams missing in one place"),
    Counter("duplicates", "telegrams", "telegrams that came again"),
    Counter("overtaken", "telegrams", "telegrams that came after a later one"),
    Counter("restarts", "events", "counters that began anew"),
    Counter("malformed", "telegrams", "telegrams too short, of a wrong Length or of an unknown service"),
    Counter("truncated", "telegrams", "telegrams of which the capture holds only the beginning"),
    Counter("missing_acknowledgements", "events", "data telegrams that nobody acknowledged in time"),
    Counter("negative_acknowledgements", "events", "acknowledgements that say: checksum invalid"),
    Counter("checksum_mismatches", "events", "data telegrams with another checksum than the list's"),
    Counter("bootup_requests", "telegrams", "requests of readers for current values"),
    Counter("bootup_unanswered", "events", "requests that no data telegram answered in time"),
    Counter("send_rejected", "events", "telegrams that came back as undeliverable (ICMP)"),
)

FIGURES = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts")
"""The counters that depend on what a sender's Counter counts; kept once for each scope."""

STREAM_FIGURES = ("lost", "lost_claimed", "duplicates", "overtaken", "restarts")


class DiagError(IntEnum):
    """Errors of a controller's diagnosis structure, numbered as NetVarUDPDiagStruct.sLastError."""

    NOERROR = 0
    UDPSENDATA = 1
    UDPSENDACKN = 2
    NOACKNOWLEDGEMENT = 3
    NOTACKNOWLEDGED = 4
    UDPSENDBOOTUPREQUEST = 5
    UDPANSWERBOOTUPREQUEST = 6
    CHECKSUM = 7
    UDPNETWORKMANAGER_NOT_READY = 20  # cannot be observed
    UNKNOWN = 100  # cannot be observed


ERROR_ORDER = (
    DiagError.NOERROR,
    DiagError.NOACKNOWLEDGEMENT,
    DiagError.NOTACKNOWLEDGED,
    DiagError.CHECKSUM,
    DiagError.UDPANSWERBOOTUPREQUEST,
    DiagError.UDPSENDATA,
    DiagError.UDPSENDACKN,
    DiagError.UDPSENDBOOTUPREQUEST,
)
"""Which of several errors at the same time is the last one: the later in this order."""


class Scope(IntEnum):
    """What a sender's Counter counts; of equal evidence, the earlier one."""

    STREAM = 0
    NODE_TELEGRAM = 1
    NODE_SEND = 2


SCOPE_NAMES = {Scope.STREAM: "stream", Scope.NODE_TELEGRAM: "node-telegram", Scope.NODE_SEND: "node-send"}
SCOPE_UNUSED = "unused"
