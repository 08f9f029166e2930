"""What came of asking the Parameter Manager, for people: a line with the value, or what went wrong and what to do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from nvscope import units
from nvscope.report.ansi import paint
from nvscope.units import count_of, duration
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import BREAK, Cell, Line, Tone, wrap

MIN_WIDTH = 20
_MOST_BYTES = 8
_LONGEST = 200
_MOST_SHOWN = 4_096
"""As many elements, or bytes of what has no known type, as are shown: a partner may send more."""

_UNREAD = "not to be read"

Document = Mapping[str, Any]


class Failure(NamedTuple):
    """What went wrong, where, and what to do next."""

    where: str
    what: str
    next_step: str


def render(document: Document, *, colour: bool = False, width: int = 80) -> str:
    """Return what was read or written (schema ``nvscope.sdo/1``) as text, ending with a line break; "" of neither."""
    shown = visible_document(document)
    lines = _read(shown) if shown["verb"] == "read" else _written(shown)
    room = max(width, MIN_WIDTH)
    # Those of elements stand below that of their array.
    return paint(
        (line for place, cells in enumerate(lines) for line in wrap(cells, room, 2 * bool(place), 2 + 2 * bool(place))),
        colour=colour,
    )


def question(document: Document) -> str:
    """Return what a person is asked before a value is written, of what is known then."""
    shown = visible_document(document)
    before, wanted = shown["before"], shown["wanted"]
    is_now = "cannot be read" if before is None else f"is {value_text(before)}"
    return f"{_name(shown)} of {_partner(shown)} {is_now}. Write {value_text(wanted)}?"


def value_text(value: Mapping[str, Any]) -> str:
    """Return a value in a line: the text of its element, several in brackets, members of structures with their names.

    Where its type is not known, it is told by its bytes.
    """
    elements = value["elements"]
    if elements is None:
        text = _bytes(value, _LONGEST // 3) or "nothing"
    else:
        texts = [_element_text(one) for one in elements]
        text = texts[0] if _is_alone(elements) else f"[{', '.join(texts)}]"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _in_cells(value: Mapping[str, Any]) -> str:
    """Return the text of a value for cells that are wrapped: lines are broken between bytes, and not within them."""
    text = value_text(value)
    return text.replace(" ", BREAK) if value["elements"] is None else text


def _is_alone(elements: Sequence[Mapping[str, Any]]) -> bool:
    """Tell whether a value is one element, and not a structure or an array that has one."""
    return len(elements) == 1 and elements[0]["name"] is None


def _element_text(element: Mapping[str, Any]) -> str:
    name, text = element["name"] or "", str(element["text"])
    # What has a number alone is told by its place.
    return text if not name or (name.startswith("[") and name.endswith("]")) else f"{name} = {text}"


def _read(document: Document) -> Iterator[Line]:
    value = document["value"]
    if value is None:
        return
    name, elements = Cell(_name(document)), value["elements"]
    latency = f"after {duration(document['exchanges'][0]['latency_ns'])}"
    size = count_of(len(value["bytes"]) // 2, "byte")
    if elements is None:
        items = f", {count_of(value['items'], 'element')}" if value["items"] != 1 else ""
        text = _bytes(value, _MOST_SHOWN) or "nothing"
        yield [
            name,
            Cell(" = "),
            Cell(text.replace(" ", BREAK), Tone.STRONG),
            Cell(f"   {size}{items}, {latency}", Tone.FAINT),
        ]
        return
    about = f"{document['type']}, {size} {_bytes(value, _MOST_BYTES).replace(' ', BREAK)}, {latency}"
    if _is_alone(elements):
        yield [name, Cell(" = "), Cell(elements[0]["text"], Tone.STRONG), Cell(f"   {about}", Tone.FAINT)]
        return
    is_several = elements[0]["name"].startswith("[") and not document["type"].startswith("ARRAY")
    yield [name, Cell(f"   {value['items']} × {about}" if is_several else f"   {about}", Tone.FAINT)]
    for element in elements[:_MOST_SHOWN]:
        yield [Cell(f"{element['name']} = "), Cell(element["text"], Tone.STRONG)]
    if (more := len(elements) - _MOST_SHOWN) > 0:
        yield [Cell(f"and {count_of(more, 'more element')}, which --json has", Tone.FAINT)]


def _written(document: Document) -> Iterator[Line]:
    if document["outcome"] not in ("written", "differs", "unverified"):
        return
    name, before = _name(document), document["before"]
    wanted, value = _in_cells(document["wanted"]), document["value"]
    was = _UNREAD if before is None else _in_cells(before)
    about = f"   {document['type']}, {duration(document['exchanges'][1]['latency_ns'])} to write"
    if document["outcome"] == "differs":
        yield [
            Cell("✗ ", Tone.ERROR), Cell(name), Cell(f": {was} → {wanted} was written and confirmed, "),
            Cell(f"but {_in_cells(value)} is what it holds", Tone.ERROR), Cell(about, Tone.FAINT),
        ]  # fmt: skip
        return
    behind = ", read back" if value is not None else ", not read back"
    yield [Cell(f"{name}: {was} → "), Cell(wanted, Tone.STRONG), Cell(about + behind, Tone.FAINT)]


def failure(document: Document) -> Failure | None:
    """Return what is to be told of a document that is not good, None of one that is. Its texts are not escaped."""
    outcome = document["outcome"]
    where, name = _partner(document), _name(document)
    if outcome in ("read", "written", "cancelled"):
        return None
    if outcome == "differs":
        return Failure(
            where, f"{name} does not hold what was written",
            "its program may write it itself, or limit it; read it again, and look who else writes it",
        )  # fmt: skip
    if outcome == "misfit":
        value = document["value"] or document["before"]
        size = len(value["bytes"]) // 2
        return Failure(
            where,
            f"{name} has {count_of(size, 'byte')} in {count_of(value['items'], 'element')} there, "
            f"which is no {document['type']}{_wanted_size(document)}" + _left_alone(document),
            "name its type with --type, or in [parameters] of the project file",
        )  # fmt: skip
    last = document["exchanges"][-1]
    times = f", asked {count_of(last['transmissions'], 'time')}" if last["transmissions"] > 1 else ""
    doing = {"ODReadRequest": "read", "ODWriteRequest": "written"}[last["request"]]
    if outcome == "unverified":
        return Failure(where, f"{name} was written and confirmed, but could not be read back ({last['ended']})",
                       "read it again")  # fmt: skip
    if outcome == "refused":
        return Failure(where, f"{name} is not {doing}: {last['answer']}", _next_of(last["answer"]))
    # Of a write nobody knows then whether it was done; of a read before it everybody does.
    open_end = "; whether it was written is not known" if doing == "written" else _left_alone(document)
    if outcome == "busy":
        return Failure(
            where, f"{name} is not {doing}: ODStateBusy until the end{times}{open_end}",
            "give it more time with --timeout, or --retries",
        )  # fmt: skip
    if outcome == "undelivered":
        from nvscope.causes.parameters import PARAMETERS_UNANSWERED  # noqa: PLC0415  # only where something is wrong

        return Failure(
            where, f"{name} is not {doing}: {last['undelivered']}{times}{_left_alone(document)}",
            "nothing listens on that port there: check " + _lower(PARAMETERS_UNANSWERED.next_step)
            if last["undelivered"] == "port unreachable"
            else "nobody has that address, or no router knows the way: check it, the cable, and the netmask",
        )  # fmt: skip
    return Failure(where, f"{name}: no answer{times}{open_end}{_others(last)}", _next_of_silence(last))


def remarks(document: Document) -> Iterator[str]:
    """Yield what a person should know of exchanges that ended well: who else answered, and how often it was asked."""
    for one in document["exchanges"]:
        if one["answer"] is None:
            continue
        if one["transmissions"] > 1:
            busy = f": {count_of(one['busy'], 'time')} it was busy" if one["busy"] else ""
            yield f"{one['request']} was sent {count_of(one['transmissions'], 'time')}{busy}"
        if strays := _strays(one):
            yield f"{one['request']} was answered; besides, there came {strays}"


def _others(exchange: Mapping[str, Any]) -> str:
    """Return what is said of what came in place of an answer, "" of nothing."""
    strays = _strays(exchange)
    return f"; what came was no answer: {strays}" if strays else ""


def _strays(exchange: Mapping[str, Any]) -> str:
    """Return what came meanwhile that was no answer: ``2 from another address (10.0.0.7)``; "" for nothing."""
    found = []
    for reason, count in exchange["ignored"].items():
        if count:
            who = f" ({', '.join(exchange['others'])})" if reason == "other_node" else ""
            found.append(f"{count} {_IGNORED[reason]}{who}")
    return ", ".join(found)


_IGNORED = {
    "other_node": "from another address",
    "no_telegram": "no telegram",
    "malformed": "malformed",
    "of_a_list": "of lists",
    "other_request": "with another Index, SubIndex or Counter",
    "other_service": "of another service",
}


def _next_of(error: str) -> str:
    from nvscope.causes.parameters import NEXT_OF_ERRORS, PARAMETERS_REFUSED  # noqa: PLC0415  # the same

    asked = "check " + _lower(NEXT_OF_ERRORS.get(error, PARAMETERS_REFUSED.next_step))
    return f"{asked.removesuffix('.')}; --items asks for so many" if error == "ODErrorReplyItems" else asked


def _next_of_silence(exchange: Mapping[str, Any]) -> str:
    from nvscope.causes.parameters import PARAMETERS_UNANSWERED  # noqa: PLC0415  # the same

    if exchange["ignored"]["other_node"]:
        return "another node answered: perhaps the controller has several addresses, name that one"
    if exchange["ignored"]["other_request"]:
        return (
            "it answers, and not to this request: --timeout waits longer, as late answers to earlier ones do so; a "
            "controller that does not repeat the Counter of a request does so, too"
        )
    return "check " + _lower(PARAMETERS_UNANSWERED.next_step).removesuffix(".") + "; --timeout waits longer"


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def _wanted_size(document: Document) -> str:
    wanted = document["wanted"]
    if wanted is None or not wanted["elements"]:
        return ""
    return f" of {count_of(len(wanted['bytes']) // 2, 'byte')} in {count_of(wanted['items'], 'element')}"


def _left_alone(document: Document) -> str:
    return "; nothing was written" if document["verb"] == "write" else ""


def _name(document: Document) -> str:
    place = units.parameter(document["index"], document["subindex"])
    return f"{document['name']} ({place})" if document["name"] else place


def _partner(document: Document) -> str:
    where = units.endpoint(str(document["partner"]), document["port"])
    return f"{document['partner_name']} ({where})" if document["partner_name"] else where


def _bytes(value: Mapping[str, Any], most: int) -> str:
    digits = str(value["bytes"])
    shown = " ".join(digits[at : at + 2] for at in range(0, min(len(digits), 2 * most), 2))
    return f"{shown} …" if len(digits) > 2 * most else shown
