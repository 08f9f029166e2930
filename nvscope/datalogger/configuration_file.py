"""Configurations of DataLogger sessions: XML files, as controllers read them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any
from xml.sax.saxutils import quoteattr

from dissectors.datalogger.tables import MOST_VARIABLES
from nvscope.datalogger.configuration import ATTRIBUTES, DEFAULTS, Attribute, NamedVariable, NotMeant, Session
from nvscope.definition.position import Position
from nvscope.definition.source import read_source
from nvscope.definition.xml_tree import Element, read_xml
from nvscope.errors import ConfigurationError

ROOT = "DataLoggerConfigDocument"
_NAMESPACE = "http://www.phoenixcontact.com/schema/dataloggerconfig"
_ELEMENTS = ("General", "Datasink", "Variables")
_TEXTS = ("path", "task")
_SHOWN = 60
_LEAST_LIKE = 0.75
_LONGEST_NAME = 1_000


@dataclass(frozen=True, slots=True)
class Configuration:
    """What a file says: a session, and what of the file nobody knows, as sentences with their places."""

    session: Session
    unknown: tuple[str, ...] = ()


def read_configuration(path: str) -> Configuration:
    """Return the session of a file.

    Namespaces do not matter. Elements and attributes that nobody knows are told, and left aside; an attribute that
    looks like a known one is a mistake. Raises ConfigurationError with file, line and attribute.
    """
    root = read_xml(read_source(path))
    if root.tag != ROOT:
        raise root.error(
            f"the file begins with <{root.tag[:_SHOWN]}>", f"The configuration of a DataLogger begins with <{ROOT}>."
        )
    unknown = [*_unknown_elements(root)]
    values: dict[str, Any] = dict(DEFAULTS)
    places: dict[str, Position] = {}
    for element in ("General", "Datasink"):
        found = _only(root, element)
        unknown += _read(element, found, values, places, root)
    if values["kind"] == "db" and not values["path"]:
        found = _only(root, "Datasink") or root
        raise found.error("Datasink has no attribute dst: which file", 'Write dst="NAME.db".')
    told: dict[str, Any] = {name: "" if value is None and name in _TEXTS else value for name, value in values.items()}
    session = Session(
        **told,
        position=root.source.position(root.start), places=places, variables=_variables(root, unknown),
    )  # fmt: skip
    return Configuration(session, tuple(unknown))


def _only(root: Element, tag: str) -> Element | None:
    found = [child for child in root.children if child.tag == tag]
    if len(found) > 1:
        raise found[1].error(f"there are two elements <{tag}>", "A file configures one session; write another file.")
    return found[0] if found else None


def _read(
    tag: str, found: Element | None, values: dict[str, Any], places: dict[str, Position], root: Element
) -> Iterator[str]:
    """Take the attributes of an element, and yield what is wrong with others."""
    known = {one.name: one for one in ATTRIBUTES if one.element == tag}
    for one in known.values():
        if one.required and (found is None or one.name not in found.attributes):
            raise (found or root).error(f"{tag} has no attribute {one.name}: {one.help}", f'Write {one.name}="…".')
    if found is None:
        return
    for name, text in found.attributes.items():
        attribute = known.get(name)
        if attribute is not None:
            values[attribute.field] = _value(found, attribute, text)
            places[attribute.field] = found.source.position(_offset(found, name))
            continue
        near = _nearest(name, known)
        if near:
            raise _error(found, name, "is not known", f"Write {near}.")
        elsewhere = next((one.element for one in ATTRIBUTES if one.name == name), None)
        if elsewhere:
            raise _error(found, name, f"belongs to <{elsewhere}>", "Move it there.")
        yield f"{_place(found, name)}: {tag}, attribute {name[:_SHOWN]}: not known, and left aside"


def _nearest(name: str, known: Any) -> str:
    folded = {one.lower(): one for one in known}
    near = get_close_matches(name.lower()[:_LONGEST_NAME], folded, 1, _LEAST_LIKE)
    return folded[near[0]] if near else ""


def _value(element: Element, attribute: Attribute, text: str) -> Any:
    try:
        return attribute.read(text)
    except NotMeant as error:
        next_step = f"It is {attribute.help}"
        if attribute.default is not None:
            next_step += f"; without it, {attribute.told(attribute.default)}"
        raise _error(element, attribute.name, f"'{text[:_SHOWN]}' {error}", f"{next_step}.") from None


def _unknown_elements(root: Element) -> Iterator[str]:
    for child in root.children:
        if child.tag not in _ELEMENTS:
            near = _nearest(child.tag, _ELEMENTS)
            if near:
                raise child.error(f"no element is called <{child.tag[:_SHOWN]}>", f"Write <{near}>.")
            yield f"{root.source.position(child.start)}: element <{child.tag[:_SHOWN]}>: not known, and left aside"


def _variables(root: Element, unknown: list[str]) -> tuple[NamedVariable, ...]:
    found: dict[str, NamedVariable] = {}
    names: dict[str, str] = {}
    parent = _only(root, "Variables")
    for child in parent.children if parent else ():
        if child.tag != "Variable":
            place = root.source.position(child.start)
            unknown.append(f"{place}: element <{child.tag[:_SHOWN]}>: not known, and left aside")
            continue
        uri = child.attributes.get("name", "").strip()
        if not uri:
            raise child.error("a variable has no name", 'Write name="Arp.Plc.Eclr/PROGRAM.VARIABLE".')
        if len(uri) > _LONGEST_NAME or not uri.isprintable():
            raise _error(child, "name", f"'{uri[:_SHOWN]}' is no name of a variable", "Write its whole name.")
        if uri in found:
            line = found[uri].position.line
            raise _error(child, "name", f"'{uri[:_SHOWN]}' is there already, in line {line}", "Name it once.")
        if (twin := names.get(uri.lower())) is not None:
            # Names of columns are the same in any case.
            raise _error(child, "name", f"'{uri[:_SHOWN]}' differs from '{twin[:_SHOWN]}' by its case alone", "")
        found[uri] = NamedVariable(uri, root.source.position(_offset(child, "name")))
        names[uri.lower()] = uri
    if not found:
        raise (parent or root).error(
            "no variable is named", 'Write <Variables><Variable name="…"/></Variables>; `nvscope datalog config` does.'
        )
    if len(found) > MOST_VARIABLES:
        raise (parent or root).error(
            f"{len(found)} variables are named, and a session has {MOST_VARIABLES} at most",
            "Write several sessions, a file each.",
        )
    return tuple(found.values())


def _offset(element: Element, attribute: str) -> int:
    """Return where in the file an attribute of an element is named."""
    text = element.source.text
    match = re.compile(rf"""(?:\s|:)({re.escape(attribute)})\s*=""").search(text, element.start)
    return match.start(1) if match else element.start


def _place(element: Element, attribute: str) -> Position:
    return element.source.position(_offset(element, attribute))


def _error(element: Element, attribute: str, what: str, next_step: str) -> ConfigurationError:
    return element.source.error(
        f"{element.tag}, attribute {attribute[:_SHOWN]}: {what}", _offset(element, attribute), next_step
    )


def written(session: Session, uris: Sequence[str]) -> str:
    """Return the file that configures a session with these variables; what is as by default is left out."""
    lines = ['<?xml version="1.0" encoding="utf-8"?>', f'<{ROOT} xmlns="{_NAMESPACE}">']
    for element in ("General", "Datasink"):
        own = [(one, one.told(getattr(session, one.field))) for one in ATTRIBUTES if one.element == element]
        shown = " ".join(
            f"{one.name}={quoteattr(text)}"
            for one, text in own
            if text and (one.required or getattr(session, one.field) != one.default)
        )
        lines.append(f"  <{element} {shown}/>")
    lines.append("  <Variables>")
    lines += [f"    <Variable name={quoteattr(uri)}/>" for uri in uris]
    lines += ["  </Variables>", f"</{ROOT}>", ""]
    return "\n".join(lines)
