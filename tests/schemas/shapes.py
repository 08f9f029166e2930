"""What schemas of documents are made of: objects with nothing beside what they name, texts, numbers, times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

Schema = dict[str, Any]
Properties = Mapping[str, Schema]

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_NUMBERS = {"report": 2, "diff": 2}
"""The numbers of schemas behind their names, where they are not 1."""


def document(name: str, about: str, properties: Properties, optional: Iterable[str] = ()) -> Schema:
    """Return the schema of a document, which says first of which schema it is."""
    return headed(name, about, record({**_head(name), **properties}, optional))


def headed(name: str, about: str, schema: Schema) -> Schema:
    """Return a schema with its head; ``about`` is the line by which it is listed."""
    return {
        "$schema": DIALECT,
        "$id": f"urn:nvscope:{name}:{_NUMBERS.get(name, 1)}",
        "title": title_of(name),
        "description": about,
    } | schema


def title_of(name: str) -> str:
    """Return what documents of a schema say that they are."""
    return f"nvscope.{name}/{_NUMBERS.get(name, 1)}"


def _head(name: str) -> Properties:
    return {"schema": {"const": title_of(name)}, "tool": TOOL}


def either(name: str, about: str, *forms: Properties) -> Schema:
    """Return the schema of a document that has one of several forms."""
    return headed(name, about, {"oneOf": [record({**_head(name), **form}) for form in forms]})


def record(properties: Properties, optional: Iterable[str] = ()) -> Schema:
    """Return an object that has these keys, those that are ``optional`` perhaps, and no others."""
    left_out = set(optional)
    assert left_out <= set(properties)
    required = [key for key in properties if key not in left_out]
    found: Schema = {"type": "object", "properties": dict(properties)}
    return found | ({"required": required} if required else {}) | {"additionalProperties": False}


def several(items: Schema, told: str = "") -> Schema:
    return described({"type": "array", "items": items}, told)


def nothing_in(told: str = "") -> Schema:
    """Return a list that is empty."""
    return described({"type": "array", "maxItems": 0}, told)


def text(told: str = "", pattern: str = "") -> Schema:
    return described({"type": "string"} | ({"pattern": pattern} if pattern else {}), told)


def word(words: Iterable[str | int | bool | None], told: str = "") -> Schema:
    """Return one of a closed set of words."""
    return described({"enum": list(words)}, told)


def whole(told: str = "", least: int | None = 0, most: int | None = None) -> Schema:
    """Return a whole number; from 0 on, if nothing else is said."""
    limits = {"minimum": least, "maximum": most}
    return described({"type": "integer"} | {key: limit for key, limit in limits.items() if limit is not None}, told)


def number(told: str = "", least: int | None = None, most: int | None = None) -> Schema:
    limits = {"minimum": least, "maximum": most}
    return described({"type": "number"} | {key: limit for key, limit in limits.items() if limit is not None}, told)


def truth(told: str = "") -> Schema:
    """Return true or false."""
    return described({"type": "boolean"}, told)


def time(told: str = "") -> Schema:
    """Return an absolute time: JavaScript cannot hold it as a number."""
    return text(_joined(told, "absolute time, ns since 1970-01-01 UTC"), "^-?[0-9]+$")


def duration(told: str = "", least: int | None = 0) -> Schema:
    return whole(_joined(told, "unit: ns"), least)


def unknown(told: str = "") -> Schema:
    """Return what is never known."""
    return described({"type": "null"}, told)


def maybe(schema: Schema) -> Schema:
    """Return the same, or null."""
    if "enum" in schema:
        return schema | {"enum": [*schema["enum"], None]}
    if isinstance(schema.get("type"), str) and schema["type"] != "object":
        return schema | {"type": [schema["type"], "null"]}
    told = {"description": schema["description"]} if "description" in schema else {}
    return {"anyOf": [{key: value for key, value in schema.items() if key != "description"}, {"type": "null"}]} | told


def shared(name: str) -> Schema:
    """Return what stands under a name in ``$defs``."""
    return {"$ref": f"#/$defs/{name}"}


def described(schema: Schema, told: str) -> Schema:
    return schema | ({"description": told} if told else {})


def _joined(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


TOOL = record({"name": {"const": "nvscope"}, "version": text()})
FILTER = maybe(
    record(
        {"expression": text(), "telegrams": whole("those it chooses"), "all_telegrams": whole()},
    )
    | {"description": "null without a filter"}
)
UDP_KEY = text("", r"^udp/[0-9]+/[0-9]+$")
CAN_KEY = text("x marks identifiers of 29 bits, * any channel", r"^can/[\s\S]+/[0-9]+x?$")
LIST_KEY = text("udp/PORT/INDEX, can/CHANNEL/COB-ID", r"^(udp/[0-9]+/[0-9]+|can/[\s\S]+/[0-9]+x?)$")
SUBINDEX = whole("", 0, 0xFFFF)
PORT = whole("", 0, 0xFFFF)
