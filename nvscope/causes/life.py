"""Life: whether a node goes on, told by its frames that are no telegrams of lists."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.findings.facts import Facts
from nvscope.tracker.evidence.presence import HARDWARE, HARDWARE_BITS, IP, Presence


class Life:
    """A look at who is there; all of it is what was seen up to now."""

    def __init__(self, presence: Presence, facts: Facts) -> None:
        self._presence = presence
        self._nodes = facts.state.keys.nodes

    def sent_between(self, node: int, since_ns: int, until_ns: int) -> bool:
        """Tell whether a node sent a frame that is no telegram of a list from one time to another."""
        numbers = self._numbers(node)
        return bool(len(numbers)) and self._presence.signs.seen_between(numbers, since_ns, until_ns)

    def is_heard(self, node: int) -> bool:
        """Tell whether a node ever sent a frame that is no telegram of a list."""
        numbers = self._numbers(node)
        return bool(len(numbers)) and bool(self._presence.columns.others[numbers].any())

    def numbers_of_ip(self, node: int) -> I64:
        """Return the number of a node's IP address among those that were seen; none where it was not."""
        return self._find(node, ())

    def hardware_of(self, node: int) -> list[int]:
        """Return the hardware addresses that a node's IP packets came from, in the order of their first frames."""
        words = self._presence.pairs.words
        own = np.flatnonzero(self._is_of(node, words[0], words[1]))
        order = own[np.argsort(self._presence.pair_columns.column("first_frame")[own], kind="stable")]
        return list(dict.fromkeys((words[2][order] & HARDWARE_BITS).tolist()))

    def hardware_of_all(self, nodes: Sequence[int]) -> list[int]:
        """Return the hardware addresses that the IP packets of some nodes came from, each once, rising."""
        own = np.array(nodes)[np.array(nodes) < len(self._nodes)]
        sought = {*zip(self._nodes.high[own].tolist(), self._nodes.low[own].tolist(), strict=True)}
        return sorted(one for one, addresses in self.addresses_of.items() if not sought.isdisjoint(addresses))

    def _is_of(self, node: int, high: U64, low: U64) -> Bool:
        own: Bool = (high == self._nodes.high[node]) & (low == self._nodes.low[node])
        return own

    @cached_property
    def addresses_of(self) -> Mapping[int, Collection[tuple[int, int]]]:
        """The IP addresses, as upper and lower half, whose packets came from each hardware address."""
        from nvscope.tracker.evidence.shared_devices import addresses_by_hardware  # noqa: PLC0415  # few plants need it

        return addresses_by_hardware(self._presence)

    @cached_property
    def _shared_hardware(self) -> set[int]:
        """The hardware addresses with several IP addresses: a router's tell nothing of a node."""
        return {one for one, several in self.addresses_of.items() if len(several) > 1}

    def _numbers(self, node: int) -> I64:
        """Return the numbers of a node's addresses: its IP address, and hardware addresses that are its alone."""
        known = self.hardware_of(node) if node < len(self._nodes) else ()
        return self._find(node, [one for one in known if one not in self._shared_hardware])

    def _find(self, node: int, hardware: Sequence[int]) -> I64:
        """Return the numbers of a node's IP address and of some hardware addresses, as far as they were seen."""
        if node >= len(self._nodes):
            return np.empty(0, np.int64)
        kinds = np.array([IP, *[HARDWARE] * len(hardware)], np.uint64)
        high = np.array([int(self._nodes.high[node]), *[0] * len(hardware)], np.uint64)
        low = np.array([int(self._nodes.low[node]), *hardware], np.uint64)
        found = self._presence.addresses.find(kinds, high, low)
        return found[found >= 0]
