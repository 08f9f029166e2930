"""The text of an expression as a tree (``expression.lark``)."""

from __future__ import annotations

import string
from functools import cache
from pathlib import Path

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from nvscope.expression.mistake import ExpressionError, Span
from nvscope.grammar import Grammar

MAX_CHARACTERS = 10_000
MAX_NESTING = 60

Node = Tree[Token]


@cache
def _parser() -> Lark:
    return grammar().parser()


def grammar() -> Grammar:
    """Return the grammar of expressions."""
    return Grammar(
        Path(__file__).with_name("expression.lark"),
        {"lexer": "contextual", "propagate_positions": True, "maybe_placeholders": False},
    )


def parse(text: str) -> Node:
    """Return the tree of an expression; ExpressionError where it is none, too long, or nested too deeply."""
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(
            f"longer than {MAX_CHARACTERS} characters", text, Span(MAX_CHARACTERS, MAX_CHARACTERS + 1)
        )
    if not text.strip():
        raise ExpressionError("the expression is empty", text, Span(0, 1), next_step="for example nv.index == 7")
    try:
        tree: Node = _parser().parse(text)
    except UnexpectedInput as error:
        raise _mistake(error, text) from None
    _check_nesting(tree, text)
    return tree


def span_of(node: Node) -> Span:
    """Return where a node stands, parentheses around it left out."""
    return Span(node.meta.start_pos, node.meta.end_pos)


def _check_nesting(tree: Node, text: str) -> None:
    level: list[Node] = [tree]
    for _ in range(MAX_NESTING):
        level = [child for node in level for child in node.children if isinstance(child, Tree)]
        if not level:
            return
    place = next((span_of(node) for node in level if not node.meta.empty), Span(0, 1))
    raise ExpressionError(f"nested more than {MAX_NESTING} deep", text, place)


def _mistake(error: UnexpectedInput, text: str) -> ExpressionError:
    if isinstance(error, UnexpectedToken) and error.token.type != "$END":
        start = error.token.start_pos or 0
        return _unexpected(text, _whole_sign(text, Span(start, start + len(error.token))))
    if isinstance(error, UnexpectedCharacters):
        start = error.pos_in_stream or 0
        if text[start] == '"':
            return ExpressionError("a quote that is not closed", text, Span(start, len(text)))
        stop = start + 1
        while text[start] in _WORD and stop < len(text) and text[stop] in _WORD:
            stop += 1
        return _unexpected(text, _whole_sign(text, Span(start, stop)))
    return ExpressionError("something is missing at the end", text, Span(len(text.rstrip()), len(text.rstrip()) + 1))


_WORD = string.ascii_letters + string.digits + "_."
_SIGN = "=!<>~|^"
_HINTS = {
    "=": "equal is written ==",
    "===": "equal is written ==; with all in front (all udp.port == 1202), all values of a name have to be",
    "!==": "different is written !=; with any in front (any udp.port != 1202), one value of a name that is will do",
    "~=": "different is written !=; with any in front (any udp.port != 1202), one value of a name that is will do",
    "<>": "different is written !=",
    "=<": "at most is written <=",
    "=>": "at least is written >=",
    "=~": "matches is written ~",
    "|": "or is written ||",
    "^": "exclusive or is written ^^",
    "'": 'texts stand in double quotes: "text"',
}


def _whole_sign(text: str, span: Span) -> Span:
    """Return the whole run of signs that a span is in: of ``===``, the parser stumbles over the last part only."""
    start, stop = span.start, span.stop
    if not set(text[start:stop]) <= set(_SIGN):
        return span
    while start and text[start - 1] in _SIGN:
        start -= 1
    while stop < len(text) and text[stop] in _SIGN:
        stop += 1
    return Span(start, stop) if text[start:stop] in _HINTS else span


def _unexpected(text: str, span: Span) -> ExpressionError:
    found = text[span.start : span.stop]
    what = f"{found[:60]} does not belong here" if found.isprintable() else "a character does not belong here"
    return ExpressionError(what, text, span, next_step=_HINTS.get(found, ""))
