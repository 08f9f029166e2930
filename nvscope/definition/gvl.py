"""Network variables lists as CODESYS V3 exports them: ``.gvl``, made by "Link to file"."""

from __future__ import annotations

import ipaddress
import re
from typing import Any

from nvscope.definition.declarations import parse_declarations
from nvscope.definition.syntax import FileSyntax, ListSyntax
from nvscope.definition.xml_tree import Element
from nvscope.duration import parse_duration

_FLAGS = {
    "Pack": "pack",
    "Checksum": "checksum",
    "Acknowledge": "acknowledge",
    "CyclicTransmission": "cyclic",
    "TransmissionOnChange": "on_change",
    "TransmissionOnEvent": "on_event",
}
_DURATIONS = {"Interval": "interval_ns", "MinGap": "min_gap_ns"}
_ADDRESS_NAME = re.compile(r"broadcast\s*adr(?:ess|\.)?|broadcast\s*address", re.IGNORECASE)


def read_gvl(root: Element) -> FileSyntax:
    """Return the list, and the types should its declarations hold any; ``root`` is the element GVL."""
    holder = root.child("Declarations")
    if holder is None:
        raise root.error("the element Declarations is missing", "Export the list again with 'Link to file'.")
    declared = parse_declarations(root.source, holder.declarations())
    settings = root.child("NetvarSettings")
    known = {} if settings is None else _settings(settings)
    start = declared.blocks[0].offset if declared.blocks else holder.start
    entry = ListSyntax(root.source.stem, start, declared.blocks, root.source, (known,))
    return FileSyntax(declared.types, (entry,), declared.left_out)


def _settings(settings: Element) -> dict[str, Any]:
    known: dict[str, Any] = {}
    protocol = settings.attributes.get("Protocol", "").strip()
    if protocol:
        known["protocol"] = protocol
    for element in settings.children:
        if element.tag in _FLAGS:
            known[_FLAGS[element.tag]] = _flag(element)
        elif element.tag in _DURATIONS and element.text:
            known[_DURATIONS[element.tag]] = _duration(element)
        elif element.tag == "ListIdentifier":
            known["list_id"] = _integer(element, element.text, 65_535)
        elif element.tag == "ProtocolSettings":
            known |= _protocol_settings(element)
    return known


def _protocol_settings(holder: Element) -> dict[str, Any]:
    known: dict[str, Any] = {}
    for element in holder.children:
        name = element.attributes.get("Name", "").strip()
        value = element.attributes.get("Value", "").strip()
        if name.lower() == "port":
            known["port"] = _integer(element, value, 65_535)
        elif _ADDRESS_NAME.fullmatch(name) and value:
            try:
                known["address"] = str(ipaddress.ip_address(value))
            except ValueError:
                raise element.error(f"'{value[:60]}' is no IP address", "Write one such as 255.255.255.255.") from None
    return known


def _flag(element: Element) -> bool:
    word = element.text.lower()
    if word not in {"true", "false", "1", "0"}:
        raise element.error(f"{element.tag}: '{element.text[:60]}' is neither True nor False", "Write True or False.")
    return word in {"true", "1"}


def _duration(element: Element) -> int:
    try:
        duration_ns = parse_duration(element.text)
    except ValueError as error:
        raise element.error(f"{element.tag}: {error}", "Write a time such as T#50ms.") from None
    if duration_ns < 0:
        raise element.error(f"{element.tag}: a time cannot be negative here", "Write a time such as T#50ms.")
    return duration_ns


def _integer(element: Element, text: str, most: int) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= 10 and int(text) <= most):
        what = f"{element.attributes.get('Name', element.tag)[:60]}: '{text[:60]}' is no number from 0 to {most}"
        raise element.error(what, "Correct the number.")
    return int(text)
