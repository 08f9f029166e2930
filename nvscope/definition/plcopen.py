"""Types and global variables of PLCopen XML (TC6), whichever version; network settings are not in it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from nvscope.definition.comments import blank_comments
from nvscope.definition.declarations import parse_expression
from nvscope.definition.source import DefinitionError, NoDefinition
from nvscope.definition.syntax import (
    ArrayType,
    Declaration,
    EnumerationType,
    Expression,
    FileSyntax,
    GlobalBlock,
    InvalidType,
    ListSyntax,
    Name,
    NamedType,
    Number,
    Opaque,
    PointerType,
    StringType,
    StructureType,
    TypeDeclaration,
    TypeSyntax,
)
from nvscope.definition.xml_tree import Element
from nvscope.errors import ConfigurationError

_NEXT = "Export the project again as PLCopen XML."
_PARTS = {"fileHeader", "contentHeader", "types", "instances"}
_BLOCK_KINDS = {"functionBlock", "interface"}
_EXTENDS = {"extends", "inheritance"}
_ENUMERATION_END = re.compile(r"\)\s*+([^\W\d]\w*+)\s*+(?::=[^;()]*+)?;?\s*+END_TYPE", re.IGNORECASE)


def read_plcopen(root: Element) -> FileSyntax:
    """Return all data types and lists of global variables; ``root`` is the element project.

    A project of programs only declares neither. Raises NoDefinition where it is a project of something else.
    """
    types: list[TypeDeclaration] = []
    blocks: dict[tuple[int, str], list[GlobalBlock]] = {}
    for owner, element in _objects(root):
        if element.tag in {"dataType", "union"} and "name" in element.attributes:
            types.append(TypeDeclaration(_name(element), _declared_type(element), root.source))
        elif element.tag == "pou" and element.attributes.get("pouType") in _BLOCK_KINDS:
            types.append(TypeDeclaration(_name(element), None, root.source))
        elif element.tag == "globalVars":
            name = element.attributes.get("name", "").strip() or "GlobalVariables"
            blocks.setdefault((owner, name), []).extend(_blocks(element))
    if not types and not blocks and not any(child.tag in _PARTS for child in root.children):
        raise NoDefinition("the file declares neither types nor variables", root.source.position(root.start), _NEXT)
    lists = (ListSyntax(name, own[0].offset, tuple(own), root.source) for (_, name), own in blocks.items() if own)
    return FileSyntax(tuple(types), tuple(lists))


def _objects(root: Element) -> Iterator[tuple[int, Element]]:
    """Yield all elements in their order, each with the start of the resource that owns it, 0 without one.

    Of a list of global variables nothing that is within it: that belongs to the list. Controllers of one project may
    well have lists of one name.
    """
    waiting = [(0, root)]
    while waiting:
        owner, element = waiting.pop()
        yield owner, element
        if element.tag != "globalVars":
            owner = element.start if element.tag == "resource" else owner
            waiting += ((owner, child) for child in reversed(element.children))


def _blocks(element: Element) -> Iterator[GlobalBlock]:
    """Yield the blocks of a list: one, or that of its variables and that of its constants.

    CODESYS writes a list of several VAR_GLOBAL blocks twice: whole and without qualifiers, as the element itself, and
    within it as MixedAttrsVarList with a ``globalVars`` for each block. The whole has the order of the declaration.
    """
    parts = [part for part in element.below() if part.tag == "globalVars" and part is not element]
    if not parts:
        yield GlobalBlock(element.start, _is_constant(element), tuple(_variables(element)))
        return
    told = {variable.names[0].text.upper(): variable for variable in _variables(element)}
    constants: set[str] = set()
    for part in parts:
        for variable in _variables(part):
            name = variable.names[0].text.upper()
            told.setdefault(name, variable)
            if _is_constant(part):
                constants.add(name)
    for is_constant in (True, False):
        own = tuple(variable for name, variable in told.items() if (name in constants) == is_constant)
        if own:
            yield GlobalBlock(element.start, is_constant, own)


def _is_constant(element: Element) -> bool:
    return element.attributes.get("constant", "").strip().lower() in {"true", "1"}


def _declared_type(element: Element) -> TypeSyntax:
    """Return the type that an element declares; what is wrong with it concerns only lists that need it."""
    try:
        return _type_of_data(element)
    except DefinitionError as error:
        return InvalidType(error.problem)


def _type_of_data(element: Element) -> TypeSyntax:
    if element.tag == "union":
        return _structure(element, is_union=True)
    kind = _type(_required(element, "baseType"))
    if isinstance(kind, StructureType) and not kind.is_union:
        extends = next((part for part in element.below() if part.tag.lower() in _EXTENDS and part.text), None)
        if extends is not None:
            return StructureType(kind.offset, kind.members, Name(extends.text, extends.start), False, kind.depth)
    if isinstance(kind, EnumerationType) and kind.base is None:
        plain = next((part for part in element.below() if part.tag == "InterfaceAsPlainText"), None)
        base = None if plain is None else _base_in_plain_text(plain)
        return EnumerationType(kind.offset, kind.values, base, plain is not None)
    return kind


def _base_in_plain_text(plain: Element) -> Name | None:
    """Return the base type of an enumeration as its declaration names it: CODESYS leaves it out of the XML."""
    written = "".join(text for part in plain.below() for text in part.texts)
    found = _ENUMERATION_END.search(blank_comments(written, plain.source, plain.start)[0])
    return None if found is None else Name(found[1], plain.start)


def _variables(holder: Element) -> Iterator[Declaration]:
    for element in holder.children:
        if element.tag == "variable":
            attributes = {
                part.attributes["Name"]: part.attributes.get("Value", "")
                for part in element.below()
                if part.tag == "Attribute" and "Name" in part.attributes
            }
            yield Declaration((_name(element),), _type_of(element), _initial(element), attributes)


def _type_of(variable: Element) -> TypeSyntax:
    try:
        return _type(_required(variable, "type"))
    except DefinitionError as error:
        return InvalidType(error.problem)


def _initial(variable: Element) -> Expression | None:
    holder = variable.child("initialValue")
    value = None if holder is None else holder.child("simpleValue")
    if value is None or not (text := value.attributes.get("value", "").strip()):
        return None
    # Strings, times and whatever else a tool writes here are no constants that anything depends on.
    if not (text[:1].isalnum() or text[:1] in "+-(_"):
        return None
    try:
        return _expression(value, text)
    except ConfigurationError:
        return Opaque(value.start)  # refused only where a bound or length depends on it


def _type(holder: Element) -> TypeSyntax:
    """Return the type that is the child of ``holder``."""
    element = next((child for child in holder.children if child.tag not in {"addData", "documentation"}), None)
    if element is None:
        raise holder.error(f"the element {holder.tag} holds no type", _NEXT)
    tag = element.tag
    if tag == "derived":
        return NamedType(_name(element))
    if tag in {"string", "wstring", "STRING", "WSTRING"}:
        length = element.attributes.get("length", "").strip()
        return StringType(element.start, tag.upper() == "WSTRING", _expression(element, length) if length else None)
    if tag == "array":
        bounds = tuple(_range(child) for child in element.children if child.tag == "dimension")
        if not bounds:
            raise element.error("the array has no dimension", _NEXT)
        inner = _type(_required(element, "baseType"))
        return ArrayType(element.start, bounds, inner, 1 + inner.depth)
    if tag in {"struct", "union"}:
        return _structure(element, is_union=tag == "union")
    if tag == "enum":
        return _enumeration(element)
    if tag in {"subrangeSigned", "subrangeUnsigned"}:
        base = _type(_required(element, "baseType"))
        if not isinstance(base, NamedType):
            raise element.error("only integers have subranges", _NEXT)
        return NamedType(base.name, *_range(_required(element, "range")))
    if tag in {"pointer", "reference"}:
        return PointerType(element.start, tag.upper())
    return NamedType(Name(tag, element.start))


def _structure(element: Element, *, is_union: bool) -> StructureType:
    members = tuple(_variables(element))
    depth = 1 + max((member.type.depth for member in members), default=0)
    return StructureType(element.start, members, None, is_union, depth)


def _enumeration(element: Element) -> EnumerationType:
    values = [
        (_name(value), _expression(value, text) if (text := value.attributes.get("value", "").strip()) else None)
        for value in _required(element, "values").children
        if value.tag == "value"
    ]
    if not values:
        raise element.error("the enumeration has no values", _NEXT)
    holder = element.child("baseType")
    base = _type(holder) if holder is not None else None
    return EnumerationType(element.start, tuple(values), base.name if isinstance(base, NamedType) else None)


def _range(element: Element) -> tuple[Expression, Expression]:
    found = [element.attributes.get(bound, "").strip() for bound in ("lower", "upper")]
    if not all(found):
        raise element.error(f"{element.tag}: lower or upper is missing", _NEXT)
    return _expression(element, found[0]), _expression(element, found[1])


def _expression(element: Element, text: str) -> Expression:
    if text.isascii() and text.isdecimal() and len(text) < 20:
        return Number(int(text), element.start)
    return parse_expression(text, element.source, element.start)


def _name(element: Element) -> Name:
    name = element.attributes.get("name", "").strip()
    if not name:
        raise element.error(f"the element {element.tag} has no name", _NEXT)
    return Name(name, element.start)


def _required(element: Element, tag: str) -> Element:
    child = element.child(tag)
    if child is None:
        raise element.error(f"the element {element.tag} has no {tag}", _NEXT)
    return child
