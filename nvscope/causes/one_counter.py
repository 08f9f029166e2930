"""Senders of a list that count on in one Counter: a program that sends from two addresses, or over two network cards.

What is missing of the one, the other has sent: it is no loss.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.symptoms import Symptoms
from nvscope.findings.facts import Facts

LEAST_ODD = 3
"""Two that count each for itself meet once in 65 536 telegrams."""

LEAST_PERCENT = 80
"""So many of the steps of both that are not by 1 go on where the other one stands; the others are losses of both."""


class _Sender(NamedTuple):
    list: int
    node: int


class OneCounter:
    """Which senders count with which others."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts

    @cached_property
    def with_whom(self) -> Mapping[tuple[int, int], Mapping[int, tuple[int, int]]]:
        """By number of the list and node: the others, with how many steps of both are not by 1, and go on there."""
        takeovers = self._facts.state.lists.counter_takeovers
        log = takeovers.events
        if not len(log.keys):
            return {}
        senders = {one.stream: _Sender(entry.number, one.node) for entry, one in self._facts.streams()}
        own, other, number = log.keys.high.tolist(), log.keys.low.tolist(), log.rows.column("count").tolist()
        steps, regular = (takeovers.columns.column(name) for name in ("steps", "regular"))
        odd: Counter[_Sender] = Counter()
        filled: Counter[tuple[_Sender, _Sender]] = Counter()
        for stream in {one for one in own if one in senders}:
            odd[senders[stream]] += int(steps[stream] - regular[stream])
        for stream, by, count in zip(own, other, number, strict=True):
            if stream in senders and by in senders:
                filled[senders[stream], senders[by]] += count
        found: dict[tuple[int, int], dict[int, tuple[int, int]]] = {}
        for one, by in filled:
            if all(
                odd[a] >= LEAST_ODD and 100 * filled[a, b] >= LEAST_PERCENT * odd[a] for a, b in ((one, by), (by, one))
            ):
                told = odd[one] + odd[by], filled[one, by] + filled[by, one]
                found.setdefault(one, {})[by.node] = told
        return found

    def of(self, symptoms: Symptoms) -> Bool:
        """Tell which symptoms are of senders that count with another one, in lists of which that is so."""
        found: Bool = np.zeros(len(symptoms.node), np.bool_)
        for number, node in self.with_whom:
            found |= (symptoms.list == number) & (symptoms.node == node)
        return found
