"""The page of a WebVisu as its controller serves it: an applet, and the parameters with which it begins.

No document says where a page has its ENCODINGSTRING (``webvisu.md``, section 1). Pages of CoDeSys V2.3 say all else in
``<param name="…" value="…">``, so that is where it is looked for: in any case, with any quotes.
"""

from __future__ import annotations

import re

ENCODING = "ENCODINGSTRING"
"""The name of the parameter that says how texts are encoded."""

_MOST_NAME = 100
_COMMENT = re.compile(rb"<!--.*?(?:-->|\Z)", re.DOTALL)
_PARAMETER = re.compile(rb"<param\s([^<>]{1,2000})>", re.IGNORECASE)
_ATTRIBUTE = re.compile(rb"""(?<![\w-])([a-z]+)\s{0,9}=\s{0,9}(?:"([^"]*)"|'([^']*)'|([^\s"']+))""", re.IGNORECASE)


def is_page(target: str) -> bool:
    """Tell whether a URL is one of a page."""
    return target.partition("?")[0].lower().endswith((".htm", ".html"))


def encoding_said(content: bytes) -> str | None:
    """Return what a page calls the encoding of its texts, the first time it does; None where it says nothing."""
    if ENCODING.lower().encode() not in content.lower():
        return None
    for parameter in _PARAMETER.finditer(_COMMENT.sub(b"", content)):
        told: dict[bytes, bytes] = {}
        for one in _ATTRIBUTE.finditer(parameter[1]):
            told.setdefault(one[1].lower(), one[2] or one[3] or one[4] or b"")
        if told.get(b"name", b"").strip().upper() == ENCODING.encode():
            said = told.get(b"value", b"").rstrip(b"/" if parameter[1].endswith(b"/") else b"").strip()
            if said:
                return said[:_MOST_NAME].decode("latin-1")
    return None
