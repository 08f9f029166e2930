"""Which files a person means who names definitions: files, directories with all below them, or patterns."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec import Struct

from nvscope.definition.foreign_files import FOREIGN_FILES, HEAD_BYTES
from nvscope.errors import ConfigurationError
from nvscope.units import count

MAX_DEFINITION_FILES = 5_000
"""Files that one path or pattern may stand for; one over a whole disk must not be followed to its end."""
DEFINITION_SUFFIXES = (".gvl", ".exp", ".st", ".xml", ".tcgvl", ".tcdut", ".tcpou", ".tcio")
"""How files are called that may hold definitions; others are looked at whether they begin like one."""

LIST_SUFFIXES = (".gvl", ".tcgvl", ".tcdut")
"""How only definitions are called: such a file without one is broken."""

_CHECK = "Check the path of the definition files."
_MAX_SEEN = 100_000
_FOREIGN_SUFFIXES = (".export", *(suffix for kind in FOREIGN_FILES for suffix in kind.suffixes))
_WILD = re.compile(r"[*?\[]")
_BEGIN = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*(?:(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*<(?:GVL|TcPlcObject|project)\b"
    rb"|(?i:VAR_GLOBAL|TYPE)\s|\(\*\s*@)",
    re.DOTALL,
)
_ROOT = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*<(?:[\w.-]+:)?([\w.-]+)", re.DOTALL
)  # fmt: skip


class DefinitionFile(Struct, frozen=True):
    """A file that may hold definitions; ``given`` is what a person wrote, its own path or what it was found by.

    ``content`` is what is in it where it lies in another file, such as a recording; of one on disk it is None.
    """

    path: str
    given: str
    content: bytes | None = None

    @property
    def named(self) -> bool:
        """Whether it was named by itself: then it must be a definition."""
        return self.path == self.given


def wanted_files(given: Sequence[str], base: Path | None = None) -> list[DefinitionFile]:
    """Return the files that paths and patterns stand for, each once, those of one pattern or directory sorted.

    Patterns are relative to ``base``, the working directory without one: ``*`` within a directory, ``**`` over
    directories too. Hidden files and directories are left out where a pattern does not name such a one. Raises
    ConfigurationError where there is no file, or there are too many.
    """
    found: dict[str, DefinitionFile] = {}
    for text in given:
        for file in _files_of(text, base):
            if file.named or file.path not in found:
                found[file.path] = file
    return list(found.values())


def has_pattern(text: str) -> bool:
    """Return whether a path that leads to no file stands for several."""
    return _WILD.search(text) is not None and not os.path.lexists(text)


def is_worth_reading(path: str) -> bool:
    """Return whether a file that nobody named by itself is worth reading: by its name, or its first bytes."""
    if path.lower().endswith((*DEFINITION_SUFFIXES, *_FOREIGN_SUFFIXES)):
        return True
    try:
        with Path(path).open("rb") as file:
            return _BEGIN.match(file.read(HEAD_BYTES)) is not None
    except (OSError, ValueError):
        return False


def is_other_xml(path: str) -> bool:
    """Return whether a file is XML with a root that no definition has, such as what build servers or loggers read."""
    try:
        with Path(path).open("rb") as file:
            root = _ROOT.match(file.read(HEAD_BYTES))
    except (OSError, ValueError):
        return False
    return root is not None and root[1] not in (b"GVL", b"TcPlcObject", b"project")


def _files_of(text: str, base: Path | None) -> list[DefinitionFile]:
    if not text.strip():
        raise ConfigurationError("the name of a definition file is empty", next_step="Name a file or a directory.")
    path = Path(text) if base is None else base / text
    try:
        if path.is_dir():
            unread: list[str] = []
            found = [file for file in _sorted(map(Path, files_below(path, unread)), text) if is_worth_reading(file)]
            found += unread  # who reads it says why it cannot be
            if not found:
                raise ConfigurationError(
                    "no definition file is in it", where=text, next_step="Name the directory of the exported lists."
                )
            return [DefinitionFile(file, text) for file in found]
        if not has_pattern(str(path)) and (base is None or path.is_file()):
            return [DefinitionFile(str(path), str(path))]
        matched = _sorted(_matching(text, base or Path()), text)
        if not matched:
            _check_readable(path)
        if text.endswith("*"):
            # It asks for no kind of file: what is called or begins like a definition is meant.
            matched = [file for file in matched if is_worth_reading(file)] or matched
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read: {error.strerror}", where=str(error.filename or text)[:200], next_step=_CHECK
        ) from None
    except (ValueError, RecursionError) as error:
        # How deep patterns and directories may be nested is a limit of pathlib's.
        deep = "it has too many parts, or directories lie too deep in one another"
        why = deep if isinstance(error, RecursionError) else error
        raise ConfigurationError(f"'{text[:200]}' cannot be followed: {why}", next_step=_CHECK) from None
    if not matched:
        try:
            where = f"Patterns are relative to {(base or Path()).resolve()}; correct the pattern."
        except OSError:
            where = "The working directory is gone; name the path from the root."
        raise ConfigurationError(f"no file matches '{text[:200]}'", next_step=where)
    return [DefinitionFile(file, text) for file in matched]


def _check_readable(pattern: Path) -> None:
    """Raise PermissionError where a directory in front of the first wild part cannot be read: pathlib says nothing."""
    fixed = itertools.takewhile(lambda part: not _WILD.search(part), pattern.parts)
    try:
        os.scandir(Path(*fixed)).close()
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return


def files_below(directory: str | Path, unread: list[str] | None = None) -> Iterator[str]:
    """Yield the paths of all files below a directory but hidden ones, however deep; links to directories are left out.

    Directories below it that cannot be read are added to ``unread``. Raises OSError where itself cannot be.
    """
    top = str(directory)
    waiting = [top]
    while waiting:
        place = waiting.pop()
        try:
            with os.scandir(place) as entries:
                shown = [entry for entry in entries if not _is_hidden(entry.name)]
        except OSError:
            if place == top:
                raise
            if unread is not None:
                unread.append(place)
            continue
        waiting += [entry.path for entry in shown if entry.is_dir(follow_symlinks=False)]
        yield from (entry.path for entry in shown if not entry.is_dir())


def _matching(pattern: str, base: Path) -> Iterator[Path]:
    wanted = Path(pattern)
    parts = list(wanted.parts)
    if wanted.is_absolute():
        base, parts = Path(wanted.anchor), parts[1:]
    hidden = any(_is_hidden(part) for part in parts)
    for path in base.glob("/".join([*parts, "*"] if parts[-1:] == ["**"] else parts)):
        if hidden or not any(map(_is_hidden, path.parts[len(base.parts) :])):
            yield path


def _sorted(paths: Iterator[Path], text: str) -> list[str]:
    """Return those that are files, in order; ConfigurationError where these are too many, or too much was seen."""
    seen = list(itertools.islice(paths, _MAX_SEEN + 1))
    found = [str(path) for path in sorted(seen) if path.is_file()]
    if len(found) > MAX_DEFINITION_FILES and len(seen) <= _MAX_SEEN:
        found = [path for path in found if is_worth_reading(path)]
    if len(seen) > _MAX_SEEN or len(found) > MAX_DEFINITION_FILES:
        raise ConfigurationError(
            f"'{text[:200]}' stands for more than {count(MAX_DEFINITION_FILES)} files",
            next_step="Name the directories that hold the definitions.",
        )
    return found


def _is_hidden(part: str) -> bool:
    return part.startswith(".") and part not in {".", ".."}
