"""Which elements of which lists a person means by a name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import TelegramLayout, known_fronts, undescribed, unknown_of
from nvscope.definition.variables import Element
from nvscope.enumeration import first_few
from nvscope.errors import UsageError
from nvscope.list_key import ANY_CHANNEL, ListKey, Transport
from nvscope.name_patterns import expression_of
from nvscope.units import cob_id, list_key

_MOST_NEAR = 3
_MOST_LISTS = 6
_MOST_NAMED = 4
_LONGEST_NAME = 1_000
_MOST_COMPARED = 1_000
_SEPARATORS = re.compile(r"[.:/\\]+|->|::")


Unplaced = Sequence[tuple[ListDefinition, Element]]
"""Lists on CAN with the first element that no frame holds."""


@dataclass(slots=True)
class Selection:
    """Names of elements, by list and SubIndex of the telegrams that have them.

    ``others`` are those in all other telegrams of a list of which not all is known. ``unplaced`` are names that were
    meant too, of elements that nobody can find, each with the element of unknown size in front of it.
    """

    telegrams: dict[tuple[ListKey, int], frozenset[str]] = field(default_factory=dict)
    others: dict[ListKey, frozenset[str]] = field(default_factory=dict)
    unplaced: list[tuple[str, Element]] = field(default_factory=list)

    def names_in(self, key: ListKey, subindex: int) -> frozenset[str]:
        """Return the names of the elements that are meant in a telegram."""
        if (key, subindex) not in self.telegrams:
            key = key.on_any_channel
        found = self.telegrams.get((key, subindex))
        return self.others.get(key, frozenset()) if found is None else found

    @property
    def repeated(self) -> bool:
        """Whether several telegrams of a list have an element of one name."""
        entries = [*((key, names) for (key, _), names in self.telegrams.items()), *self.others.items()]
        places = [(key, name) for key, names in entries for name in names]
        return len(set(places)) < len(places)

    def names(self) -> set[str]:
        """Return all names of elements that are meant."""
        return set().union(*self.telegrams.values(), *self.others.values())

    def lists(self) -> list[ListKey]:
        """Return the keys of the lists that have some of them, sorted."""
        meant = [key for (key, _), names in self.telegrams.items() if names]
        return sorted({*meant, *(key for key, names in self.others.items() if names)})


def select(layouts: Layouts, name: str, list_name: str | None = None) -> Selection:
    """Return the elements that a name stands for, in every list that has it.

    Letters are the same in any case, spaces do not count. The name of a structure or array stands for all its elements;
    ``*`` stands for any text and ``?`` for one character. In front of a colon, or as ``list_name``, a list may stand:
    its name, its identifier, or its key such as udp/1202/7. The name of an element of unknown size stands for all bytes
    from it on. Raises UsageError, with the nearest names, where there is nothing of that name.
    """
    listed, colon, rest = name.rpartition(":")
    lists = names_of_lists(layouts)
    if colon:
        try:
            lists = lists_named(lists, listed.strip(), layouts.unplaced)
        except UsageError as error:
            raise _list_or_variable(error, layouts, name) from None
    if list_name is not None:
        lists = lists_named(lists, list_name, layouts.unplaced)
    wanted = _plain(rest)
    matches = re.compile(rf"{expression_of(wanted)}(?:[.\[].*)?", re.DOTALL).fullmatch
    found = Selection()
    names: dict[str, str] = {}

    def chosen(elements: Iterable[Element]) -> frozenset[str]:
        own = {_plain(element.name): element.name for element in elements}
        names.update(own)
        meant = {name for text, name in own.items() if matches(text) or matches(text.removesuffix("…"))}
        return frozenset(meant if wanted else ())

    for key in dict.fromkeys(key for key, _ in lists):
        for layout in (layout for candidate in layouts.candidates_of(key) for layout in candidate):
            if meant := chosen(layout.elements):
                place = key, layout.subindex
                found.telegrams[place] = found.telegrams.get(place, frozenset()) | meant
        if telegrams := layouts.partly_of(key):
            _select_known(found, key, telegrams, chosen)
    if not found.lists():
        raise _nothing_named(rest, wanted, names, found)
    return found


def _select_known(
    found: Selection,
    key: ListKey,
    telegrams: Sequence[TelegramLayout],
    chosen: Callable[[Iterable[Element]], frozenset[str]],
) -> None:
    """Add what is meant of a list of which not all is known."""
    known = known_fronts(telegrams)

    def chosen_of(front: TelegramLayout, cause: Element | None) -> frozenset[str]:
        return chosen([*front.elements, *([undescribed(cause, 1)] if cause else [])])

    for subindex, one in enumerate(known.by_subindex):
        found.telegrams[key, subindex] = chosen_of(*one)
    if known.beyond:
        found.others[key] = chosen_of(*known.beyond)
    for layout in telegrams:
        found_as = known.of(layout.subindex)
        front, cause = (found_as[0].elements, found_as[1]) if found_as else ((), unknown_of(telegrams)[0])
        # What has an unknown size is told by its bytes where they are found, what follows it cannot be told.
        behind = [element for element in layout.elements[len(front) :] if not found_as or element != cause]
        if cause:
            found.unplaced += [(name, cause) for name in _in_order(chosen(behind), behind)]


def _in_order(names: frozenset[str], elements: Sequence[Element]) -> list[str]:
    return [element.name for element in elements if element.name in names]


def unplaced_text(unplaced: Sequence[tuple[str, Element]]) -> str:
    """Return which elements nobody can find, and why; of many, the first few."""
    names = first_few([name for name, _ in unplaced], _MOST_NAMED)
    cause, verb = unplaced[0][1], "is" if len(unplaced) == 1 else "are"
    told = f"{cause.name} : {cause.type.name}, whose size is not known"
    if unplaced[0][0] == cause.name:
        # Frames of CAN that begin with it are not looked for.
        return f"nobody knows where {names} {verb}, from {told}, on"
    return f"nobody knows where {names} {verb}, behind {told}"


def _nothing_named(rest: str, wanted: str, names: Mapping[str, str], found: Selection) -> UsageError:
    if found.unplaced:
        cause = found.unplaced[0][1]
        hint = f"{cause.name} stands for all bytes from there on"
        if cause.name in [name for name, _ in found.unplaced]:
            hint = f"what stands in front of {cause.name} is known"
        return UsageError(unplaced_text(found.unplaced), next_step=hint)
    # Structures and arrays as a whole, in their own spelling.
    whole = {text: names[text] for text in names}
    for text, name in names.items():
        front = text.split(".")[0].split("[")[0].removesuffix("…")
        whole.setdefault(front, name[: len(front)])
    near = dict.fromkeys([*_same_behind(wanted, whole), *get_close_matches(wanted, whole, _MOST_NEAR, 0.5)])
    told = ", ".join(whole[text] for text in list(near)[:_MOST_NEAR])
    return UsageError(
        f"no variable is named '{rest.strip()[:80]}'",
        next_step=f"near it: {told}" if told else "`nvscope gvl layout` shows all names of the definition files",
    )


def _same_behind(wanted: str, names: Iterable[str]) -> list[str]:
    """Return the names that end as what a person wrote, whose prefix or separators are others; the nearest first."""
    parts = [part for part in _SEPARATORS.split(wanted[:_LONGEST_NAME]) if part]
    known = list(names)
    for first in range(len(parts)):
        end = ".".join(parts[first:])
        found = [name for name in known if name == end or name.endswith(f".{end}")]
        if found:
            return get_close_matches(wanted, found[:_MOST_COMPARED], _MOST_NEAR, 0.0)
    return []


def _list_or_variable(error: UsageError, layouts: Layouts, name: str) -> UsageError:
    """Return the error that no list has the name in front of a colon, with variables that it is perhaps a part of."""
    elements = (
        element.name
        for key, _ in layouts.lists()
        for telegrams in [*layouts.candidates_of(key), layouts.partly_of(key)]
        for layout in telegrams
        for element in layout.elements
    )
    whole = {_plain(text): text for text in elements}
    near = ", ".join(whole[text] for text in _same_behind(_plain(name), whole))
    return UsageError(error.what, next_step=f"near it: {near}; {error.next_step}") if near else error


def names_of_lists(layouts: Layouts) -> list[tuple[ListKey, ListDefinition]]:
    """Return all lists with their keys; one that several definitions name, by each of its names."""
    named = {
        (key, known.name): (key, known)
        for key, entry in layouts.lists()
        for known in [entry, *layouts.definitions_of(key)]
    }
    return list(named.values())


def lists_named(
    lists: Sequence[tuple[ListKey, ListDefinition]], given: str, unplaced: Unplaced = ()
) -> list[tuple[ListKey, ListDefinition]]:
    """Return the lists of a name (in any case), identifier or key (udp/1202/7); UsageError where there is none.

    It says why nothing of a list is known that is ``unplaced``, as of ``Layouts``.
    """
    try:
        keys = keys_named([(key, entry.name) for key, entry in lists], given)
    except UsageError as error:
        raise _nothing_placed(unplaced, given) or error from None
    return [(key, entry) for key, entry in lists if key in keys]


def _nothing_placed(unplaced: Unplaced, given: str) -> UsageError | None:
    for entry, element in unplaced:
        if entry.key is None:
            continue
        with suppress(UsageError):
            keys_named([(entry.key, entry.name)], given)
            return UsageError(
                f"nothing of {entry.name} can be decoded: no frame of CAN holds {element.name} : {element.type.name}",
                next_step="leave its definition out to see the frames themselves",
            )
    return None


def keys_named(lists: Sequence[tuple[ListKey, str]], given: str) -> set[ListKey]:
    """Return the keys of the lists that are meant as in ``lists_named``, given all keys with names ("" without one)."""
    wanted = given.strip().lower()
    found = {key for key, name in lists if wanted in (name.lower(), *map(str.lower, _as_written(key))) and wanted}
    if not found:
        named = [f"{name} ({list_key(str(key))})" if name else list_key(str(key)) for key, name in lists]
        next_step = f"there are {first_few(named, _MOST_LISTS) or 'none'}"
        is_cut = len(lists) > _MOST_LISTS
        by_name = {name.lower(): place for place, (_, name) in enumerate(lists) if name} if is_cut else {}
        if near := get_close_matches(wanted, by_name, _MOST_NEAR, 0.6):
            next_step = f"near it: {', '.join(named[by_name[name]] for name in near)}; {next_step}"
        if channel := _channel_of(given.strip(), lists):
            next_step += f"; frames of one channel are chosen by -Y 'can.channel == \"{channel}\"'"
        raise UsageError(f"no list is named '{given[:80]}'", next_step=next_step)
    return found


def _channel_of(wanted: str, lists: Sequence[tuple[ListKey, str]]) -> str:
    """Return the channel that a key names, where its list is defined for any; else nothing."""
    match = re.fullmatch(r"can/([^/\"']{1,60})/(\d{1,10}|0x[0-9a-f]{1,8})", wanted, re.IGNORECASE)
    if match is None:
        return ""
    number = int(match[2], 16 if "x" in match[2].lower() else 10)
    return match[1] if ListKey.can(ANY_CHANNEL, number) in [key for key, _ in lists] else ""


def _as_written(key: ListKey) -> tuple[str, ...]:
    """Return how people write the key of a list, or its identifier alone."""
    told = str(key.identifier), f"{key.port}/{key.identifier}", str(key)
    if key.transport is not Transport.CAN:
        return told
    hexadecimal = dict.fromkeys((f"0x{key.identifier:x}", cob_id(key.identifier)))
    on_can = (written for number in hexadecimal for written in (number, f"can/{number}", f"{key.port}/{number}"))
    return (*told, f"can/{key.identifier}", *on_can, list_key(str(key)))


def _plain(name: str) -> str:
    return "".join(name.split()).lower().replace("...", "…")
