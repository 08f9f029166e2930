"""What follows from the frames of a CAN bus: bit rate, load, which identifiers take it, errors, CANopen nodes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.can.frame import EXTENDED_MASK
from dissectors.can.pdo import EXTENDED
from nvscope.definition.buses import Buses, BusSettings
from nvscope.tracker.can.canopen import NO_EVIDENCE, CanOpenNode, Evidence
from nvscope.tracker.can.errors import BusErrors
from nvscope.tracker.can.identifiers import CanIdentifiers
from nvscope.tracker.can.load import BEFORE_1970, rows_by_channel
from nvscope.tracker.can.state import BusState
from nvscope.tracker.holes import Holes

F64 = np.ndarray[tuple[int], np.dtype[np.float64]]

_S_NS = 1_000_000_000
_NOTHING = np.empty(0, np.int64)


class BitRate(Struct, frozen=True):
    """Bits per second of a bus, and of the data phase of CAN FD; ``given``, or else found from the frames."""

    nominal: int
    data: int | None
    given: bool

    def seconds(self, bits: float, fast_bits: float) -> float:
        """Return how long bits take; those of the data phase count as none where its bit rate is unknown."""
        return bits / self.nominal + (fast_bits / self.data if self.data else 0.0)


@dataclass(frozen=True, slots=True)
class BusLoad:
    """Which part of the time a bus was busy, in percent, counted as ``canbusload`` does: bits over bit rate.

    ``mean`` is that from the first frame to the last (of a second, where they are no further apart), ``peak`` that of
    the busiest second, which began at ``peak_ns``, and ``worst`` what that one could have had with stuff bits
    wherever its frames can have some. ``second_ns`` is when each second with frames began, ``second`` its load,
    ``second_worst`` the worst it could have had, columns of shape (n,). ``partial`` where there are bits at a data bit
    rate that is unknown: they are not counted.
    """

    mean: float
    peak: float
    peak_ns: int
    worst: float
    partial: bool
    second_ns: I64 = field(compare=False)
    second: F64 = field(compare=False)
    second_worst: F64 = field(compare=False)


class IdentifierBits(Struct, frozen=True):
    """The frames of an identifier and their bits; ``share`` is their part of all its busy time, else of its bits."""

    cob_id: int
    extended: bool
    frames: int
    bits: int
    fast_bits: int
    first_ns: int
    last_ns: int
    first_frame: int
    share: float


class CanBusSummary(Struct, frozen=True):
    """One channel: its frames, and the bits of its seconds.

    ``seconds`` counts those with frames; ``peak_bits`` are the bits of the busiest one
    (exact stuffing), ``worst_bits`` those that it could have had at most. ``bits`` and ``fast_bits`` are sums over all,
    exact; the latter at the data bit rate of CAN FD. ``load`` is None where no bit rate is known. ``identifiers`` are
    those with frames, the largest share first. ``errors`` is None without error frames. ``canopen`` tells of which
    nodes there is evidence.
    """

    channel: str
    frames: int
    seconds: int
    bits: int
    fast_bits: int
    peak_bits: int
    worst_bits: int
    bit_rate: BitRate | None
    load: BusLoad | None
    identifiers: Sequence[IdentifierBits]
    errors: BusErrors | None
    canopen_nodes: Sequence[CanOpenNode]
    canopen: Evidence = NO_EVIDENCE


def summarize_buses(
    state: BusState, name: Callable[[int], str], buses: Buses | None = None, lists: Collection[int] = (),
    holes: Holes | None = None,
) -> list[CanBusSummary]:  # fmt: skip
    """Return the buses of a state by name; ``buses`` are the bit rates that are given, ``lists`` COB-IDs of lists.

    ``name`` returns what a channel is called; ``holes`` are the times in which nobody listened.
    """
    given, rows = buses or Buses(), _rows_with_frames(state)
    identifiers = rows_by_channel(state.load.identifiers.keys)
    errors, nodes = state.errors.by_channel(), state.canopen.by_channel(lists)
    evidence = state.canopen.evidence(lists)
    found = [
        _bus(
            state, number, name(number), given, rows[number], identifiers.get(number, _NOTHING), holes or Holes(),
            errors.get(number), nodes.get(number, []), evidence.get(number, NO_EVIDENCE),
        )
        for number in rows
    ]  # fmt: skip
    return sorted(found, key=lambda bus: bus.channel)


def _rows_with_frames(state: BusState) -> dict[int, I64]:
    """Return the seconds with frames of each channel; of one that has none, as in a window, its last second."""
    frames, found = state.load.columns.frames, {}
    for number, rows in rows_by_channel(state.load.keys).items():
        own = rows[frames[rows] > 0]
        found[number] = own if len(own) else rows[-1:]
    return found


def _percent(rate: BitRate, bits: I64, fast_bits: I64) -> F64:
    fast = fast_bits * (100 / rate.data) if rate.data else 0.0
    load: F64 = bits * (100 / rate.nominal) + fast
    return load


def _bus(
    state: BusState,
    number: int,
    channel: str,
    given: Buses,
    rows: I64,
    identifiers: I64,
    holes: Holes,
    errors: BusErrors | None,
    nodes: Sequence[CanOpenNode],
    evidence: Evidence,
) -> CanBusSummary:
    columns = state.load.columns
    exact, fast = columns.exact_bits[rows], columns.fast_bits[rows]
    rate = _rate(state, number, given.of(channel))
    if rate is None:
        busiest, load = int(exact.argmax()), None
    else:
        began_ns = (state.load.keys.low[rows].astype(np.int64) - BEFORE_1970) * _S_NS
        percent = _percent(rate, exact, fast)
        busiest = int(percent.argmax())
        worst = _percent(rate, columns.worst_bits[rows], columns.worst_fast_bits[rows])
        busy_s = rate.seconds(int(exact.sum()), int(fast.sum()))
        partial = bool(fast.any()) and not rate.data
        mean = 100 * busy_s / _duration_s(state.load.identifiers, identifiers, number, holes)
        for column in (began_ns, percent, worst):
            column.flags.writeable = False
        load = BusLoad(
            mean, float(percent[busiest]), int(began_ns[busiest]), float(worst[busiest]), partial,
            began_ns, percent, worst,
        )  # fmt: skip
    return CanBusSummary(
        channel, int(columns.frames[rows].sum()), int(np.count_nonzero(columns.frames[rows])), int(exact.sum()),
        int(fast.sum()), int(exact[busiest]), int(columns.worst_bits[rows][busiest]), rate, load,
        _identifiers(state, identifiers, rate, exact.sum(keepdims=True), fast.sum(keepdims=True)), errors,
        tuple(nodes), evidence,
    )  # fmt: skip


def _rate(state: BusState, number: int, given: BusSettings) -> BitRate | None:
    if given.bit_rate is not None:
        return BitRate(given.bit_rate, given.data_bit_rate, True)
    found = state.load.back_to_back.rate(number)
    return None if found is None else BitRate(found, given.data_bit_rate, False)


def _duration_s(identifiers: CanIdentifiers, own: I64, channel: int, holes: Holes) -> float:
    """Return how long it was watched from the first frame of a channel to its last, of whatever identifiers."""
    columns, left_out = identifiers.columns, identifiers.left_out
    beyond = np.flatnonzero(left_out.keys.high == np.uint64(channel))
    first_ns = np.append(columns.first_ns[own], left_out.rows.first_ns[beyond])
    last_ns = np.append(columns.last_ns[own], left_out.rows.last_ns[beyond])
    if not len(first_ns):
        return 1.0
    start_ns, end_ns = int(first_ns.min()), int(last_ns.max())
    return max(1.0, (end_ns - start_ns - holes.within_ns(start_ns, end_ns)) / _S_NS)


def _identifiers(
    state: BusState, own: I64, rate: BitRate | None, all_bits: I64, all_fast: I64
) -> tuple[IdentifierBits, ...]:
    columns = state.load.identifiers.columns
    own = own[columns.frames[own] > 0]
    keys = state.load.identifiers.keys.low[own]
    bits, fast = columns.bits[own], columns.fast_bits[own]
    part = _percent(rate, bits, fast) if rate else (bits + fast).astype(np.float64)
    # Of all bits of the bus: those of identifiers that are not told apart are some too.
    whole = _percent(rate, all_bits, all_fast) if rate else (all_bits + all_fast).astype(np.float64)
    share = part * (100 / max(float(whole[0]), 1e-9))
    order = np.lexsort((keys, -share))
    figures = [
        columns.column(name)[own] for name in ("frames", "bits", "fast_bits", "first_ns", "last_ns", "first_frame")
    ]
    told = (column[order].tolist() for column in (keys, *figures, share))
    return tuple(
        IdentifierBits(word & EXTENDED_MASK, bool(word & EXTENDED), *row) for word, *row in zip(*told, strict=True)
    )  # fmt: skip
