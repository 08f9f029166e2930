"""The sentence about types and constants that lists need and no file declares."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.definition.model import UnknownName
from nvscope.units import count
from nvscope.view.escape import visible

_MOST_TOLD = 10
_MOST_CHARACTERS = 60


def unknown_names(names: Sequence[UnknownName]) -> str:
    """Return the sentence, which is safe to print and names the first ones; "" where there are none."""
    if not names:
        return ""
    told = [_one(name) for name in names[:_MOST_TOLD]]
    if len(names) > _MOST_TOLD:
        told.append(f"{count(len(names) - _MOST_TOLD)} more")
    kinds = {name.constant: "constants" if name.constant else "types" for name in names}
    what = " and ".join(kinds[constant] for constant in sorted(kinds))
    files = "a .TcDUT, a PLCopen XML export, ST text, or a list of constants"
    return f"{what} that no file declares: {', '.join(told)}. Name the files that do, too: {files}."


def _one(name: UnknownName) -> str:
    near = f"; perhaps {visible(name.nearest[:_MOST_CHARACTERS])}?" if name.nearest else ""
    return f"{visible(name.name[:_MOST_CHARACTERS])} ({visible(str(name.position))}{near})"
