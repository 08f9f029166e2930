"""Writes of web visualization pages as data: who wrote what over which value, and what became of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from dissectors import address
from dissectors.webvisu import Place
from nvscope.tracker.visu.writes import Write
from nvscope.view.documents.drawn import Drawn


def visu_write_rows(
    writes: Sequence[Write], node_names: Mapping[str, str] = MappingProxyType({}), *, secrets: bool = False
) -> Drawn[dict[str, Any]]:
    """Return a row a variable that was written, in the order of the frames; ``node_names`` are what people call nodes.

    Values of what is a password, or may be one, are null without ``secrets``.
    """

    def row_of(one: Write) -> dict[str, Any]:
        client, server = address.text(*one.client), address.text(*one.server)
        hidden = one.is_secret and not secrets
        return {
            "time_ns": str(one.time_ns),
            "frame": one.frame,
            "client": client,
            "client_name": node_names.get(client),
            "server": server,
            "server_name": node_names.get(server),
            "port": one.port,
            "variable": one.variable,
            "place": one.place.text if isinstance(one.place, Place) else one.place,
            "type": one.place.type_name if isinstance(one.place, Place) else None,
            "old": None if hidden else one.old,
            "new": None if hidden else one.new,
            "hidden": hidden,
            "old_known": one.old is not None,
            "outcome": one.outcome.value,
            "answer_frame": one.answer_frame or None,
            "status": one.status or None,
        }

    return Drawn(writes, row_of)
