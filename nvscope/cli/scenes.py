"""What is known of a source behind each second, for whoever prints or records that."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.cli.live import LiveRun

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.watching import Scene, Watching
    from nvscope.capture.source import Source

_LOOK_S = 1.0
_PATIENCE_S = 5.0


def scenes(
    inquiry: Inquiry, how: Watching, source: Source | None = None, *, quiet: bool, sparingly: bool = False,
    causes: bool = True,
) -> Iterator[Scene]:  # fmt: skip
    """Yield what is known behind each second: of files of their own time, else of ours.

    ``source`` are its captures where they are open already. Who asks no more ends the source.
    ``sparingly``: of files, less often the longer they are; without ``causes``, of files none has them.
    """
    from nvscope.analysis.watching import scenes_by_second, watching

    if are_read_whole(inquiry):
        yield from scenes_by_second(inquiry, how, source, sparingly=sparingly, causes=causes)
        return
    session = watching(inquiry, how, source)
    with LiveRun(session.source, quiet=quiet) as progress:
        session.start()
        due_s = time.monotonic()
        try:
            while True:
                due_s = max(due_s + _LOOK_S, time.monotonic())
                ended = session.wait(due_s - time.monotonic())
                yield session.stop() if ended else session.snapshot(_PATIENCE_S)
                if ended:
                    return
                progress()
        finally:
            if not session.ended:
                session.stop()


def are_read_whole(inquiry: Inquiry) -> bool:
    """Tell whether captures are files, which have an end already and can be read again."""
    return not inquiry.read_once
