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

_OF_PAGES = "variables of web visualization; absent without any"
_OF_PAGE: Properties = {
    "list": text("visu/ADDRESS of the controller", "^visu/"),
    "name": text("as the variable list calls it, else its place"),
    "type": text("as the request calls it; unknown where it says nothing"),
    "sender": text("address of the controller"),
}
_PLACE: Properties = {
    "place": text("ref,offset,size,type; of older pages the ADR"),
    "hidden": truth("it is, or may be, a password, and stays hidden"),
}
_PAGE_VALUE: Properties = {
    "unit": UNIT,
    "value": ANY_VALUE | {"description": "null of what is none of its type, and of what is hidden or was never read"},
    "text": maybe(text("as an engineer writes it; as it came where it is none of its type")),
}
_PAGE_VARIABLE: Properties = {
    **_OF_PAGE,
    **_PAGE_VALUE,
    "last_ns": maybe(time("of the last value")),
    "changed_ns": maybe(time("of the last change, or of the first value")),
    "telegrams": whole("replies with a value, and confirmed writes"),
    "changes": whole(),
    **{name: _VARIABLE[name] for name in ("min", "max", "min_text", "max_text")},
    "unreadable": whole("how often the controller answered ???"),
    **_PLACE,
}

_OF_LOGS = "variables of databases of DataLoggers; absent without any"
_OF_LOG: Properties = {
    "list": text("db/FILE: the database, or the series of files", "^db/"),
    "name": text("its full name"),
    "type": text("what its column is declared as"),
}
VALUE_OF_LOG: Schema = {"type": ["number", "string", "null"]}
_LOGGED_VALUE: Properties = {
    "unit": unknown(),
    "value": VALUE_OF_LOG | {"description": "as it is stored; null of bytes, of what is no finite number, and of NULL"},
    "text": maybe(text("as an engineer writes it; bytes in hexadecimal; unknown where nobody knows it any more")),
}
_LOGGED_VARIABLE: Properties = {
    **_OF_LOG,
    **_LOGGED_VALUE,
    "last_ns": maybe(time("of the last row with a value, or from which on it is unknown")),
    "changed_ns": maybe(time("of the last change, or of the first value")),
    "rows": whole("with a value: where only changes are stored, those with a change"),
    "changes": whole(),
    "min": maybe(number("of the numbers among the values")),
    "max": maybe(number()),
    "min_text": maybe(text()),
    "max_text": maybe(text()),
}

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
            "page_variables": several(shared("page_variable"), _OF_PAGES),
            "logged_variables": several(shared("logged_variable"), _OF_LOGS),
        },
        optional=["page_variables", "logged_variables"],
    )  # fmt: skip
    return found | {
        "$defs": {
            "variable": record({**_LISTED, **_VARIABLE}),
            "page_variable": record(_PAGE_VARIABLE),
            "logged_variable": record(_LOGGED_VARIABLE),
        }
    }


def history() -> Schema:
    """Return the schema of ``vars --history NAME --json``."""
    found = document(
        "history", "`nvscope vars --history NAME --json`: every change of a variable, and how often it changes",
        {
            "changes": several(shared("change")),
            "page_changes": several(shared("page_change"), _OF_PAGES),
            "logged_changes": several(shared("logged_change"), _OF_LOGS),
            "variables": several(shared("variable")),
            "page_variables": several(shared("page_variable"), _OF_PAGES),
            "logged_variables": several(shared("logged_variable"), _OF_LOGS),
            "filter": FILTER,
        },
        optional=["page_changes", "page_variables", "logged_changes", "logged_variables"],
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
    of_page = {name: part for name, part in _OF_PAGE.items() if name != "type"}
    of_lists = ("list_name", "subindex")
    page_change = {name: one for name, one in {**change, **of_page, **_PLACE}.items() if name not in of_lists}
    page_variable = {**variable, **_OF_PAGE, "place": _PLACE["place"]}
    page_variable = {name: one for name, one in page_variable.items() if name not in of_lists}
    of_nobody = (*of_lists, "sender", "telegrams")
    of_log = {name: part for name, part in _OF_LOG.items() if name != "type"}
    logged_change = {**change, **of_log, "unit": unknown(), "old": VALUE_OF_LOG, "new": VALUE_OF_LOG}
    logged_change["changed"] = truth(
        "it is another value than the last one that was known; false where --all tells one that stayed, and where it "
        "becomes unknown"
    )
    logged_variable = {**variable, **_OF_LOG, "rows": whole("with a value", 1)}
    told = {
        "change": change, "page_change": page_change, "variable": variable, "page_variable": page_variable,
        **{
            name: {key: one for key, one in properties.items() if key not in of_nobody}
            for name, properties in (("logged_change", logged_change), ("logged_variable", logged_variable))
        },
    }  # fmt: skip
    return found | {"$defs": {name: record(properties) for name, properties in told.items()}}


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
            "page_variables": several({"oneOf": [shared("on_page"), shared("not_on_page")]}, _OF_PAGES),
            "logged_variables": several({"oneOf": [shared("logged"), shared("not_logged")]}, _OF_LOGS),
        },
        optional=["page_variables", "logged_variables"],
    ) | {"$defs": {"seen": seen, "unseen": unseen, **_on_pages_at(known), **_logged_at(known)}}  # fmt: skip


def _on_pages_at(known: Properties) -> dict[str, Schema]:
    """Return what is told of variables of pages at a time, by name: of those with a value, and of the others."""
    told = {name: part for name, part in known.items() if name not in _OF_PAGE}
    on_page = {**_OF_PAGE, **told, **_PAGE_VALUE, **_PLACE, "text": text(), "missing": unknown()}
    nothing = {name: unknown() for name in told}
    why = word(("later", "not readable", "not in replies"), "why there is no value")
    return {
        "on_page": record(on_page),
        "not_on_page": record({**_OF_PAGE, **nothing, **_PLACE, "hidden": word((False,)), "missing": why}),
    }


def _logged_at(known: Properties) -> dict[str, Schema]:
    """Return what is told of variables of databases at a time: of those with a value, and of the others."""
    told = {name: part for name, part in known.items() if name != "sender"}
    logged = {**_OF_LOG, **told, **_LOGGED_VALUE, "text": text(), "missing": unknown()}
    nothing = {name: unknown() for name in told}
    why = word(("later", "no value"), "why there is no value")
    return {"logged": record(logged), "not_logged": record({**_OF_LOG, **nothing, "missing": why})}


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
