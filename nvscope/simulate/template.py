"""Template: what many frames of a scenario have in common, and what each is to an observer."""

from __future__ import annotations

from enum import IntEnum

from msgspec import Struct

from nvscope.list_key import ListKey
from nvscope.simulate.frames import Frame, IPAddress


class Role(IntEnum):
    """What a frame is to an observer, if enough of it is captured."""

    DATA = 0
    ACKNOWLEDGEMENT = 1
    BOOT_UP_REQUEST = 2
    MALFORMED_DATA = 3
    MALFORMED = 4
    PARAMETER = 5
    UNREACHABLE = 6
    OTHER = 7


class Template(Struct, frozen=True):
    """Frames that differ in the columns only, and what is true of all of them.

    ``key`` is that of the list, None where there is none. ``malformed`` is the kind of a malformed telegram, as the
    scenario names it. ``index_end`` is where in an ICMP message the quoted Index ends, 0 if it is not quoted.
    """

    frame: Frame
    role: Role
    source: IPAddress
    destination: IPAddress
    broadcast: bool
    key: ListKey | None = None
    subindex: int = 0
    stream: int = -1
    items: int = 0
    malformed: str | None = None
    index_end: int = 0
    ascii_identity: bool = False
