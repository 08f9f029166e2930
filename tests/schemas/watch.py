"""The schema of a line of what is watched: ``nvscope.watch/1``."""

from __future__ import annotations

from nvscope.analysis.transactions.transaction import Outcome, Protocol
from nvscope.view.documents.verdicts import STATUSES
from tests.schemas.report import cause
from tests.schemas.shapes import (
    LIST_KEY,
    Schema,
    document,
    duration,
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

_OF_WRITES = [
    one.value
    for one in (Outcome.OPEN, Outcome.CONFIRMED, Outcome.REFUSED, Outcome.BUSY, Outcome.CUT, Outcome.UNANSWERED)
]
"""What may be known of a write."""


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
            "transactions": several(
                shared("pair"), "who asks whom for parameters (sdo) or variables (visu), where there is such traffic"
            ),
            "causes_new": several(shared("cause"), "those that began, or are there again, since the line before"),
            "causes_ended": several(shared("ended"), "those that are over, or no longer told, since the line before"),
        },
        optional=("transactions",),
    )  # fmt: skip
    instead = maybe(text("the title of the cause that explains now what this one did; null: it is over by itself"))
    known = cause()
    ended = record({**known["properties"], "instead": instead})
    return found | {"$defs": {"cause": known, "ended": ended, "pair": _pair(), "transaction": _transaction()}}


def _pair() -> Schema:
    """Return the schema of a pair of nodes of which one asks the other."""
    return record(
        {
            "protocol": word([one.value for one in Protocol]),
            "client": text("address of who asks"),
            "client_name": maybe(text("what people call it; null: nobody does")),
            "server": text("address of who is asked"),
            "server_name": maybe(text("what people call it; null: nobody does")),
            "port": whole("of who is asked"),
            "requests": whole("so far, without repetitions"),
            "replies": whole(),
            "unanswered": whole(),
            "refused": whole("requests of a Parameter Manager, writes of a web visualization page"),
            "odd": whole("replies to nothing, requests that came back; what is miscounted, ambiguous or cut"),
            "latency_ns": record(
                {
                    "count": whole("replies"),
                    **{name: maybe(duration("null: without replies")) for name in ("p50", "p99", "max")},
                }
            ),
            "per_s": maybe(number("requests in the last whole second; null: nobody knows", 0)),
            "writes": maybe(whole("that were asked for so far; null: there was no room for this pair")),
            "last_write": maybe(shared("transaction")),
        }
    )


def _transaction() -> Schema:
    """Return the schema of a request and what became of it."""
    said = {
        "name": text("of a variable or parameter, or where it lies"),
        "old": maybe(text("the value known before; null: none")),
        "value": maybe(text("the one that is written; null: it is not known")),
    }
    return record(
        {
            "time_ns": time("of the reply; of the request as long as there is none"),
            "frame": whole("that of the reply, or of the request as long as there is none"),
            "request_frame": whole(),
            "operation": word(["write"]),
            "outcome": word(_OF_WRITES),
            "detail": maybe(text("what a refusal says")),
            "latency_ns": maybe(duration("null: without a reply")),
            "variables": several(record(said), "the first ones, texts of which may be cut; passwords are hidden"),
            "left_out": whole("how many more of them there are"),
        }
    )
