"""The definitions that recordings bring with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from nvscope.capture.open import open_source
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_attached_project
from nvscope.errors import ConfigurationError, UnreadableInput


class AttachedProject(NamedTuple):
    """A project with the definitions of the first recording that brings some, and which recordings bring ``others``.

    ``unread`` is why nothing that it brings is a definition, "" where something is.
    """

    project: Project
    others: list[str]
    unread: str = ""


def with_attached(project: Project, recordings: Sequence[str]) -> AttachedProject:
    """Return a project, or, where it has no definitions, with those that one of some recordings brings.

    Several that bring the same files are one series. A recording that cannot be read brings nothing; reading its
    packets says what is wrong. What is attached by others need be no definition.
    """
    first: tuple[str, Mapping[str, bytes]] | None = None
    others = []
    for path in () if project.files else recordings:
        try:
            files = {one.name: one.read() for one in open_source([path]).attachments}
        except UnreadableInput:
            continue
        if not files:
            continue
        if first is None:
            first = path, files
        elif files != first[1]:
            others.append(path)
    if first is None:
        return AttachedProject(project, [])
    try:
        found = read_attached_project(*first, project.path)
    except ConfigurationError as error:
        return AttachedProject(project, others, f"{error.where}: {error.what}" if error.where else error.what)
    return AttachedProject(found if found.files or project.path is None else project, others)
