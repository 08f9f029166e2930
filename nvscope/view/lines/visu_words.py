"""WebVisu messages in words: what is asked for, written and answered, with the names that are known."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from dissectors.web_protocols import WebProtocol
from dissectors.webvisu import MOST_DECLARED, UNREADABLE, Entry, Request, read_reply
from dissectors.webvisu_page import encoding_said
from nvscope import units
from nvscope.definition.visu_encoding import LATIN, encoding_of
from nvscope.enumeration import first_few
from nvscope.tracker.readings.form import HIDDEN
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind, Outcome, VisuBatch
from nvscope.tracker.visu.names import Naming, UnreadList, UnusableEncoding, is_secret, name_of, text_of

_MOST_SHOWN, _MOST_INDEXES = 8, 4
_NOT_CHANGED = 304
_LISTS = (b"<variablelist", b"<symbolvarlist")
_BREAKS = re.compile(rb"[\r\n]\||\|[\r\n]")


class Variable(NamedTuple):
    """A variable of a message: what it is called, and its value, None where there is none."""

    entry: Entry
    name: str
    value: str | None


def variables_of(part: VisuBatch, message: int, *, secrets: bool = False) -> list[Variable]:
    """Return the variables of a message with their values; values that may be secret only with ``secrets``.

    A STRING without a name may be a password, too.
    """
    names = part.namings[int(part.messages.naming[message])]
    return [
        one if one.value is None else one._replace(value=shown(one.entry, names, one.value, secrets=secrets))
        for one in said_of(part, message)
    ]


def said_of(part: VisuBatch, message: int) -> list[Variable]:
    """Return the variables of a message with their values, none of them hidden; characters of texts are bytes."""
    asked = int(part.messages.asked[message])
    if asked < 0:
        return []
    request, names = part.requests[asked], part.namings[int(part.messages.naming[message])]
    values: list[str | None] = [entry.value for entry in request.entries]
    if part.messages.kind[message] == Kind.REPLY:
        values = [None] * len(request.entries)
        if part.messages.outcome[message] in (Outcome.DONE, Outcome.MISCOUNTED) and not request.query:
            start, stop = int(part.messages.start[message]), int(part.messages.stop[message])
            read = read_reply(request, part.data[start:stop]).values
            values[: len(read)] = [UNREADABLE if value is None else value for value in read]
    return [Variable(entry, name_of(entry, names), value) for entry, value in zip(request.entries, values, strict=True)]


def shown(entry: Entry, names: Naming, value: str, *, secrets: bool = False) -> str:
    """Return a value as people read it, or what stands in its place where it is, or may be, a password."""
    return HIDDEN if not secrets and value != UNREADABLE and is_secret(entry, names) else text_of(entry, names, value)


_PROTOCOLS = {
    WebProtocol.WEBVISU_V3: "WebVisu of CODESYS V3", WebProtocol.TWINCAT: "TwinCAT ADS web service",
    WebProtocol.TLS: "TLS", WebProtocol.HTTP2: "HTTP/2", WebProtocol.OTHER: "no HTTP",
}  # fmt: skip


_CUT = {
    Outcome.UNREAD: "not read: too long, or in an unknown coding",
    Outcome.MALFORMED: "not read: its chunks are malformed",
}  # fmt: skip


def protocol_words(protocol: WebProtocol) -> str:
    """Return what people call another protocol on these ports."""
    return _PROTOCOLS[protocol]


def message_words(part: VisuBatch, message: int, *, secrets: bool = False, values: bool = True) -> str:
    """Return what a message is, in a line, values that may be secret only with ``secrets``; it may not be printable.

    Without ``values``, it does not tell the variables, either.
    """
    messages = part.messages
    kind, asked = Kind(int(messages.kind[message])), int(messages.asked[message])
    if kind in (Kind.GAP, Kind.REPLY_GAP):
        return f"{units.count_of(int(messages.gap_bytes[message]), 'byte')} missing"
    if kind is Kind.CUT:
        return _CUT.get(Outcome(int(messages.outcome[message])), "cut: bytes are missing")
    if kind in (Kind.OTHER_BYTES, Kind.OTHER_REPLY_BYTES):
        differ = units.count_of(int(messages.fields[message]), "byte")
        sent = "sent again with other bytes"
        if messages.asked_frame[message]:
            who = "the client" if kind is Kind.OTHER_BYTES else "the controller"
            sent = f"since frame {messages.asked_frame[message]}, {who} {sent}"
        return f"{sent} ({differ}): what came first is shown, the receiver may have the others"
    if kind is Kind.UNBOUNDED:
        return "no one number as Content-Length, or malformed chunks: nobody knows where it ends"
    if kind is Kind.OTHER:
        return f"{protocol_words(WebProtocol(int(messages.spoken[message])))}, not decoded"
    if kind is Kind.NAMES:
        return _list(part, message)
    if kind is Kind.PAGE:
        return _page(part, message)
    request = part.requests[asked]
    if kind is Kind.LEFT:
        return f"client closes its side, frame {messages.asked_frame[message]} waits for a reply"
    if kind is Kind.UNCLEAR:
        return f"nobody knows what answers frame {messages.asked_frame[message]}"
    if kind is Kind.PART:
        return f"part of a {'write' if request.writes else 'request'}, the rest was never sent"
    if kind is Kind.REFUSED:
        return f"HTTP status {messages.status[message]}, frame {messages.asked_frame[message]} was refused unread"
    if kind is Kind.UNANSWERED:
        unanswered = f"no reply to frame {messages.asked_frame[message]}"
        if messages.outcome[message] != Outcome.GIVEN_UP:
            reset = part.is_reset_by_server(int(messages.row[message]), int(messages.pair[message]))
            return f"{unanswered}, connection {'reset' if reset else 'ended'} by the controller"
        waited_ns = int(messages.latency_ns[message])
        return f"{unanswered}, given up{f' after {units.duration(waited_ns)}' if waited_ns > 0 else ''}"
    told = "; ".join(_shown(variables_of(part, message, secrets=secrets))) if values else ""
    if kind is Kind.REPLY:
        return _reply(part, message, request, told)
    declared = _declared(request)
    miscounted = f", declares {declared}" if request.is_miscounted else ""
    if request.ambiguous:
        miscounted = f" or more, declares {declared}, ambiguous"
    verb = "write" if request.writes else "read"
    counted = f"{units.count_of(len(request.entries), 'variable')}{miscounted}{_indexes(request)}"
    counted += _flaws(part.data[int(messages.start[message]) : int(messages.stop[message])])
    return f"{verb} {counted}{f': {told}' if told else ''}"


def _indexes(request: Request) -> str:
    """Return the indexes of variables where they do not run from 0 on: some clients number otherwise."""
    numbers = [entry.number for entry in request.entries]
    if request.query or numbers == list(range(len(numbers))):
        return ""
    return f", {'index' if len(numbers) == 1 else 'indexes'} {first_few(list(map(str, numbers)), _MOST_INDEXES)}"


def _flaws(body: bytes) -> str:
    """Return what is odd about the body of a request, and tolerated: line breaks at its ends are not."""
    tidy = body.strip(b"\r\n")
    flaws = (", no | at its end" if tidy and not tidy.endswith(b"|") else "", ", line breaks in it")
    return "".join(flaws if _BREAKS.search(tidy) else flaws[:1])


def _declared(request: Request) -> str:
    """Return how many variables a request says it has."""
    return f"{MOST_DECLARED} or more" if request.declared == MOST_DECLARED else str(request.declared)


def _list(part: VisuBatch, message: int) -> str:
    """Return what came where a list of variables was asked for."""
    messages = part.messages
    status = int(messages.status[message])
    if status == _NOT_CHANGED:
        return f"HTTP status {status}, the file that may list variables has not changed"
    if status != OK:
        return f"HTTP status {status}, no variable list"
    content = part.data[int(messages.start[message]) : int(messages.stop[message])]
    size = units.count_of(len(content), "byte")
    flaw = part.list_flaws.get(message)
    if isinstance(flaw, UnreadList):
        return f"variable list{f' ({size})' if flaw.is_whole else ''}, cannot be used: {flaw.why}"
    text = content.replace(b"\0", b"").lower()
    return f"variable list ({size})" if any(one in text for one in _LISTS) else f"XML, no variable list ({size})"


def _page(part: VisuBatch, message: int) -> str:
    """Return what a page says of its texts, and what is made of that."""
    start, stop = int(part.messages.start[message]), int(part.messages.stop[message])
    said, flaw = encoding_said(part.data[start:stop]) or "", part.list_flaws.get(message)
    if isinstance(flaw, UnusableEncoding):
        return f"page, its texts are in an encoding that cannot be used: {flaw.why}"
    encoding = part.namings[int(part.messages.naming[message])].encoding or LATIN
    try:
        differs = encoding != encoding_of(said)
    except ValueError:
        differs = True
    return f"page, its texts are in {said}{f'; they are read as {encoding.name}' if differs else ''}"


def _reply(part: VisuBatch, message: int, request: Request, told: str) -> str:
    messages = part.messages
    latency_ns = int(messages.latency_ns[message])
    took = " (seen before its request)" if latency_ns == UNMEASURED_NS else f" ({units.duration(latency_ns)})"
    outcome = Outcome(int(messages.outcome[message]))
    if outcome is Outcome.STATUS:
        return f"HTTP status {messages.status[message]}{took}"
    if outcome is Outcome.UNREAD:
        why = part.data[int(messages.start[message]) : int(messages.stop[message])].decode("latin-1")
        return f"reply not read, {why or 'it is too long'}{took}"
    if outcome is Outcome.REFUSED:
        return f"refused{took}"
    if request.writes:
        return f"written{took}"
    if outcome is Outcome.AMBIGUOUS:
        return (
            f"{messages.fields[message]} values for {units.count_of(len(request.entries), 'variable')}: ambiguous{took}"
        )
    if outcome is Outcome.MISCOUNTED:
        counted = f"{units.count_of(int(messages.fields[message]), 'value')} for {len(request.entries)}"
        return f"{counted}{f': {told}' if told else ''}{took}"
    return f"reply{took}: {told}" if told else f"reply{took}"


def _shown(variables: list[Variable]) -> Iterator[str]:
    for variable in variables[:_MOST_SHOWN]:
        yield variable.name if variable.value is None else f"{variable.name} = {variable.value}"
    if len(variables) > _MOST_SHOWN:
        yield f"… {units.count(len(variables) - _MOST_SHOWN)} more"
