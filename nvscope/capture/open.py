"""Opens capture files for reading by their content, and for writing by their name."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.content import STDIN
from nvscope.capture.formats import DATABASES, READABLE, NoCapture, suffixes_that, written_as
from nvscope.capture.output import STDOUT
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.source import FileSource, Sink
from nvscope.capture.timeline import Timeline
from nvscope.errors import UnreadableInput, UsageError
from nvscope.whole_files import is_stdout


def open_source(
    paths: Sequence[str], *, batch_packets: int = 131_072, renamed: Mapping[str, str] = MappingProxyType({}),
    copies: Mapping[str, int] = MappingProxyType({}),
) -> FileSource:  # fmt: skip
    """Return the packets of capture files as one timeline.

    "-" is stdin, a directory all capture files in it. ``renamed`` are names of channels by those that files tell.
    ``copies`` are read in place of streams of these names (``nvscope.capture.streams``).
    Raises UnreadableInput, also later when a file changes or goes.
    """
    if not paths:
        raise UsageError("no capture file is given")
    if list(paths).count(STDIN) > 1:
        raise UsageError("stdin is given more than once")
    sizes = ReadingSizes(batch_packets=batch_packets)
    files: list[CaptureFile] = []
    for path in paths:
        if not path:
            raise UsageError("the name of a source is empty", next_step="name a capture file, or - for stdin")
        if path != STDIN and os.path.isdir(path):
            files += _open_directory(path, sizes)
        else:
            files.append(CaptureFile(path, sizes=sizes, copy=copies.get(path)))
    _place(files)
    if len(files) == 1 and not renamed:
        return files[0]
    return Timeline(files, batch_packets=batch_packets, renamed=renamed)


def _place(files: Sequence[CaptureFile]) -> None:
    """Tell databases which of them follow each other: those of a series of which none lacks between them."""
    databases = [file for file in files if file.info.format in DATABASES]
    if len(databases) > 1:
        from nvscope.capture.datalogger.series import places_of  # noqa: PLC0415  # most captures are no databases

        for file, place in zip(databases, places_of([file.path for file in databases]), strict=True):
            file.place = place


def files_of(paths: Sequence[str]) -> list[str]:
    """Return the paths of the files that captures are read from: of a directory, of all capture files in it."""
    found: list[str] = []
    for path in paths:
        if path != STDIN and os.path.isdir(path):
            found += [info.path for one in _open_directory(path, ReadingSizes()) for info in one.infos]
        else:
            found.append(path)
    return found


def _open_directory(directory: str, sizes: ReadingSizes) -> list[CaptureFile]:
    try:
        names = sorted(entry.name for entry in Path(directory).iterdir() if entry.is_file())
    except OSError as error:
        raise UnreadableInput(
            error.strerror or str(error), where=directory, next_step="check the path and the permissions"
        ) from error
    files: list[CaptureFile] = []
    for name in names:
        try:
            files.append(CaptureFile(str(Path(directory) / name), sizes=sizes))
        except NoCapture:
            # Notes, definitions and the like lie beside captures.
            continue
    if not files:
        raise UnreadableInput(
            f"no capture file among {len(names)} files, expected {READABLE}",
            where=directory,
            next_step="give the directory that holds the captures; subdirectories are not searched",
        )
    return files


def open_sink(path: str, channels: Sequence[str] | None = None) -> Sink:
    """Return a sink for a file of one of the ``FORMATS``, which its suffix says.

    ``channels`` are the names of the channels by number, which may grow, where packets have any: not every format can
    hold them. The link type is that of the packets. Raises UsageError for another suffix, CaptureError where the file
    cannot be written.
    """
    known = written_as(path)
    if known is None:
        network, logs = suffixes_that(lambda one: not one.only_can), suffixes_that(lambda one: one.only_can)
        raise UsageError(
            f"no capture format has the suffix '{Path(path).suffix.lower()}'",
            where=path,
            next_step=f"name the file {network}, or, for CAN, {logs}",
        )
    return known.open_sink(STDOUT if is_stdout(path) else path, channels)
