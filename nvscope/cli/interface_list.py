"""``-D``: what can be captured on, numbered as -i takes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nvscope.cli.terminal import echo

if TYPE_CHECKING:
    from nvscope.capture.live.listing import Listed


def print_interfaces() -> None:
    """Print interfaces, then, which takes longer, what drivers of CAN adapters find."""
    from nvscope.capture.live.listing import can_channels, interfaces

    found = interfaces()
    _print(found, 1)
    _print(can_channels(), len(found) + 1)


def _print(rows: Sequence[Listed], first: int) -> None:
    from nvscope.view.escape import visible

    table = [
        (f"{number}.", visible(one.word), one.state, one.kind, ", ".join(map(str, one.addresses)), visible(one.title))
        for number, one in enumerate(rows, first)
    ]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True) if width).rstrip())
