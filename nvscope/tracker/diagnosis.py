"""Diagnosis: NetVarUDPDiagStruct of a list, or of a node on it, as rebuilt from the traffic."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Diagnosis:
    """NetVarUDPDiagStruct; times are absolute ns or None, the error a name."""

    nSendCount: int = 0  # noqa: N815  # the document's name
    tLastSend: int | None = None  # noqa: N815
    nReceiveCount: int = 0  # noqa: N815
    tLastReceive: int | None = None  # noqa: N815
    nWriteCount: int = 0  # noqa: N815
    sLastError: str = "NOERROR"  # noqa: N815
    tLastError: int | None = None  # noqa: N815
    nErrorCount: int = 0  # noqa: N815
    nAcknowledges: int = 0  # noqa: N815

    @property
    def blank(self) -> bool:
        """True where nothing was counted."""
        return not (self.nSendCount or self.nReceiveCount or self.nWriteCount or self.nErrorCount or self.nAcknowledges)
