"""Text to tokens, with the terminals of the grammar.

The lexer that lark brings counts lines, which takes longer than all the rest; here a token knows its offset only.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from lark import Token
from lark.common import LexerConf
from lark.lexer import Lexer

_KEPT_WORDS = "VAR_GLOBAL CONSTANT RETAIN PERSISTENT STRUCT UNION STRING WSTRING ARRAY POINTER REFERENCE MOD"
_PLAIN_WORDS = "TYPE END_TYPE END_VAR END_STRUCT END_UNION EXTENDS AT OF TO OR XOR AND NOT"

# The grammar drops terminals whose name begins with an underscore: nobody asks where they stand.
KEYWORDS = {word: word for word in _KEPT_WORDS.split()} | {word: f"_{word}" for word in _PLAIN_WORDS.split()}
KEYWORDS |= {"AND_THEN": "_AND", "OR_ELSE": "_OR"}
"""The terminal of each word of the language; words are written in any case."""


class NoToken(Exception):
    """At ``offset`` stands a character with which no token begins."""

    def __init__(self, offset: int) -> None:
        super().__init__(offset)
        self.offset = offset


class DeclarationLexer(Lexer):
    """What the parser asks for tokens; ``conf`` holds the terminals of the grammar."""

    def __init__(self, conf: LexerConf) -> None:
        ignored = "|".join(term.pattern.to_regexp() for term in conf.terminals if term.name in conf.ignore)
        terminals = sorted(
            (term for term in conf.terminals if term.name not in conf.ignore),
            key=lambda term: (-term.priority, -term.pattern.max_width, -len(term.pattern.value), term.name),
        )
        tokens = "|".join(f"(?P<{term.name}>{term.pattern.to_regexp()})" for term in terminals)
        # What is skipped is never given back: behind long blanks, each of them would be tried as a token again.
        self._next = re.compile(f"(?>{ignored})?+(?:{tokens})").match
        self._ignored = re.compile(f"(?:{ignored})?").match

    def lex(self, text: str) -> Iterator[Token]:  # type: ignore[override]
        """Yield the tokens; NoToken where none begins."""
        position, find, keyword = 0, self._next, KEYWORDS.get
        while (found := find(text, position)) is not None:
            terminal = found.lastgroup or ""
            value: str = found[terminal]
            if terminal == "NAME":
                terminal = keyword(value.upper(), terminal)
            position = found.end()
            yield Token(terminal, value, found.start(found.lastgroup or 0), None, None, None, None, position)
        gap = self._ignored(text, position)
        position = gap.end() if gap else position
        if position < len(text):
            raise NoToken(position)
