"""Configurations of DataLogger sessions: XML files, as controllers read them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import Any

from msgspec import Struct

from dissectors.datalogger.tables import MOST_VARIABLES
from nvscope.datalogger.configuration import ATTRIBUTES, DEFAULTS, NamedVariable, NotMeant, Session
from nvscope.definition.position import Position
from nvscope.definition.source import NoDefinition, read_source
from nvscope.definition.xml_tree import Element, read_xml
from nvscope.errors import ConfigurationError
from nvscope.units import count_of

ROOT = "DataLoggerConfigDocument"
_NAMESPACE = "http://www.phoenixcontact.com/schema/dataloggerconfig"
_ELEMENTS = ("General", "Datasink", "Variables")
_VARIABLE, _NAME = "Variable", "name"
_TEXTS = ("path", "task")
_SHOWN = 60
_LEAST_LIKE = 0.75
_MOST_TOLD = 10
_MEND = "Correct the file there, or have `nvscope datalog config` write one."
_LONGEST_NAME = 1_000


class Configuration(Struct, frozen=True):
    """What a file says: a session, and what of the file nobody knows, as sentences with their places."""

    session: Session
    unknown: tuple[str, ...] = ()


def read_configuration(path: str) -> Configuration:
    """Return the session of a file.

    Namespaces do not matter. Elements and attributes that nobody knows are told, and left aside; an attribute that
    looks like a known one is a mistake. Raises ConfigurationError with file, line and attribute; its ``others`` are
    further mistakes.
    """
    try:
        root = read_xml(read_source(path, called="configuration"), mend=_MEND)
    except NoDefinition as error:
        what = error.what.removesuffix(", no definition file")
        raise ConfigurationError(
            f"this is no configuration of a DataLogger: {what}", where=error.where,
            next_step="Name an XML file; `nvscope datalog config` writes one.",
        ) from None  # fmt: skip
    if root.tag != ROOT:
        raise root.error(
            f"the file begins with <{root.tag[:_SHOWN]}>", f"The configuration of a DataLogger begins with <{ROOT}>."
        )
    unknown: list[str] = []
    mistakes: list[ConfigurationError] = [*_unknown_elements(root, unknown)]
    values: dict[str, Any] = dict(DEFAULTS)
    places: dict[str, Position] = {}
    for element in ("General", "Datasink"):
        mistakes += _read(element, root, values, places, unknown)
    sink = _first(root, "Datasink") or root
    if values["kind"] == "db" and "path" not in places:
        mistakes.append(sink.error("Datasink has no attribute dst: which file", 'Write dst="NAME.db".'))
    variables: dict[str, NamedVariable] = {}
    mistakes += _variables(root, variables, unknown)
    if mistakes:
        raise _all_of(mistakes)
    told: dict[str, Any] = {name: "" if value is None and name in _TEXTS else value for name, value in values.items()}
    session = Session(
        **told,
        position=root.source.position(root.start), places=places, variables=tuple(variables.values()),
    )  # fmt: skip
    return Configuration(session, tuple(unknown))


def _all_of(mistakes: Sequence[ConfigurationError]) -> ConfigurationError:
    """Return mistakes, of which there is one at least, as one error that tells the first few."""
    first, others = mistakes[0], list(mistakes[1:_MOST_TOLD])
    if more := len(mistakes) - 1 - len(others):
        others.append(ConfigurationError(f"and {count_of(more, 'more mistake')}"))
    return ConfigurationError(first.what, where=first.where, next_step=first.next_step, others=others)


def _first(root: Element, tag: str) -> Element | None:
    return next((child for child in root.children if child.tag == tag), None)


def _twice(root: Element, tag: str) -> Iterator[ConfigurationError]:
    found = [child for child in root.children if child.tag == tag]
    if len(found) > 1:
        yield found[1].error(f"there are two elements <{tag}>", "A file configures one session; write another file.")


def _read(
    tag: str, root: Element, values: dict[str, Any], places: dict[str, Position], unknown: list[str]
) -> Iterator[ConfigurationError]:
    """Take the attributes of an element, and those that nobody knows; yield what is wrong with others."""
    yield from _twice(root, tag)
    found = _first(root, tag)
    known = {one.name: one for one in ATTRIBUTES if one.element == tag}
    for one in known.values():
        if one.required and (found is None or one.name not in found.attributes):
            yield (found or root).error(f"{tag} has no attribute {one.name}: {one.help}", f'Write {one.name}="…".')
    for name, text in found.attributes.items() if found else ():
        assert found
        attribute = known.get(name)
        if attribute is not None:
            places[attribute.field] = _place(found, name)
            try:
                values[attribute.field] = attribute.read(text)
            except NotMeant as error:
                default = f"; without it, {attribute.told(attribute.default)}" if attribute.default is not None else ""
                told = f"{name}: {attribute.help}{default}."
                yield _error(found, name, f"'{text[:_SHOWN]}' {error}", told)
            continue
        near = _nearest(name, known)
        elsewhere = next((one.element for one in ATTRIBUTES if one.name == name), None)
        if near:
            # What was meant is not missing.
            places.setdefault(known[near].field, _place(found, name))
            yield _error(found, name, "is not known", f"Write {near}.")
        elif elsewhere:
            yield _error(found, name, f"belongs to <{elsewhere}>", "Move it there.")
        else:
            unknown.append(f"{_place(found, name)}: {tag}, attribute {name[:_SHOWN]}: not known, and left aside")


def _nearest(name: str, known: Any) -> str:
    folded = {one.lower(): one for one in known}
    near = get_close_matches(name.lower()[:_LONGEST_NAME], folded, 1, _LEAST_LIKE)
    return folded[near[0]] if near else ""


def _unknown_elements(root: Element, unknown: list[str]) -> Iterator[ConfigurationError]:
    for child in root.children:
        if child.tag not in _ELEMENTS:
            yield from _unknown_element(child, _ELEMENTS, unknown)
        elif child.tag != "Variables":
            for inner in child.children:
                yield from _unknown_element(inner, (), unknown)


def _unknown_element(child: Element, known: Sequence[str], unknown: list[str]) -> Iterator[ConfigurationError]:
    """Yield the mistake that an element is which looks like a known one; of another one, tell that nobody knows it."""
    if near := _nearest(child.tag, known):
        yield child.error(f"no element is called <{child.tag[:_SHOWN]}>", f"Write <{near}>.")
    else:
        place = child.source.position(child.start)
        unknown.append(f"{place}: element <{child.tag[:_SHOWN]}>: not known, and left aside")


def _unknown_attributes(child: Element, known: Sequence[str], unknown: list[str]) -> Iterator[ConfigurationError]:
    """Do the same with the attributes of an element."""
    for name in child.attributes:
        if name in known:
            continue
        if (near := _nearest(name, known)) and near not in child.attributes:
            yield _error(child, name, "is not known", f"Write {near}.")
        else:
            place = _place(child, name)
            unknown.append(f"{place}: {child.tag}, attribute {name[:_SHOWN]}: not known, and left aside")


def _variables(root: Element, found: dict[str, NamedVariable], unknown: list[str]) -> Iterator[ConfigurationError]:
    """Take the variables by their names, and yield what is wrong with others."""
    yield from _twice(root, "Variables")
    names: dict[str, str] = {}
    parent = _first(root, "Variables")
    if parent:
        yield from _unknown_attributes(parent, (), unknown)
    for child in parent.children if parent else ():
        if child.tag != _VARIABLE:
            yield from _unknown_element(child, (_VARIABLE,), unknown)
            continue
        for inner in child.children:
            yield from _unknown_element(inner, (), unknown)
        misnamed = list(_unknown_attributes(child, (_NAME,), unknown))
        yield from misnamed
        uri = child.attributes.get("name", "").strip()
        if misnamed:
            continue
        if not uri:
            yield child.error("a variable has no name", 'Write name="Arp.Plc.Eclr/PROGRAM.VARIABLE".')
        elif len(uri) > _LONGEST_NAME or not uri.isprintable():
            yield _error(child, "name", f"'{uri[:_SHOWN]}' is no name of a variable", "Write its whole name.")
        elif uri in found:
            line = found[uri].position.line
            yield _error(child, "name", f"'{uri[:_SHOWN]}' is there already, in line {line}", "Name it once.")
        elif (twin := names.get(uri.lower())) is not None:
            # Names of columns are the same in any case.
            yield _error(child, "name", f"'{uri[:_SHOWN]}' differs from '{twin[:_SHOWN]}' by its case alone", "")
        else:
            found[uri] = NamedVariable(uri, root.source.position(_offset(child, "name")))
            names[uri.lower()] = uri
    if not parent or not any(child.tag == _VARIABLE or _nearest(child.tag, (_VARIABLE,)) for child in parent.children):
        yield (parent or root).error(
            "no variable is named", 'Write <Variables><Variable name="…"/></Variables>; `nvscope datalog config` does.'
        )
    if len(found) > MOST_VARIABLES:
        yield (parent or root).error(
            f"{len(found)} variables are named, and a session has {MOST_VARIABLES} at most",
            "Write several sessions, a file each.",
        )


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
    # With it come the clients of HTTP and mail, which nobody needs who only reads one.
    from xml.sax.saxutils import quoteattr  # noqa: PLC0415

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
