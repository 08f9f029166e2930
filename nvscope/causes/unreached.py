"""Lists to one reader that their sender cannot reach any more: it asks for the reader's address (ARP), in vain.

A stack that finds nobody at an address holds back what is sent to it, so that nothing of the list comes: that is the
reader's silence, half a minute after it began, and not the sender's.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.batch import Bool
from dissectors.headers import IPV4_HIGH
from nvscope.causes.node_streams import NodeStream, Pause
from nvscope.causes.symptoms import OF_SILENCE
from nvscope.engine.keys import FrameKind
from nvscope.findings.loss import TELEGRAM_GAP

if TYPE_CHECKING:  # a case has one of these
    from nvscope.causes.case import Case

_NEAR_NS, _NEAR_PERCENT = 5_000_000_000, 250
"""So far from the questions a pause may begin and end: of the usual interval, or so long."""

_SELDOM_NS = 3_000_000_000
"""A stack that finds nobody asks three times, a second apart."""


class Spell(NamedTuple):
    """A time in which a list did not come, since its sender looked for its only reader; None has no end."""

    sender: int
    reader: int
    list: int
    since_ns: int
    until_ns: int | None


class Unreached:
    """What was not sent because its reader was not found; ``spells`` are by their beginning."""

    def __init__(self, case: Case) -> None:
        self._case = case

    @cached_property
    def spells(self) -> Sequence[Spell]:
        return sorted(self._spells(), key=lambda one: one.since_ns)

    def of_reader(self, reader: int, since_ns: int, until_ns: int) -> list[Spell]:
        """Return the spells in which a reader's silence goes on: they overlap it, or nothing of it came before them."""
        return [
            one for one in self.spells
            if one.reader == reader and (one.until_ns is None or one.until_ns >= since_ns)
            and (one.since_ns <= until_ns or not self._case.life.sent_between(reader, until_ns, one.since_ns))
        ]  # fmt: skip

    def is_unreached(self, one: NodeStream, pause: Pause) -> bool:
        """Tell whether a stream pauses since its only reader is not found."""
        return self._covers(one.stream.node, one.list.number, one.nominal_ns, pause.since_ns, pause.until_ns)

    @cached_property
    def symptoms(self) -> Bool:
        """Which symptoms come of it that a list did not come."""
        return self.symptoms_of(self.spells)

    def symptoms_of(self, spells: Iterable[Spell]) -> Bool:
        """Return the same of some spells."""
        symptoms, of_silence = self._case.symptoms, self._case.symptoms.of_kinds(*OF_SILENCE)
        found: Bool = np.zeros(len(symptoms.code), np.bool_)
        for one in spells:
            own = symptoms.list == one.list
            if self._case.counts_as_a_whole(one.sender):
                # What it counts for the list is missing in the others.
                own |= symptoms.of_kinds(TELEGRAM_GAP)
            own &= (symptoms.node == one.sender) & self._case.overlapping(one.since_ns, one.until_ns)
            found |= own & of_silence
        return found

    @cached_property
    def _asked(self) -> Mapping[tuple[int, int], Sequence[tuple[int, int]]]:
        """From when to when nodes looked for others, by both."""
        asker, sought, since_ns, until_ns = self._case.witness.presence.questions.unanswered()
        found: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
        nodes = self._case.facts.state.keys.nodes
        high = np.full(len(asker), IPV4_HIGH)
        numbers = nodes.find(high, asker).tolist(), nodes.find(high, sought).tolist()
        for sender, reader, *span in zip(*numbers, since_ns.tolist(), until_ns.tolist(), strict=True):
            if sender >= 0 and reader >= 0:
                found[sender, reader].append((span[0], span[1]))
        return found

    @cached_property
    def receivers(self) -> Mapping[tuple[int, int], set[int]]:
        """Where each list of a node goes, by both; a number below 0 is no node alone."""
        flows = self._case.facts.state.lists.flows
        data = np.isin(flows.column("kind"), [FrameKind.DATA, FrameKind.MALFORMED_DATA])
        found: dict[tuple[int, int], set[int]] = defaultdict(set)
        columns = (flows.column(name)[data].tolist() for name in ("list", "source", "destination"))
        for number, node, to in zip(*columns, strict=True):
            found[number, node].add(to)
        return found

    @cached_property
    def _reader_of(self) -> Mapping[tuple[int, int], int]:
        """Which node each list of a node goes to, where it goes to no other one and its sender looks for that."""
        if not self._asked:
            return {}
        return {
            (number, sender): reader for (number, sender), own in self.receivers.items()
            for reader in own if len(own) == 1 and (sender, reader) in self._asked
        }  # fmt: skip

    def _spells(self) -> Iterable[Spell]:
        """Yield when lists were held back: cyclic ones when they pause, others where they are missing."""
        case, symptoms = self._case, self._case.symptoms
        for (number, sender), reader in self._reader_of.items():
            streams = [one for one in case.streams_of_node.get(sender, ()) if one.list.number == number]
            pauses = {pause[:2] for one in streams for pause in case.pauses(number, one.stream)}
            rows = symptoms.of_kinds(TELEGRAM_GAP) & (symptoms.list == number) & (symptoms.node == sender)
            pauses |= {*zip(symptoms.since_ns[rows].tolist(), symptoms.time_ns[rows].tolist(), strict=True)}
            interval_ns = max((one.nominal_ns for one in streams), default=0)
            for since_ns, until_ns in pauses:
                if self._covers(sender, number, interval_ns, since_ns, until_ns):
                    yield Spell(sender, reader, number, since_ns, until_ns)

    def _covers(self, sender: int, number: int, interval_ns: int, since_ns: int, until_ns: int | None) -> bool:
        """Tell whether a sender looked for the only reader of a list in a pause, and nothing of that one came."""
        reader = self._reader_of.get((number, sender))
        if reader is None:
            return False
        near_ns = max(interval_ns * _NEAR_PERCENT // 100, _NEAR_NS)
        end_ns = self._case.end_ns if until_ns is None else until_ns
        own = [one for one in self._asked[sender, reader] if one[0] <= end_ns and one[1] >= since_ns]
        if not own or own[-1][1] < end_ns - near_ns or end_ns - since_ns < _NEAR_NS:
            return False
        if abs(own[0][0] - since_ns) > near_ns:
            return False  # it asked long before, as some do all the time, or for another reason
        asked_ns = sum(min(until, end_ns) - max(since, since_ns) for since, until in own)
        # Each sending that finds nobody is followed by questions: of what is sent often, they never end.
        if interval_ns <= _SELDOM_NS and 2 * asked_ns < end_ns - since_ns:
            return False
        return not self._case.life.sent_between(reader, since_ns + 1, end_ns - near_ns)


def span_of(spells: Sequence[Spell]) -> tuple[int, int | None]:
    """Return from when to when readers were not found."""
    ends_ns = [one.until_ns for one in spells if one.until_ns is not None]
    return min(one.since_ns for one in spells), max(ends_ns) if len(ends_ns) == len(spells) else None
