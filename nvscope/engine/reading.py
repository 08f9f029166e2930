"""Reading: how frames are to be read, as one value that goes from whoever asks to the loop."""

from __future__ import annotations

from msgspec import Struct, field

from dissectors.can.pdo import PdoRules
from dissectors.dissector import Dissector
from dissectors.netvar import PortRules
from nvscope.engine.limit import MAX_STREAMS
from nvscope.engine.told import Choose

TIMEOUT_NS = 1_000_000_000
"""So long an answer may take unless somebody says otherwise."""

PARAMETER_TIMEOUT_NS = 500_000_000
"""The same of replies of the Parameter Manager."""


class Reading(Struct, frozen=True):
    """How frames are read.

    ``ports`` decide by hand which UDP payloads are telegrams, None: by their identity. ``pdos`` say which lists CAN
    frames belong to. ``choose`` is the filter, None without one: it changes what is shown, and no figure.
    ``timeout_ns`` is how long an answer may take, ``parameter_timeout_ns`` how long a reply of the Parameter Manager
    may. ``dissectors`` read the protocols that have ports of their own, the
    first one first where several could. ``max_streams`` is how many streams, and other kinds of telegrams by sender,
    receiver, list and SubIndex, are told apart; so many identifiers of CAN. ``all_frames``: frames in which nothing is
    found are wanted too (``Told.others``). Without ``hears_answers``, what nodes answer to each other is not to be
    seen: nobody waits for it.
    """

    ports: PortRules | None = None
    pdos: PdoRules = field(default_factory=PdoRules)
    choose: Choose | None = None
    timeout_ns: int = TIMEOUT_NS
    dissectors: tuple[Dissector, ...] = ()
    max_streams: int = MAX_STREAMS
    all_frames: bool = False
    hears_answers: bool = True
    parameter_timeout_ns: int = PARAMETER_TIMEOUT_NS
