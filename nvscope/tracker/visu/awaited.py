"""Awaited: requests that wait for their reply, responses that wait for their request, and what is told of both."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from nvscope.tracker.visu.asking import Ask
from nvscope.tracker.visu.http_forms import Form
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.reach import NOWHERE, UNKNOWN, Reach, is_had


class Waiting(NamedTuple):
    """A request that nobody has answered: what it asks for, its order, and when it had arrived.

    ``acknowledged`` is up to where its client had the server's bytes then, where none of these was captured; else -1.
    ``reach`` is where it lies in the client's stream. ``is_early``: its reply was captured before it was whole;
    ``is_behind``: bytes of the server are missing that its client had when it sent it.
    """

    asked: Ask
    order: int
    arrival_ns: int
    is_head: bool = False
    acknowledged: int = UNKNOWN
    reach: Reach = NOWHERE
    is_early: bool = False
    is_behind: bool = False

    def had(self, response: Reach) -> bool:
        """Tell whether its client had all of a response when it asked; of an early one, it had not asked all yet."""
        return not self.is_early and is_had(response.behind, self.reach.acknowledged)


def asked_behind(waiting: Iterable[Waiting], behind: int) -> list[Waiting]:
    """Return what waits of a client that takes turns, and was asked for when it had what is missing up to a place.

    What answers that comes later. Where more than one thing was asked for in front of that, nobody knows whether all of
    it was answered there.
    """
    every = list(waiting)
    had = (one.reach.acknowledged for one in every)
    place = next((place for place, one in enumerate(had) if is_had(behind, one)), len(every))
    return [one._replace(is_behind=True) for one in every[place:]] if place <= 1 else []


class Early(NamedTuple):
    """A response that came before the request was whole that it answers; its content, if it has any, is in its form.

    Of that request the head was there where it ``has_begun``; else ``reach`` tells whether it answers one that comes.
    ``is_reply``: whatever it answers, it is parted as those of pages are. ``is_lost``: nothing is known of it but that
    bytes are missing, which end where its ``reach`` does.
    """

    form: Form
    arrival_ns: int
    reach: Reach
    has_begun: bool
    is_reply: bool = False
    is_lost: bool = False


class Happened(NamedTuple):
    """Something to be told of a connection; ``message`` is the row of the HTTP message that it is about, or -1."""

    kind: Kind
    connection: int
    order: int
    message: int
    asked: Ask
    latency_ns: int
    asked_frame: int
    gap_bytes: int
    opens: bool
