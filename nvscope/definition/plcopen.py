"""Types and global variables of PLCopen XML (TC6), whichever version; network settings are not in it."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.definition.declarations import parse_expression
from nvscope.definition.syntax import (
    ArrayType,
    Declaration,
    EnumerationType,
    Expression,
    FileSyntax,
    GlobalBlock,
    ListSyntax,
    Name,
    NamedType,
    Number,
    PointerType,
    StringType,
    StructureType,
    TypeDeclaration,
    TypeSyntax,
)
from nvscope.definition.xml_tree import Element

_NEXT = "Export the project again as PLCopen XML."
_BLOCK_KINDS = {"functionBlock", "interface"}


def read_plcopen(root: Element) -> FileSyntax:
    """Return all data types and lists of global variables; ``root`` is the element project."""
    types: list[TypeDeclaration] = []
    blocks: dict[str, list[GlobalBlock]] = {}
    for element in root.below():
        if element.tag in {"dataType", "union"} and "name" in element.attributes:
            types.append(TypeDeclaration(_name(element), _declared_type(element), root.source))
        elif element.tag == "pou" and element.attributes.get("pouType") in _BLOCK_KINDS:
            types.append(TypeDeclaration(_name(element), None, root.source))
        elif element.tag == "globalVars":
            name = element.attributes.get("name", "").strip() or "GlobalVariables"
            constant = element.attributes.get("constant", "").strip().lower() in {"true", "1"}
            block = GlobalBlock(element.start, constant, tuple(_variables(element)))
            blocks.setdefault(name, []).append(block)
    if not types and not blocks:
        raise root.error("the file declares neither types nor variables", _NEXT)
    lists = (ListSyntax(name, own[0].offset, tuple(own), root.source) for name, own in blocks.items())
    return FileSyntax(tuple(types), tuple(lists))


def _declared_type(element: Element) -> TypeSyntax:
    if element.tag == "union":
        return _structure(element, is_union=True)
    kind = _type(_required(element, "baseType"))
    if isinstance(kind, StructureType) and not kind.is_union:
        extends = next((part for part in element.below() if part.tag.lower() in {"extends", "inheritance"}), None)
        if extends is not None and extends.text:
            base = Name(extends.text, extends.start)
            return StructureType(kind.offset, kind.members, base, False, kind.depth)
    return kind


def _variables(holder: Element) -> Iterator[Declaration]:
    for element in holder.children:
        if element.tag == "variable":
            attributes = {
                part.attributes["Name"]: part.attributes.get("Value", "")
                for part in element.below()
                if part.tag == "Attribute" and "Name" in part.attributes
            }
            kind = _type(_required(element, "type"))
            yield Declaration((_name(element),), kind, _initial(element), attributes)


def _initial(variable: Element) -> Expression | None:
    holder = variable.child("initialValue")
    value = None if holder is None else holder.child("simpleValue")
    if value is None or not (text := value.attributes.get("value", "").strip()):
        return None
    # Strings, times and whatever else a tool writes here are no constants that anything depends on.
    return _expression(value, text) if text[:1].isalnum() or text[:1] in "+-(_" else None


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
