"""HTTP forms: what messages that are read alike have in common, and what else happens in a stream."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from msgspec import Struct

from dissectors.http import Head, Side
from dissectors.web_protocols import WebProtocol
from dissectors.webvisu import Likeness
from nvscope.tracker.pieces import BROKEN_OFF, BY_CLIENT, REPLACED

NOT_BEGUN = -2
"""Stands for a place in data: of no request, the head is there and the body is not."""

_MOST_FORMS = 512
"""Each batch looks at all of them: heads that are gone are read anew sooner than many are looked at."""


class What(IntEnum):
    """What happens in a stream.

    A message is ``WHOLE``; or ``CUT``: it is known where it ends, but not all that is in it; or ``PART``: a request of
    which the client sent no more than a part, and nothing is missing. ``BROKEN``: the stream
    loses step. ``BEGIN`` and ``END`` are its own, with ``ANEW`` the whole connection begins. With ``GAP``, bytes are
    missing.
    """

    WHOLE = 0
    CUT = 1
    BROKEN = 2
    BEGIN = 3
    END = 4
    GAP = 5
    ANEW = 6
    PART = 7


class Form(Struct, frozen=True):
    """What messages of one form have in common; or what else happens.

    ``body_bytes`` is how long the body is as it came. ``content`` is what is in it where ``is_coded``, None where that
    is not known. ``touched``: whether what is not whole may be a request of a WebVisu page, or is in the response to
    the first request that waits. ``answers_nobody``: what it answers was forgotten meanwhile, or, where it
    ``is_unasked``, is a HEAD that was not captured. ``missing_bytes`` are those of a gap. ``spoken`` is what a
    connection begins with that does not begin with HTTP. ``broken_by`` is who broke off a connection that did not end
    in order; ``is_replaced``: nothing but that another one begins between the same ends shows it. ``is_broken_off``:
    with that, a request ended that does not say
    how long it is; nobody knows whether more of it should have come. ``is_late``: it may answer a request from before
    the capture (``HttpReader.is_late``). ``is_beyond``: nothing of it is missing, but not all of it is read;
    ``is_malformed``: its chunks are none. ``begin`` is how its content begins, where that is not known whole.
    ``head_bytes`` is how long the head is of what says how long its body is, and is whole; 0 of others.
    """

    what: What
    head: Head | None = None
    body_bytes: int = 0
    content: bytes | None = None
    is_coded: bool = False
    touched: Likeness = Likeness.NO
    answers_nobody: bool = False
    is_unasked: bool = False
    missing_bytes: int = 0
    spoken: WebProtocol | None = None
    broken_by: Side | None = None
    is_replaced: bool = False
    is_broken_off: bool = False
    is_late: bool = False
    is_beyond: bool = False
    is_malformed: bool = False
    begin: bytes = b""
    head_bytes: int = 0

    @property
    def is_unread(self) -> bool:
        """Whether it is whole, and nobody knows what is in it: it is too long, or its coding is none that is known."""
        return self.what is What.WHOLE and self.lacks_content

    @property
    def lacks_content(self) -> bool:
        """Whether nobody knows what is in it."""
        return self.is_coded and self.content is None

    @property
    def is_endless(self) -> bool:
        """Whether nobody knows where it ends: by what it says of that itself."""
        return self.is_malformed or (self.head is not None and self.head.is_unbounded)


class Forms:
    """The forms of messages so far, and what was found of them in the data of a batch, one behind the other.

    ``at`` is where the body of a message begins, of what has none where the stream is; below 0, ``~at`` is a piece.
    ``form`` is a place in ``forms``, of which ``body_bytes`` are known by place. ``known`` are the heads by side of
    which nothing more is to be known to read a message. ``late`` is up to where one had to read to find some, by place
    in ``at``: those that lie in what was taken for another message at first. ``arrived_ns`` is when some had
    come that ended only later, by place in ``at``, too; ``head_at`` is where the heads end of those of which ``at``
    does not say it, below 0 where that was in an earlier batch. ``repeats`` is how often the message at a place comes
    again behind it, byte for byte, as far as that is known.
    """

    BEGIN, END, ANEW, BROKEN_BY_CLIENT, BROKEN_BY_SERVER, REPLACED = range(6)

    def __init__(self) -> None:
        self.at: list[int] = []
        self.form: list[int] = []
        self.late: dict[int, int] = {}
        self.arrived_ns: dict[int, int] = {}
        self.head_at: dict[int, int] = {}
        self.repeats: dict[int, int] = {}
        self._clear()

    def _clear(self) -> None:
        self.forms = [
            Form(What.BEGIN), Form(What.END), Form(What.ANEW), Form(What.END, broken_by=Side.CLIENT),
            Form(What.END, broken_by=Side.SERVER), Form(What.END, broken_by=Side.CLIENT, is_replaced=True),
        ]  # fmt: skip
        self.body_bytes = [0] * len(self.forms)
        self.known: tuple[dict[bytes, int], dict[bytes, int]] = ({}, {})

    def note_late(self, first: int, known_at: int) -> None:
        """Note of what was found from the place ``first`` on what could not be known before ``known_at``."""
        for place in range(first, len(self.at)):
            if self.at[place] + self.body_bytes[self.form[place]] < known_at:
                self.late[place] = max(self.late.get(place, 0), known_at)

    def renew(self) -> None:
        """Forget what was found, and all forms where there are too many."""
        self.at, self.form, self.late, self.arrived_ns, self.head_at, self.repeats = [], [], {}, {}, {}, {}
        if len(self.forms) > _MOST_FORMS:
            self._clear()

    @staticmethod
    def end_of(size: int) -> int:
        """Return the number of an end, by what the ``size`` of its piece says."""
        if not size & BROKEN_OFF:
            return Forms.END
        if size & REPLACED:
            return Forms.REPLACED
        return Forms.BROKEN_BY_CLIENT if size & BY_CLIENT else Forms.BROKEN_BY_SERVER

    def add(self, form: Form) -> int:
        """Return the number of a new form."""
        self.forms.append(form)
        self.body_bytes.append(form.body_bytes)
        return len(self.forms) - 1

    def put_first(self, begin: int, first: Sequence[int]) -> None:
        """Put some of what was found, by place and rising, in front of all else from the place ``begin`` on."""
        moves = set(first)
        order = [*first, *(place for place in range(begin, len(self.at)) if place not in moves)]
        self.at[begin:] = [self.at[place] for place in order]
        self.form[begin:] = [self.form[place] for place in order]
        self.repeats = {place: count for place, count in self.repeats.items() if place < begin}
        now = {old: new for new, old in enumerate(order, begin)}
        for column in (self.late, self.arrived_ns, self.head_at):
            column.update([(now[place], column.pop(place)) for place in order if place in column])

    def repeat(self, length: int, count: int) -> None:
        """Note that the last message that was found, of so many bytes in all, comes again so often behind it."""
        self.repeats[len(self.at) - 1] = count
        at = self.at[-1]
        self.at.extend(range(at + length, at + count * length + 1, length))
        self.form.extend([self.form[-1]] * count)

    def tell(self, at: int, form: Form) -> None:
        """Note that something was found."""
        self.at.append(at)
        self.form.append(self.add(form))
