"""Column names: variables that are called like another column of their table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from dissectors.datalogger.tables import CONSISTENT, COUNT_SUFFIX, TIMESTAMP


def taken_names(uris: Sequence[str]) -> set[str]:
    """Return the names, in lower case, that several columns of a table would have; SQLite tells no case apart.

    Columns tell what a table is: where every value is stored, a variable that is called like the counter of another one
    would be taken for that by whoever reads it.
    """
    counters = [uri + COUNT_SUFFIX for uri in uris]
    times = Counter(name.lower() for name in (TIMESTAMP, CONSISTENT, *uris, *counters))
    return {name for name, number in times.items() if number > 1}


def next_step_of(uri: str) -> str:
    """Return what to do about a variable whose name is taken."""
    if uri.lower().endswith(COUNT_SUFFIX):
        whose = uri[: -len(COUNT_SUFFIX)]
        return f"So is the counter of '{whose}', or would be: log one of both in another session."
    return "Call it as the controller does: Arp.Plc.Eclr/NAME."
