"""Heads of HTTP messages: start lines and fields, and what they say of where bodies end.

``tests.oracle.rules.http`` has the readings.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from tests.oracle.rules.http_bodies import MOST_HEAD, MOST_LENGTH, Foreign, line, line_end
from tests.oracle.rules.http_message import Lost, Message

METHODS = rb"GET|HEAD|POST|PUT|DELETE|OPTIONS|PATCH|CONNECT|TRACE"
REQUEST_LINE = re.compile(rb"(%s) (\S+) HTTP/1\.[01]" % METHODS)
STATUS_LINE = re.compile(rb"HTTP/1\.[01] (\d\d\d)(?:[ \t][^\r\n]{0,1000})?")
REQUEST_SOMEWHERE = re.compile(rb"(?:%s) \S{1,65536} HTTP/1\.[01]\r?\n" % METHODS)
STATUS_SOMEWHERE = re.compile(rb"HTTP/1\.[01] \d\d\d(?:[ \t][^\r\n]{0,1000})?\r?\n")
LONGEST_REQUEST_LINE, LONGEST_STATUS_LINE = MOST_HEAD, 1000 + len("HTTP/1.1 200 \r\n")
LONGEST_OTHER_LINE = 2048 + len("CONNECT  HTTP/1.1\r\n")


@dataclass
class Head:
    """A start line, the fields by lower-case name, and where the body begins."""

    message: Message
    fields: dict[bytes, list[bytes]]
    end: int


def start_line(buffer: bytes, response: bool) -> tuple[Message, int] | None:
    """Return what the start line says, and where it ends."""
    most = LONGEST_STATUS_LINE if response else LONGEST_REQUEST_LINE
    if not response and buffer.split(b" ")[0] + b" " not in [one + b" " for one in METHODS.split(b"|")]:
        most = LONGEST_OTHER_LINE
    try:
        end = line_end(buffer, 0, 0, most)
    except Foreign as wrong:
        begins = (b"HTTP/1.",) if response else tuple(one + b" " for one in METHODS.split(b"|"))
        wrong.too_long = buffer.startswith(begins)
        raise
    if end is None:
        return None
    found = (STATUS_LINE if response else REQUEST_LINE).fullmatch(line(buffer, 0, end))
    if found is None:
        raise Foreign(0)
    return (Message(status=int(found[1])) if response else Message(method=found[1], target=found[2])), end


def head_of(buffer: bytes, response: bool) -> Head | None:
    """Return the head; None where it has not come whole."""
    started = start_line(buffer, response)
    if started is None:
        return None
    message, first = started
    fields: dict[bytes, list[bytes]] = {}
    at, last = first, list[bytes]()
    while True:
        end = buffer.find(b"\n", at) + 1
        if (end or len(buffer) + 1) > MOST_HEAD:
            raise Foreign(first, too_long=True)
        if not end:
            return None
        text = line(buffer, at, end)
        if not text:
            return Head(message, fields, end)
        at = end
        if text[:1] in (b" ", b"\t"):
            if last:
                last[-1] = (last[-1] + b" " + text.strip(b" \t")).strip(b" \t")
            continue
        name, colon, value = text.partition(b":")
        last = fields.setdefault(name.lower(), []) if colon else []
        last.append(value.strip(b" \t"))


def too_long(buffer: bytes, response: bool) -> Lost:
    """Return what is lost with a message whose head is too long: nobody knows how its body begins."""
    if response:
        return Lost(Message(cut=True, whole=False, unread=True), in_step=True)
    query = re.match(rb"GET \S*(?:READ|WRITE)PI\?", buffer[:MOST_HEAD], re.IGNORECASE)
    if not (query or buffer.startswith(b"POST ")):
        return Lost()
    return Lost(Message(method=b"POST", cut=True, whole=False, unread=True, seen=b"|1|"))


NO_BODY, TO_THE_END, CHUNKED = "none", "to the end", "chunked"


def framing(head: Head, response: bool, to_head: bool) -> int | str:
    """Return the length of the body, or how its end is found."""
    status = head.message.status
    if response and (100 <= status < 200 or status in (204, 304) or to_head):
        return NO_BODY
    codings = [one.strip().lower() for value in head.fields.get(b"transfer-encoding", []) for one in value.split(b",")]
    if codings and codings[-1] == b"chunked":
        return CHUNKED
    lengths = head.fields.get(b"content-length")
    if lengths:
        told = [one.strip() for value in lengths for one in value.split(b",")]
        numbers = {int(length.lstrip(b"0")[:20] or b"0") for length in told if re.fullmatch(rb"\d+", length)}
        if all(re.fullmatch(rb"\d+", length) for length in told) and len(numbers) == 1 and max(numbers) <= MOST_LENGTH:
            return numbers.pop()
        head.message.unbounded = True
        return TO_THE_END
    return TO_THE_END if response or head.message.method in (b"POST", b"PUT") else NO_BODY
