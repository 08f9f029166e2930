"""Requests that were answered, as data for people: who asked for what, and what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nvscope.definition.visu_encoding import LATIN, Encoding
from nvscope.definition.visu_passwords import Passwords
from nvscope.plc.visu.controller import Controller, Handled, Result, Touched
from nvscope.plc.visu.value import shown

MOST_SHOWN = 8
"""So many variables of a request are told."""


def request_row(
    handled: Handled, passwords: Passwords, address: str, port: int, time_ns: int, encoding: Encoding = LATIN
) -> dict[str, Any]:
    """Return a request: who asked for which variables, and what became of it; of passwords, no values.

    ``encoding`` is that of texts.
    """
    return {
        "time_ns": time_ns,
        "address": address,
        "port": port,
        "result": handled.result.value,
        "method": handled.method,
        "target": handled.target,
        "status": handled.status,
        "why": handled.why,
        "writes": handled.writes,
        "declared": handled.declared,
        "delay_ns": handled.delay_ns,
        "touched": len(handled.touched),
        "variables": [_row(one, passwords, encoding) for one in handled.touched[:MOST_SHOWN]],
    }


def _row(one: Touched, passwords: Passwords, encoding: Encoding) -> dict[str, Any]:
    name = one.entry.name if one.entry else ""
    secret = passwords.lie_in(one.place)

    def text(raw: str | None) -> str | None:
        return None if raw is None or secret else shown(one.place, raw, encoding).text

    return {
        "name": name or one.place.text,
        "is_known": one.entry is not None,
        "secret": secret,
        "is_read": one.before is not None,
        "before": text(one.before),
        "wanted": text(one.wanted),
        "after": text(one.after),
        "is_stuck": one.wanted is not None and one.after != one.wanted,
    }


def counts(controller: Controller) -> Mapping[str, int]:
    """Return how many requests there were, by what became of them."""
    results = {result.value: controller.results[result] for result in Result}
    return {"requests": sum(results.values()), **results}
