"""View: one of the eight things that the screen shows, and what all of them can."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from textual.containers import Vertical
from textual.message import Message

from nvscope.tui.look import Look
from nvscope.tui.painting import Palette


class View(Vertical):
    """A view: shows a ``Look``, and does what keys ask for.

    ``title`` and ``action`` are what its tab says and the action that shows it. Only the view that is in front is given
    looks; one that comes to the front is given the last one.
    """

    title: ClassVar[str]
    action: ClassVar[str]
    shows_frames: ClassVar[bool] = False
    """It shows the frames of the ring, which are looked at for it alone."""

    list_key: str | None = None
    """The list whose frames it shows alone, None for all."""

    DEFAULT_CSS = """
    View { height: 1fr; layout: vertical; }
    """

    class Asked(Message):
        """A view asks the screen for something: an action with what stands behind it, such as ``view.packets``."""

        def __init__(self, action: str, told: str = "") -> None:
            super().__init__()
            self.action, self.told = action, told

    class Changed(Message):
        """A view shows something else now: it wants to be shown the same look once more."""

    def show(self, look: Look) -> None:
        """Show a look."""
        raise NotImplementedError

    def act(self, action: str, told: str = "") -> bool:
        """Do what an action says, with what was told behind its name; False where the view knows no such action."""
        raise NotImplementedError

    def paint(self, palette: Palette) -> None:
        """Take other colours."""
        for widget in self.walk_children():
            if hasattr(widget, "palette"):
                widget.palette = palette
                widget.refresh()

    def hints(self) -> Sequence[str]:
        """Return the actions that the last line of the screen tells, the most useful first."""
        return ()

    def copied(self) -> str:
        """Return what is copied: the row under the cursor as text, "" without any."""
        return ""

    def place(self) -> Any:
        """Return what a mark keeps of where the cursor is, None where there is nothing to be marked."""
        return None

    def go_to(self, place: Any) -> bool:
        """Put the cursor where a mark says; False where that is no more."""
        return False

    def restrict(self, key: str | None) -> None:
        """Show what belongs to a list alone, told by its key; None for everything."""
