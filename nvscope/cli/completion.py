"""What the shell proposes behind an option: codes of findings, documents, fields, and lists of the project."""

from __future__ import annotations

import re
from collections.abc import Iterable

from nvscope.errors import NvscopeError

_WORD = re.compile(r"[\w.\[\]]*$")


def codes(incomplete: str) -> list[str]:
    """Return the findings and figures that ``explain`` knows and that begin like this."""
    from nvscope.findings.catalogue import CATALOGUE
    from nvscope.tracker.figures import FIGURES

    names = [*CATALOGUE, *(kind.name for kind in CATALOGUE.values()), *(figure.name for figure in FIGURES)]
    return _beginning(names, incomplete)


def documents(incomplete: str) -> list[str]:
    """Return the documents that have a schema and that begin like this."""
    from nvscope.schemas.schema_files import schema_names

    return _beginning(schema_names(), incomplete)


def fields(incomplete: str) -> list[str]:
    """Return the fields, those of the project's variables too, that begin like this."""
    return _beginning(_fields(), incomplete)


def expressions(incomplete: str) -> list[str]:
    """Return an expression with its last word completed to each field that begins like it."""
    word = _WORD.search(incomplete)
    start = word.start() if word else len(incomplete)
    return [incomplete[:start] + name for name in _beginning(_fields(), incomplete[start:])]


def lists(incomplete: str) -> list[str]:
    """Return the names of the lists that the project defines and that begin like this."""
    from nvscope.cli.definitions import project_of

    try:
        entries = project_of(None, None).definition.lists
    except NvscopeError:
        return []  # nobody reads a message between two keys
    return _beginning((entry.name for entry in entries if entry.key), incomplete)


def _fields() -> list[str]:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.definitions import project_of
    from nvscope.definition.project import Project

    try:
        plant = project_of(None, None)
    except NvscopeError:
        plant = Project()
    return list(Inquiry([], plant).fields)


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    wanted = incomplete.lower()
    return [name for name in dict.fromkeys(names) if name.lower().startswith(wanted)]
