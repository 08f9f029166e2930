"""Plants whose lists are defined, and what is told of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from nvscope.causes.cause import Cause
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.project import Project
from tests.causes.plants import causes_in
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame

MS = 1_000_000


def sent(entry: ListDefinition, number: int, port: int = 1202, source: str = "10.0.0.1") -> list[Frame]:
    """Return the telegrams of a list as its definition says, but under another number or port."""
    return [
        data_frame(
            at * 100 * MS + one.subindex * MS, source, "255.255.255.255",
            telegram(
                list_id=number, subindex=one.subindex, items=one.items, counter=at + 1,
                data=bytes([at + 1, *bytes(one.length - 21)]),
            ),
            port=port,
        )
        for at in range(30) for one in pack(entry)
    ]  # fmt: skip


def told(frames: Sequence[Frame], *lists: ListDefinition, directory: Path) -> list[Cause]:
    return causes_in(frames, directory, Project(definition=Definition(lists), ports=(1202, 1203)))
