"""What an export of some frames writes, read back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import polars as pl

from nvscope.analysis.values import values
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.engine.reading import Choose, Reading
from nvscope.export.values import paths_of, write_long, write_wide
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams
from nvscope.whole_files import WholeFiles
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of


def telegrams_of(
    frames: Sequence[Frame], lists: Sequence[ListDefinition], batch_frames: int = 1000, choose: Choose | None = None
) -> tuple[DefinedTelegrams, Iterator[DefinedRows]]:
    """Return the data telegrams among some frames, and their rows."""
    layouts = Layouts(Definition(tuple(lists)))
    telegrams = DefinedTelegrams(layouts, keys=[key for key, _ in layouts.lists()])
    parts = [batch_of(frames[start : start + batch_frames]) for start in range(0, len(frames), batch_frames)]
    return telegrams, values(Batches(parts), Reading(choose=choose), telegrams)


def wide(
    frames: Sequence[Frame], lists: Sequence[ListDefinition], path: Path, batch_frames: int = 1000
) -> list[pl.DataFrame]:
    """Return the wide tables of some lists."""
    files = WholeFiles(force=True)
    telegrams, rows = telegrams_of(frames, lists, batch_frames)
    paths = paths_of(
        str(path / "out.parquet"), [(key, entry) for key, entry in zip(telegrams.keys, lists, strict=True)]
    )
    write_wide(telegrams, rows, paths, files)
    files.publish()
    return [pl.read_parquet(name) for name in paths]


def long(
    frames: Sequence[Frame], lists: Sequence[ListDefinition], path: Path, batch_frames: int = 1000
) -> pl.DataFrame:
    """Return the long table of some lists."""
    files = WholeFiles(force=True)
    write_long(*telegrams_of(frames, lists, batch_frames), str(path / "out.parquet"), files)
    files.publish()
    return pl.read_parquet(path / "out.parquet")
