"""What a controller answers to requests of the Parameter Manager, without sockets: a payload in, datagrams out."""

from __future__ import annotations

from collections import Counter
from enum import Enum

from msgspec import Struct

from dissectors.netvar import Service
from nvscope.plc.parameter.message import REPLY_OF, Flaw, Message, read_message
from nvscope.plc.parameter.table import Entry, ServedTable


class Result(Enum):
    """What became of a request."""

    REPLIED = "replied"
    REFUSED = "refused"
    BUSY = "busy"
    SILENT = "silent"


NO_REQUEST = "no request"
"""Why a message of the Parameter Manager is left unanswered that is a reply itself."""


class Handled(Struct, frozen=True):
    """A request and what became of it: the datagrams to be sent ``delay_ns`` later, and what they say.

    ``answer`` is the service of the answer, None without one; ``before`` and ``after`` are the bytes of the value,
    where it was read or written.
    """

    request: Message
    entry: Entry | None
    result: Result
    answer: Service | None
    datagrams: tuple[bytes, ...] = ()
    delay_ns: int = 0
    before: bytes | None = None
    after: bytes | None = None


class Controller:
    """The parameters of a table and their values, which writes change.

    ``results`` and ``ignored`` count requests by what became of them, and all else that came by why it is none.
    """

    def __init__(self, table: ServedTable) -> None:
        self._table = table
        self._data = {place: entry.data for place, entry in table.by_place.items()}
        self._busy = {place: entry.settings.busy for place, entry in table.by_place.items() if entry.settings.busy}
        self.results: Counter[Result] = Counter()
        self.ignored: Counter[str] = Counter()

    def received(self, payload: bytes) -> Handled | None:
        """Take what came in a datagram; None where it is no request, which nothing is answered to. No bytes raise."""
        message = read_message(payload)
        if isinstance(message, Flaw):
            self.ignored[message.value] += 1
            return None
        if not message.is_request:
            self.ignored[NO_REQUEST] += 1
            return None
        handled = self._handled(message, self._table.by_place.get((message.index, message.subindex)))
        self.results[handled.result] += 1
        return handled

    def _handled(self, request: Message, entry: Entry | None) -> Handled:
        if entry is None:
            is_known = request.index in self._table.indexes
            unknown = Service[self._table.unknown_subindex] if is_known else Service.ODErrorReplyIdx
            return Handled(request, None, Result.REFUSED, unknown, (_packed(request, unknown),))
        settings, place = entry.settings, (entry.index, entry.subindex)
        if settings.silent:
            return Handled(request, entry, Result.SILENT, None)
        if self._busy.get(place, 0):
            self._busy[place] -= 1
            return self._answered(request, entry, Result.BUSY, Service.ODStateBusy)
        if error := self._error(request, entry):
            return self._answered(request, entry, Result.REFUSED, error)
        before = after = self._data[place]
        if request.service == Service.ODWriteRequest:
            after = before if settings.stuck else request.data
            self._data[place] = after
        return self._answered(request, entry, Result.REPLIED, REPLY_OF[request.service], before, after)

    def _error(self, request: Message, entry: Entry) -> Service | None:
        """Return why a request is refused; the first that applies, in this order."""
        if entry.settings.fault:
            return Service[entry.settings.fault]
        is_write = request.service == Service.ODWriteRequest
        if not (entry.is_writable if is_write else entry.is_readable):
            return Service.ODErrorReplyAccess
        if request.items != entry.items:
            return Service.ODErrorReplyItems
        if is_write and len(request.data) != len(entry.data):
            return Service.ODErrorReplyLen
        return None

    def _answered(
        self, request: Message, entry: Entry, result: Result, answer: Service,
        before: bytes | None = None, after: bytes | None = None,
    ) -> Handled:  # fmt: skip
        settings = entry.settings
        data = before if answer == Service.ODReadRequestReply else None
        packed = _packed(request, answer, data or b"", settings.wrong_counter)
        datagrams = (packed, packed) if settings.duplicate else (packed,)
        return Handled(request, entry, result, answer, datagrams, settings.delay, before, after)


def _packed(request: Message, answer: Service, data: bytes = b"", wrong_counter: bool = False) -> bytes:
    counter = request.counter + wrong_counter & 0xFFFF
    return Message(answer, request.index, request.subindex, counter, request.items, data).packed()
