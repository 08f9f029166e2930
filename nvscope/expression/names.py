"""Names that are nearly what somebody wrote."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

MAX_NAMES = 20_000
_MAX_NEAR = 5
_MAX_LISTED = 8
ALL_FIELDS = "`nvscope keys --fields` lists them"


def nearest(wanted: str, names: Iterable[str], otherwise: str = "the fields are", many: str = ALL_FIELDS) -> str:
    """Return a sentence of the names, among the first 20 000, that come nearest to the one wanted.

    Where none does, ``otherwise`` begins the one that lists all of them; where these are too many for a line, it is
    ``many``.
    """
    from difflib import get_close_matches  # noqa: PLC0415

    known = {name.lower(): name for name in islice(names, MAX_NAMES)}
    wanted = wanted.strip().lower()[:100]
    short = {name.partition(".")[2]: name for name in known}
    near = get_close_matches(wanted, known, n=3) + [short[part] for part in get_close_matches(wanted, short, n=3)]
    near += [name for name in known if len(wanted) > 2 and wanted in name]
    # Of several lists, the names that end alike: var.press.total and var.robot.total for var.totl.
    ends = get_close_matches(wanted.rpartition(".")[2], {name.rpartition(".")[2] for name in known}, n=2, cutoff=0.8)
    near += [name for end in ends for name in known if name.rpartition(".")[2] == end]
    if near:
        return "perhaps " + ", ".join([known[name] for name in dict.fromkeys(near)][:_MAX_NEAR])
    return many if len(known) > _MAX_LISTED else f"{otherwise} {', '.join(known.values())}"
