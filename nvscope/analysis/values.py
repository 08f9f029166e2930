"""Values: the data telegrams of defined lists, in the order of the capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from nvscope.capture.source import Source
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams


def values(
    source: Source, reading: Reading, telegrams: DefinedTelegrams, progress: Callable[[], None] = lambda: None,
    others: Sequence[Observer] = (),
) -> Iterator[DefinedRows]:  # fmt: skip
    """Yield the rows of a source, a batch at a time; ``telegrams`` say which, and know in the end what was left out.

    ``others`` observe too, in front of each batch's rows.
    """
    for _ in run(source, reading, [telegrams, *others]):
        yield telegrams.rows
        progress()
