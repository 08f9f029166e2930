"""What came of asking a WebVisu, for people: values by name, what was written, or what went wrong and what to do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dissectors.webvisu import Place
from nvscope import units
from nvscope.definition.visu_values import type_at
from nvscope.enumeration import first_few
from nvscope.report.ansi import paint
from nvscope.report.sdo import MIN_WIDTH, Failure
from nvscope.tracker.readings.form import HIDDEN
from nvscope.units import count_of, duration
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Column, Line, Tone, align, wrap

_UNREADABLE, _MISSING = "???", "-"
_LONGEST = 300
_MOST_SHOWN = 20_000
_SHORT = 40
_OTHER_LISTS = (
    "addresses change with every download to the controller: take names from its own lists, not from old files"
)
_AREAS = {0: "%M", 1: "inputs", 2: "outputs", 3: "retain", 4: "global"}
"""What areas are called; other targets may have others."""

Document = Mapping[str, Any]


def render(document: Document, *, colour: bool = False, width: int = 80) -> str:
    """Return what was read, written or listed (schema ``nvscope.visu/1``) as text; "" of nothing."""
    shown = visible_document(document)
    room = max(width, MIN_WIDTH)
    if shown["verb"] == "write":
        lines: Sequence[Line] = [line for cells in _written(shown) for line in wrap(cells, room, 0, 2)]
    elif shown["verb"] == "list":
        lines = _listed(shown, room)
    else:
        lines = _read(shown, room)
    return paint(lines, colour=colour)


def reading(document: Document, time_ns: int, *, colour: bool = False, utc: bool = False) -> str:
    """Return what was read at a time as one line."""
    cells: list[Cell] = [Cell(f"{units.clock_time(time_ns, utc=utc)}  ", Tone.FAINT)]
    for place, one in enumerate(visible_document(document)["variables"]):
        cells += [Cell(f"{', ' if place else ''}{_name(one)} = "), _value_cell(one)]
    return paint([cells], colour=colour)


def question(document: Document) -> str:
    """Return what a person is asked before a value is written, of what is known then."""
    shown = visible_document(document)
    (one,) = shown["variables"]
    is_now = "cannot be read" if one["state"] == "unreadable" else f"is {_text(one, 'before')}"
    place = f" ({_address(one)})" if one["name"] else ""
    return f"{_name(one)}{place} of {_server(shown)} {is_now}. Write {_text(one, 'wanted')}?"


def _read(document: Document, width: int) -> Sequence[Line]:
    rows = document["variables"]
    if all(one["state"] == "missing" for one in rows):
        return []
    if len(rows) == 1:
        (one,) = rows
        about = f"   {_type(one)}, after {duration(_last(document)['latency_ns'])}"
        return list(wrap([Cell(f"{_name(one)} = "), _value_cell(one), Cell(about, Tone.FAINT)], width, 0, 2))
    columns = Column("variable", identifier=True, shortest=12), Column("value", shortest=8), Column("type"), _PLACE
    table = [
        [Cell(_name(one)), _value_cell(one), Cell(_type(one), Tone.FAINT), Cell(_address(one), Tone.FAINT)]
        for one in rows[:_MOST_SHOWN]
    ]  # fmt: skip
    return align(columns, table, width)


_PLACE = Column("address", importance=0)


def _listed(document: Document, width: int) -> Sequence[Line]:
    rows = document["variables"]
    if not rows:
        return []
    columns = (
        Column("variable", identifier=True, shortest=12), Column("type"), Column("area"),
        Column("offset", right=True), Column("size", right=True), Column("address", importance=0),
    )  # fmt: skip
    table = [
        [
            Cell(_name(one)), Cell(_type(one)), Cell(_AREAS.get(one["ref"], str(one["ref"]))),
            Cell(str(one["offset"])), Cell(str(one["size"])), Cell(_address(one), Tone.FAINT),
        ]
        for one in rows[:_MOST_SHOWN]
    ]  # fmt: skip
    lines = [*align(columns, table, width)]
    if (more := len(rows) - _MOST_SHOWN) > 0:
        lines.append([Cell(f"and {count_of(more, 'more variable')}, which --json has", Tone.FAINT)])
    return lines


def _written(document: Document) -> Iterator[Line]:
    if document["outcome"] not in ("written", "differs", "unverified"):
        return
    (one,) = document["variables"]
    name, was, wanted = _name(one), _before(document, one), _text(one, "wanted")
    latencies = [row["latency_ns"] for row in document["exchanges"] if row["purpose"] == "write"]
    about = f"   {_type(one)}, {duration(latencies[0])} to write"
    if document["outcome"] == "differs":
        found = _text(one, "value")
        yield [
            Cell("✗ ", Tone.ERROR), Cell(f"{name}: {was} → {wanted} was written and confirmed, "),
            Cell(f"but {found} is what it holds", Tone.ERROR), Cell(about, Tone.FAINT),
        ]  # fmt: skip
        return
    is_back = document["outcome"] == "written" and one["state"] != "unreadable"
    behind = ", read back" if is_back else ", not read back"
    yield [Cell(f"{name}: {was} → "), Cell(wanted, Tone.STRONG), Cell(about + behind, Tone.FAINT)]


def _before(document: Document, one: Mapping[str, Any]) -> str:
    if one["before"] is None and not one["secret"]:
        return "not to be read"
    return _text(one, "before")


def _value_cell(one: Mapping[str, Any]) -> Cell:
    if one["state"] == "value":
        return Cell(_text(one, "value"), Tone.STRONG)
    told = {"unreadable": _UNREADABLE, "hidden": HIDDEN}.get(one["state"], _MISSING)
    return Cell(told, Tone.WARNING if one["state"] == "unreadable" else Tone.FAINT)


def _text(one: Mapping[str, Any], key: str) -> str:
    if one[key] is None:
        return HIDDEN if one["secret"] else _MISSING
    text = str(one[key]["text"])
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _name(one: Mapping[str, Any]) -> str:
    return str(one["name"] or _address(one))


def _address(one: Mapping[str, Any]) -> str:
    return f"{one['ref']},{one['offset']},{one['size']},{one['type_code']}"


def _type(one: Mapping[str, Any]) -> str:
    if one["type"] == "STRING":
        return f"STRING({max(one['size'] - 1, 0)})"
    return str(one["type"] or f"type {one['type_code']}")


def _server(document: Document) -> str:
    where = units.endpoint(str(document["server"]), document["port"])
    return f"{document['server_name']} ({where})" if document["server_name"] else where


def remarks(document: Document) -> Iterator[str]:
    """Yield what a person should know beside the result: what is hidden, and what lists could not be had."""
    hidden = sum(one["secret"] for one in document["variables"] if one["state"] == "hidden")
    if hidden:
        verb = "is" if hidden == 1 else "are"
        yield f"{count_of(hidden, 'value')} {verb} hidden that may be a password; --show-secrets shows it"
    for one in document["exchanges"]:
        if one["purpose"] == "page" and one["status"] == 200 and one["ended"] == "replied" and one["why"]:
            yield f"{one['path']}: {one['why']}; texts are read as ISO-8859-1, unless --encoding says otherwise"
        if one["purpose"] != "list" or one["ended"] != "replied" or not document["lists"]:
            continue
        if one["status"] != 200:
            yield f"{one['path']}: HTTP status {one['status']}"
        elif one["why"]:
            yield f"{one['path']} {_why_unread(one)}; names are missing, and nobody knows what is a password"
    for one in document["lists"]:
        if one["left_out"]:
            yield f"{one['source']}: {count_of(one['left_out'], 'variable')} more were left out"


def failure(document: Document) -> Failure | None:
    """Return what is to be told of a document that is not good, None of one that is. Its texts are not escaped."""
    outcome = document["outcome"]
    if outcome in ("read", "written", "listed", "cancelled"):
        return None
    what, next_step = _FAILURES[outcome](document)
    return Failure(_server(document), what, next_step)


def _last(document: Document) -> Mapping[str, Any]:
    """Return the last exchange; the page may have been asked for the encoding of texts behind all others."""
    exchanges = document["exchanges"]
    found: Mapping[str, Any] = ([one for one in exchanges if one["purpose"] != "page"] or exchanges)[-1]
    return found


def _doing(document: Document) -> str:
    """Return what did not work: ``PLC_PRG.a is not written``."""
    last = _last(document)
    if last["purpose"] in ("page", "list"):
        return f"{last['path']} cannot be fetched"
    rows = document["variables"]
    what = _name(rows[0]) if len(rows) == 1 else count_of(len(rows), "variable")
    done = {"read": "read", "write": "written"}[last["purpose"]]
    return f"{what} {'is' if len(rows) == 1 else 'are'} not {done}"


def _open_end(document: Document) -> str:
    """Return what is known of a write that ended without an answer, or before it began."""
    if document["verb"] != "write":
        return ""
    return "; whether it was written is not known" if _last(document)["purpose"] == "write" else "; nothing was written"


def _unreadable(document: Document) -> tuple[str, str]:
    names = [_name(one) for one in document["variables"] if one["state"] == "unreadable"]
    return (
        f"the controller cannot read {first_few(names)} ({_UNREADABLE})",
        _OTHER_LISTS,
    )


def _misfit(document: Document) -> tuple[str, str]:
    of = "before" if document["verb"] == "write" else "value"
    rows = [one for one in document["variables"] if one["state"] == "value" and one[of]["value"] is None]
    typed = [
        one for one in rows if type_at(Place(one["ref"], one["offset"], one["size"], one["type_code"])) is not None
    ]
    told = [f"{_name(one)}, which is no {one['type']}" for one in typed]
    if not told:
        return f"a hidden value is none of its type{_open_end(document)}", _OTHER_LISTS
    return f"the controller answers {_quoted(typed[0][of])} for {first_few(told)}{_open_end(document)}", _OTHER_LISTS


def _quoted(value: Mapping[str, Any]) -> str:
    text = str(value["text"])
    return f"'{text[:_SHORT]}…'" if len(text) > _SHORT else f"'{text}'"


def _refused(document: Document) -> tuple[str, str]:
    last = _last(document)
    if last["status"] == 200:
        return (
            f"{_doing(document)}: the controller refuses it",
            "check that it may be written, and that nobody else has write access (.CurrentWriteAccessClientId)",
        )
    told, end = f"{_doing(document)}: HTTP status {last['status']}", _open_end(document)
    if last["location"]:
        leads = f", which leads to {last['location']}"
        return f"{told}{leads}{end}", "name that URL if it is the page of the controller"
    status = f"{told}{end}"
    if last["status"] == 404:
        return status, "check the path of the page; without one, the usual ones are looked for"
    if last["status"] in (401, 403):
        return status, "the server asks for a login, which WebVisu has none of: ask whoever looks after it"
    return status, "look at the server's own log, or ask again later"


def _differs(document: Document) -> tuple[str, str]:
    return (
        f"{_name(document['variables'][0])} does not hold what was written",
        "its program may write it itself, or limit it; read it again, and look who else writes it",
    )


def _unverified(document: Document) -> tuple[str, str]:
    return f"{_name(document['variables'][0])} was written and confirmed, but could not be read back", "read it again"


def _counted(document: Document) -> str:
    last = _last(document)
    return f"{count_of(last['fields'] or 0, 'value')} for {count_of(last['variables'], 'variable')}"


def _miscounted(document: Document) -> tuple[str, str]:
    return (
        f"{_counted(document)}: what belongs to which is not certain{_open_end(document)}",
        "ask for fewer variables at once, or one by one",
    )


def _ambiguous(document: Document) -> tuple[str, str]:
    return (
        f"{_counted(document)}: a text has a | in it, and which one that is nobody knows",
        "read one STRING at a time",
    )


def _no_visu(document: Document) -> tuple[str, str]:
    return (
        f"{_doing(document)}: what answers is no WebVisu of CoDeSys V2.3{_open_end(document)}",
        "V3 has a page of the same name, and another protocol: check which runtime the controller has",
    )


def _no_page(document: Document) -> tuple[str, str]:
    paths = ", ".join(f"{one['path']} ({one['status']})" for one in document["exchanges"])
    return f"no page is at the usual paths: {paths}", "name its URL; check that the visualization is for the web"


def _no_list(document: Document) -> tuple[str, str]:
    told = ", ".join(
        f"{one['path']} ({_why_unread(one) if one['status'] == 200 else one['status']})"
        for one in document["exchanges"] if one["purpose"] == "list"
    )  # fmt: skip
    return f"no variable list is beside the page: {told}", "name one with --page, or a file with --variables"


def _why_unread(exchange: Mapping[str, Any]) -> str:
    """Return why nothing is known by a list that came."""
    return f"cannot be read: {exchange['why'].rstrip('.')}" if exchange["why"] else "no variables"


def _silent(document: Document) -> tuple[str, str]:
    begun = " whole" if _last(document)["status"] else ""
    return (
        f"{_doing(document)}: no{begun} answer in time{_open_end(document)}",
        "check the address, and whether the controller is busy; --timeout waits longer",
    )


def _undelivered(document: Document) -> tuple[str, str]:
    why = str(_last(document)["why"] or "nobody there").lower()
    return (
        f"{_doing(document)}: {why}{_open_end(document)}",
        "nothing takes connections on that port there: check the address, the port, and that the web server is on",
    )


def _broken(document: Document) -> tuple[str, str]:
    return (
        f"{_doing(document)}: the connection ended before the answer{_open_end(document)}",
        "ask again; a server that always does so may take fewer variables at once",
    )


def _no_http(document: Document) -> tuple[str, str]:
    why = f" ({_last(document)['why']})" if _last(document)["why"] else ""
    return f"{_doing(document)}: what answers is no HTTP{why}{_open_end(document)}", "check the port: 80 or 8080"


def _oversized(document: Document) -> tuple[str, str]:
    return (
        f"{_doing(document)}: {_last(document)['why']} came{_open_end(document)}",
        "check the URL: no reply is so long",
    )


_FAILURES = {
    "unreadable": _unreadable, "misfit": _misfit, "differs": _differs, "unverified": _unverified, "refused": _refused,
    "miscounted": _miscounted, "ambiguous": _ambiguous, "no_visu": _no_visu, "no_page": _no_page, "no_list": _no_list,
    "silent": _silent, "undelivered": _undelivered, "broken": _broken, "no_http": _no_http, "oversized": _oversized,
}  # fmt: skip
