"""The packets: a list of telegrams and CAN frames, the fields of one of them, its bytes, linked both ways."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical

from dissectors.batch import I64
from nvscope import units
from nvscope.analysis.recent_frames import FoundFrames
from nvscope.analysis.recent_rows import RecentRows
from nvscope.tui.bars import Bar
from nvscope.tui.look import Choice, Look
from nvscope.tui.packets.bytes_pane import BytesPane, width_of
from nvscope.tui.packets.facts import byte_facts, field_facts, in_ring, list_facts, title
from nvscope.tui.packets.fields_pane import SIGN_WIDTH, FieldsPane
from nvscope.tui.packets.list_pane import MARGIN, PacketList
from nvscope.tui.packets.text import PacketText, ShownFrame
from nvscope.tui.views.view import View
from nvscope.view.lines.hexdump import PER_LINE, TonedSpan
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.table import Line, Tone
from nvscope.view.lines.tree_lines import VARIABLES

_LIST, _FIELDS, _BYTES = "list", "fields", "bytes"
_BESIDE = 100
"""From so many columns on, fields and bytes stand beside each other."""

_WIDE = 120
_LEAST_WITH_BYTES = 64
_LEAST_HEIGHT = 12
"""Of less lines, one pane has all."""

_NARROWEST = 40
_DOWN = ("move.down", "move.page-down", "move.half-page-down")
_NO_NUMBERS = np.empty(0, np.int64)


class PacketsView(View):
    """The frames of the ring, as ``nvscope packets`` shows them."""

    title = "Packets"
    action = "view.packets"
    shows_frames = True
    DEFAULT_CSS = """
    PacketsView #packets-list { height: 1fr; }
    PacketsView #packets-below { height: 1fr; }
    PacketsView #packets-fields { width: 1fr; }
    PacketsView #packets-bytes { width: 1fr; }
    """

    def __init__(self) -> None:
        super().__init__(id="packets")
        self._look: Look | None = None
        self._pane = _LIST
        self._alone = False
        self._shows_bytes: bool | None = None  # None: as there is room
        self._wanted_frame: int | None = None
        self._gone_to: tuple[int, int] | None = None  # which moment was gone to, in which ring
        self._rows: RecentRows | None = None
        self._text: PacketText | None = None
        self._made_for: tuple[Any, ...] = ()
        self._frame: ShownFrame | None = None
        self._frame_for: tuple[Any, ...] = ()
        self._started = False

    def compose(self) -> ComposeResult:
        with Vertical(id="packets-list"):
            self._list_bar = Bar()
            yield self._list_bar
            self._list = PacketList()
            yield self._list
        with Horizontal(id="packets-below"):
            with Vertical(id="packets-fields"):
                self._fields_bar = Bar()
                yield self._fields_bar
                self._fields = FieldsPane()
                yield self._fields
            with Vertical(id="packets-bytes"):
                self._bytes_bar = Bar()
                yield self._bytes_bar
                self._bytes = BytesPane()
                yield self._bytes

    # What is shown.

    def show(self, look: Look) -> None:
        self._look = look
        if not self._started:
            # Of what goes on the newest is looked at, of a file the beginning.
            self._started, self._list.follows = True, look.live and self._wanted_frame is None
        self._prepare(look)
        scene, found = look.scene, self._found(look)
        choice = look.choice
        numbers = _NO_NUMBERS if found is None else in_ring(self._chosen(found, choice), scene)
        matches = found.matches if found is not None and choice is not None and choice.suspended else None
        if look.at_ns is None:
            self._gone_to = None
        self._list.show(numbers, self._lines_of, matches)
        self._go_where_wanted(look, found)
        self._tell()

    def _prepare(self, look: Look) -> None:
        """Make what makes lines anew where they have another form."""
        suspended = look.choice is not None and look.choice.suspended
        width = max(self.size.width - 1 - (MARGIN if suspended else 0), _NARROWEST)
        chosen = None if look.choice is None else (look.choice.expression, look.choice.suspended)
        made_for = (width, self._moment(look), look.scene.recent.start_ns, chosen, self.list_key)
        if self._text is None or made_for != self._made_for:
            self._made_for = made_for
            self._text = PacketText(look.scene, self._moment(look), width)
        if self._rows is None:
            self._rows = RecentRows(look.scene)

    @staticmethod
    def _moment(look: Look) -> Moment:
        if not look.live:
            return "r"
        return "u" if look.utc else "a"

    def _found(self, look: Look) -> FoundFrames | None:
        found, choice = look.found, look.choice
        expression = None if choice is None else choice.expression
        if found is None or found.wanted.list_key != self.list_key or found.wanted.expression != expression:
            return None
        return found

    @staticmethod
    def _chosen(found: FoundFrames, choice: Choice | None) -> I64:
        return found.frames if choice is None or choice.suspended else found.matches

    def _lines_of(self, numbers: I64, before: int | None) -> Sequence[Line]:
        look = self._look
        if look is None or self._rows is None or self._text is None:
            return ()
        return self._text.lines(look.scene, self._rows.rows(look.scene, numbers, before))

    def _go_where_wanted(self, look: Look, found: FoundFrames | None) -> None:
        """Go to the frame of the moment that is shown, or to the one that was asked for, once it was looked at."""
        recent = look.scene.recent
        if look.at_ns is not None and found is not None and len(self._list.numbers):
            frame = recent.frame_at(look.at_ns)
            if self._gone_to != (look.at_ns, id(recent)) and found.stop_frame > frame:
                self._gone_to = look.at_ns, id(recent)
                self._list.follows = False
                self._list.go_to(max(int(np.searchsorted(self._list.numbers, frame, "right")) - 1, 0))
        wanted = self._wanted_frame
        if wanted is None or found is None:
            return
        if wanted < recent.first_frame:
            self._wanted_frame = None
            self.app.notify(
                f"Frame {units.count(wanted)} is no longer kept: the oldest one is {units.count(recent.first_frame)}",
                severity="warning",
            )
        elif wanted >= recent.stop_frame or found.stop_frame > wanted:
            self._wanted_frame = None
            if not self._to_frame(wanted):
                self.app.notify(f"Frame {units.count(wanted)} is not shown: {self._why_not()}", severity="warning")

    def _why_not(self) -> str:
        choice = self._look.choice if self._look else None
        if choice is not None and not choice.suspended:
            return "the filter does not choose it"
        return "it is of another list" if self.list_key else "nothing that is looked for is in it"

    def _to_frame(self, frame: int) -> bool:
        """Put the cursor on a frame, or on the next one; False where it is not shown."""
        self._list.follows = False
        row = int(np.searchsorted(self._list.numbers, frame))
        self._list.go_to(row)
        return row < len(self._list.numbers) and int(self._list.numbers[row]) == frame

    def _tell(self) -> None:
        """Show the frame under the cursor, and what is known about the list."""
        self._arrange()
        self._tell_frame()
        self._tell_bars()

    def _arrange(self) -> None:
        """Show the panes that there is room for."""
        is_beside, narrow_bytes = self._is_beside, self._pane == _BYTES or bool(self._shows_bytes)
        shown = {_LIST, _FIELDS, _BYTES} if is_beside else {_LIST, _BYTES if narrow_bytes else _FIELDS}
        if self._alone or self.size.height < _LEAST_HEIGHT:
            shown = {self._pane}
        self.query_one("#packets-list").display = _LIST in shown
        self.query_one("#packets-below").display = bool(shown - {_LIST})
        self.query_one("#packets-fields").display = _FIELDS in shown
        bytes_pane = self.query_one("#packets-bytes")
        bytes_pane.display = _BYTES in shown
        per_line = PER_LINE if self.size.width >= _WIDE else PER_LINE // 2
        bytes_pane.styles.width = width_of(per_line) + 1 if _FIELDS in shown else "1fr"

    @property
    def _is_beside(self) -> bool:
        return self.size.width >= _BESIDE and self._shows_bytes is not False

    def _tell_frame(self) -> None:
        look, frame = self._look, self._list.frame
        if look is None or self._rows is None or self._text is None:
            return
        beside = self._is_beside and not self._alone and self.size.height >= _LEAST_HEIGHT
        width = self.size.width - 1 - SIGN_WIDTH
        if beside:
            width -= width_of(PER_LINE if self.size.width >= _WIDE else PER_LINE // 2) + 1
        # Where there is no room for both, what a field says goes before its bytes.
        beside = beside or self.size.width < _LEAST_WITH_BYTES
        made_for = (frame, look.scene.recent.start_ns, width, beside, self._made_for)
        if made_for != self._frame_for:
            self._frame_for = made_for
            rows = None if frame is None else self._rows.rows(look.scene, np.array([frame]), self._shown_before())
            self._frame = None
            if rows is not None and len(rows):
                before = self._rows.before_in_stream(look.scene, int(rows.frame_number[0]))
                self._frame = self._text.frame(look.scene, rows, before, max(width, _NARROWEST), beside_bytes=beside)
            shown = self._frame
            if shown is None:
                self._fields.tell((), None, tells_bytes=False)
                self._bytes.tell(b"", (), None)
            else:
                self._fields.tell(shown.tree, shown.changed, tells_bytes=not beside)
                self._bytes.tell(shown.packet, _parts(shown), shown.changed)
        self._link()

    def _shown_before(self) -> int | None:
        row = self._list.row
        return int(self._list.numbers[row - 1]) if row > 0 else None

    def _link(self) -> None:
        """Light the bytes of the field, or the field of the byte, under the cursor."""
        self._fields.is_lit = self._pane != _LIST
        self._bytes.has_keys = self._pane == _BYTES
        if self._pane == _BYTES and self._frame is not None:
            self._fields.go_to_byte(self._bytes.byte)
        self._bytes.light(None if self._pane == _LIST else self._fields.place)
        self._fields.redraw()

    def _tell_bars(self) -> None:
        of_list: Iterator[str] = iter(())
        if self._look is not None:
            found, shown = self._found(self._look), len(self._list.numbers)
            of_list = list_facts(self._look, found, shown, self.list_key, follows=self._list.follows)
        self._list_bar.tell(title("Packets", of_list, has_keys=self._pane == _LIST))
        self._fields_bar.tell(title("Fields", field_facts(self._frame), has_keys=self._pane == _FIELDS))
        self._bytes_bar.tell(title("Bytes", byte_facts(self._frame), has_keys=self._pane == _BYTES))

    def on_packet_list_moved(self) -> None:
        self._tell()

    def on_packet_list_opened(self) -> None:
        self.act("view.open")

    def on_bytes_pane_picked(self) -> None:
        self._pane = _BYTES
        self._tell()

    def on_resize(self) -> None:
        # The panes have their new sizes afterwards.
        if self._look is not None:
            self.call_after_refresh(self._again)

    def _again(self) -> None:
        if self._look is not None:
            self.show(self._look)

    # What keys ask for.

    def act(self, action: str, told: str = "") -> bool:
        if action.startswith("move.") and self._move(action):
            return True
        if action in ("find.next", "find.previous"):
            self._to_match(1 if action == "find.next" else -1)
        elif action == "time.follow":
            self._list.follows = True
        elif action == "view.pane":
            self._to_pane()
        elif action == "view.maximise":
            self._alone = not self._alone
        elif action == "show.hex":
            self._toggle_bytes()
        elif action == "view.open":
            self._open()
        elif action == "program.back":
            return self._back()
        else:
            return False
        self._again()
        return True

    def _move(self, action: str) -> bool:
        if self._pane == _BYTES:
            known = self._bytes.move(action)
        elif self._pane == _FIELDS:
            known = self._fields.move(action)
        else:
            known = self._list.move(action)
            if known:
                is_last = self._list.row == len(self._list.numbers) - 1 >= 0
                self._list.follows = action == "move.last" or (is_last and action in _DOWN)
        if known:
            self._tell()
        return known

    def _to_match(self, direction: int) -> None:
        look = self._look
        if look is None:
            return
        if look.choice is None:
            self.app.notify("There is no filter", timeout=2)
            return
        found = self._found(look)
        frame = self._list.frame
        if found is None or frame is None:
            return
        matches = in_ring(found.matches, look.scene)
        at = int(np.searchsorted(matches, frame, "right" if direction > 0 else "left")) - (direction < 0)
        if not 0 <= at < len(matches):
            self.app.notify("No match " + ("behind it" if direction > 0 else "before it"), timeout=2)
            return
        self._to_frame(int(matches[at]))

    def _to_pane(self) -> None:
        if self._is_beside or self._alone or self.size.height < _LEAST_HEIGHT:
            panes = [_LIST, _FIELDS, _BYTES]
        else:
            panes = [_LIST, _BYTES if self._shows_bytes else _FIELDS]
        self._pane = panes[(panes.index(self._pane) + 1) % len(panes)] if self._pane in panes else _LIST

    def _toggle_bytes(self) -> None:
        if self.size.width >= _BESIDE:
            self._shows_bytes = None if self._shows_bytes is False else False
        else:
            self._shows_bytes = not self._shows_bytes
        if not self._shows_bytes and self._pane == _BYTES and not self._is_beside:
            self._pane = _FIELDS
        elif self._shows_bytes and self._pane == _FIELDS:
            self._pane = _BYTES

    def _open(self) -> None:
        """Go from a frame to its fields, from a title to what is below it, from a variable to its values."""
        if self._pane == _LIST:
            self._pane = _FIELDS
            if not self._is_beside:
                self._shows_bytes = False
        elif self._pane == _FIELDS:
            shown = self._frame
            if not self._fields.fold() and self._fields.title == VARIABLES and shown is not None and shown.list_key:
                self.post_message(self.Asked("view.variables", shown.list_key))

    def _back(self) -> bool:
        if self._alone:
            self._alone = False
        elif self._pane != _LIST:
            self._pane = _LIST
        elif self.list_key is not None:
            self.restrict(None)
            return True
        else:
            return False
        self._again()
        return True

    def hints(self) -> Sequence[str]:
        return ("view.pane", "view.open", "find.filter", "find.next", "show.hex")

    def copied(self) -> str:
        if self._pane == _FIELDS:
            return self._fields.text()
        return self._bytes.text() if self._pane == _BYTES else self._list.text()

    def place(self) -> Any:
        return self._list.frame

    def go_to(self, place: Any) -> bool:
        if self._look is None or not isinstance(place, int) or place < self._look.scene.recent.first_frame:
            return False
        found = self._to_frame(place)
        self._tell()
        return found

    def restrict(self, key: str | None) -> None:
        if key is not None and key.startswith("#"):
            if key[1:].isdigit():
                self._wanted_frame = int(key[1:])
                self._list.follows = False
        elif key != self.list_key:
            self.list_key = key
            self.post_message(self.Changed())


def _parts(shown: ShownFrame) -> Sequence[TonedSpan]:
    spans = shown.spans
    return (
        (spans.start, Tone.FAINT), (spans.data, Tone.STRONG), (spans.stop, Tone.PLAIN), (len(shown.packet), Tone.FAINT),
    )  # fmt: skip
