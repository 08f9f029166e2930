"""Truth about CAN: what was put on the buses of a scenario, in the words of a report that knows the definitions.

Which frame belongs to which sending is known here, not inferred: a sending that is seen in part is an incomplete cycle,
except for the last one, behind which none began.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dissectors.batch import I64
from dissectors.can.canopen import PREDEFINED
from dissectors.can.error import CLASSES
from dissectors.can.frame import EXTENDED
from nvscope.findings.can import DLC_MISMATCH, INCOMPLETE_CYCLE
from nvscope.findings.can_bus import ERROR_FRAMES
from nvscope.findings.cob_ids import CANOPEN_COLLISION
from nvscope.list_key import ListKey
from nvscope.simulate.can.frame_table import CanFrames, CanFrameTable, frames_bits
from nvscope.simulate.can.tables import CanList
from nvscope.simulate.expected import ExpectedFindings, expect_intervals, nominal_of
from nvscope.simulate.ordering import order_by
from nvscope.simulate.scenario import Scenario

_NO_FIGURES = ("lost", "duplicates", "overtaken", "restarts")


class _Identity(NamedTuple):
    """An identifier of a bus; extended ones come behind the others."""

    channel: str
    extended: bool
    identifier: int


@dataclass(frozen=True, slots=True)
class _Place:
    """Where an identifier belongs: the list by its first identifier, and what its definition says, if there is one."""

    base: int
    subindex: int = 0
    plan: CanList | None = None


def can_lists(
    scenario: Scenario, table: CanFrameTable, end_ns: int, found: ExpectedFindings
) -> Iterator[dict[str, Any]]:
    """Yield what is true of the lists on CAN, in the order of a report; their findings go to ``found``.

    ``end_ns`` is the end of the capture.
    """
    frames = table.frames
    places = _places(scenario)
    lists: dict[ListKey, list[tuple[_Place, _Identity, I64]]] = {}
    remote = dict(_by_identity(scenario, frames, np.flatnonzero(frames.remote)))
    for identity, rows in _by_identity(scenario, frames, np.flatnonzero(~frames.error & ~frames.remote)):
        place = _Place(identity.identifier)
        if not identity.extended:
            place = places.get(identity.identifier, place)
        first = place.base | (EXTENDED.mask if identity.extended else 0)
        lists.setdefault(ListKey.can(identity.channel, first), []).append((place, identity, rows))
    for key, streams in sorted(lists.items(), key=lambda entry: entry[0]):
        rows = np.sort(np.concatenate([rows for _, _, rows in streams]))
        streams.sort(key=lambda entry: entry[0].subindex)
        told = [
            _stream(frames, key, place, identity, rows, len(remote.get(identity, ())), end_ns, found)
            for place, identity, rows in streams
        ]
        plan = streams[0][0].plan
        if plan is not None:
            _expect_cycles(scenario, frames, key, plan, found)
            taken = sum(len(rows) for _, identity, rows in streams if _is_of_canopen(identity.identifier))
            found.add(CANOPEN_COLLISION, key, None, None, taken)
        last = str(frames.ts_ns[rows[-1]])
        yield {
            "key": str(key),
            "transport": key.transport.value,
            "channel": key.port,
            "id": key.identifier & ~EXTENDED.mask,
            "name": None if plan is None else plan.name,
            "senders": [],
            "readers": [],
            "diag": {
                "nSendCount": len(rows),
                "tLastSend": last,
                "nReceiveCount": len(rows),
                "tLastReceive": last,
                "nWriteCount": len(rows),
                "nErrorCount": 0,
                "nAcknowledges": 0,
            },
            "counters": {},
            "nodes": [],
            "streams": told,
            "designed": _designed(scenario, table, key, plan),
        }


def can_buses(scenario: Scenario, table: CanFrameTable, found: ExpectedFindings) -> Iterator[dict[str, Any]]:
    """Yield what is true of the buses on which anything is seen; error frames go to ``found``."""
    frames = table.frames
    rates = {bus.channel: bus.bit_rate for bus in scenario.bus}
    for number, channel in enumerate(scenario.channels):
        own = frames.take(frames.channel == number)
        if not len(own):
            continue
        nominal, fast = frames_bits(own)
        errors = own.identifier[own.error]
        found.add(ERROR_FRAMES, None, None, None, len(errors))
        classes = {bit.name: int(np.count_nonzero(errors & np.uint32(bit.mask))) for bit in CLASSES}
        yield {
            "channel": channel,
            "frames": len(own),
            "bits": int(nominal.sum()),
            "fast_bits": int(fast.sum()),
            "designed": {
                "bit_rate": rates.get(channel),
                "error_frames": len(errors),
                "errors": {name: count for name, count in classes.items() if count},
                "bus_off": sum(off.channel == channel for off in scenario.bus_off),
            },
        }


def _places(scenario: Scenario) -> dict[int, _Place]:
    """Return where the identifiers of 11 bits belong of which a definition tells."""
    places: dict[int, _Place] = {}
    for plan in scenario.can_list:
        for subindex in range(len(plan.data_bytes) if plan.has_definition else 0):
            places.setdefault(plan.cob_id + subindex, _Place(plan.cob_id, subindex, plan))
    return places


def _is_of_canopen(cob_id: int) -> bool:
    return any(service.first <= cob_id <= service.last for service in PREDEFINED)


def _by_identity(scenario: Scenario, frames: CanFrames, rows: I64) -> Iterator[tuple[_Identity, I64]]:
    """Yield the rows of each identifier, as captured."""
    key = frames.channel[rows].astype(np.int64) << 32 | frames.word[rows] & np.uint32(EXTENDED.mask | 0x1FFF_FFFF)
    words, group = np.unique(key, return_inverse=True)
    order = order_by(group)
    cuts = np.cumsum(np.bincount(group, minlength=len(words)))[:-1]
    for word, own in zip(words.tolist(), np.split(order, cuts), strict=False):
        identity = _Identity(scenario.channels[word >> 32], bool(word & EXTENDED.mask), word & 0x1FFF_FFFF)
        yield identity, rows[own]


def _stream(
    frames: CanFrames, key: ListKey, place: _Place, identity: _Identity, rows: I64, remote: int, end_ns: int,
    found: ExpectedFindings,
) -> dict[str, Any]:  # fmt: skip
    plan, times, length = place.plan, frames.ts_ns[rows], frames.length[rows]
    intervals: I64 = np.diff(times)
    nominal_ns = plan.interval_ns if plan is not None and plan.mode == "cyclic" else nominal_of(intervals)
    if plan is None:
        wrong = int((length[1:] != length[:-1]).sum())
    else:
        wrong = int((length != plan.data_bytes[place.subindex]).sum())
    found.add(DLC_MISMATCH, key, None, place.subindex, wrong)
    if nominal_ns is not None and len(intervals):
        where = (key, None, place.subindex)
        expect_intervals(where, intervals, nominal_ns, end_ns - int(times[-1]), found)
    return {
        "node": None,
        "subindex": place.subindex,
        "cob_id": identity.identifier,
        "extended": identity.extended,
        "telegrams": len(rows),
        "remote": remote,
        "counter_scope": None,
        **dict.fromkeys(_NO_FIGURES),
        "interval_ns": {
            "count": len(intervals),
            "min": int(intervals.min()) if len(intervals) else None,
            "max": int(intervals.max()) if len(intervals) else None,
        },
        "length": int(length[-1]),
        "checksum": None,
    }


def _expect_cycles(scenario: Scenario, frames: CanFrames, key: ListKey, plan: CanList, found: ExpectedFindings) -> None:
    """Expect a finding for sendings of which some PDOs are missing."""
    if len(plan.data_bytes) < 2 or plan.mode != "cyclic":
        return
    for number, entry in enumerate(scenario.can_list):
        if entry.channel == key.port and entry.cob_id == plan.cob_id:
            own = frames.take(frames.entry == number)
            _, telegrams = np.unique(own.sending, return_counts=True)
            # One that is seen from its middle on may have begun before the capture.
            begins = 1 if len(own) and own.identifier[0] != plan.cob_id else 0
            found.add(INCOMPLETE_CYCLE, key, None, None, int((telegrams[begins:-1] < len(plan.data_bytes)).sum()))


def _designed(scenario: Scenario, table: CanFrameTable, key: ListKey, plan: CanList | None) -> dict[str, int] | None:
    """Return how many PDOs of a list were sent, and how many of them are never seen."""
    for number, entry in enumerate(scenario.can_list):
        if plan is not None and entry.channel == key.port and entry.cob_id == plan.cob_id:
            seen = int((table.frames.entry == number).sum())
            return {"telegrams_sent": table.sent_of[number], "telegrams_lost": table.sent_of[number] - seen}
    return None
