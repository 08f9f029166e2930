"""SeenLists: which of the defined lists captures have anything of, where no report is made of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

import numpy as np

from dissectors.batch import LinkType
from nvscope.definition.model import Definition, ListDefinition
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told
from nvscope.list_key import ListKey, Transport, told_of


class SeenLists:
    """An observer of all telegrams, whatever a filter chooses."""

    by_stream: ClassVar[bool] = True

    def __init__(self) -> None:
        self._keys: Keys | None = None
        self._captured: set[Transport] = set()
        self._some_left_out = False

    def observe(self, told: Told) -> None:
        self._keys = told.keys
        self._some_left_out |= bool(len(told.laid.left_out))
        on_can = 0 if told.can is None else len(told.can)
        if on_can:
            self._captured.add(Transport.CAN)
        rows_of_databases = int(np.count_nonzero(told.packets.link == LinkType.DATABASE_ROW))
        if len(told) > on_can + rows_of_databases:
            self._captured.add(Transport.UDP)

    def saw_any(self, entries: Iterable[ListDefinition]) -> bool:
        """Return whether something was seen of any of these lists."""
        keys = {entry.key for entry in entries}
        seen = self._keys.list_keys() if self._keys is not None else ()
        return any(key in keys or key.on_any_channel in keys for key in seen)

    def missing(self, definition: Definition) -> Sequence[tuple[ListKey, ListDefinition]]:
        """Return the lists of which nothing was seen, of transports that were captured; none where that is not sure."""
        if self._keys is None or self._some_left_out:
            return ()
        defined = definition.by_key()
        seen = {id(entry) for key in self._keys.list_keys() if (entry := told_of(defined, key)) is not None}
        return [
            (key, entry)
            for key, entry in defined.items()
            if entry.variables and id(entry) not in seen and key.transport in self._captured
        ]
