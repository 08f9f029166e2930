"""The kinds of what is missing of what is defined, in the order in which they are told."""

from __future__ import annotations

NEVER_SEEN = "never-seen"
"""A list that is defined, and never came."""

WITHOUT_PROGRAM = "reader-without-program"
"""A reader at whose port nobody listens."""

FOREIGN = "header-foreign"
"""A sender whose headers no controller can read."""

NEVER_CHANGED = "never-changed"
"""Variables that never changed, although others of their list did."""

KINDS = (NEVER_SEEN, WITHOUT_PROGRAM, FOREIGN, NEVER_CHANGED)
