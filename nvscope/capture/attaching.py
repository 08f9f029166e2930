"""Which captures may bring files with them, found out without reading them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from nvscope.capture.compressed import compression_of
from nvscope.capture.formats import FORMATS

_MAGICS = tuple(magic for known in FORMATS if known.holds_attachments for magic in known.magics)
_SUFFIXES = tuple(suffix for known in FORMATS if known.holds_attachments for suffix in known.suffixes)


def that_may_attach(paths: Sequence[str]) -> list[str]:
    """Return the files among some paths, and in directories among them, whose format has a place for attachments.

    Of a compressed file its name tells that. What cannot be opened is none of them.
    """
    return [path for path in _files(paths) if _may_attach(path)]


def _files(paths: Sequence[str]) -> Iterator[str]:
    for path in paths:
        if os.path.isdir(path):
            try:
                yield from sorted(entry.path for entry in os.scandir(path) if entry.is_file())
            except OSError:
                continue
        elif os.path.isfile(path):
            yield path


def _may_attach(path: str) -> bool:
    try:
        with open(path, "rb") as file:
            head = file.read(max(map(len, _MAGICS)))
    except OSError:
        return False
    return head.startswith(_MAGICS) or bool(
        compression_of(head) and os.path.splitext(path)[0].lower().endswith(_SUFFIXES)
    )
