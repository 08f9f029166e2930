"""Definition: lists, with their variables and how they are sent. It holds nothing that was observed."""

from __future__ import annotations

from collections.abc import Iterable
from operator import attrgetter
from typing import TYPE_CHECKING

from msgspec import Struct

from nvscope.list_key import ANY_CHANNEL, ListKey

if TYPE_CHECKING:  # where no list is defined, nothing of its variables is imported
    from nvscope.definition.parameters import Parameters
    from nvscope.definition.position import Position
    from nvscope.definition.variables import Variable

DEFAULT_PORT = 1202
"""The UDP port of lists for which nothing says one."""


class UnknownName(Struct, frozen=True):
    """A type or a constant that a list needs and no file declares; ``nearest`` is what was perhaps meant, or ""."""

    name: str
    position: Position
    nearest: str = ""
    constant: bool = False


class Problem(Struct, frozen=True):
    """Something in a definition file that cannot be, in the words of an error."""

    what: str
    position: Position
    next_step: str


class AssumedBase(Struct, frozen=True):
    """An enumeration that is taken for an INT, since its file does not say of what type it is."""

    name: str
    position: Position


Flaw = UnknownName | Problem | AssumedBase
"""Why a variable is of unknown size, or less is known of a type than its declaration should say."""


class ListDefinition(Struct, frozen=True):
    """One network variables list.

    What no file says is None: ``list_id`` (the COB-ID), ``interval_ns``, ``min_gap_ns``. ``order`` of the variables is
    that of the declarations; a list of which only the project file knows has none. ``position`` is where the list is
    defined. ``channel`` is the CAN channel it is sent over, "" for any. ``flaws`` are what its variables need and no
    file declares, and what about their types cannot be.
    """

    name: str
    position: Position
    variables: tuple[Variable, ...]
    list_id: int | None = None
    protocol: str = "UDP"
    port: int = DEFAULT_PORT
    address: str = "255.255.255.255"
    pack: bool = True
    checksum: bool = False
    acknowledge: bool = False
    cyclic: bool = True
    on_change: bool = False
    on_event: bool = False
    interval_ns: int | None = None
    min_gap_ns: int | None = None
    channel: str = ANY_CHANNEL
    flaws: frozenset[Flaw] = frozenset()

    @property
    def on_can(self) -> bool:
        """Whether it is sent over CAN."""
        return self.protocol.upper() == "CAN"

    @property
    def is_sent_whole(self) -> bool:
        """Whether all its telegrams are sent each time: on a change, or an event, one may be sent alone."""
        return self.cyclic and not self.on_change and not self.on_event

    @property
    def key(self) -> ListKey | None:
        """What it is told by on the wire; None of a list without identifier, or over something else."""
        if self.list_id is None:
            return None
        if self.on_can:
            return ListKey.can(self.channel, self.list_id)
        return ListKey.udp(self.port, self.list_id) if self.protocol.upper() == "UDP" else None


class Definition(Struct, frozen=True):
    """All lists of all files, and the files that had to be ``left_out`` because of a mistake in them, with that.

    ``parameters`` are those of the Parameter Manager, which only the project file tells; None where it tells none.
    """

    lists: tuple[ListDefinition, ...] = ()
    left_out: tuple[Problem, ...] = ()
    parameters: Parameters | None = None

    def flaws_of(self, lists: Iterable[ListDefinition]) -> list[Flaw]:
        """Return the flaws of some lists, each once, by file, line and column."""
        found = frozenset[Flaw]().union(*(entry.flaws for entry in lists))
        return sorted(found, key=attrgetter("position.file", "position.line", "position.column"))

    @property
    def on_can(self) -> bool:
        """Whether a list is sent over CAN, and its identifier known: without one, no frame is of a list."""
        return any(entry.on_can and entry.list_id is not None for entry in self.lists)

    def by_key(self) -> dict[ListKey, ListDefinition]:
        """Return the lists that have an identifier, by what they are told by on the wire; of several, the first."""
        found: dict[ListKey, ListDefinition] = {}
        for entry in self.lists:
            if entry.key is not None:
                found.setdefault(entry.key, entry)
        return found

    def nominal_intervals_ns(self) -> dict[ListKey, int]:
        """Return at which interval lists are sent: 0 of those that are not sent cyclically.

        Of a list that is not there, nobody says.
        """
        entries = self.by_key().items()
        told = {key: entry.interval_ns for key, entry in entries if entry.cyclic and entry.interval_ns}
        return told | {key: 0 for key, entry in entries if not entry.cyclic}
