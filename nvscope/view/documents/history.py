"""Changes of variables, and variables at a time, as data (schemas ``nvscope.history/1`` and ``nvscope.at/1``).

Values are as in ``nvscope.vars/1``, texts of changes with all digits that count. Absolute times are nanoseconds as
decimal strings, durations numbers in ns.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout, known_fronts, undescribed
from nvscope.definition.value import value_of
from nvscope.definition.variables import type_text
from nvscope.list_key import ListKey
from nvscope.tracker.variables.history import Entry, History
from nvscope.tracker.variables.moment import LastTelegram, Moment
from nvscope.version import head
from nvscope.view.documents.variables import ReadRows, filter_told
from nvscope.view.value_texts import exact_text, json_value, unit_of, value_text

if TYPE_CHECKING:
    from nvscope.tracker.readings.value_history import ReadEntry

HISTORY_SCHEMA = "nvscope.history/1"
AT_SCHEMA = "nvscope.at/1"

_Place = tuple[ListKey, int, str]
"""List, SubIndex and sender."""


def change_row(entry: Entry) -> dict[str, Any]:
    """Return one element of one telegram; ``old`` is None in its first one."""
    track = entry.track
    element, stream = track.layout.elements[entry.place], track.stream
    kind = element.type
    old, new = None if entry.before is None else value_of(kind, entry.before), value_of(kind, entry.now)
    return {
        "frame": entry.frame,
        "time_ns": str(entry.time_ns),
        "list": str(stream.list),
        "list_name": track.layout.list.name,
        "sender": stream.sender,
        "subindex": stream.subindex,
        "name": element.name,
        "changed": entry.changed,
        "unit": unit_of(kind),
        "old": None if old is None else json_value(kind, old),
        "new": json_value(kind, new),
        "old_text": None if old is None else exact_text(kind, old),
        "new_text": exact_text(kind, new),
    }


def row_of_change(entry: Entry | ReadEntry, *, secrets: bool = False) -> dict[str, Any]:
    """Return the row of a change, whoever tells it; passwords on pages are hidden without ``secrets``."""
    if isinstance(entry, Entry):
        return change_row(entry)
    from nvscope.view.documents.read_rows import row_of_reading  # noqa: PLC0415

    return row_of_reading(entry, secrets=secrets)


def change_summary(history: History) -> list[dict[str, Any]]:
    """Return how often and how fast each variable changed, by list, SubIndex, sender and place.

    A stream has the variables of each of its layouts, in the order in which these came.
    """
    tracks = sorted(
        history.tracks.values(),
        key=lambda track: (track.stream.list, track.stream.subindex, track.stream.order),
    )
    return [
        {
            "list": str(track.stream.list),
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


def at_document(
    moment: Moment,
    layouts: Layouts | None,
    time_ns: int,
    *,
    keys: Collection[ListKey] | None = None,
    expression: str | None = None,
    read_ones: ReadRows = MappingProxyType({}),
) -> dict[str, Any]:
    """Return what all variables of the defined lists were at a moment; ``keys`` are these lists, None for all.

    ``read_ones`` are rows of variables whose values come one by one, which stand behind them.

    A row without ``text`` is a variable of which there was no telegram until then, and ``missing`` says why: it was
    sent ``later`` or not at all by this sender; or by nobody (then there is no ``sender``) in the whole capture: ``not
    sent``, ``not chosen`` by the filter, or ``not decoded``, since the telegrams had another shape or were cut.
    ``age_ns`` tells how old the telegram was at ``time_ns``. ``expression`` is that of the filter.
    """
    rows: list[dict[str, Any]] = []
    by_place: dict[_Place, LastTelegram] = {
        (last.stream.list, last.stream.subindex, last.stream.sender): last for last in moment.streams.values()
    }
    senders: dict[ListKey, dict[str, tuple[bool, int]]] = {}
    for stream in moment.known.values():
        senders.setdefault(stream.list, {})[stream.sender] = stream.order
    everything = {*senders, *moment.read.lists}
    wanted = [
        key
        for defined, _ in (layouts.lists() if layouts else ())
        if keys is None or defined in keys
        for key in [one for one in everything if layouts and layouts.key_of(one) == defined] or [defined]
    ]
    for key in sorted(wanted):
        assert layouts
        own = senders.get(key, {})
        missing = "later" if own else _missing(moment, key, expression)
        for subindex, sender, last, layout in _telegrams_at(key, layouts, by_place, sorted(own, key=own.__getitem__)):
            common = {"list": str(key), "list_name": layout.list.name, "sender": sender, "subindex": subindex}
            rows += [
                {
                    **common,
                    "name": element.name,
                    "type": type_text(element.type),
                    **_state(last, offset, place, time_ns, missing),
                }
                for place, (offset, element) in enumerate(layout.spans())
            ]
    return {
        **head(AT_SCHEMA),
        "time_ns": str(time_ns),
        "capture": {
            "start_ns": None if moment.start_ns is None else str(moment.start_ns),
            "end_ns": None if moment.end_ns is None else str(moment.end_ns),
        },
        "last_frame": moment.last_frame or None,
        "filter": filter_told(expression, moment.read.chosen, moment.read.telegrams),
        "variables": rows,
        **{key: list(told) for key, told in read_ones.items() if told},
    }


def _missing(moment: Moment, key: ListKey, expression: str | None) -> str:
    """Return why no telegram of a list was decoded in the whole capture."""
    if key not in moment.read.lists:
        return "not sent"
    return "not decoded" if expression is None or key in moment.read.chosen_lists else "not chosen"


def _telegrams_at(
    key: ListKey, layouts: Layouts, by_place: Mapping[_Place, LastTelegram], senders: Sequence[str]
) -> Iterator[tuple[int, str | None, LastTelegram | None, TelegramLayout]]:
    """Yield SubIndex, sender, last telegram and its layout of one list, in the order of the rows.

    Where a list has several definitions, the layout is the one that a telegram had; what was not sent until then is as
    the definition has it that the sender's last telegram had, else as the first. Of a list that is left out, what was
    not sent is only what is known of its first telegram, and all bytes behind that.
    """
    found: list[tuple[int, int, str | None, LastTelegram | None, TelegramLayout]] = []
    sent: dict[str | None, dict[int, LastTelegram]] = {}
    for place, telegram in by_place.items():
        if place[0] == key:
            sent.setdefault(place[2], {})[place[1]] = telegram
    for order, sender in enumerate(senders or [None]):
        own = sent.get(sender, {})
        newest = max(own.values(), key=lambda last: last.frame, default=None)
        expected = {layout.subindex: layout for layout in _expected(layouts, key, newest)}
        for subindex in expected.keys() | own.keys():
            last = own.get(subindex)
            found.append((subindex, order, sender, last, last.layout if last else expected[subindex]))
    for subindex, _, sender, last, layout in sorted(found, key=lambda one: one[:2]):
        yield subindex, sender, last, layout


def _expected(layouts: Layouts, key: ListKey, newest: LastTelegram | None) -> Sequence[TelegramLayout]:
    """Return the telegrams that a sender should send, of which the newest is known, if any."""
    candidates = layouts.candidates_of(key)
    if candidates:
        own = (telegrams for telegrams in candidates if newest and telegrams[0].list is newest.layout.list)
        return next(own, candidates[0])
    if newest is not None:
        return ()
    front, cause = known_fronts(layouts.partly_of(key)).by_subindex[0]
    elements = (*front.elements, *([undescribed(cause, 1)] if cause else []))
    return [TelegramLayout(front.list, front.subindex, elements)]


def _state(last: LastTelegram | None, offset: int, place: int, time_ns: int, missing: str) -> dict[str, Any]:
    if last is None:
        return {**dict.fromkeys(("unit", "value", "text", "frame", "sent_ns", "age_ns")), "missing": missing}
    kind = last.layout.elements[place].type
    raw = last.data[offset : offset + kind.size_bytes].tobytes()
    return {
        "unit": unit_of(kind),
        "value": json_value(kind, value_of(kind, raw)),
        "text": value_text(kind, raw),
        "frame": last.frame,
        "sent_ns": str(last.time_ns),
        "age_ns": time_ns - last.time_ns,
        "missing": None,
    }
