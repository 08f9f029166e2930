"""Text of a definition file, and where in it something stands."""

from __future__ import annotations

import codecs
import re
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path, PureWindowsPath

from nvscope.definition.foreign_files import foreign_file
from nvscope.definition.model import Problem
from nvscope.definition.position import Position
from nvscope.errors import ConfigurationError
from nvscope.near_files import perhaps
from nvscope.units import data_size

MAX_FILE_BYTES = 16_000_000
"""Larger files are refused: no project exports declarations of this size."""

_LINE_END = re.compile(r"\r\n|\n|\r")
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_XML_ENCODING = re.compile(rb"""<\?xml[^>]{0,100}?encoding\s*=\s*["']([A-Za-z][\w.-]{0,40})["']""")
_NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_MOST_NO_TEXT = 0.05
_END_OF_TEXT = "\x1a"
_CYRILLIC_WORD = re.compile(rb"[\xa8\xb8\xc0-\xff]{3,}")
_HIGH_LETTER = re.compile(rb"[\xa8\xb8\xc0-\xff]")


class DefinitionError(ConfigurationError):
    """Something in a definition file is wrong, at a known place."""

    def __init__(self, what: str, position: Position, next_step: str = "") -> None:
        super().__init__(what, where=str(position), next_step=next_step)
        self.position = position

    @property
    def problem(self) -> Problem:
        """The error as a value."""
        return Problem(self.what, self.position, self.next_step)


class NoDefinition(DefinitionError):
    """A file is of another kind than definitions are."""


@dataclass(frozen=True, slots=True)
class Source:
    """The text of a file; offsets count its characters from 0."""

    file: str
    text: str = field(repr=False)
    line_starts: list[int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "line_starts", [0, *(end.end() for end in _LINE_END.finditer(self.text))])

    @property
    def stem(self) -> str:
        """The name of the file without directory and suffix, whichever system its path is of."""
        return PureWindowsPath(self.file).stem or self.file

    def position(self, offset: int) -> Position:
        """Return line and column of an offset."""
        line = bisect_right(self.line_starts, offset)
        return Position(self.file, line, offset - self.line_starts[line - 1] + 1)

    def error(self, what: str, offset: int, next_step: str = "") -> DefinitionError:
        """Return the error that something is wrong at an offset."""
        return DefinitionError(what, self.position(offset), next_step)


def read_source(
    path: str, encoding: str | None = None, content: bytes | None = None, *, called: str = "definition file"
) -> Source:  # fmt: skip
    """Return the text of a file, or of a ``content`` that is called so; ``called`` is what people call such files.

    Without ``encoding``: by byte order mark, by what an XML prolog says, UTF-8 where the bytes are that, and else the
    Windows code page 1251 or 1252. A Ctrl-Z that ends the text, as MS-DOS wrote it, is left out. Raises
    ConfigurationError where the file cannot be read, NoDefinition where it is too large, no text, or something else.
    """
    try:
        data = content if content is not None else _content_of(path)
    except (OSError, ValueError) as error:
        what = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        check = f"Check the path of the {called}."
        next_step = perhaps(path, check) if isinstance(error, FileNotFoundError) else check
        raise ConfigurationError(what, where=path, next_step=next_step) from None
    if len(data) > MAX_FILE_BYTES:
        what = f"the file is larger than {data_size(MAX_FILE_BYTES)}"
        raise NoDefinition(what, Position(path, 0, 0), "Export only the lists and the types that they use.")
    foreign = foreign_file(data, path)
    if foreign is not None:
        raise NoDefinition(foreign.what, Position(path, 0, 0), foreign.next_step)
    source = Source(path, _without_end(decode(data, path, encoding)))
    _check_text(source, data)
    return source


def _content_of(path: str) -> bytes:
    with Path(path).open("rb") as file:
        return file.read(MAX_FILE_BYTES + 1)


def _without_end(text: str) -> str:
    """Return a text without the Ctrl-Z at its end and what fills up the file behind it."""
    content = text.rstrip(f"{_END_OF_TEXT}\0 \t\r\n")
    end = text.find(_END_OF_TEXT, len(content))
    return text if end < 0 else text[:end]


def _check_text(source: Source, data: bytes) -> None:
    """Raise NoDefinition where a file is no text: NUL or many other characters that nobody types."""
    first = _NO_TEXT.search(source.text)
    if first is None:
        return
    if "\0" not in source.text and len(_NO_TEXT.findall(source.text)) <= _MOST_NO_TEXT * len(source.text):
        return
    position = source.position(first.start())
    if data.count(0) * 3 > len(data):
        what = "the file looks like UTF-16 without a byte order mark"
        raise NoDefinition(what, position, "Save it as UTF-8.")
    next_step = "Export the lists and their types from the project as text; the project file itself cannot be read."
    raise NoDefinition("no definition file: binary data", position, next_step)


def decode(data: bytes, path: str, encoding: str | None = None) -> str:
    """Return the text of bytes; ConfigurationError where they are not of the encoding that was asked for."""
    for mark, name in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(name, errors="replace")
    if encoding is not None:
        return _decode_as(data, path, encoding)
    prolog = _XML_ENCODING.match(data)
    # Bytes in which such a prolog can be read are not UTF-16, whatever it says: many a tool writes one in UTF-8.
    if prolog is not None and _is_text_encoding(name := prolog[1].decode("ascii")) and _keeps_ascii(name):
        return data.decode(name, errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1251" if _looks_cyrillic(data) else "cp1252", errors="replace")


def _decode_as(data: bytes, path: str, encoding: str) -> str:
    if not _is_text_encoding(encoding):
        what = f"no encoding is called '{encoding[:60]}'"
        raise ConfigurationError(what, where=path, next_step="Encodings are called utf-8, cp1252, cp1251, …")
    try:
        return data.decode(encoding)
    except UnicodeError as error:
        first = getattr(error, "start", 0)
        line, column = data.count(b"\n", 0, first) + 1, first - data.rfind(b"\n", 0, first)
        raise ConfigurationError(
            f"the bytes are no {encoding[:60]}", where=str(Position(path, line, column)),
            next_step="Leave the encoding out to have it recognised.",
        ) from None  # fmt: skip


def _keeps_ascii(name: str) -> bool:
    try:
        return "<?xml".encode(name) == b"<?xml"
    except UnicodeError:
        return False


def _is_text_encoding(name: str) -> bool:
    try:
        # Others turn bytes into bytes, or expand what was packed.
        return codecs.lookup(name)._is_text_encoding and name.lower() not in {"idna", "punycode", "undefined"}
    except (LookupError, ValueError):
        return False


def _looks_cyrillic(data: bytes) -> bool:
    """Whether most high bytes stand in runs, as in Cyrillic words; in western words they stand alone."""
    in_words = sum(len(word) for word in _CYRILLIC_WORD.findall(data))
    return in_words * 2 > len(_HIGH_LETTER.findall(data))
