"""Evidence: what was on the wire around the moments at which rules were broken, a small file for each rule."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from dissectors.datalogger.logged import NO_TABLE
from nvscope.capture.source import Sink
from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.words import sentence, shown
from nvscope.view.escape import visible

_MOST_MOMENTS = 10
_MOST_FRAMES = 50_000
_AROUND_FRAMES = 20
"""So many frames are kept before and behind each frame that has a comment, whenever they were."""

_ODD = re.compile(r"[^A-Za-z0-9._-]+")
_LONGEST_NAME = 80
_RESERVED = re.compile(r"(?i)con|prn|aux|nul|com[0-9]|lpt[0-9]")
"""What Windows takes for devices, whatever is behind a dot."""


class RuleEvidence(Struct):
    """The frames of one rule: from when to when, which of them have comments, and the name of its file.

    ``written`` counts frames, ``left_out`` those beyond the limit; ``of_databases`` rows, which are no frames.
    """

    rule_id: str
    name: str
    spans_ns: Sequence[tuple[int, int]]
    comments: Mapping[int, str]
    written: int = 0
    left_out: int = 0
    of_databases: int = 0

    def write(self, sink: Sink, packets: PacketBatch, first_frame: int) -> None:
        """Write those frames of a batch that belong to it; its first one has a number in the capture."""
        chosen = np.zeros(len(packets), np.bool_)
        for begin_ns, end_ns in self.spans_ns:
            chosen |= (packets.ts_ns >= begin_ns) & (packets.ts_ns <= end_ns)
        for frame in self.comments:
            place = frame - first_frame
            chosen[max(place - _AROUND_FRAMES, 0) : max(place + _AROUND_FRAMES + 1, 0)] = True
        if packets.logged is not None:
            are_rows = packets.logged.table != NO_TABLE
            self.of_databases += int(np.count_nonzero(chosen & are_rows))
            chosen &= ~are_rows
        rows = np.flatnonzero(chosen)
        room = _MOST_FRAMES - self.written
        self.left_out += max(len(rows) - room, 0)
        rows = rows[:room]
        if not len(rows):
            return
        frames = {frame: place for place, frame in enumerate((rows + first_frame).tolist())}
        for frame, text in self.comments.items():
            if frame in frames:
                sink.comment(self.written + frames[frame] + 1, text)
        sink.write(replace(packets.take(rows), logged=None))
        self.written += len(rows)


def evidence_of(found: Checked, around_ns: int, capture: str) -> list[RuleEvidence]:
    """Return what is to be written for each rule that is broken, and says when: up to ``around_ns`` before and behind.

    ``capture`` is what comments call the capture that the frames are of.
    """
    names: set[str] = set()
    return [
        RuleEvidence(
            decided.rule.id,
            _name(decided.rule.id, names),
            list(_spans(shown(decided), around_ns)),
            _comments(found, decided, capture),
        )
        for decided in found.of(Verdict.FAIL)
        if any(one.first_ns is not None or one.frames for one in shown(decided))
    ]


def _spans(subjects: Iterable[Judged], around_ns: int) -> Iterator[tuple[int, int]]:
    times = sorted(one.first_ns for one in subjects if one.first_ns is not None)[:_MOST_MOMENTS]
    for time_ns in times:
        yield time_ns - around_ns, time_ns + around_ns


def _comments(found: Checked, decided: Decided, capture: str) -> Mapping[int, str]:
    comments: dict[int, str] = {}
    for judged in shown(decided)[:_MOST_MOMENTS]:
        told = f"{visible(decided.rule.id)}: {sentence(found, judged)}"
        for frame in judged.frames:
            comments.setdefault(frame, f"{told} (frame {frame} of {visible(capture)})")
    return comments


def _name(rule_id: str, names: set[str]) -> str:
    """Return the name of the file of a rule: no other has it, whatever the case."""
    plain = _ODD.sub("-", rule_id).strip("-.")[:_LONGEST_NAME] or "rule"
    if _RESERVED.fullmatch(plain.partition(".")[0]):
        plain = f"rule-{plain}"
    name, number = plain, 1
    while name.lower() in names:
        number += 1
        name = f"{plain}-{number}"
    names.add(name.lower())
    return f"{name}.pcapng"
