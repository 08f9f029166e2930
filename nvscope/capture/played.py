"""A source whose packets pass when its player says so: a capture as it happened, or slower, faster, step by step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.player import Player
from nvscope.capture.source import Source


class Played(DerivedSource):
    """The packets of a source, each when the ``player`` lets it pass; in between, empty batches say how late it is.

    A packet whose clock was set back comes with the one before it. It ends where the player begins again.
    """

    def __init__(self, source: Source, player: Player) -> None:
        super().__init__(source)
        self._player, self._turns = player, player.turns
        self._stopped = False

    def __iter__(self) -> Iterator[PacketBatch]:
        player, turns = self._player, self._turns
        latest_ns: int | None = None
        for batch in self._source:
            if not len(batch):
                yield batch
                continue
            latest = np.maximum.accumulate(batch.ts_ns)
            if latest_ns is not None:
                np.maximum(latest, latest_ns, out=latest)
            latest_ns = int(latest[-1])
            begin = 0
            while begin < len(batch):
                turn = player.turn(turns, int(latest[begin]))
                if turn is None or self._stopped:
                    return
                end = int(np.searchsorted(latest, turn.through_ns, "right"))
                end = end if turn.most is None else min(end, begin + turn.most)
                if end > begin:
                    yield batch[begin:end]
                    # What has passed is told by the time that has come, as far as that is known.
                    reached_ns = int(latest[end - 1])
                    player.has_passed(turns, end - begin, reached_ns, reached_ns)
                    begin = end
                else:
                    yield PacketBatch.nothing(turn.through_ns)
                    player.has_passed(turns, 0, None, turn.through_ns)
        player.has_ended(turns)

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return Played(self._source.between(start_ns, end_ns), self._player)

    def stop(self) -> None:
        self._stopped = True
        super().stop()
