"""What a recording tells of the capture behind it."""

from __future__ import annotations

import platform
from collections.abc import Sequence

from nvscope.capture.source import Circumstances, SourceInfo


def circumstances_of(infos: Sequence[SourceInfo], capture_filter: str | None = None) -> Circumstances:
    """Return what is known of sources by now; of a capture file, the machine that reads it is none of it."""
    drops = [info.drops for info in infos]
    return Circumstances(
        platform.node() if any(info.is_live for info in infos) else "",
        ", ".join(info.path for info in infos if info.is_live),
        capture_filter or "",
        None if any(one is None for one in drops) else sum(one or 0 for one in drops),
        sum(info.clock_steps for info in infos),
    )
