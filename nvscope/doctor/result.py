"""What a check comes to."""

from __future__ import annotations

from enum import StrEnum

from msgspec import Struct


class State(StrEnum):
    """How it stands with what a check looks at; the worst first."""

    PROBLEM = "problem"
    NOTE = "note"
    UNKNOWN = "unknown"
    OK = "ok"


class Result(Struct, frozen=True):
    """What was seen, and what to do next ("" where there is nothing to do).

    ``about`` is the interface, port, list or node that it is about, "" for all. ``brief`` says a problem in a few words
    that go on behind "because": they stand in the verdict.
    """

    check: str
    state: State
    seen: str
    next_step: str = ""
    about: str = ""
    brief: str = ""
