"""The version of the program, and how documents for programs say of what they are."""

from __future__ import annotations

from typing import Any

__version__ = "0.1.0"

TOOL = {"name": "nvscope", "version": __version__}


def head(schema: str) -> dict[str, Any]:
    """Return what every document begins with: of which schema it is, and what wrote it."""
    return {"schema": schema, "tool": dict(TOOL)}
