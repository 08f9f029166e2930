"""The files that ``check`` writes: what build servers and code scanning read, and evidence."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

from nvscope.cli.terminal import echo
from nvscope.errors import CaptureError, UsageError

if TYPE_CHECKING:
    from dissectors.batch import PacketBatch
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.check.evidence import RuleEvidence
    from nvscope.check.run import Checked
    from nvscope.whole_files import WholeFiles


_MOST_FILES = 200


class Wanted(NamedTuple):
    """Which files are wanted: their names, None for none; evidence as a folder, with how much before and behind."""

    junit: str | None
    sarif: str | None
    evidence: str | None
    around_ns: int

    def __bool__(self) -> bool:
        return any(one is not None for one in (self.junit, self.sarif, self.evidence))


def write_files(
    inquiry: Inquiry, found: Checked, wanted: Wanted, rules: Sequence[str], *, fail_on: str, force: bool
) -> None:  # fmt: skip
    """Write what is wanted, all of it or nothing, onto no input."""
    from nvscope.capture.open import files_of
    from nvscope.check.junit import junit
    from nvscope.check.sarif import sarif
    from nvscope.report import json
    from nvscope.whole_files import Existing, WholeFiles

    inconclusive_fails = fail_on == "inconclusive"
    failing = ("error", "warning") if fail_on == "warning" else ("error",)
    files = WholeFiles([*files_of(inquiry.paths), *rules, *inquiry.project.inputs], force=force)
    try:
        if wanted.junit is not None:
            content = junit(found, inconclusive_fails=inconclusive_fails, failing=failing)
            files.write(wanted.junit, content, Existing.REPLACED)
        if wanted.sarif is not None:
            log = sarif(found, inconclusive_fails=inconclusive_fails)
            files.write(wanted.sarif, json.render(log).encode(), Existing.REPLACED)
        if wanted.evidence is not None:
            if not wanted.evidence:
                raise UsageError("--evidence names no folder", next_step="name one, or leave the option out")
            _write_evidence(inquiry, found, wanted.evidence, wanted.around_ns, files)
        files.publish()
    finally:
        files.discard()


def _write_evidence(inquiry: Inquiry, found: Checked, folder: str, around_ns: int, files: WholeFiles) -> None:
    from nvscope.capture.output import ChannelNames
    from nvscope.capture.pcapng.sink import PcapngSink
    from nvscope.check.evidence import evidence_of
    from nvscope.check.verdict import Verdict
    from nvscope.units import count_of
    from nvscope.view.escape import visible
    from nvscope.whole_files import Existing

    asked = (inquiry.asked.options if inquiry.asked else None) or ()
    told = " ".join((", ".join(inquiry.paths) or "the capture", *asked))
    evidence = evidence_of(found, around_ns, told)
    if without := len(found.of(Verdict.FAIL)) - len(evidence):
        told_of = f"{count_of(without, 'broken rule')} no moment is known, and there is no evidence"
        echo(f"nvscope: of {told_of}.", err=True)
    if len(evidence) > _MOST_FILES:
        echo(f"nvscope: evidence is kept of the first {_MOST_FILES} of {len(evidence)} broken rules.", err=True)
        del evidence[_MOST_FILES:]
    if not evidence:
        return
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise CaptureError(f"the folder cannot be made: {error.strerror}", where=folder) from None
    channels: list[str] = []
    with ExitStack() as stack:
        reserved = [files.reserve(os.path.join(folder, one.name), Existing.KEPT) for one in evidence]
        sinks = [stack.enter_context(PcapngSink(file.unfinished, ChannelNames(lambda: channels))) for file in reserved]
        for first_frame, packets, names in _frames(inquiry, found, evidence):
            channels[:] = names
            for one, sink in zip(evidence, sinks, strict=True):
                one.write(sink, packets, first_frame)
    if of_databases := [one for one in evidence if one.of_databases]:
        told = f"rows of databases are left out of the evidence of {count_of(len(of_databases), 'rule')}"
        echo(f"nvscope: {told}: no capture format can hold them; the verdict names their frames.", err=True)
    for one, file in zip(evidence, reserved, strict=True):
        if one.of_databases and not one.written:
            file.discard()
    evidence = [one for one in evidence if one.written or not one.of_databases]
    if not evidence:
        return
    cut = [one for one in evidence if one.left_out]
    for one in cut:
        what = f"{count_of(one.left_out, 'frame')} more than a file of evidence holds were left out"
        echo(f"nvscope: {visible(os.path.join(folder, one.name))}: {what}.", err=True)
    if gone := sum(not one.written for one in evidence):
        echo(f"nvscope: of {count_of(gone, 'rule')} the frames are not in memory any more.", err=True)
    echo(f"nvscope: {count_of(len(evidence), 'file')} of evidence in {visible(folder)}.", err=True)


def _frames(
    inquiry: Inquiry, found: Checked, evidence: Sequence[RuleEvidence]
) -> Iterator[tuple[int, PacketBatch, Sequence[str]]]:
    """Yield batches with the number of their first frame and the names of channels.

    Of files, they are read again; of what can be read only once, those that were kept.
    """
    if inquiry.read_once:
        for chunk in found.scene.recent.pieces():
            yield chunk.first_frame, chunk.packets, found.scene.channels
        return
    last_ns = max((end_ns for one in evidence for _, end_ns in one.spans_ns), default=0)
    last_frame = max((frame for one in evidence for frame in one.comments), default=0) + 1_000
    source, number = inquiry.open(), 1
    for packets in source:
        if len(packets):
            yield number, packets, source.channels
            number += len(packets)
            if int(packets.ts_ns.min()) > last_ns and number > last_frame:
                return
