"""``nvscope recover``: what is whole of a recording that was cut off, as a file that every tool reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, BinaryIO

import typer

from nvscope.cli.frame_files import no_file_named
from nvscope.cli.sources import ForceOption
from nvscope.cli.terminal import echo
from nvscope.errors import ExitCode, UnreadableInput, UsageError

if TYPE_CHECKING:
    from nvscope.capture.mcap.recovery import Recovered

_MOST_TOLD = 5


def recover(
    source: Annotated[str, typer.Argument(metavar="FILE", help="A recording that was cut off or damaged.")],
    write: Annotated[
        str | None,
        typer.Option("-w", "--write", metavar="FILE", help="The file to write, .mcap.", show_default=False),
    ] = None,
    force: ForceOption = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No word of what was recovered.")] = False,
) -> None:
    """Make a whole file of an MCAP recording that has no end, or is damaged, as behind a power cut or a full disk.

    All that is whole is in it: packets, topics of whatever tool, attachments, metadata. What is lost is told, in
    packets where that is known, and in seconds. The damaged file stays as it is; a file that exists is kept, unless
    --force is given. Of other captures, `nvscope convert` writes what is whole.
    """
    if not write:
        raise no_file_named("-w FILE.mcap")
    if not write.lower().endswith(".mcap"):
        raise UsageError(
            "recover writes an .mcap file, with all that was in the other one", where=write,
            next_step="name it so; `nvscope convert` writes the frames in another format",
        )  # fmt: skip

    from nvscope.view.escape import visible
    from nvscope.whole_files import Existing, WholeFiles

    files = WholeFiles([source], force=force)
    try:
        target = files.open(write, Existing.KEPT)
        found = _recovered(source, target.file)
        files.publish()
    except BaseException:
        files.discard()
        raise
    if not quiet:
        from nvscope.units import count_of

        topics = f" and {count_of(found.messages, 'message')} of topics" if found.messages else ""
        echo(f"nvscope: {count_of(found.packets, 'frame')}{topics} in {visible(write)}.", err=True)
        for line in _lost(found):
            echo(f"nvscope: {visible(source)}: {line}", err=True)
    if found.damages or found.lost_packets or found.lost_at_end_ns:
        raise typer.Exit(ExitCode.DATA_LOSS)


def _recovered(path: str, out: BinaryIO) -> Recovered:
    import mmap
    import os

    import numpy as np

    from nvscope.capture.mcap.records import MAGIC
    from nvscope.capture.mcap.recovery import Recovery
    from nvscope.capture.mcap.writer import McapWriter

    try:
        with open(path, "rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise UnreadableInput(
                    "no MCAP file, or its begin is gone", where=path,
                    next_step="`nvscope convert` writes what is whole of other captures",
                )  # fmt: skip
            head = file.read(9)
            if len(head) < 9 or os.fstat(file.fileno()).st_size < 17 + int.from_bytes(head[1:], "little"):
                raise UnreadableInput(
                    "an MCAP file that is cut short in its header", where=path,
                    next_step="there is nothing to be recovered",
                )  # fmt: skip
            data = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)
    except OSError as error:
        raise UnreadableInput(error.strerror or str(error), where=path, next_step="check the path") from error
    return Recovery(data, McapWriter(out)).run()


def _lost(found: Recovered) -> list[str]:
    """Return what was lost, in sentences."""
    from nvscope.units import count_of, duration

    told = []
    if found.lost_packets:
        seconds = sum(max(behind - before, 0) for before, behind in found.gaps_ns)
        told.append(f"{count_of(found.lost_packets, 'frame')} lost within {duration(seconds)}.")
    if found.lost_at_end_ns:
        told.append(f"what came within the last {duration(found.lost_at_end_ns)} is lost.")
    if not found.is_complete:
        cut = "it ends with a whole record"
        if found.cut_bytes:
            cut = f"{count_of(found.cut_bytes, 'byte')} behind the last whole record cannot be read"
        told.append(f"cut off: {cut}; what a recorder had not written by then is unknown.")
    told += [f"{one}." for one in found.damages[:_MOST_TOLD]]
    if len(found.damages) > _MOST_TOLD:
        told.append(f"{count_of(len(found.damages) - _MOST_TOLD, 'such place')} more.")
    if found.lacks_summary and not told:
        return ["its summary is cut off, and was made anew; nothing was lost."]
    return told or ["nothing was lost."]
