"""What the variables of captures were at a time that a person gives."""

from __future__ import annotations

from dataclasses import dataclass

from nvscope.analysis.inquiry import Capture, Inquiry
from nvscope.capture.capture_file import STDIN
from nvscope.errors import UsageError
from nvscope.tracker.variables.moment import Moment
from nvscope.units import count_of
from nvscope.view.asked_time import AskedTime, Reference


@dataclass(frozen=True)
class At:
    """The last telegrams up to ``time_ns``, and the source that was read for them."""

    moment: Moment
    time_ns: int
    source: Capture


def at(
    inquiry: Inquiry, asked: AskedTime, *, expression: str | None = None, utc: bool = False, told: str = "time"
) -> At:
    """Return what the variables were at a time; ``told`` is how a person would find it in a message.

    UsageError for a time before the end of stdin, which cannot be read twice, and for a frame that there is not.
    """
    layouts = inquiry.defined_layouts()
    end_ns = None
    if asked.reference is Reference.END:
        if STDIN in inquiry.paths:
            raise UsageError(
                f"{told}: stdin has no end that is known before it is there", next_step="name a file instead"
            )
        end_ns = _latest_ns(inquiry)
    chosen = None if expression is None else inquiry.filter(expression)
    source = inquiry.open()
    frame = asked.number if asked.reference is Reference.FRAME else None
    moment = Moment(
        layouts, frame=frame, at=None if frame else lambda start_ns: asked.absolute_ns(start_ns, end_ns, utc=utc)
    )  # fmt: skip
    for _ in inquiry.run(source, [moment], chosen):
        pass
    if frame is not None and frame > moment.frames:
        raise UsageError(f"{told}: the capture has {count_of(moment.frames, 'frame')}")
    return At(moment, (moment.last_frame_ns if frame is not None else moment.time_ns) or 0, source)


def _latest_ns(inquiry: Inquiry) -> int | None:
    """Return the latest time of the captures, None where they hold no packet; nothing else of them is looked at."""
    latest_ns = None
    source = inquiry.open()
    with inquiry.watch(source) as progress:
        for batch in source:
            if len(batch):
                own = int(batch.ts_ns.max())
                latest_ns = own if latest_ns is None else max(latest_ns, own)
            progress()
    return latest_ns
