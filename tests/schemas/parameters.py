"""The schema of what becomes of the Parameter Manager's requests, by who asks whom."""

from __future__ import annotations

from dissectors.netvar import PARAMETER_ERRORS
from tests.schemas.shapes import PORT, Schema, duration, maybe, record, text, whole


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
            "latency_ns": record(latency) | {"description": "from the first request to its reply"},
        }
    )  # fmt: skip
