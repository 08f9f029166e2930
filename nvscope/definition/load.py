"""Definition files of any format to one definition."""

from __future__ import annotations

import os
from collections.abc import Sequence

from nvscope.definition.exp import is_export, read_exp
from nvscope.definition.model import DEFAULT_PORT, Definition
from nvscope.definition.plain_text import read_plain_text
from nvscope.definition.resolve import resolve
from nvscope.definition.source import Source, read_source
from nvscope.definition.syntax import FileSyntax


def load_definitions(paths: Sequence[str], *, encoding: str | None = None, port: int = DEFAULT_PORT) -> Definition:
    """Return the lists of all files, in the order of the files; types and constants of each are known to all.

    What a file is, its content tells, not its name. ``encoding`` is that of files without byte order mark; without it
    it is recognised. ``port`` is that of lists whose file says none. Raises ConfigurationError, with file, line and
    column, where something is wrong.
    """
    return resolve(read_definitions(paths, encoding=encoding), port)


def read_definitions(paths: Sequence[str], *, encoding: str | None = None) -> list[FileSyntax]:
    """Return what the files declare, as it is written; a file given twice is read once.

    Raises ConfigurationError where something is wrong with a file by itself.
    """
    files: dict[str, str] = {}
    for path in paths:
        files.setdefault(_place_of(path), path)
    return [_read(read_source(path, encoding)) for path in files.values()]


def _place_of(path: str) -> str:
    """Return the same for each path that leads to a file."""
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):
        return path  # reading it will say what is wrong


def _read(source: Source) -> FileSyntax:
    if source.text.lstrip().startswith("<"):
        # Not before it is needed: definitions without XML do without its parser.
        from nvscope.definition.xml_formats import read_xml_format  # noqa: PLC0415

        return read_xml_format(source)
    return read_exp(source) if is_export(source.text) else read_plain_text(source)
