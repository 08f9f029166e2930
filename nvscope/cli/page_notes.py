"""What is said of variables of pages beside their values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nvscope.cli.secrets import tell_of_hidden
from nvscope.cli.terminal import echo

if TYPE_CHECKING:
    from nvscope.tracker.visu.readings import ReadValues


def tell_of_pages(read: ReadValues, *, hidden: int) -> None:
    """Say how many values are hidden, and whether variables were left out."""
    tell_of_hidden(hidden)
    if read.variables.left_out:
        from nvscope.units import count

        known = count(len(read.variables))
        echo(
            f"nvscope: of web visualization, variables beyond the first {known} were left out; max_streams in "
            "nvscope.toml, below [limits], says how many.",
            err=True,
        )
