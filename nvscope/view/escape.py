r"""Text from outside (wire, files, names) made safe to look at: one function, and what other media need on top of it.

``visible`` turns everything that a terminal would obey, hide or reorder into a backslash escape. The others build on
it, so nothing invisible reaches an HTML page, a CSV cell or a Markdown text either. Rich markup needs no escape of
its own: hand outside text to Rich as ``rich.text.Text(visible(text))``, never as a markup string.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, overload

_SHORT = {"\\": "\\\\", "\t": "\\t", "\n": "\\n", "\r": "\\r"}

# Unicode calls these printable, yet they show as nothing: Hangul and Khmer fillers, variation selectors, joiners,
# and the empty Braille pattern.
_BLANK = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180d\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)

# Scripts that need combining marks put up to three of them on a letter; more are made to cover the lines around.
_MAX_MARKS = 3


def visible(text: str) -> str:
    r"""Return ``text`` with every character that does not show as itself written as an escape.

    ``\t \n \r``, ``\xNN``, ``\uNNNN`` or ``\UNNNNNNNN`` stand for control characters, ANSI escapes, bidirectional
    controls, invisible characters, spaces other than U+0020, line separators, unassigned characters, lone surrogates
    and combining marks that have no letter of their own. A backslash is doubled, so different texts stay different.
    """
    if text.isascii() and text.isprintable() and "\\" not in text:
        return text
    shown: list[str] = []
    marks = _MAX_MARKS  # at the start there is no letter to sit on
    for character in text:
        if unicodedata.category(character)[0] == "M" and not _BLANK.match(character):
            marks += 1
            escape = marks > _MAX_MARKS
        else:
            escape = character in _SHORT or not character.isprintable() or _BLANK.match(character) is not None
            marks = _MAX_MARKS if escape or character == " " else 0
        shown.append(_escaped(character) if escape else character)
    return "".join(shown)


def _escaped(character: str) -> str:
    code = ord(character)
    if character in _SHORT:
        return _SHORT[character]
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


@lru_cache(1)
def _quoting() -> Callable[[str], str]:
    """Return what ``json.dumps`` quotes texts with; who tells a person something needs nothing of it."""
    from json.encoder import encode_basestring_ascii  # noqa: PLC0415

    quoting: Callable[[str], str] = encode_basestring_ascii
    return quoting


def json_text(text: str) -> str:
    """Return ``text`` as a JSON string of printable ASCII: what else there is in it is written as JSON escapes."""
    quoted = _quoting()(text)
    return quoted.replace("\x7f", "\\u007f") if "\x7f" in quoted else quoted


_UNPRINTED = re.compile("[^ -~\n]")


def json_ascii(document: str) -> str:
    """Return JSON texts, in lines perhaps, in printable ASCII: what else there is can only stand in their strings."""
    if document.isascii() and "\x7f" not in document:
        return document
    return _UNPRINTED.sub(lambda found: json_text(found[0])[1:-1], document)


def html_safe(text: str) -> str:
    """Return ``text`` for an HTML page, between tags or within a quoted attribute."""
    shown = visible(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return shown.replace('"', "&quot;").replace("'", "&#39;")


def csv_safe(text: str) -> str:
    """Return ``text`` as a cell that no spreadsheet takes for a formula.

    A cell that begins, spaces aside, with = + - @ (their full-width forms too) gets an apostrophe in front, as does
    one that begins with an apostrophe. Quotes and separators are left to the CSV writer. Numbers do not belong here.
    """
    shown = visible(text)
    return f"'{shown}" if shown.lstrip(" ").startswith(tuple("=+-@'＝＋－＠")) else shown


_MARKDOWN = re.compile(
    # GitHub and GitLab make links of these after Markdown is rendered, when a backslash is gone; they spare code.
    r"(?P<link>://|www\.|@(?=\w)|\#(?=\d+(?!\w)))"
    # At the start these would open a heading or a list.
    r"|\A(?P<number>\d*)(?P<block>(?<=\d)[.)](?=\ |\Z)|(?<!\d)[-+=\#])"
    r"|(?P<special>[\\`*_~\[\]<>|&$^{}])",
    re.IGNORECASE,
)


def markdown_safe(text: str) -> str:
    """Return ``text`` as Markdown prose, in a line or a table cell, that renders as ``visible(text)``."""
    shown = visible(text)
    body = shown.lstrip(" ")
    return shown[: len(shown) - len(body)] + _MARKDOWN.sub(_markdown_escape, body)


def _markdown_escape(match: re.Match[str]) -> str:
    if match["link"]:
        return f"`{match['link']}`"
    return f"\\{match['special']}" if match["special"] else f"{match['number']}\\{match['block']}"


def markdown_code(text: str) -> str:
    """Return ``text`` as a Markdown code span, for identifiers: nothing in it becomes a link, a mention or an emoji.

    A pipe is written as ``\\x7c``, since what escapes it within a table would show outside of one.
    """
    shown = visible(text).replace("|", "\\x7c")
    if not shown.strip(" "):
        return f"`{shown}`" if shown else ""
    fence = "`" * (max((len(run) for run in re.findall("`+", shown)), default=0) + 1)
    padding = " " if shown[0] in "` " or shown[-1] in "` " else ""
    return f"{fence}{padding}{shown}{padding}{fence}"


def visible_document(value: Any) -> Any:
    """Return a copy of (a part of) a document in which every text is visible: one door that all of it passes.

    Of what is made only when it is asked for, the copy is.
    """
    kind = type(value)
    if kind in _NO_TEXT:
        return value
    if kind is str:
        return visible(value)
    if kind is dict:
        return {key: item if type(item) in _NO_TEXT else visible_document(item) for key, item in value.items()}
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, Mapping):
        return _VisibleRow(value)
    if isinstance(value, list | tuple):
        return [visible_document(item) for item in value]
    return _VisibleList(value) if isinstance(value, Sequence) else value


_NO_TEXT = frozenset({int, float, bool, type(None)})


class _VisibleRow(Mapping[str, Any]):
    __slots__ = ("_known", "_row")

    def __init__(self, row: Mapping[str, Any]) -> None:
        self._row = row
        self._known: dict[str, Any] = {}

    def __getitem__(self, key: str) -> Any:
        known = self._known
        if key not in known:
            known[key] = visible_document(self._row[key])
        return known[key]

    def __contains__(self, key: object) -> bool:
        return key in self._row

    def get(self, key: str, default: Any = None) -> Any:
        return self[key] if key in self._row else default

    def __iter__(self) -> Iterator[str]:
        return iter(self._row)

    def __len__(self) -> int:
        return len(self._row)


class _VisibleList(Sequence[Any]):
    def __init__(self, entries: Sequence[Any]) -> None:
        self._entries = entries

    @overload
    def __getitem__(self, place: int) -> Any: ...

    @overload
    def __getitem__(self, place: slice) -> Sequence[Any]: ...

    def __getitem__(self, place: int | slice) -> Any:
        return visible_document(self._entries[place])

    def __iter__(self) -> Iterator[Any]:
        return map(visible_document, self._entries)

    def __len__(self) -> int:
        return len(self._entries)
