"""What an export of some frames writes, read back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from dissectors.batch import PacketBatch
from dissectors.varieties import Choose
from nvscope.capture.source import SourceInfo
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.export.files import Files
from nvscope.export.values import paths_of, write_long, write_wide
from nvscope.view.rows.defined import DefinedTelegrams
from tests.oracle.frame import Frame
from tests.packets import batch_of


@dataclass
class Frames:
    """A source of frames in batches of a size."""

    frames: Sequence[Frame]
    batch_frames: int = 1000
    infos: list[SourceInfo] = field(default_factory=list)

    def __iter__(self) -> Iterator[PacketBatch]:
        for start in range(0, len(self.frames), self.batch_frames):
            yield batch_of(self.frames[start : start + self.batch_frames])


def telegrams_of(
    frames: Sequence[Frame], lists: Sequence[ListDefinition], batch_frames: int = 1000, choose: Choose | None = None
) -> DefinedTelegrams:
    """Return the data telegrams among some frames."""
    layouts = Layouts(Definition(tuple(lists)))
    keys = [key for key, _ in layouts.lists()]
    return DefinedTelegrams(Frames(frames, batch_frames), layouts, keys=keys, choose=choose)


def wide(
    frames: Sequence[Frame], lists: Sequence[ListDefinition], path: Path, batch_frames: int = 1000
) -> list[pl.DataFrame]:
    """Return the wide tables of some lists."""
    files = Files()
    telegrams = telegrams_of(frames, lists, batch_frames)
    paths = paths_of(
        str(path / "out.parquet"), [(key, entry) for key, entry in zip(telegrams.keys, lists, strict=True)]
    )
    write_wide(telegrams, paths, files, lambda: None)
    files.publish()
    return [pl.read_parquet(name) for name in paths]


def long(
    frames: Sequence[Frame], lists: Sequence[ListDefinition], path: Path, batch_frames: int = 1000
) -> pl.DataFrame:
    """Return the long table of some lists."""
    files = Files()
    write_long(telegrams_of(frames, lists, batch_frames), str(path / "out.parquet"), files, lambda: None)
    files.publish()
    return pl.read_parquet(path / "out.parquet")
