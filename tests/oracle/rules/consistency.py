"""Senders, shapes, checksums and flags that do not go together, and the error CHECKSUM."""

from __future__ import annotations

from tests.oracle.rules.errors import CHECKSUM
from tests.oracle.rules.keys import ListKey
from tests.oracle.rules.lists import List
from tests.oracle.rules.notes import Notes
from tests.oracle.rules.telegram import CHECKSUM_PRESENT, Telegram


def observe_sender(notes: Notes, key: ListKey, entry: List, seen: Telegram) -> None:
    """Look at who sends a data telegram, malformed or not."""
    if entry.senders and seen.source not in entry.senders:
        notes.find("NV401", key, None, None, seen.moment)
    entry.senders.add(seen.source)
    entry.sent.append(seen)


def fits_checksum(notes: Notes, key: ListKey, entry: List, seen: Telegram) -> bool:
    """Tell whether a reader would take the values of a well-formed data telegram."""
    if not seen.flags & CHECKSUM_PRESENT:
        return True
    if seen.checksum == entry.reference_checksum.setdefault(seen.subindex, seen.checksum):
        return True
    notes.error(key, CHECKSUM, seen.source, seen.time, seen.frame)
    notes.find("NV403", key, seen.source, seen.subindex, seen.moment)
    return False


def observe_shape(notes: Notes, key: ListKey, entry: List, seen: Telegram, before: Telegram | None) -> None:
    """Compare a well-formed data telegram with the previous one of its SubIndex, and with ``before``, its stream's."""
    previous = entry.last_data.get(seen.subindex)
    if previous and (previous.items, previous.length) != (seen.items, seen.length):
        notes.find("NV402", key, seen.source, seen.subindex, seen.moment)
    unannounced = not seen.flags & CHECKSUM_PRESENT and seen.checksum != 0
    carried = before is not None and before.flags != seen.flags and wraps(before.counter, seen.counter)
    if unannounced or carried:
        notes.find("NV404", key, seen.source, seen.subindex, seen.moment)
    entry.last_data[seen.subindex] = seen


def wraps(before: int, counter: int) -> bool:
    """Tell whether a counter has gone through zero on its way forward."""
    if counter == 0 and before in (255, 65534):
        return True
    return counter < before and (counter - before) % 65536 < 32768
