"""What the variables of captures were at a time that a person gives."""

from __future__ import annotations

from msgspec import Struct

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.read_values import Meant, ReadAt
from nvscope.capture.source import Source
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.errors import UsageError
from nvscope.tracker.variables.moment import Moment
from nvscope.units import count_of
from nvscope.view.asked_time import AskedTime, Reference


class At(Struct, frozen=True):
    """The last telegrams up to ``time_ns``, and the source that was read for them.

    ``read_ones`` are values that come one by one, where they are meant.
    """

    moment: Moment
    time_ns: int
    source: Source
    read_ones: ReadAt | None = None


def at(
    inquiry: Inquiry, asked: AskedTime, *, expression: str | None = None, utc: bool = False, told: str = "time",
    read_ones: Meant | None = None,
) -> At:  # fmt: skip
    """Return what the variables were at a time; ``told`` is how a person would find it in a message.

    With ``read_ones``, those that are meant whose values come one by one, too; then there need be no definition.
    UsageError for a time before the end of stdin, which cannot be read twice, and for a frame that there is not.
    """
    layouts = inquiry.defined_layouts() if read_ones is None else inquiry.layouts or Layouts(Definition())
    end_ns = None
    if asked.reference is Reference.END:
        end_ns = inquiry.latest_ns(told)
    chosen = None if expression is None else inquiry.filter(expression)
    source = inquiry.open()
    frame = asked.number if asked.reference is Reference.FRAME else None
    moment = Moment(
        layouts, frame=frame, at=None if frame else lambda start_ns: asked.absolute_ns(start_ns, end_ns, utc=utc)
    )  # fmt: skip
    beside = None if read_ones is None else ReadAt(read_ones, moment)
    for _ in inquiry.run(source, [moment] if beside is None else [moment, beside], chosen):
        pass
    if frame is not None and frame > moment.frames:
        raise UsageError(f"{told}: the capture has {count_of(moment.frames, 'frame')}")
    return At(moment, (moment.last_frame_ns if frame is not None else moment.time_ns) or 0, source, beside)
