"""Reads the CAN frames of an ASAM MDF file by asammdf, and writes them to stdout; run as a process of its own.

asammdf ends the process on some damaged files, and takes memory by what a file says. So whoever wants the frames reads
them from the other side of a pipe, and this file imports nothing of the house: it is run by its path.

What is written, in this machine's byte order: blocks of a kind (one byte) and a size (u32). ``F`` holds records of
``RECORD`` in the order of time, ``E`` is the last one where something went wrong, and has what, as text; ``Z`` is the
last one where nothing did.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

RECORD = np.dtype(
    [
        ("ts_ns", "i8"), ("kind", "u1"), ("extended", "u1"), ("dlc", "u1"), ("held", "u1"), ("identifier", "u4"),
        ("channel", "i4"), ("direction", "i1"), ("fd", "u1"), ("brs", "u1"), ("esi", "u1"), ("data", "u1", (64,)),
    ]
)  # fmt: skip
"""A frame: ``kind`` is a place in ``KINDS``; of an error ``dlc`` is its type. ``channel``, and ``direction`` (0 for
received, 1 for sent), are -1 where the file has none. A time that no int64 holds is the least of them."""

KINDS = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")
HEAD = struct.Struct("=cI")
FRAMES, FAILED, DONE = b"F", b"E", b"Z"

_WAYS = {b"rx": 0, b"tx": 1}
_ERROR_WORDS = ((b"stuff", 3), (b"bit", 1), (b"form", 2), (b"crc", 4), (b"ack", 5))
_CHUNK_RECORDS = 16_384
_BUS_EVENT = 2  # FLAG_CG_BUS_EVENT
_SOURCE_BUS, _BUS_TYPE_CAN = 2, 2
_FINE_SECONDS = 4_000_000
_MOST_SECONDS = (1 << 62) / 1e9
_NO_TIME_NS = -(1 << 63)
_LEAST_MEMORY_BYTES = 4 << 30
_OF_DATA_FRAMES = "pyarrow", "polars"


class _Group:
    """The frames of one channel group, a chunk at a time: those of ``records`` are still to be written."""

    def __init__(self, mdf: Any, index: int, kind: int, start_ns: int) -> None:
        self._mdf = mdf
        self._index = index
        self._kind = kind
        self._start_ns = start_ns
        self._left = int(mdf.groups[index].channel_group.cycles_nr)
        self._done = 0
        self._chunk = _CHUNK_RECORDS
        self.fault = ""
        self.records = np.empty(0, RECORD)

    @property
    def ended(self) -> bool:
        return self._done >= self._left

    def fill(self) -> None:
        """Take the next chunk where nothing is left of the last one.

        What cannot be read is asked for in smaller and smaller chunks: all before the record that is cut is whole.
        """
        while not len(self.records) and not self.ended:
            count = min(self._chunk, self._left - self._done)
            try:
                # Not raw: where fields share a byte, only what is converted has been taken apart.
                signal = self._mdf.get(
                    KINDS[self._kind], group=self._index, raw=False, record_offset=self._done, record_count=count
                )
            except Exception:
                if count == 1:
                    self.fault = f"frame {self._done + 1} of channel group {self._index + 1} is cut or broken"
                    self._left = self._done
                self._chunk = max(count // 4, 1)
                continue
            self._done += count
            self.records = self._of(signal.samples, np.asarray(signal.timestamps, np.float64))

    def _of(self, samples: Any, seconds: Any) -> Any:
        name = KINDS[self._kind]
        told = samples.dtype.names or ()
        records = np.zeros(len(samples), RECORD)

        def column(field: str) -> Any:
            full = f"{name}.{field}"
            return samples[full] if full in told else None

        # Further from the start, a float of seconds holds no more than microseconds.
        fine = np.abs(seconds) < _FINE_SECONDS
        known = np.abs(seconds) <= _MOST_SECONDS
        seconds = np.where(known, seconds, 0.0)
        since_ns = np.rint(np.where(fine, seconds * 1e9, np.rint(seconds * 1e6) * 1e3)).astype(np.int64)
        if abs(self._start_ns) > 1 << 62:
            known[:] = False
        records["ts_ns"] = _NO_TIME_NS
        records["ts_ns"][known] = self._start_ns + since_ns[known] if known.any() else 0
        records["kind"] = self._kind
        identifier, extended = column("ID"), column("IDE")
        if identifier is not None:
            identifier = identifier.astype(np.uint32)
            records["identifier"] = identifier & np.uint32(0x1FFF_FFFF)
            records["extended"] = identifier >> np.uint32(31)
        if extended is not None:
            records["extended"] |= extended != 0
        channel = column("BusChannel")
        records["channel"] = -1 if channel is None else channel
        records["direction"] = _directions(column("Dir"))
        data, size = column("DataBytes"), column("DataLength")
        if data is not None and data.ndim == 2:
            width = min(data.shape[1], RECORD["data"].shape[0])
            records["data"][:, :width] = data[:, :width]
            records["held"] = width if size is None else np.minimum(size, width)
        dlc = column("DLC") if name != "CAN_ErrorFrame" else _error_types(column("ErrorType"))
        records["dlc"] = 0 if dlc is None else dlc
        for field, full in (("fd", "EDL"), ("brs", "BRS"), ("esi", "ESI")):
            flag = column(full)
            if flag is not None:
                records[field] = flag != 0
        return records


def _directions(told: Any) -> Any:
    if told is None:
        return -1
    if told.dtype.kind in "SU":
        return np.array([_WAYS.get(bytes(text).lower(), -1) for text in told.astype("S").tolist()])
    return np.where(told == 0, 0, np.where(told == 1, 1, -1))


def _error_types(told: Any) -> Any:
    """Return types of errors as numbers, 0 for what is none; a file may bring names for them."""
    if told is None or told.dtype.kind not in "SU":
        return told
    texts = [text.lower() for text in told.astype("S").tolist()]
    return [next((number for word, number in _ERROR_WORDS if word in text), 0) for text in texts]


def _groups(mdf: Any, start_ns: int) -> Iterator[_Group]:
    for index, group in enumerate(mdf.groups):
        head = group.channel_group
        source = head.acq_source
        if not head.flags & _BUS_EVENT or not head.cycles_nr or source is None:
            continue
        if source.source_type != _SOURCE_BUS or source.bus_type != _BUS_TYPE_CAN:
            continue
        names = {channel.name for channel in group.channels}
        for kind, name in enumerate(KINDS):
            if name in names:
                yield _Group(mdf, index, kind, start_ns)


def _merged(groups: list[_Group]) -> Iterator[Any]:
    """Yield the records of all groups by time; each keeps its own order."""
    while groups:
        for group in groups:
            group.fill()
        groups = [group for group in groups if len(group.records)]
        if not groups:
            return
        latest = [np.maximum.accumulate(group.records["ts_ns"]) for group in groups]
        open_ends = [int(keys[-1]) for group, keys in zip(groups, latest, strict=True) if not group.ended]
        bound = min(open_ends) if open_ends else None
        parts, keys = [], []
        for group, own in zip(groups, latest, strict=True):
            count = len(own) if bound is None else int(np.searchsorted(own, bound, "right"))
            parts.append(group.records[:count])
            keys.append(own[:count])
            group.records = group.records[count:]
        yield np.concatenate(parts)[np.argsort(np.concatenate(keys), kind="stable")]


def _limit_memory(path: str) -> None:
    try:
        import resource  # noqa: PLC0415
    except ImportError:
        return
    most = _LEAST_MEMORY_BYTES + 16 * os.path.getsize(path)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _reader() -> Any:
    """Return asammdf's class for files, without what it and pandas import for data frames: a third of its time."""
    for name in _OF_DATA_FRAMES:
        sys.modules.setdefault(name, None)  # type: ignore[arg-type]  # an import of it fails, as if it were missing
    try:
        from asammdf import MDF  # noqa: PLC0415
    except ImportError:
        for name in _OF_DATA_FRAMES:
            del sys.modules[name]
        from asammdf import MDF  # noqa: PLC0415
    return MDF


def write(path: str, output: BinaryIO) -> None:
    """Write the frames of a file as blocks."""
    failed = "its head cannot be read"
    try:
        _limit_memory(path)
        mdf = _reader()(path)
        start = mdf.header.start_time
        start_ns = int(start.timestamp()) * 1_000_000_000 + start.microsecond * 1000
        failed = "the records of its channel groups cannot be read"
        groups = list(_groups(mdf, start_ns))
        for records in _merged(groups):
            content = records.tobytes()
            output.write(HEAD.pack(FRAMES, len(content)) + content)
        failed = next((group.fault for group in groups if group.fault), "")
    except BrokenPipeError:
        return
    except MemoryError:
        failed = "reading it takes too much memory"
    except BaseException:
        # What asammdf stumbled over is told in words of Python, which say nothing to who has the file.
        failed = failed or "it cannot be read"
    if failed:
        text = failed.encode("utf-8")
        output.write(HEAD.pack(FAILED, len(text)) + text)
    else:
        output.write(HEAD.pack(DONE, 0))
    output.flush()


if __name__ == "__main__":
    # Whatever libraries print must not come between the blocks.
    blocks = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    write(sys.argv[1], blocks)
    # What is half open is left to the system: asammdf says much on its way out.
    os._exit(0)
