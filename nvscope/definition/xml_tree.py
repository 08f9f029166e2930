"""XML as a tree that knows where in the file each element stands. Entities, document types and depth are refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, XMLParser
from msgspec import Struct, field

from nvscope.definition.comments import blank
from nvscope.definition.source import Source
from nvscope.errors import ConfigurationError

MAX_XML_DEPTH = 200
_MARKUP = re.compile(
    r"<!\[CDATA\[(?P<data>.*?)\]\]>|<!--.*?-->|<[^>]*>|&(?P<name>lt|gt|amp|quot|apos|#\d{1,7}|#x[0-9a-fA-F]{1,6});",
    re.DOTALL,
)
_ENTITIES = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}


class Element(Struct):
    """An element; ``tag`` and the names of ``attributes`` are without namespace. It stands at ``start`` to ``end``."""

    tag: str
    attributes: dict[str, str]
    source: Source
    start: int
    end: int = 0
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The text directly within the element, without the blanks around it."""
        return "".join(self.texts).strip()

    def child(self, tag: str) -> Element | None:
        """Return the first child of a tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def below(self) -> Iterator[Element]:
        """Yield this element and all below it, in their order."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting += reversed(element.children)

    def error(self, what: str, next_step: str = "") -> ConfigurationError:
        """Return the error that something is wrong with the element."""
        return self.source.error(what, self.start, next_step)

    def declarations(self) -> str:
        """Return the text of the whole file up to the end of the element, all but what the element holds blanked."""
        raw = self.source.text[self.start : self.end]
        return blank(self.source.text[: self.start]) + _MARKUP.sub(_same_shape, raw)


_EXPORT = "Export the file again."


def read_xml(source: Source, *, mend: str = _EXPORT) -> Element:
    """Return the root element; ConfigurationError, with position, where the text is no XML that can be trusted.

    ``mend`` is what to do then.
    """
    tree = _Tree(source, mend)
    parser: Any = XMLParser(target=tree, forbid_dtd=True)
    tree.expat = parser.parser
    try:
        parser.feed(source.text)
        parser.close()
    except ParseError as error:
        line, column = error.position
        start = source.line_starts[min(line, len(source.line_starts)) - 1]
        at = min(start + column, len(source.text))
        what = f"this is no well-formed XML: {str(error).partition(':')[0]}"
        if (dashes := _dashes_within_comment(source.text, at)) is not None:
            at, what = dashes, "this is no well-formed XML: '--' stands within a comment, where XML allows none"
        raise source.error(what, at, mend) from None
    except (DefusedXmlException, ValueError) as error:
        kind = "document type or entities" if isinstance(error, DefusedXmlException) else "characters"
        next_step = f"Remove what stands before the first element. {mend}"
        raise source.error(f"the XML has {kind} that no definition needs", tree.offset(), next_step) from None
    assert tree.root is not None
    return tree.root


def _dashes_within_comment(text: str, at: int) -> int | None:
    """Return where two dashes stand that end no comment, in one that reaches to a place; None without any."""
    begin = text.rfind("<!--", 0, at)
    end = text.find("-->", begin + len("<!--"))
    if begin < 0 or end < at - 1:
        return None
    # The last dash may belong to those that end it: --->.
    found = text.find("--", begin + len("<!--"), end + 1)
    return None if found < 0 else found


class _Tree:
    """The target of the parser: it is called for each tag and text."""

    def __init__(self, source: Source, mend: str) -> None:
        self.source = source
        self.mend = mend
        self.expat: Any = None
        self.root: Element | None = None
        self._open: list[Element] = []
        self._bytes: bytes | None = None if source.text.isascii() else source.text.encode("utf-8", "surrogatepass")
        self._last = (0, 0)

    def offset(self) -> int:
        """Return where the parser is; it counts bytes of UTF-8."""
        index: int = max(self.expat.CurrentByteIndex, 0)
        if self._bytes is None:
            return index
        known_bytes, known = self._last
        if index < known_bytes:
            known_bytes = known = 0
        known += len(self._bytes[known_bytes:index].decode("utf-8", "replace"))
        self._last = (index, known)
        return known

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(_local(tag), {_local(name): value for name, value in attributes.items()}, self.source, 0)
        element.start = self.offset()
        if len(self._open) >= MAX_XML_DEPTH:
            raise element.error(f"elements are nested deeper than {MAX_XML_DEPTH}", self.mend)
        if self._open:
            self._open[-1].children.append(element)
        elif self.root is None:
            self.root = element
        self._open.append(element)

    def end(self, _: str) -> None:
        self._open.pop().end = self.offset()

    def data(self, text: str) -> None:
        self._open[-1].texts.append(text)

    def close(self) -> None:
        pass


def _local(name: str) -> str:
    return name.rpartition("}")[2]


def _same_shape(markup: re.Match[str]) -> str:
    """Return what markup stands for, in as many characters: blanks, the data of CDATA, or a character and blanks."""
    whole: str = markup[0]
    data: str | None = markup["data"]
    if data is not None:
        return f"{' ' * len('<![CDATA[')}{data}{' ' * len(']]>')}"
    name: str | None = markup["name"]
    if name is None:
        return blank(whole)
    if name in _ENTITIES:
        return _ENTITIES[name].ljust(len(whole))
    number = int(name[2:], 16) if name[1] == "x" else int(name[1:])
    return (chr(number) if number < 0x110000 else " ").ljust(len(whole))
