"""Column names: variables that are called like another column of their table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from dissectors.datalogger.tables import CONSISTENT, COUNT_SUFFIX, TIMESTAMP


def taken_names(uris: Sequence[str], *, only_changes: bool) -> set[str]:
    """Return the names, in lower case, that several columns of a table would have; SQLite tells no case apart."""
    counters = [uri + COUNT_SUFFIX for uri in uris] if only_changes else []
    times = Counter(name.lower() for name in (TIMESTAMP, CONSISTENT, *uris, *counters))
    return {name for name, number in times.items() if number > 1}


def next_step_of(uri: str) -> str:
    """Return what to do about a variable whose name is taken."""
    if uri.lower().endswith(COUNT_SUFFIX):
        whose = uri[: -len(COUNT_SUFFIX)]
        return f"It is the counter of '{whose}': leave one of both out, or write storeChangesOnly=\"false\"."
    return "Call it as the controller does: Arp.Plc.Eclr/NAME."
