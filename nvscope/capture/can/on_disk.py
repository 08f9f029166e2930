"""A log as a file on disk, for readers that want one: itself, or a copy of what is compressed or comes from a pipe."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from nvscope.errors import UnreadableInput

MAX_SPOOLED_BYTES = 2 << 30
"""Bytes that a log may have which has to be a file on disk, but is compressed or comes from a pipe."""


@contextmanager
def on_disk(path: str, pieces: Iterator[bytes]) -> Iterator[str]:
    """Yield the path of a file with the log in it: ``path``, or, where that is '', a copy that goes afterwards."""
    if path:
        yield path
        return
    directory = tempfile.mkdtemp(prefix="nvscope-")
    try:
        spooled = os.path.join(directory, "log")
        size = 0
        with open(spooled, "wb") as file:
            for piece in pieces:
                size += len(piece)
                if size > MAX_SPOOLED_BYTES:
                    raise UnreadableInput(
                        f"a log of more than {MAX_SPOOLED_BYTES >> 30} GiB that is compressed or comes from a pipe",
                        next_step="decompress it to a file first",
                    )
                file.write(piece)
        yield spooled
    finally:
        shutil.rmtree(directory, ignore_errors=True)
