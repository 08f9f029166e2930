"""How faces name a list of a definition: by its identifier, and what it is sent over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nvscope.units import cob_id


def identifier_of(entry: Mapping[str, Any]) -> str:
    """Return the identifier of a list (``id``, ``protocol``): on CAN it is a COB-ID."""
    return cob_id(entry["id"]) if entry["protocol"].upper() == "CAN" else str(entry["id"])


def list_and_port(entry: Mapping[str, Any]) -> str:
    """Return ``list 7 on UDP port 1202`` or ``list 0x110 on CAN`` (``id``, ``protocol``, ``port``)."""
    identifier = "list without identifier" if entry["id"] is None else f"list {identifier_of(entry)}"
    port = "" if entry["port"] is None else f" port {entry['port']}"
    return f"{identifier} on {entry['protocol']}{port}"
