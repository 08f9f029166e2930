"""The variables of a controller: by the names of its lists, or by where they lie."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from dissectors.webvisu import STRING, TYPES, Place, is_password
from nvscope.definition.visu_passwords import NO_PASSWORDS, Passwords
from nvscope.definition.visu_values import scalar_at
from nvscope.definition.visu_variables import VisuVariables, read_visu_variables
from nvscope.errors import ConfigurationError, UsageError
from nvscope.name_patterns import fits, is_pattern

_ADDRESS = re.compile(r"(\d{1,10}),(\d{1,10}),(\d{1,10}),(\d{1,10}|[A-Za-z]{1,20})", re.ASCII)
_MOST_NAMED = 5


class Variable(NamedTuple):
    """A variable; ``name`` is '' where nobody knows it. ``is_secret``: it holds a password, or may."""

    name: str
    place: Place
    is_secret: bool = False

    @property
    def text(self) -> str:
        """What it is called."""
        return self.name or self.place.text


class ListSource(NamedTuple):
    """A list: file or URL, what it says of its time, how many variables it has, and how many more were left out."""

    source: str
    stamp: str
    variables: int
    left_out: int

    @property
    def row(self) -> dict[str, Any]:
        """The list as documents have it."""
        return self._asdict() | {"stamp": self.stamp or None}


@dataclass(frozen=True)
class KnownVariables:
    """All variables of some lists, each once, in their order."""

    sources: Sequence[ListSource] = ()
    listed: Sequence[Variable] = field(default=(), repr=False)
    passwords: Passwords = field(default=NO_PASSWORDS, repr=False)

    @cached_property
    def _by_name(self) -> Mapping[str, Sequence[Variable]]:
        found: dict[str, list[Variable]] = {}
        for one in self.listed:
            found.setdefault(one.name.casefold(), []).append(one)
        return found

    @cached_property
    def _by_place(self) -> Mapping[Place, Variable]:
        return {one.place: one for one in self.listed}

    def find(self, word: str) -> Variable:
        """Return the variable of a name, in any case, or of an address; UsageError where there is none, or several."""
        place = place_of(word)
        if place is not None:
            known = self._by_place.get(place)
            return known or Variable("", place, place.type == STRING or self.passwords.lie_in(place))
        name = word.casefold()
        found = self._by_name.get(name) or self._by_name.get(f".{name}") or ()
        if len({one.place for one in found}) == 1:
            return found[0]
        if found:
            places = ", ".join(one.place.text for one in found[:_MOST_NAMED])
            raise UsageError(f"several variables are called '{word[:60]}'", next_step=f"name one of them: {places}")
        from nvscope.toml_table import nearest  # noqa: PLC0415  # only where something is wrong

        hint = "the verb list shows what there is; an address has four numbers: 4,0,6,8"
        raise UsageError(
            f"no variable is called '{word[:60]}'",
            next_step=nearest(word, [one.name for one in self.listed]) or hint,
        )  # fmt: skip

    def chosen(self, words: Sequence[str]) -> Sequence[Variable]:
        """Return those that words stand for (names, addresses, patterns), in the order of the lists; all without words.

        UsageError for a word that stands for none.
        """
        if not words:
            return self.listed
        rows: set[int] = set()
        for word in words:
            place = place_of(word)
            found = [
                row for row, one in enumerate(self.listed)
                if one.place == place or fits(word, one.name) or fits(f".{word}", one.name)
            ]  # fmt: skip
            if not found and (place is not None or is_pattern(word)):
                what = "like" if place is None else "at"
                raise UsageError(f"no variable is {what} '{word[:60]}'", next_step="without names, all are listed")
            rows.update(found or [self.listed.index(self.find(word))])
        return [self.listed[row] for row in sorted(rows)]


def place_of(word: str) -> Place | None:
    """Return the place that a word is, ``ref,offset,size,type``; None for a name. UsageError for an unknown type."""
    found = _ADDRESS.fullmatch(word)
    if found is None:
        return None
    ref, offset, size, kind = found.groups()
    if not kind.isdecimal():
        if kind.upper() not in TYPES:
            raise UsageError(f"{word[:60]}: no type is called {kind}", next_step=f"known are {', '.join(TYPES)}")
        kind = str(TYPES.index(kind.upper()))
    return Place(int(ref), int(offset), int(size), int(kind))


def needs_names(words: Iterable[str]) -> bool:
    """Tell whether one has to know names: to find a variable, or to know whether what is no number is a password."""
    places = list(map(place_of, words))
    return any(place is None or scalar_at(place) is None for place in places)


def known_of(lists: Iterable[tuple[str, VisuVariables]]) -> KnownVariables:
    """Return the variables of lists, each with its file or URL."""
    sources, found = [], dict[tuple[str, Place], str]()
    for source, one in lists:
        sources.append(ListSource(source, one.stamp, len(one.listed), one.left_out))
        for name, place in one.listed:
            found.setdefault((name.casefold(), place), name)
    passwords = Passwords(place for (_, place), name in found.items() if is_password(name))
    listed = tuple(Variable(name, place, passwords.lie_in(place)) for (_, place), name in found.items())
    return KnownVariables(tuple(sources), listed, passwords)


def known_of_files(paths: Sequence[str]) -> KnownVariables:
    """Return the variables of files; ConfigurationError where one cannot be read, or has none."""
    lists = [(path, read_visu_variables(path)) for path in paths]
    for path, one in lists:
        if not one.listed:
            raise ConfigurationError(
                "no variable list is in it", where=path,
                next_step="name plc_visu.xml, visu_ini.xml, or a *.SYM_XML of the project",
            )  # fmt: skip
    return known_of(lists)
