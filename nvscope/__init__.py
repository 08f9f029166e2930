"""nvscope: analyzer and diagnostics for CODESYS network variables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nvscope.version import __version__

if TYPE_CHECKING:
    from nvscope.notebook import open_captures as open
__all__ = ["__version__", "open"]


def __getattr__(name: str) -> Any:
    # The program starts without what notebooks need.
    if name == "open":
        from nvscope.notebook import open_captures  # noqa: PLC0415

        return open_captures
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
