"""The frames of the lists that are defined on CAN, where there are any."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nvscope.definition.model import Definition

if TYPE_CHECKING:
    from nvscope.definition.pdos import Pdos


def pdos_of(definition: Definition) -> Pdos | None:
    """Return the frames of the lists that are sent over CAN, None where there are none."""
    if not definition.on_can:
        return None
    # What packs lists is imported where there is one to pack.
    from nvscope.definition.pdos import Pdos  # noqa: PLC0415

    return Pdos(definition)
