"""The schema of what was put into simulated traffic: ``nvscope.truth/1``."""

from __future__ import annotations

from collections.abc import Iterable

from dissectors.can.error import CLASSES
from nvscope.list_key import Transport
from nvscope.simulate.visu.truth import COUNTS
from nvscope.tracker.figures import (
    BY_NAME,
    BY_SCOPE,
    DIAGNOSIS,
    INTERVALS,
    LIST_COUNTERS,
    REMOTE,
    STREAM_COUNTERS,
    TELEGRAMS,
    Figure,
    Of,
)
from tests.schemas.figures import figure, figures, known_to_none
from tests.schemas.report import SCOPES
from tests.schemas.shapes import (
    CAN_KEY,
    PORT,
    SUBINDEX,
    UDP_KEY,
    Properties,
    Schema,
    document,
    maybe,
    nothing_in,
    record,
    several,
    shared,
    text,
    time,
    truth,
    unknown,
    whole,
    word,
)

_NOT_TOLD = {"sLastError", "tLastError", "lost_claimed"}
_UNTOLD_INTERVALS = {one.name for one in INTERVALS} - {"interval_count", "interval_min", "interval_max"}
_DESIGNED = {"telegrams_sent": whole(), "telegrams_lost": whole("sent, and never seen")}


def simulated_truth() -> Schema:
    """Return the schema of what ``simulate`` tells about its traffic."""
    capture = {
        "frames": whole(),
        "telegrams": whole(),
        "other_frames": whole(),
        "can_frames": whole("where there are any"),
        "start_ns": maybe(time()),
        "end_ns": maybe(time()),
    }
    parts = {
        "list": _list(), "stream": _stream(), "can_list": _can_list(), "can_stream": _can_stream(), "bus": _bus(),
        "cause": _cause(), "visu": _visu(),
    }  # fmt: skip
    return document(
        "truth", "`nvscope simulate`: what was put into simulated traffic, in the words of a report",
        {
            "title": text(),
            "seed": whole(),
            "exact": truth("false for a wild scenario: figures of loss are then what was put in"),
            "capture": record(capture, optional=("can_frames",)),
            "lists": several({"oneOf": [shared("list"), shared("can_list")]}),
            "causes": several(shared("cause")),
            "buses": several(shared("bus")),
            "visu": several(shared("visu"), "what pages of web visualizations asked, where there are any"),
        },
        optional=("buses", "visu"),
    ) | {"$defs": parts}  # fmt: skip


def _visu() -> Schema:
    """Return the schema of what was asked by a client of a server and port, and what came of it."""
    counts = {name: whole() for name in (*COUNTS, "variables")}
    return record({"client": text(), "server": text(), "port": PORT, **counts})


def _perhaps(one: Figure) -> Schema:
    """Return a figure that may be unknown: an observer cannot tell what every sender counts."""
    shape = figure(one)
    return shape if "null" in shape.get("type", ()) else maybe(shape)


def _told(wanted: Iterable[Figure]) -> list[Figure]:
    return [one for one in wanted if one.name not in _NOT_TOLD]


def _diag() -> Properties:
    return figures(_told(DIAGNOSIS), Of.LIST)


def _list() -> Schema:
    unsure = [BY_NAME[name] for name in BY_SCOPE]
    counted = [one for one in _told(LIST_COUNTERS) if one not in unsure]
    counters = {
        **figures(unsure, Of.LIST, "counters", _perhaps),
        **figures(counted, Of.LIST, "counters"),
    }
    return record(
        {
            "key": UDP_KEY,
            "transport": {"const": Transport.UDP.value},
            "port": PORT,
            "id": whole("Index", 0, 0xFFFF),
            "senders": several(text()),
            "readers": several(text()),
            **_diag(),
            "counters": record(counters),
            "nodes": several(record({"address": text(), **_diag()})),
            "streams": several(shared("stream")),
            "designed": record({**_DESIGNED, "unexpected_acknowledgements": whole()}),
        }
    )


def _stream() -> Schema:
    return record(
        {
            "node": text("address of the sender"),
            "subindex": SUBINDEX,
            **figures((TELEGRAMS,), Of.STREAM),
            "counter_scope": maybe(word(SCOPES, "null where an observer cannot tell it")),
            **figures(_told(STREAM_COUNTERS), Of.STREAM, shape=_perhaps),
            **figures(INTERVALS, Of.STREAM, shape=_perhaps, leave_out=_UNTOLD_INTERVALS),
            "items": whole("of the last telegram", 0, 0xFFFF),
            "length": whole("of the last telegram, bytes with header", 0, 0xFFFF),
            "checksum": maybe(whole("of the last telegram, null if it has none", 0, 0xFF)),
        }
    )


def _can_list() -> Schema:
    return record(
        {
            "key": CAN_KEY,
            "transport": {"const": Transport.CAN.value},
            "channel": text(),
            "id": whole("COB-ID of its first frame", 0, 0x1FFF_FFFF),
            "name": maybe(text("null without a definition")),
            "senders": nothing_in(),
            "readers": nothing_in(),
            **_diag(),
            "counters": record({}),
            "nodes": nothing_in(),
            "streams": several(shared("can_stream")),
            "designed": maybe(record(_DESIGNED)),
        }
    )


def _can_stream() -> Schema:
    return record(
        {
            "node": unknown(),
            "subindex": SUBINDEX,
            "cob_id": whole("", 0, 0x1FFF_FFFF),
            "extended": truth("whether it has 29 bits"),
            **figures((TELEGRAMS, REMOTE), Of.STREAM),
            "counter_scope": unknown(),
            **figures(_told(STREAM_COUNTERS), Of.STREAM, shape=known_to_none),
            **figures(INTERVALS, Of.STREAM, leave_out=_UNTOLD_INTERVALS),
            "length": whole("data bytes of the last frame", 0, 64),
            "checksum": unknown(),
        }
    )


def _cause() -> Schema:
    return record(
        {
            "kind": text("of causes, as those of a report have it"),
            "lists": several(text("key of a list")),
            "nodes": several(text("address")),
            "channel": maybe(text("of CAN")),
            "since_ns": time(),
            "until_ns": maybe(time("null where it is still so at the end")),
        }
    ) | {"description": "what goes wrong, as it was put in; by when it began"}


def _bus() -> Schema:
    classes = {bit.name: whole("", 1) for bit in CLASSES}
    designed = {
        "bit_rate": maybe(whole("null where the scenario gives none", 1)),
        "error_frames": whole(),
        "errors": record(classes, optional=classes) | {"description": "error frames by class"},
        "bus_off": whole(),
    }
    return record(
        {
            "channel": text(),
            "frames": whole(),
            "bits": whole("on the wire, with stuff bits"),
            "fast_bits": whole("those at the data bit rate of CAN FD"),
            "designed": record(designed),
        }
    )
