"""What a schema says of each place of its documents, by its path: ``lists[].streams[].lost`` is an integer or null.

Where there are several forms, such as of lists on UDP and on CAN, a path has what any of them has.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tests.schemas.shapes import Schema

_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string", type(None): "null", list: "array"}


@dataclass(frozen=True)
class Told:
    """What may stand at a path: ``types`` of JSON, ``words`` where a text is one of few; ``optional`` keys."""

    types: frozenset[str]
    words: frozenset[str] = frozenset()
    optional: bool = False

    def line(self, path: str) -> str:
        """Return it as a line of a file that people read."""
        words = " ".join(json.dumps(word) for word in sorted(self.words))
        return f"{path}{'?' if self.optional else ''}: {' '.join(sorted(self.types))} {words}".rstrip()

    @staticmethod
    def read(line: str) -> tuple[str, Told]:
        """Return path and what is told of it, from such a line."""
        path, _, rest = line.partition(": ")
        types, _, words = rest.partition(' "')
        found = json.loads(f'["{words}]'.replace('" "', '", "')) if words else []
        return path.removesuffix("?"), Told(frozenset(types.split()), frozenset(found), path.endswith("?"))

    def joined(self, other: Told) -> Told:
        """Return what has the words of both."""
        return Told(self.types, self.words | other.words, self.optional)


def paths_of(schema: Schema) -> dict[str, Told]:
    """Return what a schema says, by path; that of the document itself is ""."""
    return dict(_walk([schema], "", schema))


def places_of(schema: Schema) -> Iterator[tuple[str, Schema]]:
    """Yield what a schema says of each place, by path: each form of it by itself."""
    yield from _places(schema, "", schema)


def _places(node: Schema, path: str, root: Schema) -> Iterator[tuple[str, Schema]]:
    for form in _forms(node, root):
        yield path, form
        for key, below in form.get("properties", {}).items():
            yield from _places(below, _below(path, key), root)
        for item in _items(form):
            yield from _places(item, f"{path}[]", root)


def type_of(value: Any) -> str:
    """Return the type of a value of a document, in the words of JSON Schema."""
    return "object" if isinstance(value, Mapping) else _TYPES[type(value)]


def seen_in(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield all values of a document, by path."""
    yield path, value
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from seen_in(item, _below(path, key))
    elif isinstance(value, list):
        for item in value:
            yield from seen_in(item, f"{path}[]")


def _below(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _walk(nodes: list[Schema], path: str, root: Schema, optional: bool = False) -> Iterator[tuple[str, Told]]:
    plain = [one for node in nodes for one in _forms(node, root)]
    types = {kind for node in plain for kind in _types(node)}
    words = {word for node in plain for word in _words(node) if isinstance(word, str)}
    yield path, Told(frozenset(types), frozenset(words), optional)
    objects = [node for node in plain if "object" in _types(node)]
    for key in dict.fromkeys(key for node in objects for key in node["properties"]):
        below = [node["properties"][key] for node in objects if key in node["properties"]]
        perhaps = any(key not in node.get("required", ()) for node in objects)
        yield from _walk(below, _below(path, key), root, perhaps)
    items = [item for node in plain for item in _items(node)]
    if items:
        yield from _walk(items, f"{path}[]", root)


def _forms(node: Schema, root: Schema) -> Iterator[Schema]:
    if "$ref" in node:
        yield from _forms(root["$defs"][node["$ref"].rpartition("/")[2]], root)
    elif "oneOf" in node or "anyOf" in node:
        for form in (*node.get("oneOf", ()), *node.get("anyOf", ())):
            yield from _forms(form, root)
    else:
        yield node


def _types(node: Schema) -> set[str]:
    if words := _words(node):
        return {type_of(word) for word in words}
    kinds = node["type"]
    return {kinds} if isinstance(kinds, str) else set(kinds)


def _words(node: Schema) -> list[Any]:
    return list(node["enum"]) if "enum" in node else [node["const"]] if "const" in node else []


def _items(node: Schema) -> Iterator[Schema]:
    yield from node.get("prefixItems", ())
    if isinstance(node.get("items"), dict):
        yield node["items"]
