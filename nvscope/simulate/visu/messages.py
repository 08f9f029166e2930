"""HTTP messages as pages and controllers exchange them.

Grammar: The Communication Protocol of WebVisu (document of the seeds), sections 1 and 4 of ``webvisu.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from dissectors.webvisu_page import ENCODING, is_page
from nvscope.definition.visu_encoding import LATIN, Encoding, encoding_of
from nvscope.simulate.frames import IPAddress
from nvscope.simulate.visu.tables import Page

DONE, REFUSED = "|0|", "|1|"
_LIST, _PAGE = "plc_visu.xml", "webvisu.htm"
_NO_XML = "\x1b"


def request(page: Page, host: IPAddress, number: int) -> bytes:
    """Return a request, of this number from 0."""
    fields = ["1" if page.write else "0", str(len(page.variables) + (number + 1 in page.overdeclared))]
    for place, (where, value) in enumerate(zip(page.variables.values(), values(page, number), strict=True)):
        fields += [str(place), *map(str, where), *([value] if page.write else ())]
    body = f"|{'|'.join(fields)}|".encode("iso-8859-1")
    return _head(page, host, f"POST {page.path}") + f"Content-Length: {len(body)}\r\n\r\n".encode("ascii") + body


def reply(page: Page, number: int) -> bytes:
    """Return what is answered to the request of this number."""
    if number + 1 in page.refused:
        return _reply(page, REFUSED) if page.write else _reply(page, "", "500 Internal Server Error")
    if page.write:
        return _reply(page, DONE)
    found = values(page, number)
    return _reply(page, "".join(f"|{value}" for value in found[: len(found) - (number + 1 in page.shortened)]) + "|")


def values(page: Page, number: int) -> Sequence[str]:
    """Return the value that each variable has in the request of this number, or in its reply.

    They are as on the wire: each character is a byte.
    """
    known, count, encoding = page.values or ("0",), len(page.variables), spoken(page)
    return [
        encoding.encoded(known[(number * count + place) % len(known)]).decode("iso-8859-1") for place in range(count)
    ]


def spoken(page: Page) -> Encoding:
    """Return the encoding of the texts of a page."""
    try:
        return LATIN if page.encoding is None else encoding_of(page.encoding)
    except ValueError:  # what nobody can read is what a scenario may want to show
        return LATIN


def page_request(page: Page, host: IPAddress) -> bytes:
    """Return the request for the page itself."""
    path = page.path if is_page(page.path) else f"{page.path.rpartition('/')[0]}/{_PAGE}"
    return _head(page, host, f"GET {path}") + b"\r\n"


def page_reply(page: Page) -> bytes:
    """Return the page, with what it says of its texts."""
    said = f'<param name="{ENCODING}" value={quoteattr(page.encoding or "")}>'
    return _reply(page, f"<html><body>\n<applet>\n{said}\n</applet>\n</body></html>\n")


def list_request(page: Page, host: IPAddress) -> bytes:
    """Return the request for the list of the variables."""
    return _head(page, host, f"GET {page.path.rpartition('/')[0]}/{_LIST}") + b"\r\n"


def list_reply(page: Page) -> bytes:
    """Return the list."""
    rows = "".join(
        f"<variable name={quoteattr(name)}>{where.text}</variable>\n" for name, where in page.variables.items()
    )  # fmt: skip
    return _reply(
        page,
        '<?xml version="1.0" encoding="ISO-8859-1"?>\n<visualisation>\n<time-stamp>0,0</time-stamp>\n'
        f"<variablelist>\n{rows}{_NO_XML if page.broken_list else ''}</variablelist>\n</visualisation>\n",
    )


def _connection(page: Page) -> str:
    return f"Connection: {'keep-alive' if page.kept else 'close'}\r\n"


def _head(page: Page, host: IPAddress, what: str) -> bytes:
    name = f"[{host}]" if host.version == 6 else str(host)
    port = "" if page.port == 80 else f":{page.port}"
    return f"{what} HTTP/1.1\r\nHost: {name}{port}\r\n{_connection(page)}".encode("ascii")


def _reply(page: Page, content: str, status: str = "200 OK") -> bytes:
    body = content.encode("iso-8859-1", "xmlcharrefreplace")
    return f"HTTP/1.1 {status}\r\n{_connection(page)}Content-Length: {len(body)}\r\n\r\n".encode("ascii") + body
