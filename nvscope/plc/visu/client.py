"""Reads and writes of the variables of a controller, from the first request to what came of it all."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from msgspec.structs import replace

from dissectors.webvisu import STRING, Entry, Request, fields_in_reply, read_reply
from dissectors.webvisu_page import encoding_said
from nvscope.definition.visu_encoding import LATIN, Encoding, encoding_of
from nvscope.definition.visu_variables import VisuVariables, variables_in
from nvscope.plc.visu.body import MOST_AT_ONCE, read_body, write_body
from nvscope.plc.visu.document import Asked, Purpose, Verdict, document, state_of, value_row, variable_row
from nvscope.plc.visu.exchange import Ending
from nvscope.plc.visu.link import VisuLink
from nvscope.plc.visu.url import USUAL_PATHS, beside
from nvscope.plc.visu.value import fits, is_same
from nvscope.plc.visu.variables import KnownVariables, Variable, known_of

LISTS = "plc_visu.xml", "visu_ini.xml"
"""The lists that lie beside the page of every controller, unless somebody called the visualization otherwise."""

_OF_LISTS = ("silent", "undelivered", "broken", "no_http", "oversized")


class VisuClient:
    """Asks a controller, one thing after the other; documents have all that was asked so far.

    ``secrets``: passwords are shown. ``server_name`` is what people call the controller. ``encoding`` is that of texts;
    None: what the page says counts, which is asked for where a text has more than ASCII in it.
    """

    def __init__(
        self, link: VisuLink, *, secrets: bool = False, server_name: str = "", encoding: Encoding | None = None
    ) -> None:  # fmt: skip
        self._link, self._secrets, self._server_name = link, secrets, server_name
        self._encoding, self._has_page = encoding, False
        self._path = link.url.path
        self._asked: list[Asked] = []
        self.known = KnownVariables()

    def find_page(self) -> Verdict | None:
        """Look for the page where nobody said where it is; return why there is none, None where there is one."""
        if self._path:
            return None
        for path in USUAL_PATHS:
            asked = self._page_at(path)
            if asked.exchange.is_good or asked.exchange.ending is Ending.OVERSIZED:
                self._path = path
                return None
            if asked.exchange.ending is not Ending.REPLIED:
                return asked.verdict
        return "no_page"

    def _page_at(self, path: str) -> Asked:
        """Ask for the page; what it says of its texts counts, unless somebody said that."""
        exchange = self._link.get(path)
        if exchange.is_good:
            self._has_page = True
            said = encoding_said(exchange.body)
            try:
                self._encoding = self._encoding or (None if said is None else encoding_of(said))
            except ValueError as error:
                exchange = replace(exchange, why=str(error))
        asked = Asked("page", exchange)
        self._asked.append(asked)
        return asked

    def encoding_for(self, texts: Iterable[str]) -> Encoding:
        """Return the encoding of texts; the page is asked for it, once, where one of them has more than ASCII in it."""
        if self._encoding is None and not self._has_page and not all(text.isascii() for text in texts):
            self._has_page = True
            self._page_at(self._path)
        return self._encoding or LATIN

    def _encoding_of(self, values: Iterable[tuple[Variable, str | None]]) -> Encoding:
        """Return the encoding of the texts among values that are shown."""
        return self.encoding_for(
            raw for one, raw in values
            if raw is not None and one.place.type == STRING and (self._secrets or not one.is_secret)
        )  # fmt: skip

    def fetch_lists(self, names: Sequence[str] = LISTS) -> Verdict | None:
        """Fetch lists from beside the page; return why there are none, None where there is one."""
        lists: list[tuple[str, VisuVariables]] = []
        for name in names:
            path = beside(self._path, name)
            asked = Asked("list", self._link.get(path))
            self._asked.append(asked)
            if asked.exchange.is_good:
                found = variables_in(asked.exchange.body)
                if found.listed:
                    lists.append((self._link.url.text(path), found))
                elif found.unread:
                    self._asked[-1] = Asked("list", replace(asked.exchange, why=found.unread))
            elif asked.verdict in _OF_LISTS:
                return asked.verdict
        self.known = known_of(lists)
        return None if lists else "no_list"

    def listed(self, words: Sequence[str] = ()) -> dict[str, Any]:
        """Return the variables that are known, of some names where there are any (``KnownVariables.chosen``)."""
        return self.document("list", "listed", [variable_row(one, "listed") for one in self.known.chosen(words)])

    def forget(self) -> None:
        """Forget what was asked so far: documents are of what comes now."""
        self._asked.clear()

    def read(self, variables: Sequence[Variable]) -> dict[str, Any]:
        """Read variables, as many at once as a request may ask for; return what came of it.

        What goes wrong with one request ends it, unless the values of it are what is wrong.
        """
        verdict: Verdict = "read"
        values: list[str | None] = []
        for start in range(0, len(variables), MOST_AT_ONCE):
            some = variables[start : start + MOST_AT_ONCE]
            asked = self._read(some)
            if verdict in ("read", "unreadable") and asked.verdict != "read":
                verdict = asked.verdict
            values[start:] = [] if asked.reply is None else asked.reply.values
            if asked.verdict not in ("read", "unreadable"):
                break
        if verdict == "read" and not all(
            raw is None or fits(one.place, raw) for one, raw in zip(variables, values, strict=False)
        ):
            verdict = "misfit"
        encoding = self._encoding_of(zip(variables, values, strict=False))
        rows = [
            variable_row(
                one, state_of(one, values, at, secrets=self._secrets),
                value=value_row(one, values[at], encoding, secrets=self._secrets) if at < len(values) else None,
            )
            for at, one in enumerate(variables)
        ]  # fmt: skip
        return self.document("read", verdict, rows)

    def write(self, variable: Variable, value: str, agrees: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Read a variable, write it, and read it back, as far as each of them is worth it; return what came of it.

        ``value`` is as it goes onto the wire. ``agrees`` is given what is known before it is written, and says whether
        it is. What cannot be read is not written, unless the controller says that of the value alone, and neither is
        what holds no value of its type: something else lies there.
        """
        first = self._read([variable])
        if first.verdict not in ("read", "unreadable"):
            return self._written(first.verdict, variable, value, first)
        held = next(iter(_values(first)), None)
        if held is not None and not fits(variable.place, held):
            return self._written("misfit", variable, value, first)
        before = self._written("cancelled", variable, value, first)
        if not agrees(before):
            return before
        entry = Entry(0, variable.place, value)
        second = self._post("write", write_body(variable.place, value), Request(True, 1, (entry,)))
        if second.verdict != "read":
            return self._written(second.verdict, variable, value, first)
        third = self._read([variable])
        verdict: Verdict = "unverified"
        if third.verdict == "read" and third.reply is not None:
            found = third.reply.values[0] or ""
            verdict = "written" if is_same(variable.place, value, found) else "differs"
        elif third.verdict == first.verdict == "unreadable":
            # Whoever wrote it was told that it is written: of what can only be written, nobody can know more.
            verdict = "written"
        return self._written(verdict, variable, value, first, third)

    def _written(
        self, verdict: Verdict, variable: Variable, value: str, first: Asked, third: Asked | None = None
    ) -> dict[str, Any]:
        """Return the document of a write: of the read before it, and the one behind it where there was one."""
        before, after = (next(iter(_values(one)), None) for one in (first, third))
        state = state_of(variable, _values(third) or _values(first), 0, secrets=self._secrets)
        encoding = self._encoding_of((variable, raw) for raw in (before, value, after))
        row = variable_row(
            variable, state,
            value=value_row(variable, after, encoding, secrets=self._secrets),
            before=value_row(variable, before, encoding, secrets=self._secrets),
            wanted=value_row(variable, value, encoding, secrets=self._secrets),
        )  # fmt: skip
        return self.document("write", verdict, [row])

    def _read(self, variables: Sequence[Variable]) -> Asked:
        places = [one.place for one in variables]
        request = Request(False, len(places), tuple(Entry(at, place) for at, place in enumerate(places)))
        return self._post("read", read_body(places), request)

    def _post(self, purpose: Purpose, body: bytes, request: Request) -> Asked:
        exchange = self._link.post(self._path, body)
        asked = Asked(purpose, exchange, len(request.entries))
        if exchange.is_good:
            fields = fields_in_reply(exchange.body)
            # To a write, whatever is not its confirmation is a refusal; to a read, a page is no answer.
            is_answer = fields or request.writes or not exchange.body.strip(b"|\r\n ")
            reply = read_reply(request, exchange.body) if is_answer else None
            asked = Asked(purpose, exchange, len(request.entries), fields, reply)
        self._asked.append(asked)
        return asked

    def document(self, verb: str, verdict: Verdict, rows: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
        """Return the document of what was asked so far."""
        url = self._link.url
        return document(
            verb, verdict, at_ns=time.time_ns(), url=url.text(self._path), server=self._link.address,
            server_name=self._server_name, port=url.port, known=self.known, encoding=self._encoding or LATIN,
            variables=rows, exchanges=self._asked,
        )  # fmt: skip


def _values(asked: Asked | None) -> Sequence[str | None]:
    return asked.reply.values if asked is not None and asked.reply is not None else ()
