"""The fields of VLAN tags, of which a frame may have several: ``vlan.id``, ``ieee8021ad.id``. Names are Wireshark's."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import Any

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from dissectors.headers import TYPE_SERVICE_TAG, VLAN, VLAN_TYPES
from dissectors.layout import gather_bytes
from dissectors.link import LAYOUTS_WITH_TYPE, MAX_VLAN_TAGS
from nvscope.expression.typed_columns import FieldType
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import FrameRows

_WORD_BYTES = 2
_ID = 0x0FFF
_SEVERAL = "of several, -T fields writes all, -Y asks each, other forms have the outermost"


def _words(rows: FrameRows, own: I64, at: Any) -> I64:
    """Return the words of two bytes at a place of some frames, 0 where they were not captured."""
    packets, row = rows.packets, rows.row[own]
    captured = at + _WORD_BYTES <= packets.captured[row]
    words = np.zeros(len(own), np.int64)
    where = (packets.offset[row] + at)[captured]
    words[captured] = gather_bytes(packets.data, where, _WORD_BYTES).view(">u2").reshape(-1)
    return words


def _tags(rows: FrameRows) -> Iterator[tuple[I64, I64, I64]]:
    """Yield, from the outermost tags inwards, which frames have one there, of which type, and the number in it."""
    links = rows.packets.link[rows.row]
    at, kind = np.zeros(len(rows), np.int64), np.zeros(len(rows), np.int64)
    for link, layout in LAYOUTS_WITH_TYPE.items():
        own = np.flatnonzero(links == link)
        at[own], kind[own] = layout.size_bytes, _words(rows, own, layout.offset_of("type"))
    own = np.arange(len(rows))
    for _ in range(MAX_VLAN_TAGS):
        room = at[own] + _WORD_BYTES <= rows.packets.captured[rows.row[own]]
        own = own[room & np.isin(kind[own], VLAN_TYPES)]
        if not len(own):
            return
        yield own, kind[own], _words(rows, own, at[own] + VLAN.offset_of("tci")) & _ID
        kind[own] = _words(rows, own, at[own] + VLAN.offset_of("type"))
        at[own] += VLAN.size_bytes


def _numbers(rows: FrameRows, types: Collection[int], place: int) -> I64:
    """Return the numbers in the tags of some types that ``place`` others of these surround; -1 without one."""
    numbers, seen = np.full(len(rows), -1), np.zeros(len(rows), np.int64)
    for own, kind, number in _tags(rows):
        meant = np.isin(kind, list(types))
        here = meant & (seen[own] == place)
        numbers[own[here]] = number[here]
        seen[own[meant]] += 1
    return numbers


def _reader(types: Collection[int], place: int) -> Callable[[FrameRows], I64]:
    return lambda rows: np.maximum(_numbers(rows, types, place), 0)


def _known(types: Collection[int], place: int) -> Callable[[FrameRows], Bool]:
    return lambda rows: _numbers(rows, types, place) >= 0


def _tag_field(name: str, label: str, text: str, types: Collection[int]) -> TelegramField:
    first, *further = (
        TelegramField(
            name, FieldType.UNSIGNED, label, f"{text}; {_SEVERAL}", _reader(types, place), _known(types, place)
        )
        for place in range(MAX_VLAN_TAGS)
    )
    return replace(first, further=tuple(further))


VLAN_FIELDS = (
    _tag_field(
        "vlan.id", "VLAN", "number in the tag (IEEE 802.1Q)", [kind for kind in VLAN_TYPES if kind != TYPE_SERVICE_TAG]
    ),
    _tag_field("ieee8021ad.id", "Service VLAN", "number in the tag of a provider (IEEE 802.1ad)", [TYPE_SERVICE_TAG]),
)
