"""Batches put together from parts over one buffer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import U8, U16, PacketBatch


def join(parts: list[PacketBatch]) -> PacketBatch:
    """Return the packets of at least one batch, all over one buffer, as one batch."""
    if len(parts) == 1:
        return parts[0]
    return PacketBatch(
        parts[0].data,
        np.concatenate([part.offset for part in parts]),
        np.concatenate([part.captured for part in parts]),
        np.concatenate([part.original for part in parts]),
        np.concatenate([part.ts_ns for part in parts]),
        np.concatenate([part.link for part in parts]),
        None if all(part.channel is None for part in parts) else np.concatenate([part.channels for part in parts]),
        direction=None
        if all(part.direction is None for part in parts)
        else np.concatenate([part.directions for part in parts]),
    )


class BatchBuilder:
    """Collects rows over one buffer into batches of ``capacity`` packets."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._renew()

    def _renew(self) -> None:
        capacity = self._capacity
        self.rows = 0
        self._offset = np.empty(capacity, np.int64)
        self._captured = np.empty(capacity, np.int32)
        self._original = np.empty(capacity, np.int64)
        self._ts_ns = np.empty(capacity, np.int64)
        self._link: int | U16 = -1
        self._channel: U16 | None = None
        self._direction: U8 | None = None

    def add(self, part: PacketBatch) -> Iterator[PacketBatch]:
        """Take the rows of ``part`` and yield the batches that become full."""
        done = 0
        while done < len(part):
            count = min(self._capacity - self.rows, len(part) - done)
            source, target = slice(done, done + count), slice(self.rows, self.rows + count)
            self._offset[target] = part.offset[source]
            self._captured[target] = part.captured[source]
            self._original[target] = part.original[source]
            self._ts_ns[target] = part.ts_ns[source]
            self._add_link(part.link[source], target)
            if part.channel is not None and self._channel is None:
                self._channel = np.zeros(self._capacity, np.uint16)
            if self._channel is not None:
                self._channel[target] = part.channels[source]
            if part.direction is not None and self._direction is None:
                self._direction = np.zeros(self._capacity, np.uint8)
            if self._direction is not None:
                self._direction[target] = part.directions[source]
            self.rows += count
            done += count
            if self.rows == self._capacity:
                yield self.take(part.data)

    def _add_link(self, link: U16, target: slice) -> None:
        only = int(link[0]) if link.strides == (0,) or bool((link == link[0]).all()) else None
        if isinstance(self._link, int):
            if only is not None and (self._link == only or not self.rows):
                self._link = only
                return
            mixed = np.empty(self._capacity, np.uint16)
            if self.rows:
                mixed[: self.rows] = self._link
            self._link = mixed
        self._link[target] = link

    def take(self, data: U8) -> PacketBatch:
        """Return what was collected, over ``data``, and begin anew."""
        rows = slice(0, self.rows)
        link = PacketBatch.link_column(self._link, self.rows) if isinstance(self._link, int) else self._link[rows]
        channel = None if self._channel is None else self._channel[rows]
        batch = PacketBatch(
            data, self._offset[rows], self._captured[rows], self._original[rows], self._ts_ns[rows], link, channel,
            direction=None if self._direction is None else self._direction[rows],
        )  # fmt: skip
        self._renew()
        return batch
