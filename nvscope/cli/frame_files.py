"""What ``convert`` and ``packets -w`` have in common: frames go to a file, which is whole or not there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from nvscope.cli.sources import tell_of_parts
from nvscope.cli.terminal import echo
from nvscope.errors import NvscopeError, UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Attachment, Source, SourceInfo
    from nvscope.engine.run import Observer
    from nvscope.record.frame_file import Comment
    from nvscope.view.display_filter import DisplayFilter


def write_frames(
    inquiry: Inquiry, source: Source, path: str, chosen: DisplayFilter | None,
    attachments: Sequence[Attachment], *, all_frames: bool = False, force: bool = False, quiet: bool = False,
) -> None:  # fmt: skip
    """Write the frames of a source that a filter chooses, or all of them, to a file, in the format of its ending.

    What the format cannot hold is told. UsageError where it cannot hold the frames, or the ending is that of no format;
    then nothing is written.
    """
    from nvscope import units
    from nvscope.analysis.not_whole import NotWhole
    from nvscope.capture.formats import written_as
    from nvscope.capture.open import open_sink
    from nvscope.capture.output import STDOUT, ChannelNames
    from nvscope.record.circumstances import circumstances_of
    from nvscope.record.frame_file import FrameFile, not_held
    from nvscope.record.recorded_topics import RecordedTopics
    from nvscope.view.escape import visible
    from nvscope.whole_files import WholeFiles, is_stdout

    check_sources(source.infos)
    files = WholeFiles([*(info.path for info in source.infos), *inquiry.project.inputs], force=force)
    target = written_as(path)
    if target is None:
        open_sink(path)  # says which endings there are
        return
    kept = attachments if target.holds_attachments else ()
    # What is asked of frames is asked of those, too, in which no protocol is found.
    all_frames |= chosen is not None and (chosen.of_any_frame or bool(chosen.of_others))
    topics = None
    if target.holds_attachments:
        topics = RecordedTopics.of(inquiry.project.definition, inquiry.layouts)
    # Numbers of frames are those of one file, of which nothing is left out.
    has_comments = target.holds_comments and len(source.infos) == 1 and inquiry.asked is None

    def comments() -> Sequence[Comment]:
        return source.infos[0].comments if has_comments else ()

    remarks = remarks_on(inquiry) if chosen is not None and target.holds_comments else []
    parts = NotWhole() if chosen is not None else None
    try:
        unfinished = path if is_stdout(path) else files.reserve(path).unfinished
        try:
            with target.open_sink(
                STDOUT if is_stdout(path) else unfinished, ChannelNames(lambda: source.channels)
            ) as sink:
                for attachment in kept:
                    sink.attach(attachment)
                written = FrameFile(sink, topics, comments, remarks)
                observers: list[Observer] = [written, *([parts] if parts else [])]
                for _ in inquiry.run(source, observers, chosen, all_frames=all_frames):
                    pass
                sink.describe(circumstances_of(source.infos))
        except NvscopeError as error:
            if error.where == unfinished:
                raise type(error)(error.what, where=path, next_step=error.next_step) from error
            raise
        files.publish()
    except BaseException:
        files.discard()
        raise
    lost = not_held(
        target, source.infos, source.channels, [one.name for one in attachments],
        has_directions=written.has_directions, has_comments=has_comments,
    )  # fmt: skip
    if lost:
        echo(f"nvscope: {visible(path)}: {target.name} has no place for {visible('; '.join(lost))}.", err=True)
    if parts:
        tell_of_parts(parts)
    tell_of_one_file(source.infos, path)
    if not quiet:
        of = f" of {units.count(written.frames)}" if chosen is not None else ""
        echo(f"nvscope: {units.count(written.written)}{of} frames in {visible(path)}.", err=True)


def check_sources(infos: Sequence[SourceInfo]) -> None:
    """Raise UsageError where one of some sources is a database, whose rows cannot be written as frames."""
    from nvscope.capture.formats import DATABASES

    for info in infos:
        if info.format in DATABASES:
            from nvscope.capture.output import rows_are_no_frames

            raise rows_are_no_frames(info.path)


def tell_of_one_file(infos: Sequence[SourceInfo], path: str) -> None:
    """Say on stderr where nobody captured between files that are one now: who reads that takes it for silence."""
    from nvscope.capture.recordings import recordings
    from nvscope.units import duration
    from nvscope.view.escape import visible

    found = recordings(infos)
    if len(found) > 1:
        longest_ns = max(behind.start_ns - before.end_ns for before, behind in pairwise(found))
        echo(
            f"nvscope: {visible(path)}: it cannot tell that these are {len(found)} recordings, with up to "
            f"{duration(longest_ns)} between them in which nobody captured; convert each by itself.", err=True,
        )  # fmt: skip


def remarks_on(inquiry: Inquiry) -> list[Comment]:
    """Return the findings of captures as comments to the frames that show them; none where they are read once."""
    if inquiry.read_once:
        return []
    found = inquiry.analyze(causes=False)
    return [
        (frame, f"{one.code} {one.kind.name}: {one.message}") for one in found.findings for frame in one.frames
    ]  # fmt: skip


def no_file_named(example: str) -> UsageError:
    """Return that it is not said where frames are to go."""
    return UsageError("no file to write is named", next_step=f"add {example}")
