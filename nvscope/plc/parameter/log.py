"""Requests that were answered, as data for people: who asked for what, and what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nvscope.plc.parameter.controller import Controller, Handled, Result
from nvscope.plc.parameter.value import value_row


def request_row(handled: Handled, address: str, port: int, time_ns: int) -> dict[str, Any]:
    """Return a request: who asked for which parameter, and what became of it; values as ``value_row`` has them."""
    entry, request = handled.entry, handled.request
    kind = None if entry is None else entry.settings.type

    def value(data: bytes | None) -> dict[str, Any] | None:
        return None if data is None else value_row(kind, request.items, data)

    return {
        "time_ns": time_ns,
        "address": address,
        "port": port,
        "request": request.service.name,
        "index": request.index,
        "subindex": request.subindex,
        "name": entry.settings.name or None if entry else None,
        "result": handled.result.value,
        "answer": handled.answer.name if handled.answer else None,
        "delay_ns": handled.delay_ns,
        "before": value(handled.before),
        "wanted": value(request.data) if request.data else None,
        "after": value(handled.after),
    }


def counts(controller: Controller) -> Mapping[str, int]:
    """Return how many requests there were, by what became of them, and what was ignored, by why."""
    results = {result.value: controller.results[result] for result in Result}
    return {"requests": sum(results.values()), **results}
