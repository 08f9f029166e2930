"""One HTTP request to a controller, and how it ended."""

from __future__ import annotations

from enum import Enum

from msgspec import Struct

TIMEOUT_NS = 5_000_000_000
"""How long all of an exchange may take: some controllers take seconds."""

MOST_TIMEOUT_NS = 600_000_000_000


class Ending(Enum):
    """How a request ended.

    ``SILENT``: no whole reply within the timeout. ``UNDELIVERED``: nobody takes connections there. ``BROKEN``: the
    connection ended before the reply did. ``NO_HTTP``: what came is no HTTP. ``OVERSIZED``: it is too long to be one.
    """

    REPLIED = "replied"
    SILENT = "silent"
    UNDELIVERED = "undelivered"
    BROKEN = "broken"
    NO_HTTP = "no_http"
    OVERSIZED = "oversized"


class Exchange(Struct, frozen=True):
    """A request, and what came of it.

    ``status`` is None where none came, ``body`` empty but of a whole reply. ``latency_ns`` runs from before the
    connection is made to the end of the reply, None without one. ``why`` says more of how it ended, in the words of
    this system; ``location`` is where a redirection leads to. Neither is safe to print.
    """

    method: str
    path: str
    ending: Ending
    status: int | None = None
    body: bytes = b""
    latency_ns: int | None = None
    why: str = ""
    location: str = ""

    @property
    def is_good(self) -> bool:
        """Whether a whole reply of status 200 came."""
        return self.ending is Ending.REPLIED and self.status == 200
