"""What a controller answers to requests of WebVisu pages, without sockets: a request in, bytes of a reply out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from xml.sax.saxutils import quoteattr

from msgspec import Struct
from msgspec.structs import replace

from dissectors.webvisu import STRING, UNREADABLE, Place, Request, read_request
from dissectors.webvisu import Entry as AskedEntry
from nvscope.definition.visu_encoding import LATIN
from nvscope.plc.visu.http_reply import reply
from nvscope.plc.visu.http_request import Flaw, HttpRequest
from nvscope.plc.visu.query import Bytes, formatted, is_query, name_of_query, page_query, why_no_query
from nvscope.plc.visu.table import Entry, ServedTable
from nvscope.plc.visu.url import beside
from nvscope.plc.visu.value import shown
from nvscope.units import count_of

_HTML, _XML, _TEXT = "text/html", "text/xml", "text/plain"
_PAGE = "<html><head><title>WebVisu</title></head><body>{applet}</body></html>\n"
_APPLET = '<applet code="webvisu.class"><param name="ENCODINGSTRING" value="{encoding}"></applet>'
_DONE, _REFUSED = b"|0|", b"|1|"
_SURPLUS = "0"
_LIST = """<?xml version="1.0" encoding="ISO-8859-1"?>
<{tag}>
\t<time-stamp>{stamp}</time-stamp>
\t<variablelist>
{rows}\t</variablelist>
</{tag}>
"""


class Result(Enum):
    """What became of a request."""

    ANSWERED = "answered"
    REFUSED = "refused"
    FILE = "file"
    NOT_FOUND = "not_found"
    MALFORMED = "malformed"
    SILENT = "silent"
    DROPPED = "dropped"


class Touched(Struct, frozen=True):
    """A variable that a request was about; ``before`` is its value as it was read, or was before it was written.

    ``entry`` is None where no variable lies there. ``wanted`` and ``after`` are of writes, None of reads.
    """

    place: Place
    entry: Entry | None
    before: str | None = None
    wanted: str | None = None
    after: str | None = None


class Handled(Struct, frozen=True):
    """A request and what became of it: the bytes that are sent ``delay_ns`` later, and whether that ends it.

    ``status`` is 0 where nothing is answered. ``declared`` is how many variables it says it is about. ``why`` is
    what is wrong with one that is malformed; it may not be printable.
    """

    result: Result
    method: str
    target: str
    status: int
    reply: bytes
    closes: bool
    delay_ns: int = 0
    writes: bool = False
    declared: int = 0
    touched: Sequence[Touched] = ()
    why: str = ""


Now = Callable[[Place], str | None]
"""Says what a variable of a table has now, as it goes onto the wire; None where nobody knows."""


class Controller:
    """The variables of a table and their values, which writes change, or which are what ``now`` says.

    ``results`` counts requests by what became of them.
    """

    def __init__(self, table: ServedTable, now: Now | None = None) -> None:
        self._table = table
        self._values = {place: entry.value for place, entry in table.by_place.items()}
        self._now: Now = now or self._values.get
        self._by_bytes: dict[Bytes, Place] = {}
        for place in table.by_place:
            self._by_bytes.setdefault(place[:3], place)
        applet = "" if table.encoding == LATIN else _APPLET.format(encoding=table.encoding.name)
        self._files = {table.path: (_HTML, _PAGE.format(applet=applet).encode("ascii"))}
        if table.lists:
            system, own = ([one for one in table.entries if one.is_of_system is which] for which in (True, False))
            stamp = table.stamp
            self._files[beside(table.path, "plc_visu.xml")] = _XML, _listed("visualisation", stamp, own)
            self._files[beside(table.path, "visu_ini.xml")] = _XML, _listed("visu-ini-file", stamp, system)
        self.results: Counter[Result] = Counter()

    def received(self, request: HttpRequest | Flaw) -> Handled:
        """Take a request, or what is none."""
        if isinstance(request, Flaw):
            nothing = HttpRequest("", "", closes=True)
            handled = self._plain(Result.MALFORMED, nothing, request.value, _reason(request))
        elif request.method == "POST":
            handled = self._posted(request)
        elif request.method in ("GET", "HEAD"):
            handled = self._fetched(request)
        else:
            handled = self._plain(Result.MALFORMED, request, 405, "GET and POST alone")
        self.results[handled.result] += 1
        return handled

    def _fetched(self, request: HttpRequest) -> Handled:
        query = page_query(request.target, self._by_bytes) if request.method == "GET" else None
        if query is not None and query.asked.entries:
            return self._asked(request, query.asked, query.formats)
        if is_query(request.target):
            why, request = why_no_query(request.target), replace(request, target=name_of_query(request.target))
            return replace(self._plain(Result.MALFORMED, request, 400, "no address that can be asked for"), why=why)
        found = self._files.get(request.target.partition("?")[0])
        if found is None:
            return self._plain(Result.NOT_FOUND, request, 404, "no such file")
        return self._handled(Result.FILE, request, 200, found[1], found[0])

    def _posted(self, request: HttpRequest) -> Handled:
        if request.target.partition("?")[0] != self._table.path:
            return self._plain(Result.NOT_FOUND, request, 404, "no such page")
        asked = read_request(request.body)
        # Who counts wrong in a read gets what he names, as controllers do; nothing is written by guess.
        is_guess = asked is not None and asked.writes and (asked.is_miscounted or asked.may_write_more)
        if asked is None or not asked.entries or is_guess:
            handled = self._plain(Result.MALFORMED, request, 400, "no request of a WebVisu page")
            return handled if asked is None else replace(handled, why=_why_not_answered(asked))
        return self._asked(request, asked)

    def _asked(self, request: HttpRequest, asked: Request, formats: Sequence[str] = ()) -> Handled:
        """Answer what a page asks for; with ``formats``, an older one, by a URL."""
        entries = [self._table.by_place.get(one.place) for one in asked.entries if isinstance(one.place, Place)]
        known = [one.settings for one in entries if one is not None]
        delay_ns = max((one.delay for one in known), default=0)
        status = next((one.status for one in known if one.status != 200), 200)
        if any(one.silent or one.drop for one in known):
            result = Result.SILENT if any(one.silent for one in known) else Result.DROPPED
            touched = tuple(Touched(*pair) for pair in zip(_places(asked.entries), entries, strict=True))
            return Handled(
                result, request.method, request.target, 0, b"", result is Result.DROPPED, delay_ns, asked.writes,
                asked.declared, touched,
            )  # fmt: skip
        if status != 200:
            touched = tuple(Touched(*pair) for pair in zip(_places(asked.entries), entries, strict=True))
            return self._handled(
                Result.REFUSED, request, status, b"", _HTML, delay_ns=delay_ns, asked=asked, touched=touched
            )  # fmt: skip
        if asked.writes:
            return self._written(request, asked, entries, delay_ns)
        surplus = sum(one.surplus for one in known)
        return self._read(request, asked, entries, delay_ns, surplus, formats)

    def _read(
        self, request: HttpRequest, asked: Request, entries: Sequence[Entry | None], delay_ns: int, surplus: int,
        formats: Sequence[str],
    ) -> Handled:  # fmt: skip
        touched = tuple(
            Touched(place, entry, self._now(place) if entry is not None and entry.is_readable else None)
            for place, entry in zip(_places(asked.entries), entries, strict=True)
        )
        if asked.query:
            lines = [
                UNREADABLE if one.before is None else formatted(one.place, one.before, wanted)
                for one, wanted in zip(touched, formats, strict=True)
            ]
            return self._handled(
                Result.ANSWERED, request, 200, "\n".join(lines).encode("iso-8859-1"), _TEXT, delay_ns=delay_ns,
                asked=asked, touched=touched,
            )  # fmt: skip
        values = [UNREADABLE if one.before is None else one.before for one in touched]
        values = [*values, *[_SURPLUS] * surplus][: max(len(values) + surplus, 0)]
        content = "".join(f"|{value}" for value in values) + "|" * self._table.trailing_pipe
        return self._handled(
            Result.ANSWERED, request, 200, content.encode("iso-8859-1"), _HTML, delay_ns=delay_ns, asked=asked,
            touched=touched,
        )  # fmt: skip

    def _written(self, request: HttpRequest, asked: Request, entries: Sequence[Entry | None], delay_ns: int) -> Handled:
        """All of it or nothing: nobody documents what controllers do with half of it."""
        wanted = [one.value or "" for one in asked.entries]
        places = _places(asked.entries)
        may = all(
            entry is not None and entry.is_writable and _fits(entry.place, value)
            for entry, value in zip(entries, wanted, strict=True)
        )
        touched = []
        for place, entry, value in zip(places, entries, wanted, strict=True):
            before = None if entry is None else self._now(place)
            after = value if may and entry is not None and not entry.settings.stuck else before
            if may and after is not None:
                self._values[place] = after
            touched.append(Touched(place, entry, before, value, after))
        status, content = (200, _DONE if may else _REFUSED) if not asked.query else (200 if may else 403, b"")
        return self._handled(
            Result.ANSWERED if may else Result.REFUSED, request, status, content, _HTML, delay_ns=delay_ns,
            asked=asked, touched=tuple(touched),
        )  # fmt: skip

    def _plain(self, result: Result, request: HttpRequest, status: int, text: str) -> Handled:
        handled = self._handled(result, request, status, f"{text}\n".encode("ascii"), _TEXT)
        return replace(handled, why=text)

    def _handled(
        self, result: Result, request: HttpRequest, status: int, content: bytes, kind: str, *, delay_ns: int = 0,
        asked: Request | None = None, touched: Sequence[Touched] = (),
    ) -> Handled:  # fmt: skip
        closes = request.closes or not self._table.keep_alive
        sent = reply(self._table, status, content, kind, closes=closes, bodiless=request.method == "HEAD")
        writes, declared = (asked.writes, asked.declared) if asked is not None else (False, 0)
        return Handled(
            result, request.method, request.target, status, sent, closes, delay_ns, writes, declared, touched
        )  # fmt: skip


def _why_not_answered(asked: Request) -> str:
    if not asked.entries:
        return "it asks for no variable"
    if asked.rest:
        return f"it has {count_of(asked.rest, 'field')} more than its variables"
    if asked.ambiguous:
        return "a | in its texts: nobody knows what belongs to which"
    return f"it declares {count_of(asked.declared, 'variable')} and has {len(asked.entries)}"


def _places(entries: Iterable[AskedEntry]) -> list[Place]:
    return [one.place for one in entries if isinstance(one.place, Place)]


def _fits(place: Place, value: str) -> bool:
    """Tell whether a controller takes a value for a variable."""
    if place.type == STRING:
        return len(value) < place.size
    return shown(place, value).value is not None


def _listed(tag: str, stamp: str, entries: Iterable[Entry]) -> bytes:
    rows = "".join(
        f"\t\t<variable name={quoteattr(one.name)}>{one.place.text}</variable>\n" for one in entries
    )  # fmt: skip
    return _LIST.format(tag=tag, stamp=_escaped(stamp), rows=rows).encode("iso-8859-1", "xmlcharrefreplace")


def _escaped(text: str) -> str:
    return quoteattr(text)[1:-1]


def _reason(flaw: Flaw) -> str:
    return {Flaw.NO_HTTP: "no request", Flaw.BODY_TOO_LONG: "too much", Flaw.HEAD_TOO_LONG: "too much"}[flaw]
