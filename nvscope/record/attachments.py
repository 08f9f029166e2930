"""The files of a project as attachments of a recording: with them it can be read anywhere."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from nvscope.capture.source import Attachment

_XML, _TOML, _TEXT = "application/xml", "application/toml", "text/plain"
_MEDIA_TYPES = {".xml": _XML, ".tcgvl": _XML, ".tcdut": _XML, ".toml": _TOML}
"""By the suffix of a file; all others are plain text."""


def attachments_of(paths: Sequence[str], project: Path | None) -> list[Attachment]:
    """Return files as attachments, in their order.

    They are called as seen from the directory of the ``project``, or else by what they have in their paths that tells
    them apart. What cannot be read when it is attached is an OSError then.
    """
    if not paths:
        return []
    whole = [os.path.abspath(path) for path in paths]
    shared = os.path.commonpath([os.path.dirname(one) for one in whole])
    base = os.path.abspath(project.parent) if project is not None else shared
    if any(not one.startswith(os.path.join(base, "")) for one in whole):
        base = shared
    return [
        Attachment(
            Path(os.path.relpath(one, base)).as_posix(), _MEDIA_TYPES.get(Path(one).suffix.lower(), _TEXT),
            Path(one).read_bytes, os.stat(one).st_mtime_ns,
        )
        for one in whole
    ]  # fmt: skip
