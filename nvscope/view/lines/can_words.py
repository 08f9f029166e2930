"""What CAN frames are in words: the list they carry, or what an error frame tells; with evidence, CANopen's."""

from __future__ import annotations

from msgspec import Struct

from dissectors.batch import Bool
from dissectors.can.canopen import describe
from dissectors.can.error import describe_error
from dissectors.can.frame import FD_LENGTHS, MAX_DATA_BYTES, CanBatch, Fault
from nvscope.findings.can import DLC_MISMATCH
from nvscope.list_key import ListKey
from nvscope.units import cob_id, count_of
from nvscope.view.escape import visible
from nvscope.view.lines.shown import NO_WORDING, Wording
from nvscope.view.lines.table import Tone

FAULT_WORDS = {
    Fault.SHORT: "shorter than a CAN frame",
    Fault.XL: "CAN XL, which is not read here",
    Fault.TOO_LONG: f"Length above {FD_LENGTHS[-1]}",
    Fault.CLASSIC_TOO_LONG: f"Length above {MAX_DATA_BYTES} in a frame that is not CAN FD",
    Fault.TRUNCATED: "cut short by the capture",
    Fault.IDENTIFIER: "a standard frame with an identifier above 0x7FF",
}


UNTOLD = "?"
"""In place of what is not known of a frame that was cut off within its header."""


class Meaning(Struct, frozen=True):
    """What a frame is, and how it stands in a line."""

    text: str
    tone: Tone = Tone.PLAIN


def identifier_texts(frames: CanBatch) -> list[str]:
    """Return identifiers in hexadecimal digits, as candump writes them: 3, or 8 of extended ones; ? where unknown.

    Of an error frame these are its classes.
    """
    columns = frames.identifier, frames.extended | frames.error, (frames.fault == Fault.SHORT) | without_class(frames)
    return [
        UNTOLD if short else f"{identifier:08X}" if extended else f"{identifier:03X}"
        for identifier, extended, short in zip(*(column.tolist() for column in columns), strict=True)
    ]


def without_class(frames: CanBatch) -> Bool:
    """Return which are error frames of which nobody recorded anything else: their bytes are a reader's."""
    blank: Bool = frames.error & (frames.identifier == 0)
    return blank


def flags_of(frames: CanBatch, row: int) -> str:
    """Return what kind of frame it is, where it is not a plain data frame."""
    kinds = (
        ("error", frames.error), ("remote", frames.remote), ("FD", frames.fd), ("BRS", frames.brs), ("ESI", frames.esi),
    )  # fmt: skip
    return " ".join(name for name, column in kinds if column[row])


class Meanings:
    """Tells what frames mean, by the defined lists, and what there is of CANopen; each COB-ID is asked for once."""

    def __init__(self, wording: Wording = NO_WORDING) -> None:
        self._pdos = wording.pdos
        self._canopen = wording.canopen
        self._lists: dict[ListKey, str] = {}

    def of(self, channel: str, frames: CanBatch, row: int, frame_number: int) -> Meaning:
        """Return what one of some frames means, on a channel of this name; ``frame_number`` is its place."""
        fault = int(frames.fault[row])
        if fault:
            return Meaning(FAULT_WORDS[Fault(fault)], Tone.WARNING)
        identifier, data = int(frames.identifier[row]), frames.payload(row)
        if frames.error[row]:
            return Meaning(describe_error(identifier, data), Tone.ERROR)
        if frames.extended[row]:
            return Meaning("")
        key = ListKey.can(channel, identifier)
        listed = self._list_name(key)
        if listed:
            size = "" if frames.remote[row] else self._wrong_size(key, int(frames.length[row]))
            return Meaning(f"{listed}{size}", Tone.WARNING if size else Tone.STRONG)
        if self._canopen is None or not self._canopen.of_frame(int(frames.channel[row]), identifier, frame_number):
            return Meaning("")
        return Meaning(describe(identifier, data, bool(frames.remote[row])), Tone.FAINT)

    def _wrong_size(self, key: ListKey, size_bytes: int) -> str:
        """Return that a frame of a list has not the size that its definition gives it."""
        pdo = self._pdos.pdo_of(key) if self._pdos else None
        if self._pdos is None or pdo is None or pdo.layout is None:
            return ""
        if self._pdos.fitting(key, size_bytes) is not None:
            return ""
        size = count_of(pdo.layout.layout.size_bytes, "byte")
        return f": less than the {size} that are known" if pdo.unknown else f": not of {size} ({DLC_MISMATCH.code})"

    def _list_name(self, key: ListKey) -> str:
        if key not in self._lists:
            pdo = self._pdos.pdo_of(key) if self._pdos else None
            name = f"{visible(pdo.list.name or f'list {cob_id(pdo.list.list_id or 0)}')} {pdo.subindex}" if pdo else ""
            self._lists[key] = name
        return self._lists[key]
