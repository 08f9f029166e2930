"""How frames of a protocol are shown: what each protocol gives, and what it is given."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

from msgspec import Struct, field

from nvscope.view.lines.layers import Layer
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.table import Line
from nvscope.view.lines.tree_lines import Entry
from nvscope.view.rows.frames import FrameRows

if TYPE_CHECKING:  # without definitions, nothing of them is imported
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.parameters import Parameters
    from nvscope.definition.pdos import Pdos


class KnowsCanOpen(Protocol):
    """Knows which CAN frames are CANopen's."""

    def of_frame(self, channel: int, cob_id: int, frame_number: int) -> bool:
        """Tell it of a frame by what came up to it, with itself."""
        ...


class Wording(Struct, frozen=True):
    """What people call things: ``names`` of nodes by the text of their address, defined lists on UDP and on CAN.

    ``canopen`` tells which CAN frames are CANopen's by what the capture has shown so far; without it, none are.
    ``parameters`` are those of the Parameter Manager, None or none where nobody has named any. ``secrets``: passwords
    are shown; else what goes over TCP ports of web visualization (``page_ports``) is not shown as bytes, either.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    layouts: Layouts | None = None
    pdos: Pdos | None = None
    canopen: KnowsCanOpen | None = None
    parameters: Parameters | None = None
    secrets: bool = False
    page_ports: Collection[int] = ()


NO_WORDING = Wording()


class Spans(NamedTuple):
    """Where in its packet a frame's message begins, where the data behind its header do, and where it ends.

    ``hidden``: what it is must not be shown as bytes, since passwords may be among them.
    """

    start: int
    data: int
    stop: int
    hidden: bool = False


HIDDEN_BYTES = "hidden, since passwords may be among them; `packets --show-secrets` shows them"
"""What is said of bytes in their place."""


class LineMaker(Protocol):
    """Makes the lines of pieces that follow each other; columns never get narrower, so that lines stay aligned.

    A line begins with cells of the frame's number and of its time; with ``ends``, of its source and of " → " and its
    destination too.
    """

    @property
    def ends(self) -> bool:
        """Whether lines tell from where to where frames went."""
        ...

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of rows that are all of the protocol."""
        ...


class MakeLines(Protocol):
    """Makes a ``LineMaker``: how times are told, how wide a line may be (None: as it takes), what things are called."""

    def __call__(self, moment: Moment, width: int | None, wording: Wording) -> LineMaker: ...


class Tree(Protocol):
    """The part of trees and dumps that is about a protocol; ``place`` is the position in the protocol's part."""

    def spans(self, place: int) -> Spans:
        """Return where the message lies in its packet."""
        ...

    def layers(self, place: int, packet: bytes, link: int) -> Sequence[Layer]:
        """Return the headers in front of the message."""
        ...

    def entries(self, place: int, packet: bytes) -> Iterator[Entry]:
        """Yield the lines on the message, and on what is behind it."""
        ...


class MakeTree(Protocol):
    """Makes the ``Tree`` of rows of which some, or all, are of the protocol.

    Without ``dumps``, what has no fields is told in its length only.
    """

    def __call__(self, rows: FrameRows, wording: Wording, *, dumps: bool) -> Tree: ...
