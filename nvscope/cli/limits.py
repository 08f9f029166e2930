"""Limits as tshark has them for ``-a`` and ``-b``: ``duration:60``, ``packets:1000``, ``filesize:9``, ``files:5``."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.errors import UsageError

_UNITS = {"duration": (1_000_000_000, "SECONDS"), "packets": (1, "N"), "filesize": (1000, "KB"), "files": (1, "N")}
"""What one of each is in ns, packets, bytes and files."""

_MOST = 1e12


def limits(option: str, texts: Sequence[str], kinds: Sequence[str]) -> dict[str, int]:
    """Return the limits that were given for an option, by kind: in ns, packets, bytes, files; of a kind the last.

    Raises UsageError for what is none of some kinds.
    """
    told: dict[str, int] = {}
    for text in texts:
        what, _, number = text.partition(":")
        try:
            value = float(number)
        except ValueError:
            value = 0.0
        if what not in kinds or not 0 < value < _MOST:
            forms = [f"{kind}:{_UNITS[kind][1]}" for kind in kinds]
            raise UsageError(
                f"{option} {text[:80]}: expected {', '.join(forms[:-1])} or {forms[-1]}",
                next_step=f"for example {option} {kinds[0]}:60",
            )
        told[what] = max(int(value * _UNITS[what][0]), 1)
    return told


def file_limits(texts: Sequence[str]) -> dict[str, int]:
    """Return when a recorded file is followed by another one, as ``limits`` does; ``files`` is how many stay.

    UsageError, too, where only how many is said.
    """
    told = limits("-b", texts, ("duration", "packets", "filesize", "files"))
    if told.keys() == {"files"}:
        raise UsageError(
            f"-b files:{told['files']} does not say when a file is followed by another one",
            next_step="add -b filesize:KB, -b packets:N or -b duration:SECONDS",
        )
    return told
