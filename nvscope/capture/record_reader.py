"""What reading pcap and pcapng has in common: a lockstep walk over the records, their columns, batches, and faults."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator

from msgspec import Struct

from dissectors.batch import I64, PacketBatch
from nvscope.capture.batch_builder import BatchBuilder
from nvscope.capture.byte_window import View
from nvscope.capture.content import Content
from nvscope.capture.lockstep import Framing, LockstepWalker
from nvscope.capture.reader import ReadingSizes, WindowReader
from nvscope.capture.source import Truncation

MAX_PACKET_BYTES = 262_144
"""Captured bytes of a packet that are believed without a larger snap length; tcpdump's and Wireshark's own limit."""

MAX_SNAP_BYTES = 16 << 20
"""Captured bytes of a packet that are believed at all."""

# The walk visits a stretch all over: small enough to stay in the cache, large enough for many lanes.
_FIRST_STRIDE_BYTES = 64 << 10
_SMALL_RECORD_BYTES = 256
_LARGE_STRIDES = 4
"""Of records that are not small, a stretch of so many strides is walked at a time: it is jumped over, not read."""


class Taken(Struct, frozen=True):
    """The packets of some records, where in the view the records end, and why they end there if not by choice.

    ``incomplete`` is a record that is not whole in the view, ``fault`` says what is wrong with a record that is.
    """

    packets: PacketBatch
    after: int
    fault: str = ""
    incomplete: bool = False


class RecordReader(WindowReader):
    """A reader of a format whose records tell their length."""

    framing: Framing

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        self._record_bytes = 0.0
        self._doubtful_times = 0
        self._first_doubtful = 0
        self._first_doubt = ""

    @abstractmethod
    def _take(self, view: View, found: I64) -> Taken:
        """Decode the records at ``found``, as a walk returns them; may change ``framing`` for what comes after."""

    def read(self, view: View) -> Iterator[PacketBatch]:
        sizes = self.sizes
        columns = BatchBuilder(sizes.batch_packets)
        here = view.start
        framing = None
        incomplete = False
        stride = sizes.stride_bytes if self._record_bytes else min(_FIRST_STRIDE_BYTES, sizes.stride_bytes)
        while here < view.stop and not self.finished and not incomplete:
            if framing is not self.framing:
                framing = self.framing
                walker = LockstepWalker(
                    view.data, view.end, framing, record_bytes=self._record_bytes, lanes=sizes.lanes
                )
            stop = min(here + stride, view.stop)
            if self._record_bytes < _SMALL_RECORD_BYTES:
                # Reading the stretch in order brings it into the cache at several times the speed of the walk's jumps.
                view.data[here : min(stop, view.end)].max()
            found = walker.walk(here, stop)
            self._record_bytes = walker.record_bytes
            if not len(found):
                incomplete = True
                break
            taken = self._take(view, found)
            here, incomplete = taken.after, taken.incomplete
            self.position = view.origin + here
            if taken.fault:
                self._stop_at(self.position, f"damaged: {taken.fault}; nothing after it can be read")
            self.progress.frames += len(taken.packets)
            # After a section in the other byte order the walk begins small again: there may be many of them.
            longest = sizes.stride_bytes * (_LARGE_STRIDES if self._record_bytes >= _SMALL_RECORD_BYTES else 1)
            stride = min(2 * stride, longest) if framing is self.framing else min(4096, stride)
            yield from columns.add(taken.packets)
        if columns.rows:
            yield columns.take(view.data)
        if view.ends_file and not self.finished:
            if incomplete:
                self._stop_at(self.position, f"cut short: the last record has only {view.end - here} bytes left of it")
            elif here >= view.end:
                self.finished = True
                if self.progress.left_out:
                    self.progress.truncation = Truncation(self._first_doubtful, self.progress.left_out)

    def _doubt_times(self, rows: I64, position: int, frames: int, what: str) -> None:
        """Tell of packets whose times cannot be right: some of a batch that has ``frames`` in front of it.

        ``position`` is where the first of them lies in the file, ``what`` says what is wrong with its time.
        """
        if not self._doubtful_times:
            self._first_doubtful = position
            self._first_doubt = f"frame {frames + int(rows[0]) + 1} has {what}"
        self._doubtful_times += len(rows)
        more = "" if self._doubtful_times == 1 else f"; {self._doubtful_times} such frames"
        self.progress.left_out = self._first_doubt + more

    def _judge_last(self, view: View, found: I64) -> tuple[I64, int, str, bool]:
        """Return the whole records, where the last of them ends, what is wrong there, and whether it is a cut."""
        framing, at = self.framing, int(found[-1])
        field = view.data[at + framing.length_at : at + framing.length_at + 4]
        length = int(field.view(framing.byte_order + "u4")[0])
        if not framing.shortest <= length <= framing.longest:
            fault = f"a record of {length} bytes, expected {framing.shortest} to {framing.longest}"
            return found[:-1], at, fault, False
        if length % framing.alignment:
            return found[:-1], at, f"a record of {length} bytes, expected a multiple of {framing.alignment}", False
        after = at + length + framing.length_adds
        if after > view.end:
            return found[:-1], at, "", True
        return found, after, "", False

    def _stop_at(self, position: int, message: str) -> None:
        if self.progress.left_out:
            message += f"; before that, {self.progress.left_out}"
        self.progress.truncation = Truncation(position, message)
        self.finished = True
