"""HttpReader: where a stream of HTTP is, and what is found when more of it comes.

What is found, and up to which byte one has to read to find it, does not depend on how much comes at a time.
"""

from __future__ import annotations

from msgspec.structs import replace

from dissectors import http
from dissectors.http import MOST_BODY_BYTES, MOST_HEAD_BYTES, Body, Head, Side
from dissectors.web_protocols import protocol_of_bytes
from dissectors.webvisu import Likeness
from nvscope.tracker.visu.answering import Answering
from nvscope.tracker.visu.http_forms import NOT_BEGUN, Form, Forms, What
from nvscope.tracker.visu.lost_messages import FOREIGN, long_head_form, lost_form
from nvscope.tracker.visu.open_requests import open_form, unbounded_form
from nvscope.tracker.visu.part_requests import OpenRequest, behind_body, bodiless, end_form, head_in, part_form
from nvscope.tracker.visu.same_messages import DIFFERING, take_known, take_same
from nvscope.tracker.visu.unread_requests import passed_form, unread_form, unread_response

_MOST_CHUNKED_BYTES = 2 * MOST_BODY_BYTES
_ENDLESS = 1 << 62
END_OF_HEAD = b"\r\n\r\n"


class HttpReader(Answering):
    """One direction of a connection.

    ``rest`` are the bytes of the message that has begun; they stand in front of what is read next. ``asks_head``: the
    client has sent HEAD; then ``requests`` of the server's reader has to tell which responses answer that.
    ``begins_head``: the request that has begun, if one has, is HEAD. ``breaks`` are the places in ``Forms.at`` at which
    it lost step. ``open`` is the request that has begun, where that does not say how long it is; a reader that
    ``pauses`` does not read on in such a one. ``arrived_ns`` is when what is left over had come.
    ``begun_at`` is where the head ends of a message of known length that is not whole: in the data of the batch, below
    0 where that was an earlier one; ``NOT_BEGUN`` without such. It ``seeks`` where none has begun; ``passed`` is told
    of one that is passed over.
    """

    __slots__ = (
        "_chunks", "_found_before", "_is_first", "_passes", "arrived_ns", "asks_head", "begins_head", "begun_at",
        "breaks", "open", "passed", "pauses", "rest", "seeks",
    )  # fmt: skip

    def __init__(self, side: Side) -> None:
        super().__init__(side)
        self.rest, self.asks_head, self.begins_head = b"", False, False
        self.breaks: list[int] = []
        # The chunks of the message that has begun, None where it has none.
        self._chunks: http.Chunks | None = None
        self.seeks = True
        self._passes = 0  # bytes that are still to come of a body that is not kept
        self.passed: Form | None = None
        # Whether nothing of the stream is known yet but that it has begun, and how much was found before this read.
        self._is_first, self._found_before = False, 0
        self.open: OpenRequest | None = None
        self.pauses, self.arrived_ns, self.begun_at = False, 0, NOT_BEGUN

    def begin(self, *, in_step: bool) -> None:
        """Take the begin of a connection; its first bytes begin a message where it is ``in_step``."""
        self.rest, self._passes, self.passed = b"", 0, None
        self.seeks, self._is_first = not in_step, in_step
        self._answers_head, self._answers_nobody, self._chunks, self.open = None, False, None, None
        self.begun_at, self.is_late = NOT_BEGUN, self.side is Side.SERVER and not in_step
        self.is_wary = self.may_answer_head = self.is_late

    def read(self, data: bytes, begin: int, end: int, found: Forms, known_at: int = 0) -> None:
        """Read ``data`` from ``begin``, where its rest is, to ``end``; where nothing is new, nothing is found."""
        self.known_at = known_at
        if self._passes:
            if self._passes >= _ENDLESS:
                return
            if self._passes > end - begin:
                self._passes -= end - begin
                return
            begin += self._passes
            self._tell_passed(begin, found)
        if end - begin == len(self.rest) and self.side is Side.SERVER:
            return
        self.begun_at, self._found_before = NOT_BEGUN, len(found.at)
        known, body_bytes, find = found.known[self.side].get, found.body_bytes, data.find
        tell_at, tell_form = found.at.append, found.form.append
        plain = self.requests is None and not self._answers_nobody
        # Pages poll with the same request again and again; replies seldom are the same.
        differing = 0 if self.side is Side.CLIENT else DIFFERING
        # Most heads are as long as the one before.
        head_bytes = 0
        while begin < end:
            if self.seeks:
                start = http.start_of_message(data, begin, end, self.side)
                if start < 0:
                    self.rest = data[http.keep_from(data, begin, end, self.side) : end]
                    return
                self.seeks, begin = False, start
            head_end = begin + head_bytes
            number = known(data[begin:head_end]) if plain and head_end <= end else None
            if number is None and plain:
                head_end = find(END_OF_HEAD, begin, end) + len(END_OF_HEAD)
                number, head_bytes = known(data[begin:head_end]), max(head_end - begin, 0)
            if number is None or (self.may_answer_head and (self.is_wary or data[head_end : head_end + 1] != b"|")):
                begin = http.behind_blank_lines(data, begin, end)
                first = len(found.at)
                behind = self._read_one(data, begin, end, found)
                known_at = self.known_at
                if known_at:
                    found.note_late(first, known_at)
                if behind < 0:
                    break
                begin, plain = behind, self.requests is None and not self._answers_nobody
                continue
            behind = head_end + body_bytes[number]
            if behind > end:
                self._answers_head, self.begins_head, self.begun_at = False, False, head_end
                break
            if behind < known_at:
                found.late[len(found.at)] = known_at
            tell_at(head_end)
            tell_form(number)
            self._answers_head = None
            if differing < DIFFERING and behind >= known_at:
                count = take_same(data, begin, behind, end, found)
                differing = 0 if count else differing + 1
                behind += count * (behind - begin)
            begin = behind
            if differing >= DIFFERING and begin >= known_at:
                begin = take_known(data, begin, end, head_bytes, self, found)
        self.rest = data[begin:end] if not self._passes else b""
        self._is_first = self._is_first and len(found.at) == self._found_before and not self._passes

    def forget_request(self) -> None:
        """Take that nobody knows any more which request the message answers that is being received, if one is."""
        self._answers_nobody = not self.seeks and bool(self.rest or self._passes)
        self.is_wary = self.may_answer_head = True

    def _read_one(self, data: bytes, start: int, end: int, found: Forms) -> int:
        """Read a message; return where it ends, -1 where it is not there whole."""
        is_first = self._is_first and self.side is Side.CLIENT and len(found.at) == self._found_before
        if is_first and (known := http.no_request_at(data, start, end)):
            return self._lose_step(data, start, known, found)
        longest = http.longest_line(data, start, end, self.side)
        line_end = data.find(b"\n", start, min(end, start + longest)) + 1
        if not line_end:
            behind = start + longest
            return -1 if end < behind else self._lose_step(data, start, behind, found, self._long_head(data, start))
        if not http.is_start_line(data, start, line_end, self.side):
            return self._lose_step(data, start, line_end, found)
        head_end = http.end_of_head(data, line_end - 1, min(end, start + MOST_HEAD_BYTES))
        if head_end < 0:
            behind = start + MOST_HEAD_BYTES
            return -1 if end < behind else self._lose_step(data, start, behind, found, self._long_head(data, start))
        head = http.read_head(data[start:head_end], self.side)
        if self.side is Side.SERVER and not (head is not None and head.is_interim) and self._is_to_head(head_end):
            head = http.read_head(data[start:head_end], self.side, answers_head=True)
        if head is None:
            return self._lose_step(data, start, head_end, found)
        if self.side is Side.CLIENT:
            self.begins_head = head.method == "HEAD"
            self.asks_head |= self.begins_head
            if head.body is not Body.LENGTH:
                self.open = OpenRequest(head, head_end - start)
                # The server may answer it before another request shows that it has no body.
                if self.pauses:
                    return -1
        if head.has_body and (head.expects or self.may_answer_head):
            line = self._line_in_place_of_body(data, head_end, end, head)
            if line > 0:
                return self._skip_body(data[start:head_end], head_end, line, head, found)
            if line < 0:
                self.begun_at = head_end
                return -1
        if head.body is Body.LENGTH:
            return self._read_length(data, start, head_end, end, head, found)
        if head.is_unbounded and self.side is Side.SERVER:
            late, nobody = self.is_late, self._answered(head_end, head)
            found.tell(head_end, Form(What.WHOLE, head, 0, is_coded=True, answers_nobody=nobody, is_late=late))
            self.seeks = True
            return head_end
        if head.is_unbounded and (behind := http.start_of_message(data, head_end, end, self.side)) >= 0:
            self.open, found.late[len(found.at)] = None, data.find(b"\n", behind) + 1
            found.tell(head_end, unbounded_form(data[start:behind], head_end - start, head))
            return behind
        if head.body is Body.CHUNKS:
            return self._read_chunks(data, start, head_end, end, head, found)
        if end - head_end <= MOST_BODY_BYTES:
            return -1
        self._passes, self.passed = _ENDLESS, passed_form(data, head_end, end, head, self.side)
        return end

    def _skip_body(self, text: bytes, head_end: int, line: int, head: Head, found: Forms) -> int:
        """Take a message without its body, in whose place there is, up to ``line``, the first line of another one."""
        self.begun_at, self.open, found.late[len(found.at)] = NOT_BEGUN, None, line
        is_request, self._answers_nobody = self.side is Side.CLIENT, self.side is Side.SERVER
        form = part_form(text, len(text), head) if is_request else bodiless(head, self._answered(line, None))
        found.tell(head_end, form)
        return head_end

    def _read_length(self, data: bytes, start: int, head_end: int, end: int, head: Head, found: Forms) -> int:
        behind = head_end + head.length
        self.begun_at = NOT_BEGUN if behind <= end and head.length <= MOST_BODY_BYTES else head_end
        if head.length > MOST_BODY_BYTES:
            self.passed = passed_form(data, head_end, end, head, self.side)
            if self.passed is None:
                return -1
            if behind > end:
                self._passes = behind - end
                return end
            self._tell_passed(behind, found)
            return behind
        if behind > end:
            return -1
        late, nobody = self.is_late, self._answered(behind, head, start)
        size = head_end - start
        form = Form(What.WHOLE, head, head.length, answers_nobody=nobody, is_late=late, head_bytes=size)
        if head.coding:
            form = replace(form, content=http.decoded(data[head_end:behind], head.coding), is_coded=True)
            found.tell(head_end, self._or_unread(form, data[head_end:behind]))
            return behind
        number = found.add(form)
        found.at.append(head_end)
        found.form.append(number)
        text = data[start:head_end]
        if text.find(END_OF_HEAD) == len(text) - len(END_OF_HEAD) and self._may_be_known(head) and not (nobody or late):
            found.known[self.side][text] = number
        return behind

    def _read_chunks(self, data: bytes, start: int, head_end: int, end: int, head: Head, found: Forms) -> int:
        most = head_end + _MOST_CHUNKED_BYTES
        reader, self._chunks = self._chunks or http.Chunks(), None
        chunks = reader.read(data, head_end, min(end, most))
        is_malformed = chunks.wrong_at >= 0
        if is_malformed or (chunks.stop < 0 and end >= most):
            lost = self._or_unread(Form(What.WHOLE, head, touched=self._if_answers()), reader.so_far(data))
            lost = replace(lost, what=What.BROKEN, is_beyond=not is_malformed, is_malformed=is_malformed)
            return self._lose_step(data, start, chunks.wrong_at if is_malformed else most, found, lost)
        if chunks.stop < 0:
            self._chunks = reader
            return -1
        self.open = None
        late, nobody = self.is_late, self._answered(chunks.stop, head, head_end)
        content, size = http.decoded(chunks.content, head.coding), chunks.stop - head_end
        form = Form(What.WHOLE, head, size, content, is_coded=True, answers_nobody=nobody, is_late=late)
        found.tell(head_end, self._or_unread(form, chunks.content))
        return chunks.stop

    def _or_unread(self, form: Form, body: bytes) -> Form:
        """Return the form of a message of known ``body``, or what is told where nobody reads that."""
        if form.content is not None or form.head is None:
            return form
        if self.side is Side.SERVER:
            return unread_response(form, body)
        return replace(unread_form(form.head, form.body_bytes, body), head_bytes=form.head_bytes)

    def _long_head(self, data: bytes, start: int) -> Form:
        return long_head_form(data, start, self._if_answers(), self.side)

    def _lose_step(self, data: bytes, start: int, at: int, found: Forms, lost: Form = FOREIGN) -> int:
        """Give up what begins at ``start``, as is known at ``at``, and tell ``lost``; look for a message behind."""
        self.known_at = at = max(at, self.known_at)
        is_told = lost.touched is not Likeness.NO
        if is_told and self.requests is not None:
            self.requests.lost(at)
        self._out_of_step(at)
        self.breaks.append(len(found.at))
        is_first = self._is_first and len(found.at) == self._found_before and not is_told
        found.tell(at, replace(lost, spoken=protocol_of_bytes(data, start, at) if is_first else None))
        return start + 1

    @property
    def is_passing(self) -> bool:
        """Whether what has begun is passed over, since it is too long."""
        return self._passes > 0

    def is_open_up_to(self, data: bytes, begin: int, end: int) -> bool:
        """Tell whether the open request, which begins at ``begin``, goes on up to ``end`` at least."""
        assert self.open is not None
        body = begin + self.open.head_bytes
        if self._passes:
            return True
        is_none = self.open.head.expects and behind_body(data, body, end, self.open.head, self.side) > 0
        if is_none or (self.open.head.is_unbounded and http.start_of_message(data, body, end, self.side) >= 0):
            return False
        if self.open.head.body is Body.END:
            return end - body <= MOST_BODY_BYTES
        self._chunks = self._chunks or http.Chunks()
        chunks = self._chunks.read(data, body, min(end, body + _MOST_CHUNKED_BYTES))
        return chunks.stop < 0 and chunks.wrong_at < 0 and end - body < _MOST_CHUNKED_BYTES

    def end_open(self, data: bytes, begin: int, end: int, at: int, found: Forms) -> None:
        """Take that the open request, which begins at ``begin``, has been answered: it ends at ``end``.

        Of one in chunks that ends within a chunk it is not known what it asks for.
        """
        assert self.open is not None
        head = self.open.head
        body = begin + self.open.head_bytes
        if self.passed is not None:
            found.tell(at, self.passed)
        else:
            found.tell(at, open_form(data[begin:end], body - begin, head, self._chunks))
        self.begin(in_step=True)
        self._is_first = False

    def miss(self, size: int, at: int, found: Forms) -> None:
        """Take a hole of so many bytes."""
        found.tell(at, Form(What.GAP, missing_bytes=size))
        self._drop(size, at, found)

    def give_up(self, at: int, found: Forms) -> None:
        """Drop the bytes of the message that has begun, for which there is no room: it is cut."""
        self._drop(0, at, found)

    def _drop(self, size: int, at: int, found: Forms) -> None:
        """Take that the bytes of the message that has begun are lost, and so many behind them."""
        rest, self.rest, self._chunks = self.rest, b"", None
        in_step, self._is_first = not self.seeks, False
        lost = FOREIGN
        if in_step and not self._passes and rest:
            head_end, head = head_in(rest, self.side)
            lost = lost_form(rest, head_end, head, self.side)
            if head is not None and head.body is Body.LENGTH and not self._may_lack_body(rest, head_end, head):
                length = 0 if self._answers_head else head.length
                self._passes = length - (len(rest) - head_end)
                self.passed = replace(lost, what=What.CUT)
        if self.passed is not None and size <= self._passes < _ENDLESS:
            self._passes -= size
            self.passed = replace(self.passed, what=What.CUT, is_beyond=False)
            if not self._passes:
                self._tell_passed(at, found)
            return
        if self.passed is not None:
            lost = replace(self.passed, what=What.BROKEN, is_beyond=False)
        self._passes, self.passed = 0, None
        if in_step and self.side is Side.SERVER and not self._answers_nobody:
            lost = replace(lost, touched=Likeness.YES)
            if self.requests is not None:
                self.requests.lost(at)
        if self.begun_at != NOT_BEGUN:
            found.head_at[len(found.at)] = self.begun_at
        self._out_of_step(at)
        self.breaks.append(len(found.at))
        found.tell(at, lost)

    def _out_of_step(self, at: int) -> None:
        self.seeks, self._answers_head, self._answers_nobody = True, None, False
        self.open, self.begun_at = None, NOT_BEGUN
        self.is_wary = self.may_answer_head = self.side is Side.SERVER
        if self.requests is not None:
            self.requests.forget(at)

    def _tell_passed(self, at: int, found: Forms) -> None:
        assert self.passed is not None
        late, nobody = self.is_late, self._answered(at, self.passed.head)
        if self.begun_at != NOT_BEGUN:
            found.head_at[len(found.at)], self.begun_at = self.begun_at, NOT_BEGUN
        found.tell(at, replace(self.passed, answers_nobody=nobody, is_late=late))
        self._passes, self.passed = 0, None

    def end(self, at: int, found: Forms, ended: int) -> None:
        """Take the end of the stream: a message that goes up to there is whole.

        ``ended`` is a number of ``Forms.end_of``. Where the connection is broken off, a request might have gone on
        (``Form.is_broken_off``).
        """
        rest = self.rest
        dropped = ended != Forms.END and self.side is Side.CLIENT
        if self._passes >= _ENDLESS and self.passed is not None:
            if dropped:
                found.arrived_ns[len(found.at)] = self.arrived_ns
                self.passed = replace(self.passed, is_broken_off=True)
            self._tell_passed(at, found)
        elif self._passes or (rest and not self.seeks):
            head_end, head = head_in(rest, self.side)
            if dropped:
                if head is not None and head.body is not Body.LENGTH:
                    found.arrived_ns[len(found.at)] = self.arrived_ns
                    found.tell(at, open_form(rest, head_end, head, self._chunks, found.forms[ended]))
            elif head is not None and head.is_unbounded and self.side is Side.CLIENT:
                found.tell(at, unbounded_form(rest, head_end, head))
            elif head is not None and (head.body is Body.END or head.is_unbounded):
                content = None if head.is_unbounded else http.decoded(rest[head_end:], head.coding)
                late, nobody = self.is_late, self._answered(at, head)
                form = Form(What.WHOLE, head, 0, content, is_coded=True, answers_nobody=nobody, is_late=late)
                found.tell(at, form if head.is_unbounded else self._or_unread(form, rest[head_end:]))
            # Of a response that was not sent whole nothing is missing: it is none, though a list lacks something.
            elif self.side is Side.SERVER and self.passed is not None and self.passed.what is What.CUT:
                found.tell(at, replace(self.passed, answers_nobody=self._answered(at, self.passed.head)))
            elif self.side is Side.SERVER and (head is not None or self.passed is not None):
                unsent = self.passed or lost_form(rest, head_end, head, self.side)
                found.tell(at, replace(unsent, what=What.PART, answers_nobody=self._answers_nobody))
            if self.side is Side.CLIENT and (part := end_form(rest, head_end, head, self.passed, found.forms[ended])):
                if self.begun_at != NOT_BEGUN:
                    found.head_at[len(found.at)] = self.begun_at
                found.tell(at, part)
        self.begin(in_step=False)
        if self.requests is not None:
            if ended == Forms.END:
                self.requests.ended(at)
            self.requests.forget(at)
        found.at.append(at)
        found.form.append(ended)
