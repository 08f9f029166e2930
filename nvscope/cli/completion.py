"""What the shell proposes behind an option: codes of findings, documents, fields, and lists of the project."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from nvscope.errors import NvscopeError

if TYPE_CHECKING:  # a shell waits for every import between two keys
    from nvscope.view.fields.vocabulary import Vocabulary

_CODE = re.compile(r"nv[0-9]", re.IGNORECASE)
_WORD = re.compile(r"[\w.\[\]]*$")
_TEXT = re.compile(
    r"""([\w.\[\]]+)\s*(?:==|!=|\beq\b|\bne\b|\bin\s*\{(?:\s*"[^"]*"\s*,)*)\s*("?[\w-]*)$""", re.IGNORECASE
)
"""The end of an expression that compares a field with texts, the last of which is not finished, or not begun."""


def codes(incomplete: str) -> list[str]:
    """Return the causes, findings and figures that ``explain`` knows and that begin like this."""
    from nvscope.findings.catalogue import CATALOGUE

    if _CODE.match(incomplete):  # nobody need wait for what causes are judged from
        return _beginning(CATALOGUE, incomplete)

    from nvscope.causes.catalogue import BY_NAME
    from nvscope.tracker.figures import FIGURES

    names = [*BY_NAME, *CATALOGUE, *(kind.name for kind in CATALOGUE.values()), *(figure.name for figure in FIGURES)]
    return _beginning(names, incomplete)


def documents(incomplete: str) -> list[str]:
    """Return the documents that have a schema and that begin like this."""
    from nvscope.schemas.schema_files import schema_names

    return _beginning(schema_names(), incomplete)


def fields(incomplete: str) -> list[str]:
    """Return the fields, those of the project's variables too, that begin like this."""
    return _beginning(_fields(), incomplete)


def expressions(incomplete: str) -> list[str]:
    """Return an expression with its last word completed to each field that begins like it.

    Behind a field that has only some texts, such as ``cause.kind ==``, it is completed to each of these.
    """
    known = _fields()
    if text := _TEXT.search(incomplete):
        spelled = known.spelled(text[1])
        names = (known[spelled].texts or tuple(known[spelled].values)) if spelled else ()
        if names or text[2].startswith('"'):
            begun = incomplete[: text.start(2)]
            return [f'{begun}"{name}"' for name in _beginning(names, text[2].removeprefix('"'))]
    word = _WORD.search(incomplete)
    start = word.start() if word else len(incomplete)
    return [incomplete[:start] + name for name in _beginning(known, incomplete[start:])]


def lists(incomplete: str) -> list[str]:
    """Return the names of the lists that the project defines and that begin like this."""
    from nvscope.cli.definitions import project_of

    try:
        entries = project_of(None, None).definition.lists
    except NvscopeError:
        return []  # nobody reads a message between two keys
    return _beginning((entry.name for entry in entries if entry.key), incomplete)


def interfaces(incomplete: str) -> list[str]:
    """Return the interfaces of this machine that begin like this."""
    from nvscope.capture.live.device import names

    return _beginning(names(), incomplete)


def _fields() -> Vocabulary:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.definitions import project_of
    from nvscope.definition.project import Project

    try:
        plant = project_of(None, None)
    except NvscopeError:
        plant = Project()
    return Inquiry([], plant).fields


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    wanted = incomplete.lower()
    return [name for name in dict.fromkeys(names) if name.lower().startswith(wanted)]
