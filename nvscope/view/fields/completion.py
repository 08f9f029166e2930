"""How an expression that is not finished can go on: what a shell proposes, and what a line to type in does."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a shell waits for every import between two keys
    from nvscope.view.fields.vocabulary import Vocabulary

_WORD = re.compile(r"[\w.\[\]]*$")
_TEXT = re.compile(
    r"""([\w.\[\]]+)\s*(?:==|!=|\beq\b|\bne\b|\bin\s*\{(?:\s*"[^"]*"\s*,)*)\s*("?[\w-]*)$""", re.IGNORECASE
)
"""The end of an expression that compares a field with texts, the last of which is not finished, or not begun."""


def completions(incomplete: str, known: Vocabulary) -> list[str]:
    """Return an expression with its last word completed to each field that begins like it.

    Behind a field that has only some texts, such as ``cause.kind ==``, it is completed to each of these.
    """
    if text := _TEXT.search(incomplete):
        spelled = known.spelled(text[1])
        names = (known[spelled].texts or tuple(known[spelled].values)) if spelled else ()
        if names or text[2].startswith('"'):
            begun = incomplete[: text.start(2)]
            return [f'{begun}"{name}"' for name in beginning(names, text[2].removeprefix('"'))]
    word = _WORD.search(incomplete)
    start = word.start() if word else len(incomplete)
    return [incomplete[:start] + name for name in beginning(known, incomplete[start:])]


def beginning(names: Iterable[str], incomplete: str) -> list[str]:
    """Return the names that begin like this, in whatever case, each once."""
    wanted = incomplete.lower()
    return [name for name in dict.fromkeys(names) if name.lower().startswith(wanted)]
