"""The one loop: batches from a source are recognised and told to observers, wherever they come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from msgspec.structs import replace

from nvscope.capture.source import Source, WorksAhead
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Recogniser
from nvscope.engine.told import Told


class Observer(Protocol):
    """Whatever looks at traffic: a state, a history, lines, a recorder, a rule.

    A batch may hold no packet: then it says that time has passed (``Told.until_ns``), or that a source has ended
    (``Told.unheard``).

    ``by_stream``: it needs telegrams laid out by stream. What it comes to does not depend on who else observes.
    """

    @property
    def by_stream(self) -> bool: ...

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        ...


def run(source: Source, reading: Reading, observers: Sequence[Observer]) -> Iterator[Told]:
    """Tell a source to observers, batch by batch, and yield what they have been told.

    A batch is valid until the next one is asked for. Who stops asking stops the loop.
    """
    if not all(info.hears_answers for info in source.infos):
        reading = replace(reading, hears_answers=False)
    by_stream = any(observer.by_stream for observer in observers)
    recogniser = Recogniser(reading, lambda: source.channels, by_stream=by_stream)
    if isinstance(source, WorksAhead):
        source.work_ahead(recogniser.preparation)
    for packets in source:
        for told in recogniser.tell(packets):
            for observer in observers:
                observer.observe(told)
            yield told
