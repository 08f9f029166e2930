"""What was asked of a WebVisu, and what came of it, as data (schema ``nvscope.visu/1``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from msgspec import Struct

from dissectors.webvisu import Answer, Reply
from nvscope.definition.visu_encoding import Encoding
from nvscope.definition.visu_values import type_name
from nvscope.plc.visu.exchange import Ending, Exchange
from nvscope.plc.visu.value import shown
from nvscope.plc.visu.variables import KnownVariables, Variable
from nvscope.version import head

_SCHEMA = "nvscope.visu/1"

Verdict = Literal[
    "read", "written", "listed", "unreadable", "misfit", "differs", "unverified", "cancelled", "refused", "miscounted",
    "ambiguous", "no_visu", "no_page", "no_list", "silent", "undelivered", "broken", "no_http", "oversized",
]  # fmt: skip
"""What came of it all: the first three are good. Unreadable is what the controller says of a value, misfit one that is
none of its type; unverified is what was written, but not read back; no_visu is an answer that is none of a WebVisu of
V2.3."""

State = Literal["listed", "value", "unreadable", "missing", "hidden"]
"""What is known of the value of a variable. Missing: none came."""

Purpose = Literal["page", "list", "read", "write"]

_ENDED: dict[Ending, Verdict] = {
    Ending.SILENT: "silent", Ending.UNDELIVERED: "undelivered", Ending.BROKEN: "broken", Ending.NO_HTTP: "no_http",
    Ending.OVERSIZED: "oversized",
}  # fmt: skip
_ANSWERED: dict[Answer, Verdict] = {
    Answer.MISCOUNTED: "miscounted", Answer.AMBIGUOUS: "ambiguous", Answer.REFUSED: "refused", Answer.DONE: "read",
}  # fmt: skip


class Asked(Struct, frozen=True):
    """An exchange and what it was for: ``variables`` is how many it was about, ``fields`` how many values came."""

    purpose: Purpose
    exchange: Exchange
    variables: int = 0
    fields: int | None = None
    reply: Reply | None = None

    @property
    def verdict(self) -> Verdict:
        """What came of it; a write that is done is ``read`` as well."""
        if self.exchange.ending is not Ending.REPLIED:
            return _ENDED[self.exchange.ending]
        if self.exchange.status != 200:
            return "refused"
        if self.reply is None:
            return "no_visu" if self.purpose in ("read", "write") else "read"
        if self.reply.answer is Answer.DONE and None in self.reply.values:
            return "unreadable"
        return _ANSWERED[self.reply.answer]

    @property
    def row(self) -> dict[str, Any]:
        """The exchange as documents have it."""
        one = self.exchange
        return {
            "purpose": self.purpose,
            "method": one.method,
            "path": one.path,
            "variables": self.variables,
            "ended": one.ending.value,
            "status": one.status,
            "answer": self.reply.answer.value if self.reply else None,
            "fields": self.fields,
            "latency_ns": one.latency_ns,
            "why": one.why or None,
            "location": one.location or None,
        }


def value_row(
    variable: Variable, raw: str | None, encoding: Encoding, *, secrets: bool
) -> dict[str, Any] | None:  # fmt: skip
    """Return a value as JSON has it; None where there is none, or it is hidden."""
    if raw is None or (variable.is_secret and not secrets):
        return None
    return shown(variable.place, raw, encoding).row


def variable_row(
    variable: Variable, state: State, *, value: dict[str, Any] | None = None, before: dict[str, Any] | None = None,
    wanted: dict[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return a variable as JSON has it."""
    place = variable.place
    return {
        "name": variable.name or None,
        "ref": place.ref,
        "offset": place.offset,
        "size": place.size,
        "type_code": place.type,
        "type": type_name(place.type),
        "secret": variable.is_secret,
        "state": state,
        "value": value,
        "before": before,
        "wanted": wanted,
    }


def state_of(variable: Variable, values: Sequence[str | None], at: int, *, secrets: bool) -> State:
    """Return what is known of a variable by the values that came, in their order."""
    if at >= len(values):
        return "missing"
    if values[at] is None:
        return "unreadable"
    return "hidden" if variable.is_secret and not secrets else "value"


def document(
    verb: str, verdict: Verdict, *, at_ns: int, url: str, server: str, server_name: str, port: int,
    known: KnownVariables, encoding: Encoding, variables: Sequence[dict[str, Any]], exchanges: Sequence[Asked],
) -> dict[str, Any]:  # fmt: skip
    """Return the document."""
    return {
        **head(_SCHEMA),
        "at_ns": str(at_ns),
        "verb": verb,
        "outcome": verdict,
        "url": url,
        "server": server,
        "server_name": server_name or None,
        "port": port,
        "encoding": encoding.name,
        "lists": [one.row for one in known.sources],
        "variables": list(variables),
        "exchanges": [one.row for one in exchanges],
    }
