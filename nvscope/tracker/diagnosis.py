"""Diagnosis: NetVarUDPDiagStruct of a list, or of a node on it, as rebuilt from the traffic."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Diagnosis(NamedTuple):
    """NetVarUDPDiagStruct; times are absolute ns or None, the error a name.

    Error and number of errors are None where nobody knows of them: something that makes them was left out.
    """

    nSendCount: int = 0  # noqa: N815  # the document's name
    tLastSend: int | None = None  # noqa: N815
    nReceiveCount: int = 0  # noqa: N815
    tLastReceive: int | None = None  # noqa: N815
    nWriteCount: int = 0  # noqa: N815
    sLastError: str | None = "NOERROR"  # noqa: N815
    tLastError: int | None = None  # noqa: N815
    nErrorCount: int | None = 0  # noqa: N815
    nAcknowledges: int = 0  # noqa: N815

    @property
    def blank(self) -> bool:
        """True where nothing was counted."""
        return not (self.nSendCount or self.nReceiveCount or self.nWriteCount or self.nErrorCount or self.nAcknowledges)


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
