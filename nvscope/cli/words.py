"""What a person may write in front of, behind or instead of a verb, put into the order that the program expects."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

from nvscope.errors import UsageError
from nvscope.near_files import near_files

USUAL_VERB = "report"
"""The verb of a command line that names captures, but no verb."""

_OF_PROGRAM = {"--version", "--help", "-h", "--install-completion", "--show-completion"}
_HELP = "help"
LIVE = ("can:", "udp://")
"""What words of live sources begin with that are no names of interfaces."""

_MOST_NEAR = 3


def in_order(words: Sequence[str], verbs: Iterable[str]) -> list[str]:
    """Return a command line with the verb in front: the one in it, that of ``help VERB``, or the usual one.

    Options may stand in front of the verb, too. Raises UsageError, with near names, for a word that is neither a verb
    nor a file.
    """
    words, known = list(words), set(verbs)
    if not words or words[0] in _OF_PROGRAM or words[0] in known:
        return words
    if words[0] == _HELP:
        return _help(words[1:], known)
    if words[0].startswith("-") and words[0] != "-":
        place = next((number for number, word in enumerate(words) if word in known), None)
        return [USUAL_VERB, *words] if place is None else [words[place], *words[:place], *words[place + 1 :]]
    if _is_source(words[0]):
        return [USUAL_VERB, *words]
    raise UsageError(f"no verb and no file is called '{words[0][:80]}'", next_step=_near(words[0], known))


def _help(words: Sequence[str], verbs: set[str]) -> list[str]:
    if not words:
        return ["--help"]
    if words[0] not in verbs:
        raise UsageError(f"no verb is called '{words[0][:80]}'", next_step=_near(words[0], verbs))
    return [*words, "--help"]


def _is_source(word: str) -> bool:
    """Return whether a word is meant as a source; of one that looks like a path, opening it will say what is wrong."""
    if word == "-" or word.startswith(LIVE) or os.path.lexists(word):
        return True
    if _is_interface(word):
        return True
    return any(mark in word for mark in "./\\*?[")


def _is_interface(word: str) -> bool:
    import socket

    try:
        return any(name == word for _, name in socket.if_nameindex())
    except OSError:
        return False


def _near(word: str, verbs: set[str]) -> str:
    from difflib import get_close_matches

    near = get_close_matches(word.lower(), sorted(verbs), _MOST_NEAR, 0.6)
    told = [*(f"nvscope {verb}" for verb in near), *near_files(word)]
    return f"perhaps {', '.join(told)}" if told else "`nvscope --help` lists the verbs"
