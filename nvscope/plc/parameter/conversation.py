"""One request to a partner and what comes of it, without sockets: datagrams and times in, datagrams and an outcome out.

::

    due(now) -> datagram or None        what is to be sent now: the request, the same again after busy or the timeout
    received(source, payload, now)      what came, from whomever
    undelivered(why, quoted)            what came back, as the system tells it
    outcome                             None until it is over
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType

from msgspec import Struct, field

from dissectors.netvar import Service
from nvscope.plc.parameter.message import REPLY_OF, Flaw, Message, read_message

TIMEOUT_NS = 500_000_000
"""How long an answer is waited for: what the function block of controllers waits unless told otherwise."""

MOST_TIMEOUT_NS = 600_000_000_000
MOST_RETRIES = 100
_SHORTEST_PAUSE_NS, _LONGEST_PAUSE_NS, _PAUSES = 1_000_000, 100_000_000, 10
_MOST_OTHERS = 5


class Ending(Enum):
    """How a request ended."""

    REPLIED = "replied"
    REFUSED = "refused"
    BUSY = "busy"
    SILENT = "silent"
    UNDELIVERED = "undelivered"


class Ignored(Enum):
    """Why a datagram was no answer to the request."""

    OTHER_NODE = "other_node"
    NO_TELEGRAM = "no_telegram"
    MALFORMED = "malformed"
    OF_A_LIST = "of_a_list"
    OTHER_REQUEST = "other_request"
    OTHER_SERVICE = "other_service"


_OF_FLAW = {
    Flaw.NO_TELEGRAM: Ignored.NO_TELEGRAM, Flaw.MALFORMED: Ignored.MALFORMED, Flaw.OF_A_LIST: Ignored.OF_A_LIST,
}  # fmt: skip


class Patience(Struct, frozen=True):
    """How long one answer is waited for, and how many times the request is sent again when none came."""

    timeout_ns: int = TIMEOUT_NS
    retries: int = 0


class Outcome(Struct, frozen=True):
    """What came of a request.

    ``latency_ns`` runs from the request that was answered, the last one sent, to its answer; None without one.
    ``others`` are the first addresses of others that sent something meanwhile, ``why`` it came back undelivered.
    """

    request: Message
    ending: Ending
    answer: Message | None = None
    latency_ns: int | None = None
    transmissions: int = 0
    busy: int = 0
    ignored: Mapping[Ignored, int] = field(default_factory=lambda: MappingProxyType({}))
    others: tuple[str, ...] = ()
    why: str = ""


class Conversation:
    """A request that waits for its answer from a partner, which is known by its address.

    Busy is asked again within the timeout, after a tenth of it or 100 ms. Whatever else comes is counted, and changes
    nothing.
    """

    def __init__(self, request: Message, partner: str, patience: Patience) -> None:
        self._request, self._partner, self._patience = request, partner, patience
        self._retries = patience.retries
        self._send_at_ns: int | None = None
        self._deadline_ns: int | None = None
        self._since_ns = 0
        self._is_busy = False
        self._transmissions = self._busy = 0
        self._ignored: Counter[Ignored] = Counter()
        self._others: dict[str, None] = {}
        self._why = ""
        self.outcome: Outcome | None = None

    @property
    def wait_until_ns(self) -> int:
        """When ``due`` is to be asked next, if nothing comes before; 0 is at once."""
        return min((one for one in (self._send_at_ns, self._deadline_ns) if one is not None), default=0)

    def due(self, now_ns: int) -> bytes | None:
        """Return what is to be sent now; None where that is nothing, or it is over."""
        if self.outcome is not None:
            return None
        if self._deadline_ns is None or (now_ns >= self._deadline_ns and self._retries):
            self._retries -= self._deadline_ns is not None
            self._deadline_ns = now_ns + self._patience.timeout_ns
            self._is_busy, self._why = False, ""
            return self._sent(now_ns)
        if now_ns >= self._deadline_ns:
            silent = Ending.BUSY if self._is_busy else Ending.SILENT
            self._end(Ending.UNDELIVERED if self._why else silent)
            return None
        if self._send_at_ns is not None and now_ns >= self._send_at_ns:
            return self._sent(now_ns)
        return None

    def received(self, source: str, payload: bytes, now_ns: int) -> None:
        """Take a datagram that came from an address."""
        if self.outcome is not None:
            return
        if source != self._partner:
            self._ignored[Ignored.OTHER_NODE] += 1
            if len(self._others) < _MOST_OTHERS:
                self._others[source] = None
            return
        answer = read_message(payload)
        if isinstance(answer, Flaw):
            self._ignored[_OF_FLAW[answer]] += 1
        elif not self._is_about_the_same(answer) or not self._transmissions:
            self._ignored[Ignored.OTHER_REQUEST] += 1
        elif answer.service == REPLY_OF[self._request.service]:
            self._end(Ending.REPLIED, answer, now_ns)
        elif answer.is_error:
            self._end(Ending.REFUSED, answer, now_ns)
        elif answer.service == Service.ODStateBusy:
            self._wait_for_it(now_ns)
        else:
            self._ignored[Ignored.OTHER_SERVICE] += 1

    def undelivered(self, why: str, quoted: bytes = b"") -> None:
        """Take that the request came back; it ends with that, unless it is to be sent again after the timeout.

        ``quoted`` are the first bytes of what came back, as far as they are known: another request may be late.
        """
        if self.outcome is None and self._request.packed().startswith(quoted):
            self._why = why
            if not self._retries:
                self._end(Ending.UNDELIVERED)

    def _is_about_the_same(self, answer: Message) -> bool:
        mine = self._request
        return (answer.index, answer.subindex, answer.counter) == (mine.index, mine.subindex, mine.counter)

    def _wait_for_it(self, now_ns: int) -> None:
        if self._send_at_ns is not None:  # of one request it was said twice
            self._ignored[Ignored.OTHER_SERVICE] += 1
            return
        self._busy += 1
        self._is_busy = True
        pause_ns = min(self._patience.timeout_ns // _PAUSES, _LONGEST_PAUSE_NS)
        self._send_at_ns = now_ns + max(pause_ns, _SHORTEST_PAUSE_NS)

    def _sent(self, now_ns: int) -> bytes:
        self._transmissions += 1
        self._send_at_ns, self._since_ns = None, now_ns
        return self._request.packed()

    def _end(self, ending: Ending, answer: Message | None = None, now_ns: int | None = None) -> None:
        self.outcome = Outcome(
            self._request, ending, answer, None if now_ns is None else now_ns - self._since_ns, self._transmissions,
            self._busy, MappingProxyType(dict(self._ignored)), tuple(self._others), self._why,
        )  # fmt: skip
