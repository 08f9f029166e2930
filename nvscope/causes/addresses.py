"""Addresses that two devices have: duplicate-address."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dissectors.batch import Bool
from dissectors.keys import KeyTable
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.ways import device_in_words
from nvscope.causes.words import lists_in_words, moment
from nvscope.findings.kind import Severity
from nvscope.findings.loss import COUNTER_ERRATIC, COUNTER_SCOPE, COUNTER_UNUSED
from nvscope.tracker.evidence.presence import HARDWARE_BITS
from nvscope.tracker.evidence.shared_addresses import ALL_DEVICES, ALL_LISTS
from nvscope.units import count_of

DUPLICATE_ADDRESS = CauseKind(
    "duplicate-address",
    "address twice",
    "Two devices have the same IP address: who sends to it reaches the one or the other, and what both send looks like "
    "one sender that does not count.",
    "Frames of one IP address from two hardware addresses that take turns, with ARP of both, or Counters that are "
    "regular for each of them and not for both together.",
    "Unplug one of both devices, and give it an address of its own.",
    at_least=Severity.ERROR,
)

_LEAST_ALTERNATIONS = 3
_MOST_IPS = 2  # a hardware address with more of them is a router's
_REPEATED_PERCENT = 80
_REGULAR_PERCENT = 90
_LEAST_STEPS = 3
_OF_WHOLE_STREAMS = (COUNTER_UNUSED, COUNTER_SCOPE, COUNTER_ERRATIC)
"""What is said of a stream as a whole, whenever it began: two devices that count for themselves spoil it."""


class _Device(NamedTuple):
    """A hardware address that sends from an address others have, too; ``alternations`` are its turns behind others."""

    hardware: int
    first_frame: int
    first_ns: int
    last_ns: int
    alternations: int


class _Pairs:
    """Which addresses came from which hardware, looked up once for all: a flood makes very many of them."""

    def __init__(self, case: Case) -> None:
        high, low, device, _ = case.witness.presence.pairs.words
        self._hardware = (device & HARDWARE_BITS).tolist()
        self._rows: dict[tuple[int, int], list[int]] = defaultdict(list)
        for row, place in enumerate(zip(high.tolist(), low.tolist(), strict=True)):
            self._rows[place].append(row)
        self._routers = {one for one, several in case.life.addresses_of.items() if len(several) > _MOST_IPS}

    def of(self, high: int, low: int) -> dict[int, list[int]]:
        """Return the rows of an address by hardware address, routers left out."""
        rows: dict[int, list[int]] = defaultdict(list)
        for row in self._rows[high, low]:
            if self._hardware[row] not in self._routers:
                rows[self._hardware[row]].append(row)
        return rows


def judge_duplicate_addresses(case: Case) -> Iterator[Explained]:
    """Explain everything of addresses that two devices have, one cause an address."""
    presence = case.witness.presence
    if not presence.columns.shared.any():
        return
    pairs = _Pairs(case)
    for node, number in case.life.ip_numbers:
        if not presence.columns.shared[number]:
            continue
        devices = _devices(case, number, pairs)
        if len(devices) < 2 or sum(one.alternations for one in devices) < _LEAST_ALTERNATIONS:
            continue
        if told := _told_by(case, number, devices):
            yield _draft(case, node, devices, told)


def _devices(case: Case, number: int, pairs: _Pairs) -> list[_Device]:
    """Return the devices that have an address, by their first frames: no routers, and none that only repeat."""
    presence = case.witness.presence
    _, high, low = (int(words[number]) for words in presence.addresses.words)
    found = []
    for own, of_pairs in pairs.of(high, low).items():
        if _repeats(case, high, low, own):
            continue
        columns = presence.pair_columns
        first = min(of_pairs, key=lambda row: int(columns.first_frame[row]))
        found.append(
            _Device(
                own, int(columns.first_frame[first]), int(columns.first_ns[first]),
                max(int(columns.last_ns[row]) for row in of_pairs),
                sum(int(columns.alternations[row]) for row in of_pairs),
            )
        )  # fmt: skip
    return sorted(found, key=lambda one: one.first_frame)


def _repeats(case: Case, high: int, low: int, hardware: int) -> bool:
    """Tell whether a device only sends again what another one has sent."""
    shared = case.witness.shared_addresses
    device = _find(shared.devices, _find(shared.addresses, high, low), hardware)
    if device < 0:
        return False
    telegrams, repeated = (int(shared.device_columns.column(name)[device]) for name in ("telegrams", "repeated"))
    return bool(telegrams) and 100 * repeated >= _REPEATED_PERCENT * telegrams


def _find(table: KeyTable, *words: int) -> int:
    """Return the number of one key, -1 where there is none."""
    if any(word < 0 for word in words):
        return -1
    return int(table.find(*(np.array([word], np.uint64) for word in words))[0])


def _told_by(case: Case, number: int, devices: list[_Device]) -> list[str]:
    """Return what tells two devices from one whose frames come by two ways; nothing where nothing does."""
    presence, told = case.witness.presence, []
    _, high, low = (words[number] for words in presence.addresses.words)
    claims = presence.claims.words
    own = claims[2][(claims[0] == high) & (claims[1] == low)].tolist()
    address = _find(case.witness.shared_addresses.addresses, int(high), int(low))
    counters = [_regular(case, address, one.hardware) for one in devices]
    together = _regular(case, address, int(ALL_DEVICES))
    if sum(one is not None and any(one) for one in counters) >= 2 and together is not None and not any(together):
        told.append("the counters of each of them are regular, those of both together are not")
    if sum(one.hardware in own for one in devices) >= 2:
        told.append("ARP tells both hardware addresses for it")
    return told


def _regular(case: Case, address: int, hardware: int) -> tuple[bool, bool] | None:
    """Tell whether a device counts regularly by stream, and over all that it sends; None where nobody knows."""
    shared = case.witness.shared_addresses
    if address < 0:
        return None
    words = shared.sequences.words
    own = (words[0] == np.uint64(address)) & (words[1] == np.uint64(hardware))
    whole = words[2] == ALL_LISTS
    found = []
    for chosen in (own & ~whole, own & whole):
        steps, regular = (int(shared.columns.column(name)[chosen].sum()) for name in ("steps", "regular"))
        found.append(steps >= _LEAST_STEPS and 100 * regular >= _REGULAR_PERCENT * steps)
        if not steps:
            return None
    return found[0], found[1]


def _draft(case: Case, node: int, devices: list[_Device], told: list[str]) -> Explained:
    since_ns = devices[1].first_ns
    lists = case.lists_of_node(node)
    last_ns = min(devices[0].last_ns, max(one.last_ns for one in devices[1:]))
    # What comes in pairs is one event.
    turns_each = min(one.alternations for one in devices)
    # Two that send one list spoil its interval: then the usual ones tell what is no pause.
    usual_ns = max((one.intervals.p99 or 0 for entry in lists for one in entry.streams), default=0)
    # A reader comes as often as what it reads.
    read = [entry for entry in case.facts.summary.lists if node in entry.readers]
    least_ns = max(slack_ns([*lists, *read]), usual_ns * PAUSE_PERCENT // 100)
    until_ns = case.end_of_many(since_ns, last_ns, turns_each, least_ns)
    both = " and ".join(device_in_words(one.hardware) for one in devices)
    turns = sum(one.alternations for one in devices)
    title = f"{'Two' if len(devices) == 2 else len(devices)} devices have the address {case.address(node)}"
    title += f" since {moment(case, since_ns)}" if until_ns is None else (
        f" from {moment(case, since_ns)} to {moment(case, until_ns)}"
    )  # fmt: skip
    if lists:
        title += f" ({lists_in_words(case, lists)})"
    checked = [f"hardware addresses {both} take turns, {count_of(turns, 'time')}", *told]
    draft = Draft(
        DUPLICATE_ADDRESS, title, DUPLICATE_ADDRESS.next_step, checked, lists, [node], since_ns=since_ns,
        until_ns=until_ns,
    )  # fmt: skip
    return draft, _of_address(case, node, since_ns)


def _of_address(case: Case, node: int, since_ns: int) -> Bool:
    """Tell which symptoms are of an address, be it as sender or as reader, and of lists that it alone sends.

    What was before the second device is not, but for what is said of whole streams.
    """
    symptoms = case.symptoms
    alone = [entry.number for entry in case.lists_of_node(node) if {stream.node for stream in entry.streams} == {node}]
    own: Bool = (symptoms.node == node) | (symptoms.peer == node)
    own |= (symptoms.node < 0) & np.isin(symptoms.list, alone)
    earlier = (symptoms.since_ns > 0) & (symptoms.time_ns < since_ns) & ~symptoms.of_kinds(*_OF_WHOLE_STREAMS)
    return own & ~earlier
