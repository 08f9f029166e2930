"""Names that are nearly what somebody wrote."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

_MAX_NAMES = 20_000
_MAX_SHOWN = 40


def nearest(wanted: str, names: Iterable[str]) -> str:
    """Return a sentence of the names, among the first 20 000, that come nearest to the one wanted."""
    from difflib import get_close_matches  # noqa: PLC0415

    known = {name.lower(): name for name in islice(names, _MAX_NAMES)}
    wanted = wanted.strip().lower()[:100]
    short = {name.partition(".")[2]: name for name in known}
    near = get_close_matches(wanted, known, n=3) + [short[part] for part in get_close_matches(wanted, short, n=3)]
    near += [name for name in known if len(wanted) > 2 and wanted in name]
    if near:
        return "perhaps " + ", ".join([known[name] for name in dict.fromkeys(near)][:5])
    return "the fields are " + ", ".join(list(known.values())[:_MAX_SHOWN]) + (", …" if len(known) > _MAX_SHOWN else "")
