"""What is said of variables whose values come one by one, beside these values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nvscope.cli.secrets import tell_of_hidden
from nvscope.cli.terminal import echo

if TYPE_CHECKING:
    from nvscope.tracker.readings.readings import ReadValues
    from nvscope.view.documents.variables import ReadRows


def hidden_in(rows: ReadRows) -> int:
    """Return how many values are hidden in the rows of documents."""
    return sum(row.get("hidden", False) for several in rows.values() for row in several)


def tell_of_read_ones(read: Sequence[ReadValues], *, hidden: int) -> None:
    """Say how many values are hidden, and whether variables were left out."""
    if read:
        tell_of_hidden(hidden)
    for one in read:
        if one.missed:
            from nvscope.units import count_of

            told = "says" if one.missed == 1 else "say"
            echo(
                f"nvscope: {count_of(one.missed, 'row')} {told} that data was lost before (ConsistentDataSeries 0): "
                "changes may be missing there.",
                err=True,
            )
        if one.left_out:
            from nvscope.units import count

            known = count(len(one.known))
            echo(
                f"nvscope: of {one.title}, variables beyond the first {known} were left out; max_streams in "
                "nvscope.toml, below [limits], says how many.",
                err=True,
            )
