"""HTTP/1 as WebVisu clients and servers speak it: heads of messages, and what their bodies were before they were coded.

Source: RFC 9110 and 9112, and the tolerances of ``webvisu.md`` section 2: any case of names, bare LF, no
Content-Length. Total: no bytes raise.
"""

from __future__ import annotations

import re
import zlib
from enum import IntEnum

from msgspec import Struct
from msgspec.structs import replace

MOST_HEAD_BYTES = 1 << 16
MOST_BODY_BYTES = 1 << 20
"""Longer bodies are passed over, and longer ones are not made of compressed ones."""

_GZIP, _MAGIC_OF_GZIP, _OF_GZIP = ("gzip", "x-gzip"), b"\x1f\x8b", 16 + zlib.MAX_WBITS
_MOST_MEMBERS, _PIECE_BYTES = 256, 1 << 14
"""What is zipped in more members is not read, and it is taken by pieces: each member costs a copy of what is left."""

_MOST_OTHER_BYTES = 2048
_MOST_LENGTH = 1 << 30
_METHODS = b"GET|HEAD|POST|PUT|DELETE|OPTIONS|PATCH|CONNECT|TRACE"
_REQUEST = rb"(?P<method>" + _METHODS + rb") (?P<target>[^\s]{1,%d}) HTTP/1\.[01]\r?\n" % MOST_HEAD_BYTES
_MOST_REASON_BYTES = 1000
_RESPONSE = rb"HTTP/1\.[01] (?P<status>\d{3})(?:[ \t][^\r\n]{0,%d})?\r?\n" % _MOST_REASON_BYTES
_END_OF_HEAD = re.compile(rb"\n\r?\n")
_BLANKS = re.compile(rb"[\r\n]*")
_CHUNK = re.compile(rb"[ \t]*([0-9a-fA-F]{1,8})[ \t]*(?:;[^\n]*)?\r?\n")
_NO_REQUEST = re.compile(rb"\x16[\s\S]|(?!\x16)[\w!#$%&'*+.^`|~-]{0,40}[^\w!#$%&'*+.^`|~ \r\n-]")
"""A byte that is neither of a token (RFC 9110, 5.6.2) nor behind one; of TLS, the second byte tells."""

_NO_BODY = (204, 304)
_FOLD = re.compile(rb"\r?\n[ \t]+")
_FOLDED_FIRST = re.compile(rb"(?:[ \t][^\n]*\n)+")


class Side(IntEnum):
    """Who speaks."""

    CLIENT = 0
    SERVER = 1


class Body(IntEnum):
    """How one finds out where a body ends: it has so many bytes, it is in chunks, or it goes on up to the end."""

    LENGTH = 0
    CHUNKS = 1
    END = 2


_LINES = {Side.CLIENT: re.compile(_REQUEST), Side.SERVER: re.compile(_RESPONSE)}
LONGEST_LINE = {Side.CLIENT: MOST_HEAD_BYTES, Side.SERVER: len(b"HTTP/1.1 200 \r\n") + _MOST_REASON_BYTES}
"""How long the first line of a message may be, with its end: older pages write many variables in one."""

_LONGEST_OTHER_LINE = len(b"CONNECT  HTTP/1.1\r\n") + _MOST_OTHER_BYTES
"""Of what does not begin with a method, so much is looked through for the end of a line."""

_BEGINS = {
    Side.CLIENT: tuple(method + b" " for method in _METHODS.split(b"|")), Side.SERVER: (b"HTTP/1.0 ", b"HTTP/1.1 "),
}  # fmt: skip
_LONGEST_BEGIN = max(len(one) for begins in _BEGINS.values() for one in begins)


class Head(Struct, frozen=True):
    """The head of a message: ``method`` and ``target`` of a request, ``status`` of a response, 0 of a request.

    ``length`` is that of the body in bytes, where ``body`` is ``LENGTH``. ``coding`` is '' where the content is as it
    is. ``expects``: the client may wait for an interim response, and send no body without one (RFC 9110, 10.1.1).
    ``is_unbounded``: its Content-Length is not one number, and nobody knows where it ends (RFC 9112, 6.3).
    """

    body: Body
    length: int
    method: str = ""
    target: str = ""
    status: int = 0
    coding: str = ""
    expects: bool = False
    is_unbounded: bool = False

    @property
    def has_body(self) -> bool:
        """Whether a body of more than no bytes is to come."""
        return self.body is not Body.LENGTH or self.length > 0

    @property
    def is_interim(self) -> bool:
        """Whether it answers nothing: another response follows."""
        return 100 <= self.status < 200


def start_of_message(data: bytes, start: int, stop: int, side: Side) -> int:
    """Return where the next whole start line is, -1 without one."""
    found = _LINES[side].search(data, start, stop)
    return -1 if found is None else found.start()


def longest_line(data: bytes, start: int, stop: int, side: Side) -> int:
    """Return of how many bytes the end of the first line has to be among them, where a message is to begin."""
    longest = LONGEST_LINE[side]
    return longest if data.startswith(_BEGINS[side], start, stop) else min(longest, _LONGEST_OTHER_LINE)


def no_request_at(data: bytes, start: int, stop: int) -> int:
    """Return behind which byte it is known that no request begins there, of whatever method; 0 where it is not."""
    found = _NO_REQUEST.match(data, start, stop)
    return 0 if found is None else found.end()


def keep_from(data: bytes, start: int, stop: int, side: Side) -> int:
    """Return from where on data may hold the begin of a start line that was not found in it."""
    first = max(start, stop - LONGEST_LINE[side])
    if side is Side.SERVER:
        return first
    # A blank stands behind the method, another one behind the target.
    behind_target = data.rfind(b" ", first, stop)
    behind_method = data.rfind(b" ", first, behind_target) if behind_target >= 0 else -1
    last = behind_method if behind_method >= 0 else behind_target if behind_target >= 0 else stop
    return max(first, last - _LONGEST_BEGIN)


def behind_blank_lines(data: bytes, start: int, stop: int) -> int:
    """Return where a message begins that has empty lines in front of it."""
    found = _BLANKS.match(data, start, stop)
    assert found is not None
    return found.end()


def end_of_head(data: bytes, start: int, stop: int) -> int:
    """Return where the head that begins at ``start`` ends, behind its empty line; -1 where that is not there."""
    found = _END_OF_HEAD.search(data, start, stop)
    return -1 if found is None else found.end()


def is_start_line(data: bytes, start: int, stop: int, side: Side) -> bool:
    """Tell whether bytes are the first line of a message, with its end."""
    found = _LINES[side].match(data, start, stop)
    return found is not None and found.end() == stop


def start_line_at(data: bytes, start: int, stop: int, side: Side) -> int:
    """Return where the start line ends that begins at a place; 0 where none does, -1 where more has to come to know."""
    begins = _BEGINS[side]
    # Seldom does one begin there, which few bytes tell.
    if not data.startswith(begins, start, stop):
        begin = data[start : min(stop, start + _LONGEST_BEGIN)]
        return -1 if any(one.startswith(begin) for one in begins) else 0
    most = start + LONGEST_LINE[side]
    end = data.find(b"\n", start, min(stop, most)) + 1
    if end:
        return end if is_start_line(data, start, end, side) else 0
    return -1 if stop < most else 0


def no_start_line_at(data: bytes, start: int, side: Side) -> int:
    """Return up to where one has to read to know that no start line begins at a place, where none does."""
    begins = _BEGINS[side]
    if data.startswith(begins, start):
        most = start + LONGEST_LINE[side]
        return data.find(b"\n", start, most) + 1 or most
    begin = data[start : start + _LONGEST_BEGIN]
    return start + next(
        count for count in range(1, _LONGEST_BEGIN + 1) if not any(one.startswith(begin[:count]) for one in begins)
    )


def target_of(head: bytes) -> str:
    """Return the target of a request of whose head the first line is there, '' where that is not."""
    line = _LINES[Side.CLIENT].match(head)
    return "" if line is None else line["target"].decode("latin-1")


def read_head(head: bytes, side: Side, *, answers_head: bool = False) -> Head | None:
    """Read a head with its empty line; None where it is none.

    Lines that begin with a blank go on with the one before. A response that ``answers_head``, an interim one, and one
    of 204 or 304 has no body whatever it says (RFC 9112, section 5.2 and 6.3).
    """
    line = _LINES[side].match(head)
    if line is None:
        return None
    headers: dict[bytes, list[bytes]] = {}
    for text in _unfolded(head[line.end() :]).split(b"\n"):
        name, colon, value = text.removesuffix(b"\r").partition(b":")
        if colon:
            headers.setdefault(name.lower(), []).append(value.strip(b" \t"))
    if side is Side.SERVER:
        status = int(line["status"])
        if answers_head or 100 <= status < 200 or status in _NO_BODY:
            return Head(Body.LENGTH, 0, status=status)
    chunked = headers.get(b"transfer-encoding", [b""])[-1].rpartition(b",")[2].strip().lower() == b"chunked"
    coding = b",".join(headers.get(b"content-encoding", [])).lower().decode("latin-1")
    length = _length(headers.get(b"content-length", []))
    is_unbounded = length is None and not chunked
    if side is Side.CLIENT:
        method = line["method"].decode("ascii")
        nothing = Body.END if is_unbounded or method in ("POST", "PUT") else Body.LENGTH
        body = Body.CHUNKS if chunked else nothing if is_unbounded or length == _UNTOLD else Body.LENGTH
        target = line["target"].decode("latin-1")
        expects = headers.get(b"expect", [b""])[-1].lower() == b"100-continue"
        size = max(length or 0, 0)
        return Head(body, size, method, target, 0, _coding(coding), expects=expects, is_unbounded=is_unbounded)
    body = Body.CHUNKS if chunked else Body.END if is_unbounded or length == _UNTOLD else Body.LENGTH
    return Head(body, max(length or 0, 0), status=status, coding=_coding(coding), is_unbounded=is_unbounded)


def _unfolded(lines: bytes) -> bytes:
    """Return header lines, each as a whole; there is none with which the first one could go on."""
    if b"\n " not in lines and b"\n\t" not in lines and lines[:1] not in (b" ", b"\t"):
        return lines
    return _FOLD.sub(b" ", _FOLDED_FIRST.sub(b"", lines, count=1) if lines[:1] in (b" ", b"\t") else lines)


_UNTOLD = -1


def _length(values: list[bytes]) -> int | None:
    """Return what Content-Length says, ``_UNTOLD`` without one, None where it is wrong."""
    parts = [part.strip() for value in values for part in value.split(b",")]
    if not parts:
        return _UNTOLD
    if not all(map(bytes.isdigit, parts)):
        return None
    told = {part.lstrip(b"0") or b"0" for part in parts}
    text = told.pop()
    if told or len(text) > len(str(_MOST_LENGTH)) or int(text) > _MOST_LENGTH:
        return None
    return int(text)


def _coding(told: str) -> str:
    return "" if told in ("", "identity") else told


class Chunked(Struct, frozen=True):
    """What was found of a body in chunks: where it ends, and what is in it.

    ``stop`` is -1 where that is not there yet; ``content`` is what there is. ``wrong_at`` is up to where one has to
    read to know that these are no chunks, -1 where they are.
    """

    stop: int = -1
    content: bytes = b""
    wrong_at: int = -1


class Chunks:
    """A body in chunks of which more comes again and again: what was read of it is not read anew."""

    __slots__ = ("_at", "_begun", "_parts", "_trailers_at")

    def __init__(self) -> None:
        # Counted from the begin of the body: what was read, and where the trailers begin, -1 before they do.
        self._at = 0
        self._trailers_at = -1
        self._parts: list[bytes] = []
        # What is there of the chunk that has begun.
        self._begun = slice(0, 0)

    def read(self, data: bytes, start: int, stop: int) -> Chunked:
        """Read on in a body that begins at ``start``; ``content`` is empty until it ends."""
        at, self._begun = start + self._at, slice(0, 0)
        while self._trailers_at < 0:
            line = _line(data, at, stop, MOST_HEAD_BYTES)
            if line <= 0:
                return Chunked(wrong_at=-line or -1)
            head = _CHUNK.match(data, at, line)
            if head is None or head.end() != line or (size := int(head[1], 16)) > _MOST_LENGTH:
                return Chunked(wrong_at=line)
            if not size:
                self._at = self._trailers_at = line - start
                at = line
                break
            end = behind = line + size
            if behind < stop and data[behind] == ord("\r"):
                behind += 1
            if behind >= stop:
                self._begun = slice(line, min(end, stop))
                return Chunked()
            if data[behind] != ord("\n"):
                self._begun = slice(line, end)
                return Chunked(wrong_at=behind + 1)
            self._parts.append(data[line:end])
            at = behind + 1
            self._at = at - start
        while True:
            line = _line(data, at, stop, MOST_HEAD_BYTES - (self._at - self._trailers_at))
            if line <= 0:
                return Chunked(wrong_at=-line or -1)
            if not data[at:line].strip(b"\r\n"):
                return Chunked(line, b"".join(self._parts))
            at = line
            self._at = at - start

    def whole_up_to(self, data: bytes, start: int, stop: int) -> bytes | None:
        """Return the content of the chunks of a body that goes up to ``stop``; None where one of them is not whole."""
        self.read(data, start, stop)
        return b"".join(self._parts) if self._trailers_at >= 0 or start + self._at == stop else None

    def so_far(self, data: bytes) -> bytes:
        """Return the content that was found, in the same data as ``read`` found it last."""
        return b"".join([*self._parts, data[self._begun]])


def body_up_to(data: bytes, start: int, stop: int, head: Head, chunks: Chunks) -> bytes | None:
    """Return what is in a body that does not say how long it is, and that ends at ``stop``, wherever it is by then.

    It is in its coding; None where a chunk is not whole. ``chunks`` are those that were read of it.
    """
    return data[start:stop] if head.body is Body.END else chunks.whole_up_to(data, start, stop)


def read_chunks(data: bytes, start: int, stop: int) -> Chunked:
    """Read a body in chunks that is there as far as it ever will be."""
    chunks = Chunks()
    found = chunks.read(data, start, stop)
    return found if found.stop >= 0 else replace(found, content=chunks.so_far(data))


def _line(data: bytes, start: int, stop: int, most_bytes: int) -> int:
    """Return where a line ends, with its end; 0 where that is not there, ``-at`` where it is too long."""
    found = data.find(b"\n", start, min(stop, start + most_bytes))
    if found >= 0:
        return found + 1
    return -(start + most_bytes) if stop - start >= most_bytes else 0


def decoded(content: bytes, coding: str) -> bytes | None:
    """Return what a coded content was; None where it cannot be decoded, or is longer than ``MOST_BODY_BYTES``."""
    if not coding:
        return content if len(content) <= MOST_BODY_BYTES else None
    if coding in _GZIP:
        found, is_whole = _unzipped(content, MOST_BODY_BYTES + 1)
        return found if is_whole and len(found) <= MOST_BODY_BYTES else None
    if coding == "deflate":
        inflated = _inflated(content, zlib.MAX_WBITS)
        return _inflated(content, -zlib.MAX_WBITS) if inflated is None else inflated
    return None


def begin_of(content: bytes, coding: str, most_bytes: int) -> bytes:
    """Return the first bytes of what a coded content was, as far as it can be decoded."""
    if not coding:
        return content[:most_bytes]
    if coding in _GZIP:
        return _unzipped(content, most_bytes)[0]
    for bits in (zlib.MAX_WBITS, -zlib.MAX_WBITS) if coding == "deflate" else ():
        try:
            return zlib.decompressobj(bits).decompress(content, most_bytes)
        except zlib.error:
            continue
    return b""


def _unzipped(content: bytes, most_bytes: int) -> tuple[bytes, bool]:
    """Return the first bytes of what was zipped, and whether all of it is there: all members of it (RFC 1952, 2.2).

    What is behind them, and no member, is ignored. Of a member that is damaged there is nothing.
    """
    found, at = b"", 0
    for _ in range(_MOST_MEMBERS):
        inflater, parts, room = zlib.decompressobj(_OF_GZIP), [found], most_bytes - len(found)
        while not inflater.eof and room and at < len(content):
            piece = content[at : at + _PIECE_BYTES]
            try:
                parts.append(inflater.decompress(piece, room))
            except zlib.error:
                return found, False
            room -= len(parts[-1])
            at += len(piece) - len(inflater.unconsumed_tail) - len(inflater.unused_data)
        found = b"".join(parts)
        if not inflater.eof:
            return found, False
        if not content.startswith(_MAGIC_OF_GZIP, at):
            return found, True
    return found, False


def _inflated(content: bytes, bits: int) -> bytes | None:
    inflater = zlib.decompressobj(bits)
    try:
        found = inflater.decompress(content, MOST_BODY_BYTES + 1)
    except zlib.error:
        return None
    return found if inflater.eof and len(found) <= MOST_BODY_BYTES else None
