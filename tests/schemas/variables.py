"""The schemas of what telegrams carry: variables, their changes, their state at a time, and proposed layouts."""

from __future__ import annotations

from nvscope.definition.infer import GUESS, LAYOUTS, LIKELY, SURE
from nvscope.view.documents.variables import ASSUMED, DOCUMENTED
from nvscope.view.documents.verdicts import SEVERITIES
from nvscope.view.missing_kinds import KINDS
from tests.schemas.shapes import (
    FILTER,
    LIST_KEY,
    PORT,
    SUBINDEX,
    Properties,
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
    truth,
    unknown,
    whole,
    word,
)

ANY_VALUE: Schema = {"type": ["boolean", "number", "string", "null"]}
_ORDERED: Schema = {"type": ["boolean", "number", "null"]}
UNIT = word(("ns", "s", None), "that of values of times")
VALUE: Properties = {
    "unit": UNIT,
    "value": ANY_VALUE | {"description": "bytes in hexadecimal; null of what is no finite number"},
    "text": text("as an engineer writes it"),
}
_LISTED: Properties = {"list": LIST_KEY, "list_name": text()}
_VARIABLE: Properties = {
    "name": text(),
    "type": text(),
    "sender": text("address; the channel on CAN"),
    "packing": word((DOCUMENTED, ASSUMED), "how sure it is which bytes it has"),
    "subindex": SUBINDEX,
    **VALUE,
    "last_ns": time("of the last telegram"),
    "changed_ns": time("of the last change, or of the first telegram"),
    "telegrams": whole("", 1),
    "changes": whole(),
    "min": _ORDERED,
    "max": _ORDERED,
    "min_text": maybe(text("null of what has no order")),
    "max_text": maybe(text("null of what has no order")),
}
VALUE_OF_LIST = record(_VARIABLE)

_MISSING: Properties = {
    "kind": word(KINDS),
    "severity": word(SEVERITIES),
    "lists": several(LIST_KEY, "the one that is missing first, then that which is sent in its place"),
    "list_name": maybe(text("that of the first one")),
    "nodes": several(text(), "addresses of those that send it, or do not get it"),
    "variables": several(text(), "what never changed, up to ten; structures and arrays as one"),
    "variables_cut": whole("further ones"),
    "what": text("what is missing, as a sentence"),
    "why": maybe(text("null where nobody knows")),
    "next": text("what to change or to look at"),
}
MISSING = record(_MISSING)


def last_values() -> Schema:
    """Return the schema of ``vars --json``."""
    found = document(
        "vars", "`nvscope vars --json`: the last value of every variable, its changes and its bounds",
        {
            "filter": FILTER,
            "missing": several(record({**_MISSING, "list_name": text()}), "what does not arrive of what is defined"),
            "variables": several(shared("variable")),
            "earlier": several(shared("variable"), "of telegrams with a layout that another one took the place of"),
        },
    )  # fmt: skip
    return found | {"$defs": {"variable": record({**_LISTED, **_VARIABLE})}}


def history() -> Schema:
    """Return the schema of ``vars --history NAME --json``."""
    found = document(
        "history", "`nvscope vars --history NAME --json`: every change of a variable, and how often it changes",
        {
            "changes": several(shared("change")),
            "variables": several(shared("variable")),
            "filter": FILTER,
        },
    )  # fmt: skip
    change = {
        "frame": whole("", 1),
        "time_ns": time(),
        **_LISTED,
        "sender": text(),
        "subindex": SUBINDEX,
        "name": text(),
        "changed": truth("false where --all tells a value that stayed"),
        "unit": UNIT,
        "old": ANY_VALUE | {"description": "null in the first telegram of a recording"},
        "new": ANY_VALUE,
        "old_text": maybe(text("null in the first telegram of a recording")),
        "new_text": text("with all digits that count"),
    }
    variable = {
        **_LISTED,
        "name": text(),
        "type": text(),
        "sender": text(),
        "subindex": SUBINDEX,
        "telegrams": whole("", 1),
        "first_ns": time(),
        "last_ns": time(),
        "changes": whole(),
        "changed_ns": maybe(time("of the last change, null if there was none")),
        "shortest_ns": maybe(duration("between two changes", None)),
        "longest_ns": maybe(duration("between two changes", None)),
    }
    return found | {"$defs": {"change": record(change), "variable": record(variable)}}


def at() -> Schema:
    """Return the schema of ``vars --at TIME --json``."""
    place = {**_LISTED, "subindex": SUBINDEX, "name": text(), "type": text()}
    known = {
        "sender": text(),
        **VALUE,
        "frame": whole("", 1),
        "sent_ns": time(),
        "age_ns": duration("how old the telegram was", None),
    }
    missing = ("later", "not sent", "not chosen", "not decoded")
    seen = record({**place, **known, "missing": unknown()})
    nothing = {key: unknown() for key in known}
    unseen = record({**place, **nothing, "sender": maybe(text()), "missing": word(missing, "why there is no value")})
    return document(
        "at", "`nvscope vars --at TIME --json`: what every variable was at a time, and how old its telegram was",
        {
            "time_ns": time("what was asked for"),
            "capture": record({"start_ns": maybe(time()), "end_ns": maybe(time())}),
            "last_frame": maybe(whole("the last one up to that time", 1)),
            "filter": FILTER,
            "variables": several({"oneOf": [shared("seen"), shared("unseen")]}),
        },
    ) | {"$defs": {"seen": seen, "unseen": unseen}}  # fmt: skip


def inference() -> Schema:
    """Return the schema of ``vars --infer --json``."""
    field = {
        "offset": whole("from the first byte behind the header"),
        "bytes": whole("", 1),
        "name": text(),
        "type": text(),
        "grade": word((SURE, LIKELY, GUESS)),
        "probability": number("", 0, 1),
        "evidence": text("what speaks for it"),
        "others": several(text(), "types that are about as plausible"),
    }
    layout = {
        "behind_bits": number("how much less plausible than the first; unit: bits", 0),
        "fields": several(record(field)),
    }
    telegram = {
        "subindex": SUBINDEX,
        "items": whole("", 0, 0xFFFF),
        "length": whole("bytes with header"),
        "telegrams": whole("", 1),
        "looked_at": whole("telegrams whose bytes were compared"),
        "other_shapes": whole("telegrams of another shape"),
        "reason": maybe(text("why nothing is proposed")),
        "layouts": several(record(layout), "the most plausible first") | {"maxItems": LAYOUTS},
    }
    entry = {
        "list": LIST_KEY,
        "port": PORT,
        "id": whole("", 0, 0xFFFF),
        "sender": text(),
        "pack": truth(),
        "interval_ns": maybe(duration("null where it is not sent in a cycle")),
        "reproducible": truth("whether a controller could declare it so"),
        "problem": maybe(text("why not")),
        "telegrams": several(record(telegram)),
    }
    return document(
        "infer", "`nvscope vars --infer --json`: layouts proposed for lists that nobody defined",
        {
            "lists": several(record(entry)),
            "frames": whole("of the capture"),
            "left_out": whole("telegrams of streams beyond those that are looked at"),
            "on_can": whole("COB-IDs, for which nothing is proposed"),
        },
    )  # fmt: skip
