"""Telegrams of lists as JSON messages: structures are objects, arrays are arrays, whatever telegram they come in.

Arrays of several dimensions, and arrays of arrays, are one array, the last index fastest: Foxglove shows no topic in
whose schema an array is in an array, or something has two types.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product, repeat
from typing import Any

from dissectors.batch import I64
from nvscope.definition.model import ListDefinition
from nvscope.definition.variables import Array, Element, Structure, Type
from nvscope.record.json_values import value_schema, value_texts
from nvscope.view.escape import json_text
from nvscope.view.rows.defined import DefinedRows, Place
from nvscope.view.rows.values import ColumnDecoder

ORIGIN = "_nv"
"""What a message tells beside variables: no variable is called so."""

REST = "_rest"
"""What nobody has described of a telegram."""

_ORIGIN_SCHEMA = {
    "type": "object",
    "properties": {
        "sender": {"type": "string", "description": "address of the sender; on CAN the channel"},
        "subindex": {"type": "integer"},
        "frame": {"type": "integer", "description": "number of the frame, counted from the begin"},
    },
}


def list_schema(definitions: Sequence[ListDefinition], *, has_rest: bool = False) -> str:
    """Return the JSON Schema of the messages of a list; of several definitions, the first says what a variable is.

    ``has_rest``: of some telegrams, nobody has described what is behind the variables.
    """
    properties: dict[str, Any] = {ORIGIN: _ORIGIN_SCHEMA}
    for definition in definitions:
        for variable in definition.variables:
            properties.setdefault(variable.name, _schema(variable.type))
    if has_rest:
        properties[REST] = {"type": "string", "description": "bytes that nobody has described, hexadecimal"}
    return json.dumps({"title": definitions[0].name, "type": "object", "properties": properties})


def _schema(kind: Type) -> dict[str, Any]:
    if isinstance(kind, Structure):
        return {"type": "object", "properties": {member.name: _schema(member.type) for member in kind.members}}
    if isinstance(kind, Array):
        dimensions = [kind.bounds]
        while isinstance(kind.element, Array):
            kind = kind.element
            dimensions.append(kind.bounds)
        bounds = "".join(f"[{', '.join(f'{low}..{high}' for low, high in own)}]" for own in dimensions)
        return {"type": "array", "items": _schema(kind.element), "description": bounds}
    return value_schema(kind)


class TelegramMessages:
    """Makes messages of the telegrams of one place; ``senders`` are the addresses by number."""

    def __init__(self, place: Place) -> None:
        self._place = place
        self._decoder = ColumnDecoder(place.layout)
        self._order: list[int] = []
        parts = [f'"{ORIGIN}": {{"sender": %s, "subindex": %d, "frame": %d}}', *self._variables()]
        if place.rest is not None:
            parts.append(f'"{REST}": "%s"')
        self._form = f"{{{', '.join(parts)}}}"

    def _variables(self) -> Iterator[str]:
        """Yield the forms of the variables of which something is in the telegram."""
        number = {element.name: place for place, element in enumerate(self._place.layout.elements)}
        for variable in self._place.layout.list.variables:
            form = self._form_of(variable.name, variable.type, number)
            if form is not None:
                yield f"{_key(variable.name)}: {form}"

    def _form_of(self, name: str, kind: Type, number: Mapping[str, int]) -> str | None:
        """Return how values of a type are written, None where nothing of them is in the telegram."""
        if isinstance(kind, Structure):
            told = [
                (member.name, self._form_of(f"{name}.{member.name}", member.type, number)) for member in kind.members
            ]
            members = [f"{_key(name)}: {form}" for name, form in told if form is not None]
            return f"{{{', '.join(members)}}}" if members else None
        if isinstance(kind, Array):
            forms = list(self._entries(name, kind, number))
            # What comes in other telegrams keeps its place.
            return (
                f"[{', '.join(form or absent for form, absent in forms)}]" if any(form for form, _ in forms) else None
            )
        place = number.get(name)
        if place is None:
            return None
        self._order.append(place)
        return "%s"

    def _entries(self, name: str, kind: Array, number: Mapping[str, int]) -> Iterator[tuple[str | None, str]]:
        """Yield the form of each entry of an array, and what stands for one that is not in the telegram."""
        for index in product(*(range(low, high + 1) for low, high in kind.bounds)):
            entry = f"{name}[{', '.join(map(str, index))}]"
            if isinstance(kind.element, Array):
                yield from self._entries(entry, kind.element, number)
            else:
                absent = "{}" if isinstance(kind.element, Structure) else "null"
                yield self._form_of(entry, kind.element, number), absent

    def messages(self, rows: DefinedRows, which: I64, senders: Sequence[str]) -> list[bytes]:
        """Return a message for each of some telegrams, all of this place."""
        size_bytes = self._place.layout.layout.size_bytes
        columns = self._decoder.columns(rows.bytes_of(which, size_bytes))
        elements: tuple[Element, ...] = self._place.layout.elements
        texts = [value_texts(elements[place].type, columns[place]) for place in self._order]
        quoted = [json_text(sender) for sender in senders]
        head = ([quoted[sender] for sender in rows.sender[which].tolist()], rows.subindex[which].tolist())
        rest: list[Sequence[Any]] = []
        if self._place.rest is not None:
            behind = rows.bytes_behind(which, size_bytes)
            data, offset = behind.data.tobytes(), behind.offset.tolist()
            rest = [[data[begin:end].hex() for begin, end in pairwise(offset)]]
        told = zip(*head, rows.frame[which].tolist(), *texts, *rest, strict=True)
        return [text.encode() for text in map(str.__mod__, repeat(self._form), told)]


def _key(name: str) -> str:
    return json_text(name).replace("%", "%%")
