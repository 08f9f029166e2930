"""Which of the files on a command line are captures, and which are definitions: their content decides."""

from __future__ import annotations

import os
import stat
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress

from msgspec import Struct

from nvscope.capture.compressed import compression_of
from nvscope.capture.content import STDIN
from nvscope.capture.formats import FORMATS, TEXT_HEAD_BYTES, format_of
from nvscope.cli.streams import refuse_streams_onto
from nvscope.cli.terminal import echo
from nvscope.cli.words import LIVE
from nvscope.errors import UnreadableInput, UsageError
from nvscope.whole_files import identity_of

_MOST_LOOKED_AT = 1_000
_STDOUT, _STDERR = 1, 2
_BINARY = {known.name for known in FORMATS if known.magics and not known.only_can}


class NamedFiles(Struct, frozen=True):
    """The captures, of which there is one at least where no interface was named, and the definitions."""

    captures: list[str]
    definitions: list[str]


def named_files(
    sources: Sequence[str] | None, read: Sequence[str] | None, gvl: Sequence[str] | None = None,
    interfaces: Sequence[str] = (),
) -> NamedFiles:  # fmt: skip
    """Return what was named as arguments, by -r and by --gvl, sorted by what it is.

    A shell makes one --gvl and arguments of ``--gvl *.gvl``, and does not say what stands first. A pattern that it left
    as it is stands for its files. Raises UsageError where there is no capture and no interface was named,
    UnreadableInput for a pattern without files.
    """
    captures = _expanded(read or ())
    definitions: list[str] = []
    misnamed: list[str] = []
    for path in gvl or ():
        (misnamed if _is_file(path) and not _is_worth_reading(path) and _is_capture(path) else definitions).append(path)
    captures += misnamed
    named = _expanded(sources or ())
    files = {identity for path in (*captures, *named) if (identity := identity_of(path))}
    for path in named:
        (definitions if _is_definition(path, files) else captures).append(path)
    if not captures and not interfaces:
        if definitions:
            raise UsageError(
                "no capture is given, only definitions",
                next_step=f"name the capture, too; `nvscope gvl layout {definitions[0]}` shows what a definition says",
            )
        raise UsageError("no source is given", next_step="name a capture file, or - to read one from stdin")
    refuse_streams_onto(_read([*captures, *definitions]))
    # Where it is the only one, --gvl took from the shell what stands first.
    if len(captures) > 1 and misnamed:
        from nvscope.view.escape import visible

        for path in misnamed:
            echo(f"nvscope: {visible(path)} is a capture, and read as one: --gvl names definitions.", err=True)
    if not definitions:
        for path in captures:
            if _is_directory(path) and _holds_definitions(path):
                from nvscope.view.escape import visible

                echo(f"nvscope: {visible(path)} holds definitions, too; --gvl {visible(path)} takes them.", err=True)
    return NamedFiles(captures, definitions)


def _read(paths: Sequence[str]) -> Iterator[str]:
    """Yield the paths, and behind a directory the captures in it to which stdout and stderr go, if there are any."""
    written = {identity for stream in (_STDOUT, _STDERR) if (identity := identity_of(stream)) is not None}
    for path in paths:
        yield path
        if written and _is_directory(path):
            with suppress(OSError), os.scandir(path) as entries:
                yield from (one.path for one in entries if identity_of(one.path) in written and _is_capture(one.path))


def _expanded(sources: Sequence[str]) -> list[str]:
    """Return the sources, with the files of patterns in place of these: some shells leave them to the program.

    Raises UnreadableInput for a pattern that no file has.
    """
    found: list[str] = []
    for path in sources:
        if (
            path != STDIN
            and not path.startswith(LIVE)
            and ("*" in path or "?" in path or "[" in path)
            and not os.path.lexists(path)
        ):
            from glob import glob

            try:
                matching = sorted(glob(path))
            except RecursionError:  # more parts than a path can have
                matching = []
            if not matching:
                raise UnreadableInput(
                    "no file matches this pattern", where=path, next_step="check the directory, and the ending"
                )
            found += matching
        else:
            found.append(path)
    return found


def _is_definition(path: str, named: Collection[tuple[int, int]]) -> bool:
    """Return whether a file, or what lies below a directory, may be a definition and cannot be a capture.

    Captures in a directory that were ``named`` by themselves are not meant once more.
    """
    if _is_directory(path):
        return _holds_definitions(path) and not _holds_captures(path, named)
    return _is_file(path) and _is_worth_reading(path) and not _is_capture(path)


def _is_file(path: str) -> bool:
    try:
        # Nothing but files: what is read from a pipe is gone.
        return stat.S_ISREG(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False  # opening it will say what is wrong


def _is_directory(path: str) -> bool:
    return path != STDIN and os.path.isdir(path)


def _is_worth_reading(path: str) -> bool:
    """Return whether a file may be a definition; what begins like a capture is looked at no further."""
    try:
        with open(path, "rb") as file:
            head = file.read(TEXT_HEAD_BYTES)
    except (OSError, ValueError):
        return False  # opening it will say what is wrong
    if b"\0" in head and (compression_of(head) or _is_binary_capture(head)):
        return False
    # Not before it is needed: most runs have captures alone.
    from nvscope.definition.wanted_files import is_worth_reading

    return is_worth_reading(path)


def _is_binary_capture(head: bytes) -> bool:
    known = format_of(head)
    return known is not None and known.name in _BINARY


def _is_capture(path: str) -> bool:
    from nvscope.capture.capture_file import CaptureFile
    from nvscope.capture.formats import NoCapture

    if _only_begins_like_a_capture(path):
        return False
    try:
        CaptureFile(path)
    except NoCapture:
        return False
    except UnreadableInput:
        pass  # opening it once more will say what is wrong
    return True


def _only_begins_like_a_capture(path: str) -> bool:
    """Return whether a text begins with the bytes of a binary format; captures of these have a NUL in their head."""
    try:
        with open(path, "rb") as file:
            head = file.read(TEXT_HEAD_BYTES)
    except (OSError, ValueError):
        return False  # opening it will say what is wrong
    known = format_of(head)
    return known is not None and bool(known.magics) and b"\0" not in head


def _holds_captures(directory: str, named: Collection[tuple[int, int]]) -> bool:
    """Return whether a capture is in a directory that was not named; as where captures are read, not below it."""
    try:
        with os.scandir(directory) as entries:
            paths = sorted(entry.path for entry in entries if entry.is_file())
    except OSError:
        return True  # opening it will say what is wrong
    return any(identity_of(path) not in named and _is_capture(path) for path in paths)


def _holds_definitions(directory: str) -> bool:
    """Return whether something below a directory is called like a definition, or begins like one."""
    from itertools import islice

    from nvscope.definition.wanted_files import files_below, is_other_xml

    try:
        return any(
            _is_file(path) and _is_worth_reading(path) and not is_other_xml(path) and not _is_capture(path)
            for path in islice(files_below(directory), _MOST_LOOKED_AT)
        )
    except OSError:
        return False  # opening it will say what is wrong
