"""The searches behind the rules of ``lint``: where in definitions something is that will not work on the wire.

``find_…`` yields places, ``tell_…`` returns the message about one list, None where there is nothing to say; what each
is about, and why it matters, the rule says.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from msgspec import Struct

from dissectors.can.canopen import MAX_COB_ID
from nvscope.definition.cob_ids import CobIds, canopen_uses, overlaps, taken_by
from nvscope.definition.difference import list_difference
from nvscope.definition.initial_values import misfits
from nvscope.definition.model import AssumedBase, ListDefinition, Problem
from nvscope.definition.named_sizes import named_sizes
from nvscope.definition.packing import TelegramLayout, capacity_bytes, pack, placed
from nvscope.definition.position import Position
from nvscope.definition.reached_types import reached_types
from nvscope.definition.syntax import FileSyntax
from nvscope.definition.variables import Array, Scalar, Structure, Union, elements
from nvscope.units import cob_id, count, count_of, duration

MOST_TELEGRAMS = 20
"""How many telegrams a receiver takes per task cycle, as one vendor states it."""

_MOST_NAMESAKES = 100
_MOST_VERSIONS = 5


class Packed(Struct, frozen=True):
    """A list, and its telegrams by SubIndex, as far as they are known; ``whole`` where nothing of it has no place."""

    list: ListDefinition
    telegrams: tuple[TelegramLayout, ...]
    whole: bool = True

    @staticmethod
    def of(entry: ListDefinition) -> Packed:
        """Return a list, packed. Raises ConfigurationError where it cannot be."""
        telegrams, unplaced = placed(pack(entry))
        return Packed(entry, telegrams, not unplaced)

    @property
    def on_can(self) -> bool:
        """Whether the list is sent over CAN."""
        return self.list.on_can

    @property
    def cob_ids(self) -> CobIds | None:
        """What the list takes on CAN; None where it is not there, or its identifier is unknown."""
        return taken_by(self.list)


class Subject(Struct, frozen=True):
    """What is looked at: the files as they are written, and the lists and mistakes that follow from them.

    ``lists`` are those that are surely sent; ``nameless`` are all without an identifier, which may be no such lists.
    """

    files: Sequence[FileSyntax]
    lists: Sequence[Packed]
    nameless: Sequence[ListDefinition] = ()
    left_out: Sequence[Problem] = ()
    problems: Sequence[Problem] = ()
    assumed: Sequence[AssumedBase] = ()


class Place(Struct, frozen=True):
    """Where a rule found something, of which list (empty for types), and what."""

    position: Position
    list_name: str
    message: str


def find_left_out(subject: Subject) -> Iterator[Place]:
    """Find files, and declarations, that had to be left out."""
    return (Place(problem.position, "", problem.what) for problem in subject.left_out)


def find_contradictions(subject: Subject) -> Iterator[Place]:
    """Find what lists need and cannot be."""
    return (Place(problem.position, "", problem.what) for problem in subject.problems)


def find_initial_values(subject: Subject) -> Iterator[Place]:
    """Find initial values that do not fit; what bounds need is a contradiction already."""
    told = {problem.position for problem in subject.problems}
    for found in misfits(subject.files):
        if found.position not in told:
            message = f"the initial value {found.value} of {found.variable} does not fit into {_range_text(found.kind)}"
            yield Place(found.position, found.list_name, message)


def _range_text(kind: Scalar) -> str:
    """Return the name of a type as it is declared, with its subrange."""
    return kind.name if kind.low is None else f"{kind.name} ({kind.low}..{kind.high})"


def find_assumed_bases(subject: Subject) -> Iterator[Place]:
    """Find enumerations whose base type is assumed."""
    for base in subject.assumed:
        yield Place(base.position, "", f"the base type of {base.name} is not in this export, INT is assumed")


def each_list(test: Callable[[ListDefinition], str | None]) -> Callable[[Subject], Iterator[Place]]:
    """Return a search that asks each list by itself; the answer is a message, or None."""

    def find(subject: Subject) -> Iterator[Place]:
        for packed in subject.lists:
            message = test(packed.list)
            if message is not None:
                yield _of_list(packed.list, message)

    return find


def _of_list(entry: ListDefinition, message: str) -> Place:
    return Place(entry.position, entry.name, message)


def find_duplicates(subject: Subject) -> Iterator[Place]:
    by_address: dict[tuple[int, int], list[ListDefinition]] = {}
    for packed in subject.lists:
        if packed.list.list_id is not None and not packed.on_can:
            by_address.setdefault((packed.list.port, packed.list.list_id), []).append(packed.list)
    for (port, number), entries in by_address.items():
        first, versions = entries[0], entries[:1]
        for other in entries[1:_MOST_NAMESAKES]:
            # The sender's and the reader's file of one list say the same, and are meant to: a version is told once.
            if any(_is_the_same(other, version) for version in versions[:_MOST_VERSIONS]):
                continue
            versions.append(other)
            what = f"{other.name} has the identifier {number} on port {port}, which {first.name} has too"
            yield _of_list(other, f"{what} ({first.position})")


def _is_the_same(one: ListDefinition, other: ListDefinition) -> bool:
    return one.name.upper() == other.name.upper() and list_difference(one, other).may_be_same


def find_identifiers_missing(subject: Subject) -> Iterator[Place]:
    return (_of_list(entry, f"{entry.name} has no list identifier") for entry in subject.nameless)


def tell_identifier_large(entry: ListDefinition) -> str | None:
    if entry.list_id is None or entry.list_id <= 255 or entry.on_can:
        return None
    return f"the identifier {entry.list_id} of {entry.name} needs more than 8 bits"


def tell_empty(entry: ListDefinition) -> str | None:
    return None if entry.variables else f"{entry.name} has no variables"


def tell_never_sent(entry: ListDefinition) -> str | None:
    if entry.cyclic or entry.on_change or entry.on_event:
        return None
    return f"{entry.name} is sent neither cyclically, nor on change, nor on an event"


def tell_interval_zero(entry: ListDefinition) -> str | None:
    return f"{entry.name} is cyclic with an interval of 0" if entry.cyclic and entry.interval_ns == 0 else None


def tell_interval_short(entry: ListDefinition) -> str | None:
    if not entry.cyclic or not entry.interval_ns or not entry.min_gap_ns or entry.interval_ns >= entry.min_gap_ns:
        return None
    return (
        f"the interval of {entry.name}, {duration(entry.interval_ns)}, is shorter than its minimum gap of "
        f"{duration(entry.min_gap_ns)}"
    )


def tell_acknowledged_broadcast(entry: ListDefinition) -> str | None:
    if not entry.acknowledge or not _goes_to_many(entry):
        return None
    return f"{entry.name} wants acknowledgements, and is sent to {entry.address}"


def tell_checksum_broadcast(entry: ListDefinition) -> str | None:
    if not entry.checksum or not _goes_to_many(entry):
        return None
    return f"{entry.name} carries a checksum, and is sent to {entry.address}"


def _goes_to_many(entry: ListDefinition) -> bool:
    """Return whether an address is a broadcast or multicast; of a subnet's, the usual form is recognised."""
    address = ipaddress.ip_address(entry.address)
    return not entry.on_can and (address.is_multicast or address.packed[-1] == 255)


def find_cut(subject: Subject) -> Iterator[Place]:
    for packed in subject.lists:
        if packed.on_can:
            continue  # on CAN every array is cut: nobody can help it
        if not packed.list.pack:
            composite = [entry for entry in packed.list.variables if isinstance(entry.type, Array | Structure)]
            names = [variable.name for variable in composite]
            if names and (len(packed.telegrams) > 1 or not packed.whole):
                more = f" and {count_of(len(names) - 1, 'more variable')}" if len(names) > 1 else ""
                message = f"{names[0]}{more} of {packed.list.name} go in a telegram for each element: it is not packed"
                yield Place(composite[0].position, packed.list.name, message)
            continue
        cuts = _cuts_of(packed.telegrams)
        place = 0
        for variable in packed.list.variables:
            last = place + sum(1 for _ in elements(variable))
            own = [cut for at, cut in cuts.items() if place < at < last]
            place = last
            if own:
                before, behind, subindex = own[0]
                more = f", and at {count_of(len(own) - 1, 'more place')}" if len(own) > 1 else ""
                message = (
                    f"{variable.name} is cut between {before} (SubIndex {subindex - 1}) and {behind} "
                    f"(SubIndex {subindex}){more}"
                )
                yield Place(variable.position, packed.list.name, message)


def _cuts_of(telegrams: Sequence[TelegramLayout]) -> dict[int, tuple[str, str, int]]:
    """Return the elements before and behind the beginning of each SubIndex, by the place of the latter in the list."""
    cuts: dict[int, tuple[str, str, int]] = {}
    place = 0
    for before, behind in pairwise(telegrams):
        place += before.items
        cuts[place] = before.elements[-1].name, behind.elements[0].name, behind.subindex
    return cuts


def find_long_elements(subject: Subject) -> Iterator[Place]:
    for packed in subject.lists:
        limit = capacity_bytes(packed.list)
        if packed.on_can:
            continue
        for variable in packed.list.variables:
            longest = max(elements(variable), key=lambda element: element.type.size_bytes, default=None)
            if longest is not None and longest.type.size_bytes > limit:
                message = f"{longest.name} : {longest.type.name} has {count_of(longest.type.size_bytes, 'byte')}"
                yield Place(variable.position, packed.list.name, f"{message}, more than the {limit} of a telegram")


def find_many_telegrams(subject: Subject) -> Iterator[Place]:
    for packed in subject.lists:
        number = len(packed.telegrams)
        if number > MOST_TELEGRAMS and not packed.on_can:
            how = "" if packed.list.pack else ", one for each element: it is not packed"
            least = "" if packed.whole else "at least "
            yield _of_list(packed.list, f"{packed.list.name} takes {least}{count(number)} telegrams{how}")


def find_unknown_sizes(subject: Subject) -> Iterator[Place]:
    for packed in subject.lists:
        for variable in packed.list.variables:
            unknown = next((element for element in elements(variable) if not element.type.size_bytes), None)
            if unknown is not None:
                message = f"nobody knows how many bytes {unknown.name} : {unknown.type.name} has"
                yield Place(variable.position, packed.list.name, message)


def find_unions(subject: Subject) -> Iterator[Place]:
    for packed in subject.lists:
        for variable in packed.list.variables:
            union = next((element for element in elements(variable) if isinstance(element.type, Union)), None)
            if union is not None:
                yield Place(variable.position, packed.list.name, f"{union.name} : {union.type.name} is a UNION")


def find_sizes_by_name(subject: Subject) -> Iterator[Place]:
    places = {packed.list.position for packed in subject.lists}
    lists = [entry for file in subject.files for entry in file.lists if entry.source.position(entry.offset) in places]
    for found in named_sizes(lists, reached_types(subject.files, lists)):
        yield Place(found.position, found.list_name, f"{found.what} of {found.variable} is {found.text}")


def _can_lists(subject: Subject) -> list[CobIds]:
    return [taken for packed in subject.lists if (taken := packed.cob_ids) is not None]


def find_can_overlaps(subject: Subject) -> Iterator[Place]:
    for one, other in overlaps(_can_lists(subject)):
        what = f"{other.list.name} takes {other.text}, {one.list.name} {one.text}"
        yield _of_list(other.list, f"{what} ({one.list.position})")


def find_can_services(subject: Subject) -> Iterator[Place]:
    for taken in _can_lists(subject):
        uses = canopen_uses(taken)
        if uses:
            yield _of_list(taken.list, f"{taken.list.name} takes {taken.text}, which CANopen uses for {uses}")


def find_can_identifiers(subject: Subject) -> Iterator[Place]:
    for taken in _can_lists(subject):
        if taken.last > MAX_COB_ID:
            message = f"{taken.list.name} takes {taken.text}, beyond {cob_id(MAX_COB_ID)}"
            yield _of_list(taken.list, message)


def find_can_long(subject: Subject) -> Iterator[Place]:
    for packed in subject.lists:
        if packed.on_can:
            for variable in packed.list.variables:
                long = next((entry for entry in elements(variable) if entry.type.size_bytes > 8), None)
                if long is not None:
                    message = f"{long.name} : {long.type.name} has {count_of(long.type.size_bytes, 'byte')}"
                    yield Place(variable.position, packed.list.name, f"{message}, more than a CAN frame")


def tell_can_unsupported(entry: ListDefinition) -> str | None:
    wanted = [
        word
        for word, on in (
            ("a checksum", entry.checksum), ("acknowledgements", entry.acknowledge), ("an event", entry.on_event),
        )
        if on
    ]  # fmt: skip
    if not entry.on_can or not wanted:
        return None
    return f"{entry.name} is sent over CAN with {' and '.join(wanted)}"
