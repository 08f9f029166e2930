"""What is the same for all frames of a variety, asked once of each variety."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dissectors.batch import Bool
from dissectors.netvar import Fault
from dissectors.varieties import NO_TELEGRAM, Varieties
from nvscope.engine.told import Told
from nvscope.view.rows.frames import NETVAR, FrameRows


class VarietyAnswers:
    """Tells by variety whether something is so, and whether that is known; ``ask`` tells it of rows.

    ``true`` and ``known`` have one row a variety; of those that are ``undecided``, a variety does not tell all that was
    captured, so that each of its frames has to be asked, and neither is true. Nothing is true of what is no telegram.
    """

    def __init__(self, ask: Callable[[FrameRows], tuple[Bool, Bool | None]]) -> None:
        self._ask = ask
        self._varieties: Varieties | None = None
        self.true, self.known, self.undecided = (np.zeros(0, np.bool_) for _ in range(3))

    def learn(self, told: Told) -> None:
        """Ask of the varieties that are new."""
        if told.varieties is not self._varieties:
            self._varieties = told.varieties
            self.true, self.known, self.undecided = (np.zeros(0, np.bool_) for _ in range(3))
        known = len(self.true)
        if len(told.varieties) == known:
            return
        new = np.arange(known, len(told.varieties))
        rows = FrameRows.of_varieties(told, new)
        is_telegram = new != NO_TELEGRAM
        true, exists = self._ask(rows)
        undecided = np.zeros(len(new), np.bool_)
        if found := rows.parts.get(NETVAR):
            fault = found.part.fault
            undecided[found.positions(len(new))] = (fault == Fault.HEADER_CUT) | (fault == Fault.SHORT)
        is_known = is_telegram if exists is None else is_telegram & exists
        self.true = np.concatenate([self.true, true & is_telegram & ~undecided])
        self.known = np.concatenate([self.known, is_known & ~undecided])
        self.undecided = np.concatenate([self.undecided, undecided])
