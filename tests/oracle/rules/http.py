"""HTTP in one direction of a connection: messages found in bytes and holes.

What is there of a message is read anew from its first byte whenever more of it comes: slow, and easy to follow.

Readings, where the rules leave a choice:

- from the client only requests are understood, from the server only responses
- a start line is judged when its end has come, or when more has come than the longest one has: a request's has 64 KiB,
  what does not begin with a method and a blank is none where 2067 bytes have no end; other lines when 64 KiB have come
  without an end
- what a client begins with, where its connection does, is none with the first byte that is neither of a token of at
  most 40 letters (RFC 9110) nor a blank or line end
- a request whose head has more than 64 KiB is lost, and a page's where it is a POST or a query of an older page; a
  response of that kind may be one to a page
- where the body of a POST is not known, its first 64 bytes tell whether it is a page's, decoded as far as that goes
- behind three digits of a status comes the line's end, or a space and anything
- a search goes on behind the first byte of what is foreign: what was taken for its head may be that of the next one
- header lines without a colon mean nothing, and a line that begins with a blank goes on with the one before, if
  there is any; a name ends where its colon stands
- where Content-Length is needed, and is not one number of at most 2^30, nobody knows where a message ends: a request
  does so in front of the next start line, if it is not answered before, as one without a length; a response is there
  with its head, and the next one is searched for
- whether a response has no body (1xx, 204, 304, to HEAD) is looked at first, then chunked, then Content-Length: what is
  not needed is not wrong
- a response is one to HEAD where the first request that waits when its head is whole is one, or, where none waits, the
  one that is being received, of which the head is there, and that nothing has answered
- the size of a chunk is 1 to 8 digits, at most 2^30, with blanks at most around it; its line, and the trailers, have at
  most 64 KiB; where that is not so, nobody knows where the message ends, and nobody reads it
- Content-Encoding: identity, and nothing, are none; all that is neither those nor known cannot be decoded. A stream of
  gzip has up to 256 members (RFC 1952); what follows them, or a whole stream of deflate, is ignored. An empty body that
  is said to be encoded is not decoded either
- a hole while the direction searches breaks the pairing once more; in step, one from the server is where the response
  is to the first request that waits
- a response is being received where its status line is whole
- a request is open where its head is whole and it is in chunks, or has a body and does not say how long that is. It
  ends where it is answered: with its content where chunks are whole, one of chunks that end within one has none; and
  where the connection is reset, with what came before that
- who sends Expect: 100-continue may send no body: where a whole start line stands in its place, the request is a part,
  and so is an open one that is answered before anything of its body. Where a direction began before the capture, its
  final responses are late up to the first one that has a body: those may be ones to HEAD, of which the same tells.
  Empty lines in front of that are none of a body, unless so many are there that they are all of it.
  While what is there may become a start line, it is none of a body of known length, or of such a response. The same
  tells it of all responses behind that, and behind a place where one of both directions lost step: how many requests
  are missing there nobody knows. Up to the first one with a body, bytes that are missing there, behind a head, are not
  known to be of a body
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from tests.oracle.rules.http_bodies import (
    BEGIN,
    BEGIN_OF_LIST,
    MOST_BODY,
    Foreign,
    begin,
    chunks,
    coding_of,
    decoded,
    whole_chunks,
)
from tests.oracle.rules.http_heads import (
    CHUNKED,
    LONGEST_REQUEST_LINE,
    LONGEST_STATUS_LINE,
    METHODS,
    NO_BODY,
    REQUEST_LINE,
    REQUEST_SOMEWHERE,
    STATUS_LINE,
    STATUS_SOMEWHERE,
    TO_THE_END,
    Head,
    framing,
    head_of,
    start_line,
    too_long,
)
from tests.oracle.rules.http_message import Lost, Message
from tests.oracle.rules.streams import Delivery

TOKEN = frozenset(b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_!#$%&'*+.^`|~-")


def is_foreign(begin: bytes) -> bool:
    """Whether a byte shows that this begins no request, of whatever method."""
    if begin[:1] == b"\x16":  # of TLS, the second byte tells
        return len(begin) > 1
    other = next((byte for byte in begin[:41] if byte not in TOKEN), None)
    return other is not None and other not in b" \r\n"


class Reader:
    """One direction of a connection; ``first_is_head`` tells whether the first request that waits is HEAD."""

    def __init__(
        self,
        response: bool,
        in_step: bool,
        first_is_head: Callable[[], bool],
        happened: Counter[str] | None = None,
    ) -> None:
        self.response = response
        self.in_step = in_step
        self.is_first = in_step and not response
        self.first_is_head = first_is_head
        self.is_late = self.is_wary = self.may_answer_head = response and not in_step
        self.happened: Counter[str] = Counter() if happened is None else happened
        self.buffer = b""
        self.missing_at: int | None = None
        """Where in the buffer the first missing byte is; missing ones are there as zeros."""
        self.head: Head | None = None
        self.framing: int | str = NO_BODY
        self.latest: int | None = None
        self.sequence = 0
        self.told: int | None = None

    def be_wary(self) -> None:
        """Take that one of both directions has lost step: responses may answer HEAD, which nobody saw."""
        self.is_wary = self.may_answer_head = self.response

    @property
    def receiving(self) -> bool:
        """Whether a message has begun and not ended."""
        return self.in_step and self.buffer != b""

    @property
    def open(self) -> bool:
        """Whether a request has begun that does not say where it ends."""
        return self.head is not None and not self.response and self.framing in (TO_THE_END, CHUNKED)

    @property
    def begun(self) -> bool:
        """Whether a request has begun that says where it ends, and its head is there."""
        return self.head is not None and not self.response and isinstance(self.framing, int)

    def answered(self, by_reset: bool = False) -> Message:
        """Take the open request for whole, since something answers it."""
        assert self.head is not None
        body: bytes | None = self.buffer[self.head.end :]
        chunks_so_far = b""
        if self.framing == CHUNKED:
            body = whole_chunks(self.buffer, self.head.end)
            if body is None:
                chunks_so_far, _ = chunks(self.buffer, self.head.end)
        self.happened["open request answered"] += 1
        self.happened["open request answered within a chunk"] += body is None
        is_part = self.expects and len(self.buffer) == self.head.end and not by_reset
        head, message = self.head, self.whole(len(self.buffer), body)
        message.head_at = message.behind = message.told = None
        message.body, message.part = None if body is None else decoded(head.fields, body), is_part
        message.unread = message.body is None and not (by_reset and body is None)
        if body is None:
            message.seen = begin(head.fields, chunks_so_far)
        return message

    def malformed(self, content: bytes) -> Lost:
        """Return what is lost where chunks are none, behind so much that is in some."""
        assert self.head is not None
        known, most = self.head.message, BEGIN_OF_LIST if self.response else BEGIN
        seen = begin(self.head.fields, content, most)
        self.happened["malformed chunks"] += 1
        message = Message(known.method, known.target, known.status, None, seen, cut=True, whole=False)
        message.unread = message.malformed = True
        return Lost(message, in_step=self.response)

    def take(self, event: Delivery) -> Iterator[Message | Lost]:
        """Take bytes, or missing ones."""
        known = event.behind, event.told
        return self.hole(event.missing, *known) if event.missing else self.feed(event.data, event.time, *known)

    def feed(self, data: bytes, time: int, behind: int = 0, told: int | None = None) -> Iterator[Message | Lost]:
        self.sequence, self.told = behind, told
        self.latest = time
        self.buffer += data
        yield from self.advance()

    def hole(self, size: int, behind: int = 0, told: int | None = None) -> Iterator[Message | Lost]:
        self.sequence, self.told = behind, told
        head, length = self.head, self.framing
        unsure = self.is_wary and not self.is_late and head is not None and self.other_begins(head.end) is not False
        if head is not None and not unsure and isinstance(length, int) and len(self.buffer) + size <= head.end + length:
            self.happened["hole in a body of known length"] += 1
            self.missing_at = len(self.buffer) if self.missing_at is None else self.missing_at
            self.buffer += bytes(size)
            yield from self.advance()
            return
        dropped = self.so_far()
        if head is not None:
            self.happened["hole over the end of a body" if isinstance(length, int) else f"hole in a body {length}"] += 1
        elif self.receiving:
            self.happened["hole in a head"] += 1
        else:
            self.happened["hole between messages" if self.in_step else "hole while searching"] += 1
        self.next_message(b"")
        in_step, self.in_step = self.in_step, False
        self.be_wary()
        yield Lost(dropped, in_step, missing=True, told=told, size=size, behind=behind)

    def end(self, reset: bool, time: int) -> Iterator[Message | Lost]:
        """End the direction: a message may end with it; what is not whole is told of a request, or where it is cut."""
        before, self.latest = self.latest, time
        message = self.so_far()
        if reset and self.open:
            self.latest = before
            message = self.answered(by_reset=True)
            message.broken_off = True
            self.happened["open request broken off"] += 1
            yield message
        elif self.head is not None and message is not None:
            if self.framing == TO_THE_END:
                self.happened["body to the end"] += 1
                nobody_knows = self.response and self.head.message.unbounded
                message = self.whole(len(self.buffer), None if nobody_knows else self.buffer[self.head.end :])
                message.body = None if nobody_knows else message.body
                message.head_at = message.behind = message.told = None
                yield message
            elif self.response:
                self.happened["response not whole at the end"] += 1
                message.part = self.missing_at is None
                yield message
            else:
                message.part, message.cut = self.missing_at is None, self.missing_at is not None
                self.happened["part of a request" if message.part else "part of a cut request"] += 1
                yield message
        self.next_message(b"")

    def so_far(self) -> Message | None:
        """Return what was seen of the message that is being received, as cut."""
        if not self.receiving:
            return None
        if self.head is not None:
            known = self.head.message
            end = len(self.buffer) if self.missing_at is None else self.missing_at
            seen = self.buffer[self.head.end : end]
            if self.framing == CHUNKED:
                seen, _ = chunks(self.buffer, self.head.end)
            seen = self.begin_of(seen)
            return Message(known.method, known.target, known.status, None, seen, True, False, self.latest or 0)
        started = start_line(self.buffer, self.response)
        if started is not None:
            message = started[0]
        elif not self.response and self.buffer.split(b" ")[0] == b"POST":
            message = Message(method=b"POST")
        else:
            return None
        message.cut, message.whole = True, False
        return message

    def advance(self) -> Iterator[Message | Lost]:
        """Yield what has become whole."""
        while True:
            if not self.in_step:
                found = (STATUS_SOMEWHERE if self.response else REQUEST_SOMEWHERE).search(self.buffer)
                if found is None:
                    return
                self.happened["found by searching"] += 1
                self.buffer = self.buffer[found.start() :]
                self.in_step = True
            if self.head is None:
                self.buffer = self.buffer.lstrip(b"\r\n")
            try:
                message = self.message()
            except Foreign as wrong:
                self.happened["foreign"] += 1
                lost = too_long(self.buffer, self.response) if wrong.too_long else Lost()
                if wrong.behind_chunks is not None:
                    lost = self.malformed(wrong.behind_chunks)
                self.next_message(self.buffer[1:])
                self.in_step = False
                self.be_wary()
                lost.told = self.told
                yield lost
                continue
            if message is None:
                return
            yield message

    def message(self) -> Message | None:
        """Return the message in the buffer if it is whole, and take it out."""
        if self.head is None:
            if self.is_first and is_foreign(self.buffer):
                raise Foreign(0)
            self.head = head_of(self.buffer, self.response)
            if self.head is None:
                return None
            self.framing = framing(self.head, self.response, self.response and self.first_is_head())
        begin = self.head.end
        if (self.may_answer_head if self.response else self.expects) and self.framing not in (NO_BODY, 0):
            other = self.other_begins(begin)
            if other:
                return self.without_body()
            if other is None and (self.response or isinstance(self.framing, int)):
                return None
        if self.framing == NO_BODY:
            return self.whole(begin, None)
        if self.head.message.unbounded:
            return self.without_end(begin)
        if self.framing == TO_THE_END:
            return None
        if self.framing == CHUNKED:
            content, end = chunks(self.buffer, begin)
            self.happened["chunked"] += end is not None
            return None if end is None else self.whole(end, content)
        assert isinstance(self.framing, int)
        end = begin + self.framing
        return self.whole(end, self.buffer[begin:end]) if len(self.buffer) >= end else None

    @property
    def expects(self) -> bool:
        assert self.head is not None
        return self.head.fields.get(b"expect", [b""])[-1].lower() == b"100-continue"

    def other_begins(self, at: int) -> bool | None:
        """Tell whether a start line stands in the place of a body; None where more has to come to know."""
        body, at = at, len(self.buffer) - len(self.buffer[at:].lstrip(b"\r\n"))
        if isinstance(self.framing, int) and at - body >= self.framing:
            return False
        most = LONGEST_STATUS_LINE if self.response else LONGEST_REQUEST_LINE
        text = self.buffer[at : at + most]
        if b"\n" in text:
            first = text[: text.find(b"\n")].removesuffix(b"\r")
            return (STATUS_LINE if self.response else REQUEST_LINE).fullmatch(first) is not None
        starts = [b"HTTP/1.0 ", b"HTTP/1.1 "] if self.response else [one + b" " for one in METHODS.split(b"|")]
        may_be = any(one.startswith(text) or text.startswith(one) for one in starts)
        return None if may_be and len(text) < most else False

    def without_body(self) -> Message:
        """Take the message for one without a body, though its head says that there is one."""
        assert self.head is not None
        self.happened["response to HEAD that was not captured" if self.response else "body that was not sent"] += 1
        known = self.is_late, self.is_wary
        message = self.whole(self.head.end, None)
        self.is_late, self.is_wary = known
        message.part, message.unasked, message.begin_at = not self.response, self.response, None
        return message

    def without_end(self, begin: int) -> Message | None:
        """Return a message of which nobody knows where it ends, if it is known that it does."""
        other = None if self.response else REQUEST_SOMEWHERE.search(self.buffer, begin)
        if other is not None:
            return self.whole(other.start(), self.buffer[begin : other.start()])
        if not self.response:
            return None
        message = self.whole(begin, None)
        message.body, self.in_step = None, False
        return message

    def whole(self, end: int, content: bytes | None) -> Message:
        """Take the message, up to ``end``, out of the buffer; ``content`` None says that it has no body."""
        assert self.head is not None
        message = self.head.message
        message.cut = self.missing_at is not None
        if message.cut:
            message.seen = self.begin_of(self.buffer[self.head.end : self.missing_at])
        else:
            message.seen = content or b""
            message.body = b"" if content is None else decoded(self.head.fields, content)
            message.unread = message.body is None
            if message.unread:
                message.seen = self.begin_of(message.seen)
            self.happened["body not known"] += message.body is None
            self.happened["body decoded"] += message.body not in (None, message.seen)
        message.arrival, message.told = self.latest or 0, self.told
        left = [len(self.buffer) - at for at in (self.head.end, end)]
        message.head_at, message.behind = [(self.sequence - one) % 2**32 for one in left]
        if message.cut or end - self.head.end > MOST_BODY:
            message.head_at = message.behind
        elif self.framing == NO_BODY or isinstance(self.framing, int):
            message.begin_at = (self.sequence - len(self.buffer)) % 2**32
        message.late = self.is_late and not 100 <= message.status < 200
        if self.framing not in (NO_BODY, 0):
            self.is_late = self.is_wary = False
        self.next_message(self.buffer[end:])
        return message

    def begin_of(self, seen: bytes) -> bytes:
        """Return what is known of a body of which so much was seen: the first bytes where it is coded."""
        assert self.head is not None
        if not coding_of(self.head.fields) and len(seen) <= MOST_BODY:
            return seen
        return begin(self.head.fields, seen, BEGIN_OF_LIST if self.response else BEGIN)

    def next_message(self, buffer: bytes) -> None:
        self.buffer, self.missing_at, self.head, self.framing = buffer, None, None, NO_BODY
        self.is_first = False
