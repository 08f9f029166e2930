"""Changes of variables, and variables at a time, as data (schemas ``nvscope.history/1`` and ``nvscope.at/1``).

Values are as in ``nvscope.vars/1``; absolute times are nanoseconds as decimal strings, durations numbers in ns.
"""

from __future__ import annotations

from typing import Any

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import type_text
from nvscope.definition.value import value_of
from nvscope.tracker.history import Entry, History
from nvscope.tracker.moment import LastTelegram, Moment
from nvscope.tracker.summary import list_key
from nvscope.version import __version__
from nvscope.view.variables import plain_value, value_text

HISTORY_SCHEMA = "nvscope.history/1"
AT_SCHEMA = "nvscope.at/1"
TOOL = {"name": "nvscope", "version": __version__}


def change_row(entry: Entry) -> dict[str, Any]:
    """Return one element of one telegram; ``old`` is None in its first one."""
    track = entry.track
    element, stream = track.layout.elements[entry.place], track.stream
    kind, before = element.type, entry.before
    return {
        "frame": entry.frame,
        "time_ns": str(entry.time_ns),
        "list": list_key(stream.port, stream.index),
        "sender": stream.sender,
        "name": element.name,
        "changed": entry.changed,
        "old": None if before is None else plain_value(value_of(kind, before)),
        "new": plain_value(value_of(kind, entry.now)),
        "old_text": None if before is None else value_text(kind, before),
        "new_text": value_text(kind, entry.now),
    }


def change_summary(history: History) -> list[dict[str, Any]]:
    """Return how often and how fast each variable changed, by list, SubIndex, sender and place."""
    tracks = sorted(
        history.tracks.values(),
        key=lambda track: (track.stream.port, track.stream.index, track.stream.subindex, track.stream.order),
    )
    return [
        {
            "list": list_key(track.stream.port, track.stream.index),
            "list_name": track.layout.list.name,
            "name": track.layout.elements[place].name,
            "type": type_text(track.layout.elements[place].type),
            "sender": track.stream.sender,
            "subindex": track.stream.subindex,
            "telegrams": track.telegrams,
            "first_ns": str(track.first_ns),
            "last_ns": str(track.last_ns),
            "changes": int(track.changes[at]),
            "changed_ns": str(int(track.changed_ns[at])) if track.changes[at] else None,
            "shortest_ns": _known(int(track.shortest_ns[at])),
            "longest_ns": _known(int(track.longest_ns[at])),
        }
        for track in tracks
        for at, place in enumerate(track.places)
    ]


def _known(duration_ns: int) -> int | None:
    return None if duration_ns < 0 else duration_ns


def at_document(moment: Moment, layouts: Layouts, time_ns: int) -> dict[str, Any]:
    """Return what all variables of the defined lists were at a moment.

    A row without ``value`` is a variable that had not been sent until then; its sender is None where nobody sends its
    list in the whole capture. ``age_ns`` tells how old the telegram was at ``time_ns``.
    """
    rows: list[dict[str, Any]] = []
    by_place = {
        (last.stream.port, last.stream.index, last.stream.subindex, last.stream.sender): last
        for last in moment.streams.values()
    }
    senders: dict[tuple[int, int], dict[str, tuple[bool, int]]] = {}
    for stream in moment.known.values():
        senders.setdefault((stream.port, stream.index), {})[stream.sender] = stream.order
    for key, entry in sorted(layouts.lists(), key=lambda listed: listed[0]):
        own = senders.get(key, {})
        for layout in layouts.telegrams_of(*key) or ():
            known: list[str | None] = [*sorted(own, key=own.__getitem__)]
            for sender in known or [None]:
                last = None if sender is None else by_place.get((*key, layout.subindex, sender))
                common = {
                    "list": list_key(*key), "list_name": entry.name, "sender": sender, "subindex": layout.subindex
                }  # fmt: skip
                rows += [
                    {
                        **common,
                        "name": element.name,
                        "type": type_text(element.type),
                        **_state(last, offset, place, time_ns),
                    }
                    for place, (offset, element) in enumerate(layout.spans())
                ]
    return {
        "schema": AT_SCHEMA,
        "tool": TOOL,
        "time_ns": str(time_ns),
        "capture": {
            "start_ns": None if moment.start_ns is None else str(moment.start_ns),
            "end_ns": None if moment.end_ns is None else str(moment.end_ns),
        },
        "last_frame": moment.last_frame or None,
        "variables": rows,
    }


def _state(last: LastTelegram | None, offset: int, place: int, time_ns: int) -> dict[str, Any]:
    if last is None:
        return dict.fromkeys(("value", "text", "frame", "sent_ns", "age_ns"))
    kind = last.layout.elements[place].type
    raw = last.data[offset : offset + kind.size_bytes].tobytes()
    return {
        "value": plain_value(value_of(kind, raw)),
        "text": value_text(kind, raw),
        "frame": last.frame,
        "sent_ns": str(last.time_ns),
        "age_ns": time_ns - last.time_ns,
    }
