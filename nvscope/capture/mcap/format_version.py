"""What a recording says of itself, and which version of that this is."""

from __future__ import annotations

FORMAT_VERSION = 1

RECORDING = "nvscope"
"""Metadata: ``format`` (the version), ``program``, and what else is known of a recording as a whole."""

INTERFACES = "nvscope.interfaces"
"""Metadata: the names of the interfaces of packets by number; where there are several, the last one holds."""

COMMENTS = "nvscope.comments"
"""Metadata: comments by the number of their packet in the file, from 1, in front of it; further ones as ``7.1``."""
