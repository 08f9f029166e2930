"""Addresses that two devices have: duplicate-address."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.ways import device_in_words
from nvscope.causes.words import lists_in_words, moment
from nvscope.enumeration import joined
from nvscope.findings.kind import Severity
from nvscope.findings.loss import COUNTER_ERRATIC, COUNTER_SCOPE, COUNTER_UNUSED
from nvscope.units import count_of

if TYPE_CHECKING:  # most plants have none
    from nvscope.tracker.evidence.shared_devices import SharedAddress

DUPLICATE_ADDRESS = CauseKind(
    "duplicate-address",
    "address twice",
    "Two devices have the same IP address: who sends to it reaches the one or the other, and what both send looks like "
    "one sender that does not count.",
    "Frames of one IP address from two hardware addresses that take turns, with ARP of both, or Counters, of lists or "
    "of requests, that are regular for each of them and not for both together.",
    "Unplug one of both devices, and give it an address of its own.",
    at_least=Severity.ERROR,
)

_OF_WHOLE_STREAMS = (COUNTER_UNUSED, COUNTER_SCOPE, COUNTER_ERRATIC)
"""What is said of a stream as a whole, whenever it began: two devices that count for themselves spoil it."""


def judge_duplicate_addresses(case: Case) -> Iterator[Explained]:
    """Explain everything of addresses that two devices have, one cause an address."""
    presence, seen = case.witness.presence, case.witness.shared_addresses
    if not presence.columns.shared.any():
        return
    from nvscope.tracker.evidence.shared_devices import shared_addresses  # noqa: PLC0415

    for shared in shared_addresses(presence, seen, case.facts.node_numbers, case.life.addresses_of):
        yield _draft(case, shared)


def _draft(case: Case, shared: SharedAddress) -> Explained:
    node, devices = shared.node, shared.devices
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
    checked = [f"hardware addresses {both} take turns, {count_of(turns, 'time')}", *shared.told_by]
    step = DUPLICATE_ADDRESS.next_step
    if shared.are_apart:
        vlans = joined(["none" if vlan < 0 else str(vlan) for one in devices for vlan in sorted(one.vlans)])
        checked.insert(0, f"each is in a VLAN of its own ({vlans}): networks that have the same addresses")
        step = "Look at one VLAN at a time: what two networks with the same addresses send looks like one sender."
    draft = Draft(
        DUPLICATE_ADDRESS, title, step, checked, lists, [node], since_ns=since_ns,
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
