"""Packages that only some verbs need, and the extra of nvscope that installs each (``pyproject.toml``)."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping

from nvscope.errors import NvscopeError, UnreadableInput, UsageError

EXTRAS: Mapping[str, str] = {"asammdf": "mf4", "polars": "export", "pyarrow": "export"}


def require(what: str, *packages: str, path: str = "") -> None:
    """Return where all of ``packages`` are installed; none of them is imported.

    Else UnreadableInput where ``path`` is the file that cannot be read without them, UsageError where it is empty:
    ``what`` is what needs them.
    """
    missing = [package for package in packages if not _is_installed(package)]
    if not missing:
        return
    kind: type[NvscopeError] = UnreadableInput if path else UsageError
    extras = ",".join(dict.fromkeys(EXTRAS[package] for package in missing))
    raise kind(
        f"{what} {' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} not installed",
        where=path,
        next_step=f'install {"it" if len(missing) == 1 else "them"}: pip install "nvscope[{extras}]"',
    )


def _is_installed(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ValueError:  # a module without a specification stands in its place
        return False
