"""What people call the definitions of a list: the names of their files."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a report without definitions starts without what reads them
    from nvscope.definition.model import ListDefinition


def file_name(entry: ListDefinition) -> str:
    """Return the name of a definition's file without its directories, those of Windows included."""
    return re.split(r"[/\\]", entry.position.file)[-1]


def names_of_definitions(lists: Sequence[ListDefinition]) -> list[str]:
    """Return names that tell definitions apart: of files, with as much before or behind them as needed."""
    files = [entry.position.file for entry in lists]
    short = [file_name(entry) for entry in lists]
    for names in (short, files):
        if len(set(names)) == len(names):
            return names
    return [f"{entry.name} in {file}, line {entry.position.line}" for entry, file in zip(lists, short, strict=True)]


def how_to_compare(a: ListDefinition, b: ListDefinition, shows: str) -> str:
    """Return how to see what differs between two definitions; ``shows`` says what the command for it does."""
    files = [entry.position.file for entry in (a, b)]
    if files[0] == files[1]:
        return f"Compare both in {files[0]}, lines {a.position.line} and {b.position.line}"
    return f"`nvscope gvl diff {' '.join(map(shlex.quote, files))}` {shows}"
