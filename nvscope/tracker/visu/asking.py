"""Asking: what HTTP requests ask for, each body read once however often it is sent."""

from __future__ import annotations

from dissectors.http import Head
from dissectors.webvisu import Answer, Likeness, Request, answer_of, fields_in_reply, read_query, read_request
from dissectors.webvisu_lists import is_list, list_likeness
from dissectors.webvisu_page import is_page
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.limits import MOST_ENTRIES

_MOST_KNOWN = 4096
"""So many different bodies and addresses are remembered, and of ``MOST_ENTRIES`` variables in all."""

_QUERIES = ("readpi", "writepi")


class Ask:
    """What a request asks for: variables (``request``), or, where it ``is_list``, an XML file that may list some.

    ``target`` is the URL of such a file, or, where it ``is_page``, of a page that may say how texts are encoded.
    ``is_known``: it is the same object for all that ask the same. ``is_part``: it was never asked whole, and nobody
    knows for which variables.
    """

    __slots__ = ("is_known", "is_list", "is_page", "is_part", "number", "request", "target")

    def __init__(
        self, request: Request | None, *, target: str = "", is_known: bool = False, is_part: bool = False
    ) -> None:  # fmt: skip
        self.is_part = is_part
        self.request = request
        self.target, self.is_page = target, is_page(target)
        self.is_list = bool(target) and not self.is_page
        self.is_known = is_known
        self.number = -1
        """Its number in the batch that is being taken, -1 where it has none."""

    @property
    def is_file(self) -> bool:
        """Whether what is in the response is looked at."""
        return bool(self.target)


NOTHING = Ask(None)
_PARTS = tuple(Ask(Request(writes, 0, (), is_part=True), is_known=True, is_part=True) for writes in (False, True))
_WRITES = b"|1|"


def part_of(body: bytes) -> Ask:
    """Return what a body asks for of which the client sent no more than the begin."""
    return _PARTS[body.lstrip(b"\r\n").startswith(_WRITES)]


def asks_whole(request: Request | None, body: bytes) -> bool:
    """Tell whether a body, of which more might have come, is whole by what it says: so many variables, and a bar."""
    if request is None or request.is_miscounted or request.ambiguous:
        return False
    return body.rstrip(b"\r\n").endswith(b"|")


def fits(ask: Ask, response: Form) -> bool:
    """Tell whether a response, whose content is in its form, is one to what was asked for: nothing in it is wrong."""
    request, head = ask.request, response.head
    if request is None or ask.is_part or head is None or head.status != OK or response.content is None:
        return False
    return answer_of(request, response.content) is Answer.DONE


def may_be_reply(ask: Ask, response: Form) -> bool | None:
    """Tell whether a response, whose content is in its form, may be one to a request; None where nothing tells.

    It may not where it has another number of values, or several fields in place of that with which a write is answered.
    """
    request, head = ask.request, response.head
    if request is None or ask.is_part or request.is_miscounted or request.ambiguous:
        return None
    if head is None or head.status != OK or response.content is None:
        return None
    answer = answer_of(request, response.content)
    if answer is Answer.REFUSED:
        return False if fields_in_reply(response.content) > 1 else None
    return None if answer is Answer.AMBIGUOUS else answer is Answer.DONE


def is_list_of(ask: Ask, response: Form, *, is_visu: bool) -> bool:
    """Tell whether what came in place of a list is to be told: all of it, or what begins like one.

    What does not say what it is may be one of a page.
    """
    if not ask.is_list or not response.lacks_content:
        return ask.is_list
    found = list_likeness(response.begin, ask.target)
    return response.head is not None and (found is Likeness.YES or (found is Likeness.PERHAPS and is_visu))


def is_whole_page(ask: Ask, response: Form) -> bool:
    """Tell whether a response is a page, and it is known what is in it."""
    return ask.is_page and response.what is What.WHOLE and not response.lacks_content


class Asking:
    """What has been asked so far."""

    def __init__(self) -> None:
        self._bodies: dict[bytes, Ask] = {}
        self._targets: dict[str, Ask] = {}
        self._entries = 0

    def by_body(self, body: bytes) -> Ask:
        """Return what the body of a POST asks for, ``NOTHING`` where it is no request of a page."""
        known = self._bodies.get(body)
        if known is not None:
            return known
        request = read_request(body)
        if request is None:
            return NOTHING
        # Writes seldom come again.
        if request.writes or not self._is_room(request):
            return Ask(request)
        ask = self._bodies[body] = Ask(request, is_known=True)
        return ask

    def _is_room(self, request: Request | None) -> bool:
        """Tell whether there is room to remember a request, and take it."""
        entries = self._entries + (0 if request is None else len(request.entries))
        if len(self._bodies) + len(self._targets) >= _MOST_KNOWN or entries > MOST_ENTRIES:
            return False
        self._entries = entries
        return True

    def by_target(self, head: Head) -> Ask:
        """Return what a request without such a body asks for."""
        target = head.target
        if head.method != "GET":
            return NOTHING
        known = self._targets.get(target)
        if known is not None:
            return known
        request = read_query(target) if any(word in target.lower() for word in _QUERIES) else None
        if request is None and not (is_list(target) or is_page(target)):
            return NOTHING
        is_known = not (request is not None and request.writes) and self._is_room(request)
        ask = Ask(request, target=target if request is None else "", is_known=is_known)
        if is_known:
            self._targets[target] = ask
        return ask
