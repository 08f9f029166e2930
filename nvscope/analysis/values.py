"""Values: the data telegrams of defined lists, in the order of the capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from nvscope.capture.source import Source
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams


def values(
    source: Source, reading: Reading, telegrams: DefinedTelegrams, progress: Callable[[], None] = lambda: None
) -> Iterator[DefinedRows]:
    """Yield the rows of a source, a batch at a time; ``telegrams`` say which, and know in the end what was left out."""
    for _ in run(source, reading, [telegrams]):
        yield telegrams.rows
        progress()
