"""Protocol: what a protocol has on each floor, from the bytes to the line on the screen.

::

    dissector    dissectors/<name>.py               bytes to columns: the ports it asks for, and what is in their frames
    observe      nvscope/tracker/<name>.py          what is counted of it, over all frames
    findings     nvscope/findings/<name>.py         what may be wrong with that: rows of the catalogue
    judge        nvscope/findings/<name>.py         … and what finds it
    fields       nvscope/view/fields/<name>.py      what -Y and -e may name
    lines, tree  nvscope/view/lines/<name>_….py     how it is shown

Rooms of different protocols do not know each other; a file in this folder names those of one protocol, and nothing else
knows them by name. All members are called when they are needed, so that whoever asks for less starts faster.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from msgspec import Struct

if TYPE_CHECKING:
    from dissectors.dissector import Dissector
    from nvscope.findings.facts import Facts
    from nvscope.findings.finding import Finding
    from nvscope.findings.kind import FindingKind
    from nvscope.tracker.accumulator import ProtocolAccumulator
    from nvscope.view.fields.field import TelegramField
    from nvscope.view.lines.shown import MakeLines, MakeTree


class Protocol(Struct, frozen=True, kw_only=True):
    """One protocol; ``title`` is what people call it, ``name`` what ``Told.parts``, rows of frames and fields do.

    ``dissector`` is None where frames are recognised without being asked for (``dissectors.sorter``). ``observe`` makes
    what counts it, which then is ``TrackerState.others[name]``; None where the state itself does (``tracker.state``),
    or nobody. ``judge`` finds what is wrong with what was counted.
    """

    name: str
    title: str
    fields: Callable[[], Sequence[TelegramField]]
    lines: Callable[[], MakeLines]
    tree: Callable[[], MakeTree]
    findings: Callable[[], Sequence[FindingKind]] = tuple
    dissector: Callable[[], Dissector] | None = None
    observe: Callable[[], ProtocolAccumulator] | None = None
    judge: Callable[[Facts], Iterable[Finding]] | None = None
