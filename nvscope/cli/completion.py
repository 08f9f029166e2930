"""What the shell proposes behind an option: codes of findings, documents, fields, and lists of the project."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nvscope.errors import NvscopeError
from nvscope.view.fields.completion import beginning, completions

if TYPE_CHECKING:  # a shell waits for every import between two keys
    from nvscope.view.fields.vocabulary import Vocabulary

_CODE = re.compile(r"nv[0-9]", re.IGNORECASE)


def codes(incomplete: str) -> list[str]:
    """Return the causes, findings, figures and checks that ``explain`` knows and that begin like this."""
    from nvscope.findings.catalogue import CATALOGUE

    if _CODE.match(incomplete):  # nobody need wait for what causes are judged from
        return beginning(CATALOGUE, incomplete)

    from nvscope.causes.catalogue import BY_NAME
    from nvscope.check.catalogue import CATALOGUE as CHECKS
    from nvscope.tracker.figures import FIGURES

    names = [*BY_NAME, *CATALOGUE, *(kind.name for kind in CATALOGUE.values()), *(figure.name for figure in FIGURES)]
    return beginning(dict.fromkeys([*names, *CHECKS]), incomplete)


def documents(incomplete: str) -> list[str]:
    """Return the documents that have a schema and that begin like this."""
    from nvscope.schemas.schema_files import schema_names

    return beginning(schema_names(), incomplete)


def fields(incomplete: str) -> list[str]:
    """Return the fields, those of the project's variables too, that begin like this."""
    return beginning(_fields(), incomplete)


def expressions(incomplete: str) -> list[str]:
    """Return an expression with its last word completed to each field that begins like it, or to each of its texts."""
    return completions(incomplete, _fields())


def lists(ctx: Any, incomplete: str) -> list[str]:
    """Return the names of the lists that the project defines, and of the databases named, that begin like this."""
    from nvscope.cli.definitions import project_of

    databases = _databases(ctx.params.get("sources") or ())
    try:
        entries = project_of(None, None).definition.lists
    except NvscopeError:
        entries = ()  # nobody reads a message between two keys
    return beginning([*(entry.name for entry in entries if entry.key), *databases], incomplete)


def _databases(sources: Sequence[str]) -> list[str]:
    """Return what stands for the databases among some sources in the place of lists."""
    if not any(".db" in path for path in sources):
        return []
    from nvscope.capture.capture_file import CaptureFile
    from nvscope.capture.datalogger.names import title_of
    from nvscope.capture.formats import DATABASES

    found: dict[str, None] = {}
    for path in sources:
        try:
            if ".db" in path and CaptureFile(path).info.format in DATABASES:
                found[title_of(path)] = None
        except NvscopeError:
            continue
    return list(found)


def nodes(incomplete: str) -> list[str]:
    """Return the names of the nodes of the project that begin like this, or their addresses."""
    from nvscope.cli.definitions import project_of

    try:
        known = project_of(None, None).nodes
    except NvscopeError:
        return []
    return beginning([*(node.name for node in known.values() if node.name), *known], incomplete)


def parameters(incomplete: str) -> list[str]:
    """Return the names of the project's parameters of the Parameter Manager that begin like this."""
    from nvscope.cli.definitions import project_of

    try:
        known = project_of(None, None).definition.parameters
    except NvscopeError:
        return []
    return beginning(dict.fromkeys(one.name for one in known.known if one.name) if known else (), incomplete)


def parameter_types(incomplete: str) -> list[str]:
    """Return the elementary types that begin like this."""
    from nvscope.definition.scalars import SCALARS

    names = [name for name, kind in SCALARS.items() if kind.size_bytes]
    return beginning([*names, "STRING", "WSTRING"], incomplete.upper())


def visu_variables(ctx: Any, incomplete: str) -> list[str]:
    """Return the variables of the files of ``--variables`` that begin like this: nothing is asked of a controller."""
    from nvscope.plc.visu.variables import known_of_files

    try:
        listed = known_of_files(ctx.params.get("variables") or ()).listed
    except NvscopeError:
        return []
    return beginning(dict.fromkeys(one.name for one in listed), incomplete)


def interfaces(incomplete: str) -> list[str]:
    """Return the interfaces of this machine that begin like this."""
    from nvscope.capture.live.device import names

    return beginning(names(), incomplete)


def _fields() -> Vocabulary:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.definitions import project_of
    from nvscope.definition.project import Project

    try:
        plant = project_of(None, None)
    except NvscopeError:
        plant = Project()
    return Inquiry([], plant).fields
