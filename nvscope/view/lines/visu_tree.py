"""The tree of a frame with which WebVisu messages were whole: what was asked for, written and answered."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.webvisu import Entry as VisuEntry
from nvscope import units
from nvscope.tracker.readings.form import HIDDEN
from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind, VisuBatch
from nvscope.view.escape import visible
from nvscope.view.lines import tree_lines
from nvscope.view.lines.shown import Spans, Wording
from nvscope.view.lines.table import Cell, Tone
from nvscope.view.lines.transport_tree import TransportTree
from nvscope.view.lines.tree_lines import Entry, label_cell, title_entry
from nvscope.view.lines.visu_words import Variable, message_words, variables_of
from nvscope.view.rows.frames import FrameRows

_NAME = "visu"
_MARGIN = Cell(" " * tree_lines.INDENT)
_AREAS = ("%M", "inputs", "outputs", "retain", "global")


class VisuTree(TransportTree):
    """A ``Tree`` of frames of the protocol: messages lie in any number of frames, and are told of their last one.

    The bytes of a message are not dumped without being asked for: passwords may be among them.
    """

    def __init__(self, rows: FrameRows, wording: Wording, *, dumps: bool = True) -> None:
        super().__init__(rows, _NAME, 0)
        part = rows.parts[_NAME].part
        assert isinstance(part, VisuBatch)
        self._part = part
        self._secrets = wording.secrets

    def spans(self, place: int) -> Spans:
        return super().spans(place)._replace(hidden=not self._secrets)

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        start, _, stop, _ = self.spans(place)
        carried = f"  ends with {units.count_of(stop - start, 'byte')} of this frame"
        first, count = int(self._part.first[place]), int(self._part.count[place])
        for message in range(first, first + count):
            place_of_all = tree_lines.Place(start, stop)
            yield title_entry("WebVisu", [Cell(f"  {self._title(message)}"), Cell(carried, Tone.FAINT)], place_of_all)
            yield from self._facts(message)
            for variable in variables_of(self._part, message, secrets=self._secrets):
                yield _variable(variable)

    def _title(self, message: int) -> str:
        return str(visible(message_words(self._part, message, values=False)))

    def _facts(self, message: int) -> Iterator[Entry]:
        messages = self._part.messages
        kind, asked = Kind(int(messages.kind[message])), int(messages.asked[message])
        if kind in (Kind.READ, Kind.WRITE):
            request = self._part.requests[asked]
            wrong = request.is_miscounted or request.ambiguous
            yield _fact("Declared", units.count_of(request.declared, "variable"), wrong=wrong)
            sent = units.count_of(len(request.entries), "variable")
            yield _fact("Sent", f"{sent} or more, ambiguous" if request.ambiguous else sent, wrong=request.ambiguous)
        if kind in (Kind.REPLY, Kind.UNANSWERED, Kind.LEFT, Kind.UNCLEAR, Kind.REFUSED):
            yield _fact("Request", f"frame {messages.asked_frame[message]}")
        if kind is Kind.REPLY:
            yield _fact("Status", str(messages.status[message]))
            latency_ns = int(messages.latency_ns[message])
            unknown = latency_ns == UNMEASURED_NS
            yield _fact("Took", "not known, seen before its request" if unknown else units.duration(latency_ns))


def _fact(label: str, text: str, *, wrong: bool = False) -> Entry:
    return Entry([_MARGIN, label_cell(label), Cell(text, Tone.WARNING if wrong else Tone.PLAIN)])


def _variable(variable: Variable) -> Entry:
    value = "" if variable.value is None else f" = {visible(variable.value)}"
    tone = Tone.FAINT if variable.value == HIDDEN else Tone.PLAIN
    return Entry([_MARGIN, label_cell(str(visible(variable.name))), Cell(value, tone)], _where(variable.entry))


def _where(entry: VisuEntry) -> str:
    place = entry.place
    if isinstance(place, str):
        return ""
    area = _AREAS[place.ref] if place.ref < len(_AREAS) else f"area {place.ref}"
    size = units.count_of(place.size, "byte") if place.size else "one bit"
    return f"index {entry.number}: {place.type_name}, {area}, offset {place.offset}, {size}"
