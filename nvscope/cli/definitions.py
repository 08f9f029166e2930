"""The options by which verbs are told what should be on the wire, and what nodes are called."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.streams import refuse_streams_onto
from nvscope.cli.terminal import echo
from nvscope.enumeration import first_few
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.seen_lists import SeenLists
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.model import Definition, ListDefinition
    from nvscope.definition.project import Project

_MOST_NAMED = 5

GvlOption = Annotated[
    list[str] | None,
    typer.Option(
        "--gvl",
        metavar="PATH",
        help="Definitions: a file (.gvl, .exp, PLCopen XML, .TcGVL, .TcDUT, ST text with types), a directory with all "
        "below it, or a pattern such as 'plc/*.gvl'; several options, or further arguments. They take the place of "
        "those that the project names.",
        show_default=False,
    ),
]
ProjectOption = Annotated[
    str | None,
    typer.Option(
        "--project",
        metavar="FILE",
        help="Project file with definitions, names of nodes, settings of lists, and limits. Without it, the next "
        "nvscope.toml in the working directory or above it.",
        show_default=False,
    ),
]
NoNamesOption = Annotated[
    bool, typer.Option("-n", "--no-names", help="Show addresses of nodes, not the names that the project gives them.")
]


def project_of(path: str | None, gvl: Sequence[str] | None, captures: Sequence[str] = ()) -> Project:
    """Return what the project file says, or where there is none what the definition files alone do.

    ``path`` is that of --project; without it the file is looked for upwards from the working directory. Files of
    ``gvl`` take the place of the project's definitions; all else that it says stays. Where neither names a definition,
    those are taken that a recording among the ``captures`` brings with it. Raises ConfigurationError; UsageError where
    stdout or stderr goes to one of the files.
    """
    from nvscope.definition.project import Project

    if path is not None and not path.strip():
        what = "the name of a project file is empty"
        raise UsageError(what, next_step="name the file, or leave --project out: then the next nvscope.toml is taken")
    found = _next_project() if path is None else Path(path)
    if found is None and not gvl:
        return _with_attached(Project(), captures)
    from nvscope.definition.project_file import read_project

    refuse_streams_onto([*([found] if found else []), *(gvl or ())])
    project = read_project(found, gvl or None)
    refuse_streams_onto(project.inputs)
    return _with_attached(project, captures)


def _with_attached(project: Project, captures: Sequence[str]) -> Project:
    """Return a project with the definitions of a recording, where it has none, and say which are left out."""
    from nvscope.capture.attaching import that_may_attach

    if project.files or not (recordings := that_may_attach(captures)):
        return project
    from nvscope.analysis.attached_project import with_attached
    from nvscope.view.escape import visible

    found = with_attached(project, recordings)
    if found.unread:
        echo(f"nvscope: what is attached is left out: {visible(found.unread)} (--gvl names definitions)", err=True)
    for path in found.others:
        echo(f"nvscope: {visible(path)} brings other definitions, which are left out.", err=True)
    return found.project


def _next_project() -> Path | None:
    """Return the project file that is found from the working directory, as short as a person would write it."""
    from nvscope.definition.project import find_project

    try:
        here = Path.cwd()
    except OSError:  # the working directory is gone
        return None
    upwards = find_project(here)
    # Messages name it.
    return upwards and Path(os.path.relpath(upwards, here))


def tell_of_flaws(definition: Definition, lists: Sequence[ListDefinition] | None = None) -> None:
    """Say what was left out of the files, and what lists (None: all) need and no file declares, all at once."""
    from nvscope.view.lines.definition_flaws import definition_flaws

    for sentence in definition_flaws(definition, lists):
        echo(f"nvscope: {sentence}", err=True)


@contextmanager
def flaws_told_first(definition: Definition) -> Iterator[None]:
    """Say what is wrong with the files in front of a UsageError: what it misses may be in what was left out of them."""
    try:
        yield
    except UsageError:
        tell_of_flaws(definition, _sent(definition))
        raise


def _sent(definition: Definition) -> list[ListDefinition]:
    return [entry for entry in definition.lists if entry.key]


def tell_of_missing(inquiry: Inquiry, seen: SeenLists) -> None:
    """Say of which lists there is nothing in the captures: a definition that fits nothing may be the wrong one."""
    from nvscope.units import list_key
    from nvscope.view.escape import visible

    missing = seen.missing(inquiry.project.definition)
    if missing:
        told = first_few([visible(f"{entry.name} ({list_key(str(key))})") for key, entry in missing], _MOST_NAMED)
        lists = f"{told} {'is' if len(missing) == 1 else 'are'} defined"
        echo(f"nvscope: {lists}, but not one telegram of {'it' if len(missing) == 1 else 'them'} was seen.", err=True)


def tell_of_lists(inquiry: Inquiry) -> None:
    """Say of which lists nothing can be shown, and why."""
    from nvscope.view.escape import visible

    definition = inquiry.project.definition
    tell_of_flaws(definition, _sent(definition))
    # Types alone may be those of parameters.
    if inquiry.project.files and not (definition.lists or definition.left_out or definition.parameters):
        echo("nvscope: the definition files declare types, but no list: name the exported list, too.", err=True)
    layouts = inquiry.layouts
    for key, (element, is_open) in layouts.left_out.items() if layouts else ():
        entry = layouts.list_of(key) if layouts else None
        name, unknown = visible(entry.name if entry else ""), visible(f"{element.name} : {element.type.name}")
        rest = "from there on, bytes are bytes" if is_open else "what it sends is bytes"
        what = f"{name}: nobody knows how many bytes {unknown} has; {rest}."
        echo(f"nvscope: {what}", err=True)
    for sentence in _of_definitions_aside(layouts) if layouts else ():
        echo(f"nvscope: {sentence}", err=True)
    for entry, element in layouts.unplaced if layouts else ():
        what = visible(f"{entry.name}: no frame of CAN holds {element.name} : {element.type.name}")
        echo(f"nvscope: {what}; neither it nor what follows it can be shown.", err=True)
    unnamed = [visible(entry.name) for entry in definition.lists if entry.list_id is None and entry.variables]
    if unnamed:
        names, were = first_few(unnamed, _MOST_NAMED), "was" if len(unnamed) == 1 else "were"
        echo(
            f"nvscope: {names} {were} not looked for: no file says the list identifier. Write it into "
            f'nvscope.toml: [lists.N] and below it name = "{unnamed[0]}".',
            err=True,
        )


def _of_definitions_aside(layouts: Layouts) -> Iterator[str]:
    """Yield which definitions are not gone by, since they are not wholly known and others of their list are taken."""
    from nvscope.units import count_of, list_key
    from nvscope.view.escape import visible

    for key, entry, element in layouts.aside[:_MOST_NAMED]:
        what = f"{list_key(str(key))} is not read by {entry.name} ({entry.position})"
        why = f"nobody knows how many bytes {element.name} : {element.type.name} has"
        taken = "; ".join(f"{other.name} ({other.position})" for other in layouts.definitions_of(key)[:_MOST_NAMED])
        yield visible(f"{what}: {why}. It is read by {taken}.")
    if (more := len(layouts.aside) - _MOST_NAMED) > 0:
        yield f"{count_of(more, 'more definition')} left aside for the same reason."
