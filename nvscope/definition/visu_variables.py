"""Variable lists of WebVisu pages: the XML files that controllers serve beside them.

Source: ``webvisu.md`` section 4: ``variablelist/variable`` of any file of a visualization (``plc_visu.xml``,
``visu_ini.xml``), and ``SymbolVarList/Var`` of ``*.SYM_XML``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from msgspec import Struct, field

from dissectors.webvisu import MOST_ADDRESS_CHARACTERS, TYPES, Place
from nvscope.definition.source import DefinitionError, read_source
from nvscope.definition.xml_tree import Element, read_xml
from nvscope.errors import ConfigurationError

MOST_VARIABLES = 100_000
_MOST_WHY = 200
"""So many of a file are read."""

_PLACE = re.compile(r"\s*(\d{1,10})\s*,\s*(\d{1,10})\s*,\s*(\d{1,10})\s*,\s*(\d{1,10})\s*\Z")
_SIZES = {
    "BOOL": 1, "BYTE": 1, "SINT": 1, "USINT": 1, "INT": 2, "UINT": 2, "WORD": 2, "DINT": 4, "UDINT": 4, "DWORD": 4,
    "REAL": 4, "TIME": 4, "DATE": 4, "TOD": 4, "DT": 4, "LREAL": 8,
}  # fmt: skip


class VisuVariables(Struct, frozen=True):
    """The variables of a list: their names by where they lie.

    ``listed`` are all of them in the order of the file, also several names of one place. ``stamp`` is what the file
    says of its time, '' where it says nothing; ``left_out`` how many there was no room for. ``unread`` is why it cannot
    be read, '' where it can; it may not be printable.
    """

    names: Mapping[Place, str] = field(default_factory=dict)
    stamp: str = ""
    left_out: int = 0
    listed: Sequence[tuple[str, Place]] = ()
    unread: str = ""


def read_visu_variables(path: str, content: bytes | None = None) -> VisuVariables:
    """Return the variables that an XML file lists, or a ``content`` that is called so.

    Raises ConfigurationError where it cannot be read, or is no XML that can be trusted. A file without such a list has
    none.
    """
    root = read_xml(read_source(path, content=content))
    names: dict[Place, str] = {}
    listed: list[tuple[str, Place]] = []
    left_out = 0
    for name, place in _listed(root):
        if len(listed) >= MOST_VARIABLES:
            left_out += 1
        elif name:
            names[place] = name
            listed.append((name, place))
    stamp = root.child("time-stamp")
    return VisuVariables(
        MappingProxyType(names), "" if stamp is None else stamp.text[:100], left_out, tuple(listed)
    )  # fmt: skip


def variables_in(content: bytes) -> VisuVariables:
    """Return the variables of a file as it came over the network; none, and why, where it cannot be read."""
    try:
        return read_visu_variables("variable list", content)
    except ConfigurationError as error:
        line = error.position.line if isinstance(error, DefinitionError) else 0
        return VisuVariables(unread=f"{f'line {line}: ' if line else ''}{error.what}"[:_MOST_WHY])


def _listed(root: Element) -> Iterator[tuple[str, Place]]:
    for element in root.below():
        if element.tag == "variablelist":
            for variable in element.children:
                numbers = _PLACE.match(variable.text)
                if variable.tag == "variable" and numbers is not None:
                    yield _name(variable.attributes.get("name", "")), Place(*map(int, numbers.groups()))
        elif element.tag == "SymbolVarList":
            for variable in element.children:
                place = _symbol(variable.attributes)
                if place is not None:
                    yield _name(variable.attributes.get("Name") or variable.text), place


def _name(text: str) -> str:
    return text[:MOST_ADDRESS_CHARACTERS]


def _symbol(attributes: Mapping[str, str]) -> Place | None:
    """Return where a variable of a SYM_XML file lies; its sizes are those of its types."""
    kind = attributes.get("Type", "").upper()
    area, offset = attributes.get("RefId", ""), attributes.get("Offset", "")
    if not (area.isdecimal() and offset.isdecimal()) or kind not in _SIZES:
        return None
    return Place(int(area), int(offset), _SIZES[kind], TYPES.index(kind))
