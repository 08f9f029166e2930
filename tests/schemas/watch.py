"""The schema of a line of what is watched: ``nvscope.watch/1``."""

from __future__ import annotations

from nvscope.view.documents.verdicts import STATUSES
from tests.schemas.report import cause
from tests.schemas.shapes import (
    LIST_KEY,
    Schema,
    document,
    maybe,
    number,
    record,
    several,
    shared,
    text,
    time,
    whole,
    word,
)


def watch() -> Schema:
    """Return the schema of a line of ``watch --json``."""
    about = "`nvscope watch --json`: a line a second, what came so far, and which causes began and ended"
    entry = {
        "key": LIST_KEY,
        "status": word(STATUSES, "that of the worst finding on it"),
        "telegrams": whole("data telegrams so far"),
        "lost": maybe(whole("null: nobody knows", None)),
        "per_s": maybe(number("in the last whole second; null: nobody knows", 0)),
    }
    found = document(
        "watch", about,
        {
            "at_ns": maybe(time("up to when the source was watched; null before anything came")),
            "until_ns": maybe(time("time has passed up to here, frame or not; null: only frames tell")),
            "frames": whole(),
            "telegrams": whole(),
            "drops": maybe(whole("lost while capturing; null: nobody counts them")),
            "telegrams_per_s": maybe(number("in the last whole second; null: nobody knows", 0)),
            "lists": several(record(entry)),
            "causes_new": several(shared("cause"), "those that began, or are there again, since the line before"),
            "causes_ended": several(shared("ended"), "those that are over, or no longer told, since the line before"),
        },
    )  # fmt: skip
    instead = maybe(text("the title of the cause that explains now what this one did; null: it is over by itself"))
    known = cause()
    ended = record({**known["properties"], "instead": instead})
    return found | {"$defs": {"cause": known, "ended": ended}}
