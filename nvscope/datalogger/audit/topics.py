"""The ways in which findings come, each with the sentence that has its figures."""

from __future__ import annotations

from nvscope.datalogger.audit.finding import Noted, Topic
from nvscope.findings.datalogger import (
    CHANGE_WITHOUT_CHANGE,
    CHANGES_MISSED,
    CLOCK_SET,
    COUNTER_CORRUPT,
    DOCUMENT_STYLE,
    LOSS_NOT_TOLD,
    LOSS_TOLD,
    MIXED_TIME,
)
from nvscope.findings.kind import Severity
from nvscope.units import count_of, duration


def _times(noted: Noted) -> str:
    return "once" if noted.count == 1 else f"{count_of(noted.count, 'time')}"


def _told(noted: Noted) -> str:
    missed = f"; {count_of(noted.total, 'change')} were counted and not stored" if noted.total > 1 else ""
    missed = "; 1 change was counted and not stored" if noted.total == 1 else missed
    return f"The logger says {_times(noted)} that data was lost before a row{missed}."


def _unsaid(noted: Noted) -> str:
    rows, them = count_of(noted.count, "row"), "it" if noted.count == 1 else "them"
    return f"ConsistentDataSeries is neither 0 nor 1 in {rows}: whether data was lost before {them} nobody knows."


def _deleted(noted: Noted) -> str:
    ids = "The id of 1 row is" if noted.total == 1 else f"The ids of {count_of(noted.total, 'row')} are"
    places = "" if noted.count == 1 else f" in {noted.count} places"
    return f"{ids} missing{places}: loggers number rows one by one, so somebody deleted them."


def _not_told(noted: Noted) -> str:
    longest = f"{duration(noted.most)} passed" if noted.count == 1 else f"up to {duration(noted.most)} passed"
    return f"Rows are missing {_times(noted)}, and none says so: {longest} between two rows."


def _slower(noted: Noted) -> str:
    most = "" if noted.total == noted.count * noted.most else "up to "
    return (
        f"By the configuration, rows are missing {_times(noted)}, and none says so. They come every "
        f"{most}{duration(noted.most)} there by themselves: the configuration may have been another one then."
    )


def _missed(noted: Noted) -> str:
    places = "" if noted.count == 1 else f" in {noted.count} places, up to {noted.most} in one"
    changes = "1 change was" if noted.total == 1 else f"{count_of(noted.total, 'change')} were"
    return f"{changes} counted and not stored{places}."


def _run_back(noted: Noted) -> str:
    most = "" if noted.count == 1 else "up to "
    return f"Timestamps run back {_times(noted)}, by {most}{duration(noted.most)}."


LOST = Topic(LOSS_TOLD, _told)
UNSAID = Topic(
    LOSS_TOLD, _unsaid, Severity.WARNING, "Compare with the original file on the controller: loggers write 0 or 1."
)
DELETED = Topic(
    LOSS_NOT_TOLD, _deleted, Severity.WARNING,
    "Compare with the original file on the controller; ask who edits such files.",
)  # fmt: skip
GAP = Topic(LOSS_NOT_TOLD, _not_told)
SLOWER = Topic(
    LOSS_NOT_TOLD,
    _slower,
    hint="If it was another one, audit without --config: each part of the table is judged by its own interval then.",
)
MISSED = Topic(CHANGES_MISSED, _missed)
BACK = Topic(COUNTER_CORRUPT, lambda noted: f"The counter goes back {_times(noted)}, and the row is no restart.")
AHEAD = Topic(
    COUNTER_CORRUPT,
    lambda noted: (
        f"The counter is ahead {_times(noted)}, of that before it and of that behind it: no change is missing."
    ),
)
STUCK = Topic(
    COUNTER_CORRUPT, lambda noted: f"The value changes {_times(noted)} while its counter stands still."
)  # fmt: skip
NO_COUNT = Topic(
    COUNTER_CORRUPT, lambda noted: f"The counter is no count {_times(noted)}: a text, a fraction, negative."
)
RESTART = Topic(
    COUNTER_CORRUPT,
    lambda noted: f"The logger started anew {_times(noted)}: a row in which all counters are 0.",
    Severity.NOTE,
    hint="Nothing is known of the time in front of it; look when the controller, or its program, was started anew.",
)
RUN_BACK = Topic(CLOCK_SET, _run_back)
OF_FORM = {
    form: Topic(
        MIXED_TIME, lambda noted: f"{count_of(noted.count, 'timestamp')} of another form than most of the table."
    )
    for form in ("iso", "raw")
}
"""Those of one form; it is a finding where most of the table are of the other one."""

LOCAL = Topic(MIXED_TIME, lambda noted: f"{count_of(noted.count, 'timestamp')} with the kind bits of local time.")
NO_TIME = Topic(MIXED_TIME, lambda noted: f"{count_of(noted.count, 'timestamp')} of which no time can be told.")
HALF = Topic(
    DOCUMENT_STYLE,
    lambda noted: f"{count_of(noted.count, 'row')} with a counter without its value, or a value without its counter.",
)
EQUAL = Topic(
    CHANGE_WITHOUT_CHANGE,
    lambda noted: f"{count_of(noted.count, 'value')} stored as a change, equal to the one before.",
)
