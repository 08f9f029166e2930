"""What else is spoken over the ports of web visualizations: recognised and named, never decoded.

Sources: ``webvisu.md`` section 2; of TLS, RFC 8446, section 5.1 (the record layer).
"""

from __future__ import annotations

from enum import IntEnum

_HANDSHAKE, _TLS_MAJOR = 22, 3


class WebProtocol(IntEnum):
    """Another protocol. ``OTHER``: what a client begins with is no HTTP, and nothing else that is known."""

    WEBVISU_V3 = 0
    TWINCAT = 1
    TLS = 2
    OTHER = 3


_PAGES = {"webvisuv3.bin": WebProtocol.WEBVISU_V3, "tcadswebservice": WebProtocol.TWINCAT}
"""What occurs in the address to which such requests are posted, in small letters."""


def protocol_of_request(method: str, target: str) -> WebProtocol | None:
    """Return which other protocol a request is of, None where it is of none that is known."""
    if method != "POST":
        return None
    address = target.partition("?")[0].lower()
    return next((protocol for name, protocol in _PAGES.items() if name in address), None)


def protocol_of_bytes(data: bytes, start: int) -> WebProtocol:
    """Return which protocol a connection speaks that begins with bytes that are no HTTP."""
    is_tls = data[start : start + 2] == bytes((_HANDSHAKE, _TLS_MAJOR))
    return WebProtocol.TLS if is_tls else WebProtocol.OTHER
