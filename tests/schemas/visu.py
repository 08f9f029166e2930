"""The schemas of web visualization: who asks whom, and each write."""

from __future__ import annotations

from dissectors.web_protocols import WebProtocol
from nvscope.tracker.readings.form import MOST_CHARACTERS
from nvscope.tracker.visu.writes import WriteOutcome
from nvscope.view.documents.visu import MOST_NAMED
from tests.schemas.shapes import (
    PORT,
    Schema,
    described,
    duration,
    maybe,
    record,
    several,
    text,
    time,
    truth,
    whole,
    word,
)

_ENDS = {
    "client": text("address"), "client_name": maybe(text("what the project calls it")),
    "server": text("address"), "server_name": maybe(text("the same")), "port": PORT,
}  # fmt: skip


def visu() -> Schema:
    """Return the schema of a row of ``visu``."""
    latency = {"count": whole(), **{name: maybe(duration()) for name in ("p50", "p99", "max")}}
    polling = {name: maybe(duration()) for name in ("p50", "p99")}
    return record(
        {
            **_ENDS,
            "connections": whole("those with such requests", 1),
            "reads": whole("requests that were seen whole"), "writes": whole("the same"),
            "entries": whole("the variables in them"), "variables": whole("those that differ"),
            "replies": whole("to these requests"), "refused": whole("writes that were not done"),
            "unanswered": whole("requests whose connection ended without a reply"),
            "cut": whole("requests and replies of which bytes are missing"),
            "gap_bytes": whole("bytes that are missing of the connections"),
            "miscounted": whole("requests and replies with more or fewer entries than told or asked for"),
            "ambiguous": whole("requests and replies whose values may be divided so or so, or whose end is unknown"),
            "other_bytes": whole("bytes that came again, and were others than those that came first, which count"),
            "latency_ns": described(record(latency), "from the request to its reply"),
            "polling_ns": described(record(polling), "from one read to the next one of the same"),
        }
    )  # fmt: skip


def visu_other() -> Schema:
    """Return the schema of a row of ``visu_others``."""
    protocols = [protocol.name.lower().replace("_", "-") for protocol in WebProtocol]
    return record(
        {
            **_ENDS,
            "protocol": word(protocols, "what is spoken; other: no HTTP, and nobody knows what"),
            "count": whole("requests, or, of what is no HTTP/1, connections", 1),
            "first_frame": whole("that of the first one", 1),
        }
    )  # fmt: skip


def visu_unchanging() -> Schema:
    """Return the schema of a row of ``visu_unchanging``."""
    names = several(text(), f"names, up to {MOST_NAMED}")
    return record(
        {
            **{name: _ENDS[name] for name in ("server", "server_name")},
            "variables": whole("that pages asked it for", 1),
            "unchanged": described(names, "told twice at least, and always the same"), "unchanged_cut": whole("more"),
            "unreadable": described(names, "told at least once, and always ???"), "unreadable_cut": whole("more"),
        }
    )  # fmt: skip


def visu_write() -> Schema:
    """Return the schema of a row of ``visu_writes``."""
    return record(
        {
            "time_ns": time("of the request"), "frame": whole("its number", 1), **_ENDS,
            "variable": text("its name, or where it lies"), "place": text("area, offset, size and type; or an address"),
            "type": maybe(text("null: it is asked for by address")),
            "old": maybe(text(f"what it was before; null: nobody knows. Cut behind {MOST_CHARACTERS} characters")),
            "new": maybe(text("what it is then, cut likewise; null: hidden, or nobody knows how far it goes")),
            "hidden": truth("it is a password, or may be one: old and new are not shown"),
            "old_known": truth("somebody may know what it was before; of what is hidden, old does not tell that"),
            "outcome": word([outcome.value for outcome in WriteOutcome], "open: nobody has seen what came of it"),
            "answer_frame": maybe(whole("that of the reply", 1)),
            "status": maybe(whole("the HTTP status of the reply")),
        }
    )  # fmt: skip
