"""What else is spoken over the ports of web visualizations: recognised and named, never decoded.

Sources: ``webvisu.md`` section 2; of TLS, RFC 8446, section 5.1 (the record layer); of HTTP/2, RFC 9113, section 3.4;
of methods, RFC 9110, section 5.6.2 (tokens).
"""

from __future__ import annotations

import re
from enum import IntEnum

_HANDSHAKE, _TLS_MAJOR = 22, 3
_HTTP2 = b"PRI * HTTP/2.0\r\n"
_HTTP1 = re.compile(
    rb"(?:GET|HEAD|POST|PUT|DELETE|OPTIONS|PATCH|CONNECT|TRACE) "
    rb"|[\w!#$%&'*+.^`|~-]{1,40} [^\r\n]*HTTP/1\.\d\r?\n"
)
"""What requests begin with, also those of WebDAV and UPnP, of HTTP/0.9, and with an address that cannot be."""


class WebProtocol(IntEnum):
    """Another protocol. ``OTHER``: what a client begins with is no HTTP, and nothing else that is known."""

    WEBVISU_V3 = 0
    TWINCAT = 1
    TLS = 2
    HTTP2 = 3
    OTHER = 4


_PAGES = {"webvisuv3.bin": WebProtocol.WEBVISU_V3, "tcadswebservice": WebProtocol.TWINCAT}
"""What occurs in the address to which such requests are posted, in small letters."""


def protocol_of_request(method: str, target: str) -> WebProtocol | None:
    """Return which other protocol a request is of, None where it is of none that is known."""
    if method != "POST":
        return None
    address = target.partition("?")[0].lower()
    return next((protocol for name, protocol in _PAGES.items() if name in address), None)


def protocol_of_bytes(data: bytes, start: int, stop: int) -> WebProtocol | None:
    """Return which protocol a connection speaks whose first message is none that is read; None of HTTP/1 all the same.

    ``stop`` is up to where one had to read to know that.
    """
    if data[start : start + 2] == bytes((_HANDSHAKE, _TLS_MAJOR)):
        return WebProtocol.TLS
    if data.startswith(_HTTP2, start, stop):
        return WebProtocol.HTTP2
    return None if _HTTP1.match(data, start, stop) else WebProtocol.OTHER
