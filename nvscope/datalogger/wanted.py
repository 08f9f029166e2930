"""Wanted streams: those of the lists that are logged."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from dissectors.batch import Bool
from nvscope.engine.told import Told
from nvscope.list_key import ListKey


class WantedStreams:
    """Knows which streams are of some lists, of those on CAN also where they are defined for any channel."""

    def __init__(self, keys: Collection[ListKey]) -> None:
        self._keys = frozenset(keys)
        self._wanted: Bool = np.zeros(0, np.bool_)

    def of(self, told: Told) -> Bool:
        """Return, for each stream up to the end of a batch, whether it is wanted."""
        known = len(self._wanted)
        if len(told.keys.streams) > known:
            keys = (told.keys.place_key(number)[0] for number in range(known, len(told.keys.streams)))
            new = [key in self._keys or key.on_any_channel in self._keys for key in keys]
            self._wanted = np.append(self._wanted, np.array(new, np.bool_))
        return self._wanted
