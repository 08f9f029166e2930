"""The definitions that recordings bring with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from nvscope.capture.open import open_source
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_attached_project
from nvscope.errors import UnreadableInput


class AttachedProject(NamedTuple):
    """The project of the first recording that brings definitions, None where none does, and who brings ``others``."""

    project: Project | None
    others: list[str]


def attached_project(recordings: Sequence[str], project: Path | None = None) -> AttachedProject:
    """Return what recordings bring with them; a ``project`` file on disk takes the place of theirs.

    Several that bring the same files are one series. A recording that cannot be read brings nothing; reading its
    packets says what is wrong. Raises ConfigurationError as ``nvscope.definition.project_file.read_project``.
    """
    first: tuple[str, Mapping[str, bytes]] | None = None
    others = []
    for path in recordings:
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
        return AttachedProject(None, [])
    found = read_attached_project(*first, project)
    return AttachedProject(found if found.files or found.path is None else None, others)
