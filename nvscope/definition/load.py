"""Definition files of any format to one definition."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from nvscope.definition.exp import is_export, read_exp
from nvscope.definition.model import DEFAULT_PORT, Definition, Problem
from nvscope.definition.plain_text import read_plain_text
from nvscope.definition.position import Position
from nvscope.definition.resolve import resolve
from nvscope.definition.source import DefinitionError, NoDefinition, Source, read_source
from nvscope.definition.syntax import FileSyntax
from nvscope.definition.wanted_files import LIST_SUFFIXES, DefinitionFile, wanted_files
from nvscope.errors import ConfigurationError
from nvscope.units import count

MAX_ALL_CHARACTERS = 32_000_000
"""Characters of all definition files together: what is made of 1 MB of declarations takes up to 30 MB of memory."""

_MOST_GIVEN = 3


class ReadFiles(Struct, frozen=True):
    """What files declare, as it is written, by path; ``left_out`` are those in which something is wrong."""

    files: dict[str, FileSyntax]
    left_out: tuple[Problem, ...] = ()


def load_definitions(paths: Sequence[str], *, encoding: str | None = None, port: int = DEFAULT_PORT) -> Definition:
    """Return the lists of all files, sorted by their paths; types and constants of each are known to all.

    ``paths`` may be directories and patterns (``wanted_files``). What a file is, its content tells, not its name.
    ``encoding`` is that of files without byte order mark; without it it is recognised. ``port`` is that of lists whose
    file says none. A file in which something is wrong is left out; where nothing else is left, and where a file cannot
    be opened, ConfigurationError is raised.
    """
    return definition_of(read_definitions(wanted_files(paths), encoding=encoding), port)


def definition_of(read: ReadFiles, port: int = DEFAULT_PORT) -> Definition:
    """Return the lists that files declare together."""
    return resolve(list(read.files.values()), port, read.left_out)


def read_definitions(wanted: Sequence[DefinitionFile], *, encoding: str | None = None) -> ReadFiles:
    """Return what the files declare, sorted by path; a file that is there twice is read once.

    The order in which a person names files says nothing: with the same files everything is the same.

    Of those that were found and not named, what is no definition is passed over, where others call files so too. What
    would be more than ``MAX_ALL_CHARACTERS`` together is left out, and so is what cannot be opened. Raises
    ConfigurationError where a file that was named cannot be opened, or none can be read.
    """
    places: dict[str, DefinitionFile] = {}
    for file in sorted(wanted, key=lambda file: Path(file.path)):
        places.setdefault(_place_of(file.path), file)
    read: dict[str, FileSyntax] = {}
    errors: list[DefinitionError] = []
    passed: list[DefinitionError] = []
    characters = 0
    for file in places.values():
        try:
            source = read_source(file.path, encoding, file.content)
            _check_amount(source, characters + len(source.text))
            read[file.path] = _read(source)
            characters += len(source.text)
        except NoDefinition as error:
            (errors if file.named or file.path.lower().endswith(LIST_SUFFIXES) else passed).append(error)
        except DefinitionError as error:
            errors.append(error)
        except ConfigurationError as error:
            if file.named:
                raise
            errors.append(DefinitionError(error.what, Position(file.path, 0, 0), error.next_step))
    if errors and not read:
        raise errors[0]
    if wanted and not read:
        raise _nothing_in(wanted, passed)
    return ReadFiles(read, tuple(error.problem for error in errors))


def _check_amount(source: Source, characters: int) -> None:
    if characters > MAX_ALL_CHARACTERS:
        what = f"the definition files have {count(characters)} characters together up to here"
        next_step = (
            f"They may have {count(MAX_ALL_CHARACTERS)}: name only the files that declare lists and their types."
        )
        raise source.error(what, 0, next_step)


def _nothing_in(wanted: Sequence[DefinitionFile], passed: Sequence[DefinitionError]) -> ConfigurationError:
    given = ", ".join(list(dict.fromkeys(file.given for file in wanted))[:_MOST_GIVEN])
    if passed:
        return ConfigurationError(
            f"no definition file is there; {passed[0].position}: {passed[0].what}", where=given,
            next_step=passed[0].next_step,
        )  # fmt: skip
    return ConfigurationError("no definition file", where=given, next_step="Name the directory of the exported lists.")


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
    return read_exp(source) if is_export(source) else read_plain_text(source)
