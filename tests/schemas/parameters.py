"""The schemas of what becomes of the Parameter Manager's requests: by who asks whom, and of each write."""

from __future__ import annotations

from dissectors.netvar import PARAMETER_ERRORS
from nvscope.tracker.parameter.values import KEPT_BYTES
from nvscope.tracker.parameter.writes import Outcome
from tests.schemas.shapes import PORT, Schema, described, duration, maybe, record, text, time, whole, word
from tests.schemas.variables import ANY_VALUE

_KINDS = [*ANY_VALUE["type"], "array"]
_VALUE: Schema = {"type": _KINDS, "items": ANY_VALUE}
_TYPED = "by the type that the project gives it, of several elements a list; else bytes in hexadecimal"


def sdo() -> Schema:
    """Return the schema of a row of ``sdo``."""
    errors = {service.name: whole("", 1) for service in PARAMETER_ERRORS}
    latency = {"count": whole(), **{name: maybe(duration()) for name in ("p50", "p99", "max")}}
    return record(
        {
            "requester": text("address"), "requester_name": maybe(text("what the project calls it")),
            "partner": text("address"), "partner_name": maybe(text("the same")), "port": PORT,
            "requests": whole("those that were opened, without those that repeat one"),
            "replies": whole("those that ended one, errors among them"),
            "errors": record(errors, optional=errors) | {"description": "how many of them refused, by their service"},
            "busy": whole("requests that ended with ODStateBusy"),
            "timeouts": whole("requests that nobody answered in time"),
            "retransmissions": whole("requests that were there already, and open"),
            "unexpected": whole("replies that ended no request: too late, again, or never asked for"),
            "undeliverable": whole("requests that came back: ICMP destination unreachable"),
            "copies": whole("requests and replies that the capture has once more: they count nowhere else"),
            "latency_ns": record(latency) | {"description": "from the first request to its reply"},
        }
    )  # fmt: skip


def sdo_write() -> Schema:
    """Return the schema of a row of ``sdo_writes``."""
    return record(
        {
            "time_ns": time("of the first request"), "frame": whole("its number", 1),
            "requester": text("address"), "requester_name": maybe(text("what the project calls it")),
            "partner": text("address"), "partner_name": maybe(text("the same")), "port": PORT,
            "index": whole("of the parameter", 0, 0xFFFF), "subindex": whole("of the parameter", 0, 0xFFFF),
            "name": maybe(text("what the project calls the parameter")), "type": maybe(text("that of the project")),
            "old": described(_VALUE, "what it was before, as it was read or written last; null: nobody knows"),
            "new": described(_VALUE, _TYPED),
            "old_text": maybe(text("as an engineer writes it; null: nobody knows")), "new_text": text("the same"),
            "old_bytes": maybe(whole(f"how long it is; of longer ones, the first {KEPT_BYTES} bytes are kept")),
            "new_bytes": whole("how long it is"),
            "outcome": word([outcome.value for outcome in Outcome], "open: nobody has seen yet what came of it"),
            "error": maybe(word([service.name for service in PARAMETER_ERRORS], "how it was refused")),
            "answer_frame": maybe(whole("that of the reply", 1)),
        }
    )  # fmt: skip
