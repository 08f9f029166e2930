"""HTTP to one controller: whom it may go to, how long it may take, and how much may come.

Every request is a connection of its own. Nothing is followed that a reply redirects to, no proxy is asked, and the
name of the controller is looked up once: what was allowed is what is connected to.
"""

from __future__ import annotations

import http.client
import socket
import time
import zlib
from collections.abc import Sequence
from typing import Any

import urllib3
from urllib3.connection import HTTPConnection

from dissectors.http import MOST_BODY_BYTES, decoded
from nvscope.errors import CaptureError, UsageError
from nvscope.plc.permission import is_near, plain_address, refuse_far
from nvscope.plc.visu.exchange import TIMEOUT_NS, Ending, Exchange
from nvscope.plc.visu.url import VisuUrl

_PIECE_BYTES = 1 << 16
_MOST_BYTES = 8 * MOST_BODY_BYTES
"""So much may come in all, of heads, and of chunks however small: what reads them would take any length for one."""

_FIRST_BYTES = "HTTP/"
_ANY_WINDOW = 32 + zlib.MAX_WBITS
"""What is compressed as gzip or zlib has it, whichever it is."""
_LONGEST_LOCATION, _LONGEST_WHY = 300, 200
_HEADERS = {"Accept": "*/*", "Accept-Encoding": "identity", "Connection": "close", "User-Agent": "nvscope"}

Address = tuple[int, Any]
"""A family of addresses, and an address with its port as sockets take it."""


class VisuLink:
    """Asks one controller; UsageError where nothing may be sent there, CaptureError where nobody knows its name."""

    def __init__(self, url: VisuUrl, *, allow_network: bool = False, timeout_ns: int = TIMEOUT_NS) -> None:
        self.url = url
        self._timeout_ns = timeout_ns
        self._addresses = _resolved(url)
        found = [str(plain_address(target[0])) for _, target in self._addresses]
        for address in found:
            one = plain_address(address)
            if one.is_multicast or one.is_unspecified or address == "255.255.255.255":
                raise UsageError(f"{address} is no node", next_step="name the address of the controller")
            if not allow_network and not is_near(address):
                raise refuse_far(address)
        self.address = found[0]

    def get(self, path: str) -> Exchange:
        """Ask for a file."""
        return self._ask("GET", path, None)

    def post(self, path: str, body: bytes) -> Exchange:
        """Ask for variables, or write them."""
        return self._ask("POST", path, body)

    def _ask(self, method: str, path: str, body: bytes | None) -> Exchange:
        begun_ns = time.monotonic_ns()
        deadline = _Deadline(begun_ns + self._timeout_ns)
        connected: _TimedSocket | None = None
        status, location = None, ""
        try:
            try:
                connected = self._connected(deadline)
            except OSError as error:
                ending = Ending.SILENT if isinstance(error, TimeoutError) else Ending.UNDELIVERED
                return Exchange(method, path, ending, why=_why(error))
            connection = _Connection(self.url, connected)
            typed = {"Content-Type": "application/x-www-form-urlencoded"} if body is not None else {}
            connection.request(method, path, body, _HEADERS | typed, preload_content=False)
            with connection.getresponse() as response:
                if connected.is_ended:
                    # What reads heads takes the end for that of the head: nobody knows what else would have come.
                    raise http.client.RemoteDisconnected("the connection ended within the head")
                status = response.status
                location = response.headers.get("Location", "")[:_LONGEST_LOCATION]
                content = _content(response)
                coding = response.headers.get("Content-Encoding", "").lower()
        except _TooMuch as error:
            return Exchange(method, path, Ending.OVERSIZED, status, why=_why(error), location=location)
        except (http.client.HTTPException, urllib3.exceptions.HTTPError, OSError, ValueError) as error:
            # A ValueError comes where a chunk has a length below 0.
            is_cut = connected is not None and connected.is_ended
            ending = _ending_of(error, is_over=deadline.is_over, is_cut=is_cut)
            # What is no HTTP behind a head is what parts its body.
            is_malformed = status is not None and ending is Ending.NO_HTTP
            why = "its chunks are malformed" if is_malformed else _why(error)
            return Exchange(method, path, ending, status, why=why, location=location)
        finally:
            if connected is not None:
                connected.close()
        latency_ns = time.monotonic_ns() - begun_ns
        if content is None:
            why = f"more than {MOST_BODY_BYTES} bytes"
            return Exchange(method, path, Ending.OVERSIZED, status, why=why, location=location)
        body = decoded(content, "" if coding == "identity" else coding)
        if body is None:
            if _is_longer(content):
                why = f"more than {MOST_BODY_BYTES} bytes"
                return Exchange(method, path, Ending.OVERSIZED, status, why=why, location=location)
            why = f"its body is no {coding}"[:_LONGEST_WHY]
            return Exchange(method, path, Ending.NO_HTTP, status, why=why, location=location)
        return Exchange(method, path, Ending.REPLIED, status, body, latency_ns, location=location)

    def _connected(self, deadline: _Deadline) -> _TimedSocket:
        for place, (family, target) in enumerate(self._addresses):
            one = _TimedSocket(family, deadline)
            try:
                one.settimeout(deadline.left_s())
                one.connect(target)
            except OSError:
                one.close()
                if place == len(self._addresses) - 1:
                    raise
            else:
                return one
        raise AssertionError("a name without an address")


def _resolved(url: VisuUrl) -> Sequence[Address]:
    try:
        found = socket.getaddrinfo(url.host, url.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise CaptureError(
            f"nobody knows this name: {_why(error)}", where=url.host,
            next_step="check the name, or write the address of the controller",
        ) from error  # fmt: skip
    return [(int(family), target) for family, _, _, _, target in found]


def _content(response: Any) -> bytes | None:
    """Return the body of a reply as it was coded; None where it is too long."""
    content = bytearray()
    while piece := response.read(_PIECE_BYTES, decode_content=False):
        content += piece
        if len(content) > MOST_BODY_BYTES:
            return None
    return bytes(content)


def _is_longer(content: bytes) -> bool:
    """Tell whether a compressed body is longer than one may be."""
    try:
        return len(zlib.decompressobj(_ANY_WINDOW).decompress(content, MOST_BODY_BYTES + 1)) > MOST_BODY_BYTES
    except zlib.error:
        return False


def _ending_of(error: BaseException, *, is_over: bool, is_cut: bool) -> Ending:
    """Return how an exchange ended by an error. ``is_cut``: the other side had ended the connection then."""
    if isinstance(error, TimeoutError | urllib3.exceptions.TimeoutError) or is_over:
        return Ending.SILENT
    if isinstance(error, http.client.BadStatusLine) and not isinstance(error, OSError):
        begins = str(error)[: len(_FIRST_BYTES)]
        return Ending.BROKEN if is_cut and _FIRST_BYTES.startswith(begins) else Ending.NO_HTTP
    # urllib3 wraps what is wrong within a body.
    cause = error.args[-1] if isinstance(error, urllib3.exceptions.ProtocolError) and error.args else error
    if _has_long_head(cause):
        return Ending.OVERSIZED
    return Ending.BROKEN if is_cut or isinstance(cause, OSError) else Ending.NO_HTTP


def _has_long_head(error: BaseException) -> bool:
    """Tell whether a head, whose first line is one of HTTP, is longer than the library reads."""
    if isinstance(error, http.client.LineTooLong):
        return "status line" not in str(error)
    # Of more than 100 headers, it raises what all others are of.
    return type(error) is http.client.HTTPException


def _why(error: BaseException) -> str:
    if isinstance(error, TimeoutError):
        return "timed out"
    # urllib3 wraps what is wrong within a body, and says it twice.
    cause = error.args[-1] if isinstance(error, urllib3.exceptions.ProtocolError) and error.args else error
    if isinstance(cause, http.client.IncompleteRead):
        return "its body is not whole"
    told = str(getattr(cause, "strerror", None) or cause).strip() or type(cause).__name__
    if _has_long_head(error):
        told = told.removeprefix("got ").replace("when reading header line", "in one header")
    return told[:_LONGEST_WHY]


class _TooMuch(Exception):
    """More came than any reply has."""


class _Deadline:
    """When an exchange is over, however slowly bytes come."""

    def __init__(self, end_ns: int) -> None:
        self._end_ns = end_ns

    @property
    def is_over(self) -> bool:
        return time.monotonic_ns() >= self._end_ns

    def left_s(self) -> float:
        """Return the time that is left; TimeoutError where that is none."""
        left_ns = self._end_ns - time.monotonic_ns()
        if left_ns <= 0:
            raise TimeoutError
        return left_ns / 1e9


class _TimedSocket(socket.socket):
    """A socket all of whose waits end at one time: a timeout of each would wait for every byte anew.

    What is sent goes when something is waited for, head and body in one piece: small servers may look at no more than
    what comes first.
    """

    def __init__(self, family: int, deadline: _Deadline) -> None:
        super().__init__(family, socket.SOCK_STREAM)
        self._deadline = deadline
        self._held = b""
        self.is_ended = False
        """Whether all that will come has come."""

        self._left_bytes = _MOST_BYTES

    def sendall(self, data: Any, *flags: int) -> None:
        self._held += bytes(data)

    def recv_into(self, *words: Any) -> int:
        self.settimeout(self._deadline.left_s())
        if self._held:
            held, self._held = self._held, b""
            super().sendall(held)
            self.settimeout(self._deadline.left_s())
        taken = super().recv_into(*words)
        self.is_ended = not taken
        self._left_bytes -= taken
        if self._left_bytes < 0:
            raise _TooMuch(f"more than {_MOST_BYTES} bytes")
        return taken


class _Connection(HTTPConnection):
    """A connection over a socket that is there already."""

    def __init__(self, url: VisuUrl, connected: socket.socket) -> None:
        super().__init__(url.host, url.port)
        self._connected = connected

    def connect(self) -> None:
        self.sock = self._connected
