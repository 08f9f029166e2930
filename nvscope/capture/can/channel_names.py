"""The names of channels that a log numbers: ``can`` and the number that the log gives, whichever format it is of.

So channel 1 of ``.asc`` and ``.blf`` and bus 1 of ``.trc`` and ``.mf4`` are one bus, ``can1``.
"""

from __future__ import annotations

from nvscope.capture.can.frame import MAX_CHANNELS


class TooManyChannels(Exception):
    """A log with more channels than ``MAX_CHANNELS``."""


class ChannelNames:
    """Numbers channels as they are met, and writes their names into ``names``.

    A channel without a number has the name ''; while there is no other, no name is told at all.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        self._numbers: dict[int | str | None, int] = {}

    def number(self, told: int | str | None) -> int:
        """Return the place of the channel that a log calls by a number or a name; raises TooManyChannels."""
        known = self._numbers.get(told)
        if known is not None:
            return known
        if len(self._numbers) >= MAX_CHANNELS:
            raise TooManyChannels(f"more than {MAX_CHANNELS} channels")
        if told is not None or self._names:
            if not self._names and None in self._numbers:
                # What came before has no name, which need not be said as long as nothing has one.
                self._names.append("")
            self._names.append("" if told is None else told if isinstance(told, str) else f"can{told}")
        number = self._numbers[told] = max(len(self._names) - 1, 0)
        return number
