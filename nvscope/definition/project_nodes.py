"""Nodes in the project file: what they are called, and which lists they read and send."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from nvscope.definition.project_lists import NAME
from nvscope.toml_table import Place, ValueKind, array, integer, key, mapping, nearest, read_table

_LIST_KEY = re.compile(r"udp/(\d{1,5})/(\d{1,5})", re.ASCII)
_U16_MAX = 0xFFFF

Told = TypeVar("Told")

ReadList = tuple[int | None, int]
"""A list that a node reads, or sends: port (None: whichever it has) and identifier."""


def _read_list(value: Any, place: Place) -> ReadList:
    if not isinstance(value, str):
        return None, int(_IDENTIFIER.read(value, place))
    match = _LIST_KEY.fullmatch(value)
    port, index = (int(match[1]), int(match[2])) if match else (0, 0)
    if match is None or not 0 < port <= _U16_MAX or index > _U16_MAX:
        what = f"'{value[:60]}' is no list"
        raise place.error(what, 'Write its identifier, such as 7, or port and identifier: "udp/1300/7".')
    return port, index


_IDENTIFIER = integer(0, _U16_MAX)


@dataclass(frozen=True, slots=True)
class Node:
    """A node of the plant. A quoted address names it: ``"192.168.1.10" = { name = "press", reads = [7] }``."""

    name: str = key(NAME, "what people call the node; reports and telegrams show it", default="")
    reads: tuple[ReadList, ...] = key(
        array(ValueKind('identifier or "udp/port/identifier"', _read_list)),
        "lists that the node reads, even if it never answers: it counts what is broadcast on them",
        default=(),
    )
    writes: tuple[ReadList, ...] = key(
        array(ValueKind('identifier or "udp/port/identifier"', _read_list)),
        "lists that the node sends; who sends one of them, and is not named so, is an unknown writer (NV961)",
        default=(),
    )


def of_unknown_node(name: str, addresses: Mapping[str, str]) -> str:
    """Return what to do about a name that no node has; ``addresses`` are those of nodes by their names."""
    return f"Write its address, or the name that it has in [nodes]. {nearest(name, addresses)}".strip()


def by_address(
    value: Any, place: Place, read: Callable[[Any, Place], Told], noun: str, example: str
) -> Mapping[str, Told]:  # fmt: skip
    """Return the entries of a table whose keys are addresses, as reports write these.

    ConfigurationError where a key is none, or one is there twice. ``noun`` is what has the address, ``example`` an
    entry.
    """
    found: dict[str, Told] = {}
    for text, entry in mapping(ValueKind("", lambda entry, _: entry)).read(value, place).items():
        here = place.below(f'"{text[:60]}"')
        address = canonical_address(text)
        if address is None:
            raise here.error(f"'{text[:60]}' is no IP address", f"Write one in quotes: {example}.")
        if address in found:
            raise here.error(f"the {noun} {address} is there twice", "Leave one of the entries out.")
        found[address] = read(entry, here)
    return found


def _nodes(value: Any, place: Place) -> tuple[tuple[str, Node], ...]:
    example = '"192.168.1.10" = { name = "press" }'
    return tuple(by_address(value, place, partial(read_table, Node), "node", example).items())


NODE_TABLES = ValueKind('{name}."ADDRESS"', _nodes, Node)


def canonical_address(text: str) -> str | None:
    """Return an IP address as reports write it, None where the text is none."""
    try:
        address = ipaddress.ip_address(text.strip())
    except ValueError:
        return None
    if isinstance(address, ipaddress.IPv6Address):
        if address.scope_id is not None:
            return None
        address = address.ipv4_mapped or address
    return str(address)
