"""Where a controller has its WebVisu page, as a person writes it: a URL, or its address alone."""

from __future__ import annotations

import ipaddress
import re
from urllib.parse import quote, urlsplit

from msgspec import Struct

from nvscope.errors import UsageError

USUAL_PATHS = "/plc/webvisu.htm", "/PLC/webvisu.htm", "/webvisu/webvisu.htm", "/webvisu.htm"
"""Where controllers have the page, in the order in which it is looked for."""

_PAGE = "webvisu.htm"
_EXAMPLE = "for example http://192.168.1.3/plc/webvisu.htm, or 192.168.1.3"
_PORT, _TLS_PORT = 80, 443
_LONGEST = 1_000
_PLAIN = "/%:@!$&'()*+,;=~-._"
_USER = re.compile(r"^([^:/?#]*://)?[^/?#]*@")
"""A user in front of a host, perhaps with a password, which no message repeats."""


class VisuUrl(Struct, frozen=True):
    """A page: ``host`` without brackets, ``path`` '' where nobody said it."""

    host: str
    port: int = _PORT
    path: str = ""

    @property
    def authority(self) -> str:
        """Host and port as URLs have them."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == _PORT else f"{host}:{self.port}"

    def text(self, path: str = "") -> str:
        """The URL of the page, or of another path there."""
        return f"http://{self.authority}{path or self.path}"


def beside(path: str, name: str) -> str:
    """Return the path of a file in the folder of a page."""
    return f"{path.rpartition('/')[0]}/{quote(name, safe='')}"


def visu_url(text: str) -> VisuUrl:
    """Return what a text names; UsageError where that is nothing that can be asked."""
    shown = _USER.sub(r"\1(hidden)@", text)[:80]
    if len(text) > _LONGEST or any(not one.isprintable() or one.isspace() for one in text):
        raise UsageError(f"{shown}: no URL", next_step=_EXAMPLE)
    scheme, sign, rest = text.partition("://")
    if not sign:
        scheme, rest = "http", f"[{text}]" if _is_ipv6(text) else text
    if scheme.lower() == "https":
        raise _tls(shown)
    if scheme.lower() != "http":
        raise UsageError(f"{shown}: expected http://", next_step=_EXAMPLE)
    try:
        parts = urlsplit(f"http://{rest}")
        host, port = parts.hostname or "", _PORT if parts.port is None else parts.port
    except ValueError:
        host, port, parts = "", 0, urlsplit("")
    if not host or not port:
        raise UsageError(f"{shown}: no address and port", next_step=_EXAMPLE)
    if "@" in parts.netloc or parts.query:
        what = "a user" if "@" in parts.netloc else "a query"
        raise UsageError(f"{shown}: {what} has no meaning here", next_step=_EXAMPLE)
    if port == _TLS_PORT:
        raise _tls(shown)
    path = quote(parts.path, safe=_PLAIN)
    if path.endswith("/") and path != "/":
        path += _PAGE
    return VisuUrl(host, port, "" if path == "/" else path)


def _is_ipv6(text: str) -> bool:
    try:
        return ipaddress.ip_address(text.partition("%")[0]).version == 6
    except ValueError:
        return False


def _tls(shown: str) -> UsageError:
    return UsageError(
        f"{shown}: this is TLS (https), which is not spoken here",
        next_step="WebVisu of CoDeSys V2.3 is plain HTTP, on port 80 or 8080: name that",
    )
