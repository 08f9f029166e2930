"""The schema of reports: ``nvscope.report/2``."""

from __future__ import annotations

from itertools import permutations

from nvscope.capture.formats import FORMATS, LIVE_FORMATS
from nvscope.capture.source import DropsPart
from nvscope.causes.catalogue import BY_NAME
from nvscope.findings.badness import EXTENTS
from nvscope.findings.catalogue import CATALOGUE
from nvscope.list_key import Transport
from nvscope.tracker.counters import SCOPE_NAMES, SCOPE_UNUSED
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.figures import (
    DIAGNOSIS,
    INTERVALS,
    LATENCIES,
    LIST_COUNTERS,
    PACE,
    REMOTE,
    STREAM_COUNTERS,
    TELEGRAMS,
    Of,
)
from nvscope.view.documents.verdicts import SEVERITIES, STATUSES
from tests.schemas.buses import bus, canopen_node
from tests.schemas.figures import figures, known_to_none, limited
from tests.schemas.parameters import sdo, sdo_write
from tests.schemas.shapes import (
    CAN_KEY,
    LIST_KEY,
    PORT,
    SUBINDEX,
    UDP_KEY,
    Properties,
    Schema,
    document,
    duration,
    maybe,
    nothing_in,
    number,
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
from tests.schemas.variables import MISSING, VALUE, VALUE_OF_LIST, VALUE_OF_LOG
from tests.schemas.visu import visu, visu_other, visu_unchanging, visu_write

SCOPES = [*SCOPE_NAMES.values(), SCOPE_UNUSED]
_JUDGED = [kind for kind in CATALOGUE.values() if kind.judged]
_OF_COMPARE = ("hops", "hops_of_other_types")
_STATUS = word(STATUSES, "that of the worst finding on it")
_NOT_OF_CAN = "null: no frame on CAN tells it"
_NOT_OF_PARTS = "null where the limit of streams has left out others of the sender (NV906)"


def report() -> Schema:
    """Return the schema of ``report --json``."""
    about = "`nvscope report --json`: what was counted of lists, nodes, streams and buses, and what was found"
    found = document(
        "report", about,
        {
            "capture": capture(), "totals": _totals(),
            "causes": several(shared("cause"), "what happened: what is broken now, then by severity and weight"),
            "evidence_left_out": whole("events and frames without room: causes are told without them", 1),
            "lists": several({"oneOf": [shared("list"), shared("can_list")]}),
            "findings": several(shared("finding"), "the worst first"),
            "sdo": several(shared("sdo"), "the Parameter Manager, where there is such traffic: who asks whom"),
            "sdo_writes": several(shared("sdo_write"), "the first writes of parameters, where there are any"),
            "visu": several(shared("visu"), "web visualization, where there is such traffic: who asks whom"),
            "visu_unchanging": several(shared("visu_unchanging"), "what pages saw no change of, where there is any"),
            "visu_writes": several(shared("visu_write"), "the first variables that were written, where there are any"),
            "visu_others": several(shared("visu_other"), "other protocols on the same ports, where there are any"),
            "databases": several(shared("database"), "of DataLoggers, where there are any"),
            "buses": several(shared("bus"), "the channels of CAN, where there are any"),
            "filter": record({"expression": text(), "telegrams": whole("those it chooses")}),
            "missing": several(MISSING, "with definitions: what does not arrive of what is defined"),
            "hops": several(shared("hop"), "with --compare: variables that several lists have"),
            "hops_of_other_types": several(text(), "with --compare: names of variables that differ in type"),
            "page_hops": several(shared("page_hop"), "with --compare: what pages showed of variables of lists"),
            "logged_hops": several(shared("logged_hop"), "with --compare: what databases have of variables of lists"),
        },
        optional=(
            "evidence_left_out", "sdo", "sdo_writes", "visu", "visu_writes", "visu_unchanging", "visu_others",
            "databases", "buses", "filter", "missing", *_OF_COMPARE, "page_hops", "logged_hops",
        ),
    )  # fmt: skip
    parts = {
        "list": _list(), "node": _node(), "stream": _stream(), "can_list": _can_list(), "can_stream": _can_stream(),
        "value": VALUE_OF_LIST, "cause": cause(), "finding": _finding(), "bus": bus(), "hop": _hop(),
        "page_hop": _page_hop(), "logged_hop": _logged_hop(),
        "database": _database(),
        "canopen_node": canopen_node(), "sdo": sdo(), "sdo_write": sdo_write(),
        "visu": visu(), "visu_write": visu_write(), "visu_unchanging": visu_unchanging(), "visu_other": visu_other(),
    }  # fmt: skip
    return found | {"dependentRequired": {key: [other] for key, other in permutations(_OF_COMPARE)}, "$defs": parts}


def _database() -> Schema:
    return record(
        {
            "database": text("db/FILE, as variables have it in the place of a list", "^db/"),
            "rows": whole("they are frames of the capture, and no telegrams", 1),
            "tables": whole("", 1),
            "variables": whole("names that are different"),
            "start_ns": time(),
            "end_ns": time(),
            "lost": whole("rows that say that data was lost before them, the first of all aside"),
            "first_lost_frame": maybe(whole("", 1)),
        }
    )


def capture() -> Schema:
    formats = sorted({*(entry.name for entry in FORMATS), *LIVE_FORMATS})
    source = {"path": text(), "format": word(formats), "bytes": whole(), "frames": whole()}
    recording = {"start_ns": time(), "end_ns": time(), "first": text("its first file"), "last": text("its last file")}
    return record(
        {
            "sources": several(record(source)),
            "recordings": several(record(recording))
            | {"description": "where there are several: stretches of time with captures between which nobody listened"},
            "frames": whole(),
            "telegrams": whole(),
            "other_frames": whole("frames that are no telegrams"),
            "can_frames": whole("where there are any"),
            "drops": maybe(whole("packets that the capturing side says it lost; null where it cannot know")),
            "drops_by": maybe(_drops_by()),
            "start_ns": maybe(time("of the first frame")),
            "end_ns": maybe(time("of the last frame")),
            "until_ns": maybe(time("up to when the source was watched; null where only frames tell that time passes")),
        },
        optional=("can_frames", "recordings"),
    )


def _drops_by() -> Schema:
    told = "how many of them were lost where, as far as that is told; null where nobody can know it"
    parts = {part.value: whole(part.label, 1) for part in DropsPart}
    return record(parts, optional=parts) | {"description": told}


def _totals() -> Schema:
    findings = {word: whole() for word in SEVERITIES}
    return record(
        {
            "lists": record({word: whole() for word in STATUSES}) | {"description": "how many have which status"},
            "findings": record(findings) | {"description": "how many are how severe"},
            "findings_beside_lists": record(findings) | {"description": "those of them on none of the lists"},
        }
    )


def _list() -> Schema:
    return record(
        {
            "key": UDP_KEY,
            "transport": {"const": Transport.UDP.value},
            "port": PORT,
            "id": whole("Index", 0, 0xFFFF),
            "name": maybe(text("that of its definition")),
            "status": _STATUS,
            "senders": several(text()),
            "readers": several(text()),
            **figures((*DIAGNOSIS, *LIST_COUNTERS), Of.LIST, shape=limited),
            "nodes": several(shared("node")),
            "streams": several(shared("stream")),
            "values": several(shared("value"), "with definitions"),
            **figures(PACE, Of.LIST, shape=limited),
        },
        optional=("values",),
    )


def _node() -> Schema:
    return record(
        {
            "address": text(),
            "name": maybe(text("that of the project file")),
            **figures((*DIAGNOSIS, *PACE), Of.NODE, shape=limited),
        }
    )


def _stream() -> Schema:
    return record(
        {
            "node": text("address of the sender"),
            "subindex": SUBINDEX,
            **figures((TELEGRAMS,), Of.STREAM),
            "counter_scope": maybe(word(SCOPES, f"what its sender's Counter counts; {_NOT_OF_PARTS}")),
            **figures((*STREAM_COUNTERS, *INTERVALS), Of.STREAM, shape=limited),
            "items": whole("Items of the last telegram", 0, 0xFFFF),
            "length": whole("Length of the last telegram, bytes with header", 0, 0xFFFF),
            "checksum": maybe(whole("of the last telegram, null if it has none", 0, 0xFF)),
            **figures(PACE, Of.STREAM, shape=limited),
        }
    )


def _pace_of_can(of: Of) -> Properties:
    return figures((one for one in PACE if one not in LATENCIES), of) | figures(LATENCIES, of, shape=known_to_none)


def _can_list() -> Schema:
    return record(
        {
            "key": CAN_KEY,
            "transport": {"const": Transport.CAN.value},
            "channel": text(),
            "id": whole("COB-ID of its first frame", 0, 0x1FFF_FFFF),
            "cob_id": text("the same as people read it", "^0x([0-9A-F]{3}|[0-9A-F]{8})$"),
            "name": maybe(text("that of its definition")),
            "status": _STATUS,
            "canopen": maybe(text("what CANopen plans the identifier for")),
            "senders": nothing_in("no frame on CAN names its sender"),
            "readers": nothing_in(),
            **figures(DIAGNOSIS, Of.LIST),
            **figures(LIST_COUNTERS, Of.LIST, shape=known_to_none),
            "nodes": nothing_in(),
            "streams": several(shared("can_stream")),
            "values": several(shared("value"), "with definitions"),
            **_pace_of_can(Of.LIST),
        },
        optional=("values",),
    )


def _can_stream() -> Schema:
    return record(
        {
            "node": unknown(_NOT_OF_CAN),
            "subindex": SUBINDEX,
            "cob_id": whole("", 0, 0x1FFF_FFFF),
            "extended": truth("whether it has 29 bits"),
            **figures((TELEGRAMS, REMOTE), Of.STREAM),
            "counter_scope": unknown(_NOT_OF_CAN),
            **figures(STREAM_COUNTERS, Of.STREAM, shape=known_to_none),
            **figures(INTERVALS, Of.STREAM),
            "items": unknown(_NOT_OF_CAN),
            "length": whole("data bytes of the last frame", 0, 64),
            "checksum": unknown(_NOT_OF_CAN),
            **_pace_of_can(Of.STREAM),
        }
    )


def cause() -> Schema:
    explained = {
        "code": word([kind.code for kind in _JUDGED]),
        "list": maybe(LIST_KEY),
        "node": maybe(text("address")),
        "subindex": maybe(SUBINDEX),
    }
    return record(
        {
            "kind": word(BY_NAME),
            "severity": word(SEVERITIES),
            "lists": several(LIST_KEY),
            "nodes": several(text("address")),
            "channel": maybe(text("that of CAN it is about")),
            "since_ns": maybe(time("the last moment at which all was well; at the beginning, that of the capture")),
            "until_ns": maybe(time("null: it is still so at the end")),
            "frames": several(whole("", 1), "the first of its events") | {"maxItems": FRAMES_KEPT},
            "frames_cut": whole("how many more there are behind those that are named"),
            "title": text("what happened, where and when"),
            "checked": several(text(), "facts, the deciding one first"),
            "next": text("what to do first"),
            "findings": several(record(explained), "those of which it explains most of the events"),
        }
    )


def _finding() -> Schema:
    extents = "; ".join(f"{code}: {what}" for code, what in EXTENTS.items())
    events = {
        "count": whole("how often", 1),
        "extent": maybe(number(f"how far it goes, by which the worst of several is told. {extents}. Else null")),
        "first_ns": maybe(time()),
        "last_ns": maybe(time()),
        "frames": several(whole("", 1), "the first of its frames") | {"maxItems": FRAMES_KEPT},
        "frames_cut": whole("how many more there are behind those that are named"),
        "message": text(),
        "hint": text(),
    }
    found = record(
        {
            "code": word([kind.code for kind in _JUDGED]),
            "name": word([kind.name for kind in _JUDGED]),
            "severity": word(SEVERITIES),
            "list": maybe(LIST_KEY),
            "node": maybe(text("address")),
            "subindex": maybe(SUBINDEX),
            "channel": text("that of CAN it is about"),
            "variable": text("what of another conversation it is about: sdo/ADDRESS/INDEX:SUBINDEX, visu/ADDRESS/NAME"),
            "lists": several(LIST_KEY, "where it is about many"),
            "parts": several(
                record(
                    {"list": LIST_KEY, "subindex": maybe(SUBINDEX), **events, "first_ns": time(), "last_ns": time()}
                ),
                "where it is about many lists: what is said of each of their identifiers",
            ),
            **events,
        },
        optional=("channel", "variable", "lists", "parts"),
    )
    return found | {"dependentRequired": {"lists": ["channel", "parts"], "parts": ["lists"]}}


def _page_hop() -> Schema:
    end = record({"list": text("key, or visu/ADDRESS"), "sender": text(), "telegrams": whole(), **VALUE})
    return record({**_hop_of(end), "hidden": truth("it is, or may be, a password, and stays hidden")})


def _logged_hop() -> Schema:
    listed = record({"list": LIST_KEY, "sender": text(), "telegrams": whole(), **VALUE})
    told = {"value": VALUE_OF_LOG, "unit": unknown()}
    logged = record({"list": text("db/FILE", "^db/"), "rows": whole("with a value"), **VALUE, **told})
    missed = whole("changes of the list that the database has not, while it was written")
    return record({**_hop_of(listed), "to": logged, "missed": missed})


def _hop() -> Schema:
    return record(_hop_of(record({"list": LIST_KEY, "sender": text(), "telegrams": whole(), **VALUE})))


def _hop_of(end: Schema) -> dict[str, Schema]:
    delays = {"count": whole("changes that were timed")}
    return {
        "variable": text(),
        "type": text(),
        "from": end,
        "to": end,
        "changes": whole(),
        "followed": whole(),
        "delay_ns": record(delays | {key: maybe(duration()) for key in ("min", "mean", "p50", "p99", "max")}),
        "observed_ns": duration(),
        "differed_ns": duration(),
        "equal": truth("whether both had the same value at last"),
    }
