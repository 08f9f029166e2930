"""Who waits for an answer, and what becomes of it: acknowledgements and boot-up requests."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from tests.oracle.frame import Address
from tests.oracle.rules.errors import NOACKNOWLEDGEMENT, NOTACKNOWLEDGED, UDPANSWERBOOTUPREQUEST
from tests.oracle.rules.keys import ListKey, Moment, StreamKey
from tests.oracle.rules.lists import List
from tests.oracle.rules.notes import Notes
from tests.oracle.rules.telegram import ACKNOWLEDGE_WANTED, CHECKSUM_INVALID, Telegram


@dataclass(frozen=True)
class Wait:
    """Somebody waits for an answer until the deadline, the deadline itself included."""

    node: Address
    list_key: ListKey
    subindex: int
    opened: Moment
    deadline: int


class Waits:
    """Senders that wait for acknowledgements, readers that wait for data they asked for; ``latencies`` of the first."""

    def __init__(self, notes: Notes, timeout_ns: int) -> None:
        self.notes = notes
        self.timeout_ns = timeout_ns
        self.acknowledgement_waits: dict[StreamKey, Wait] = {}
        self.boot_up_waits: list[Wait] = []
        self.latencies: dict[StreamKey, list[int]] = defaultdict(list)

    def expire(self, now: Moment) -> None:
        """Turn every wait whose deadline is before now into an error, the earliest deadline first."""
        waits: list[Wait] = [*self.acknowledgement_waits.values(), *self.boot_up_waits]
        passed = [wait for wait in waits if now.time > wait.deadline]
        for wait in sorted(passed, key=lambda wait: (wait.deadline, wait.opened.frame)):
            key, moment = wait.list_key, Moment(wait.deadline, wait.opened.frame)
            if wait in self.boot_up_waits:
                self.boot_up_waits.remove(wait)
                self.notes.error(key, UDPANSWERBOOTUPREQUEST, None, wait.deadline, now.frame, at_deadline=True)
                self.notes.find("NV304", key, None, wait.subindex, moment)
            else:
                del self.acknowledgement_waits[StreamKey(wait.node, key, wait.subindex)]
                self.notes.error(key, NOACKNOWLEDGEMENT, wait.node, wait.deadline, now.frame, at_deadline=True)
                self.notes.find("NV301", key, wait.node, wait.subindex, moment)

    def observe_data(self, at: StreamKey, entry: List, seen: Telegram, *, repeated: bool) -> None:
        """End what a data telegram of a stream finds open, or answers, and open a wait where it wants an answer."""
        key = at.list_key
        if not repeated:
            if at in self.acknowledgement_waits:
                wait = self.acknowledgement_waits.pop(at)
                self.notes.error(key, NOACKNOWLEDGEMENT, seen.source, seen.time, seen.frame)
                self.notes.find("NV301", key, seen.source, seen.subindex, Moment(seen.time, wait.opened.frame))
            if seen.flags & ACKNOWLEDGE_WANTED:
                self.acknowledgement_waits[at] = self.wait(key, seen)
            self.boot_up_waits = [
                wait
                for wait in self.boot_up_waits
                if (wait.list_key, wait.subindex) != (key, seen.subindex) or wait.node == seen.source
            ]
        if seen.flags & ACKNOWLEDGE_WANTED:
            entry.wanted.setdefault(seen.subindex, []).append(seen)

    def observe_boot_up_request(self, key: ListKey, entry: List, seen: Telegram) -> None:
        entry.boot_up_requests += 1
        entry.readers.add(seen.source)
        self.boot_up_waits.append(self.wait(key, seen))

    def observe_acknowledgement(self, key: ListKey, entry: List, seen: Telegram) -> None:
        entry.acknowledgements.append(seen)
        entry.readers.add(seen.source)
        for at in list(self.acknowledgement_waits):
            awaited = (at.list_key, at.subindex) == (key, seen.subindex)
            addressed = seen.broadcast or seen.destination == at.node
            if awaited and addressed and seen.source != at.node:
                wait = self.acknowledgement_waits.pop(at)
                self.latencies[at].append(seen.time - wait.opened.time)
        if seen.flags & CHECKSUM_INVALID:
            blamed: Address | None = seen.destination
            if seen.broadcast:
                last = entry.last_data.get(seen.subindex)
                blamed = last.source if last else None
            self.notes.error(key, NOTACKNOWLEDGED, blamed, seen.time, seen.frame)
            self.notes.find("NV302", key, blamed, seen.subindex, seen.moment)
        expected = any(
            seen.time - data.time <= self.timeout_ns
            for data in reversed(entry.wanted.get(seen.subindex, []))
            if seen.broadcast or data.source == seen.destination
        )
        if not expected:
            self.notes.find("NV303", key, seen.source, seen.subindex, seen.moment)

    def wait(self, key: ListKey, seen: Telegram) -> Wait:
        return Wait(seen.source, key, seen.subindex, seen.moment, seen.time + self.timeout_ns)
