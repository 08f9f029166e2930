"""A line a frame with which WebVisu messages were whole."""

from __future__ import annotations

from nvscope.tracker.visu.messages import VisuBatch
from nvscope.view.lines.message_line import MessageLines
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.shown import LineMaker, Wording
from nvscope.view.lines.visu_words import message_words

_NAME = "visu"


def visu_lines(moment: Moment, width: int | None, wording: Wording) -> LineMaker:
    """Return what makes the lines of frames with such messages."""

    def told(part: VisuBatch) -> list[str]:
        return [
            " | ".join(message_words(part, one, secrets=wording.secrets) for one in range(first, first + count))
            for first, count in zip(part.first.tolist(), part.count.tolist(), strict=True)
        ]

    return MessageLines(_NAME, told, moment, width, wording)
