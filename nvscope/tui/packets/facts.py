"""What the titles of the panes of packets say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64
from nvscope import units
from nvscope.analysis.recent_frames import FoundFrames
from nvscope.analysis.watching import Scene
from nvscope.tui.look import Look
from nvscope.tui.packets.text import ShownFrame
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Line, Tone


def title(name: str, facts: Iterator[str], *, has_keys: bool) -> Line:
    """Return the title of a pane, which says whether keys are for it."""
    told = "   ".join(facts)
    return [
        Cell(f"▸ {name}" if has_keys else f"  {name}", Tone.STRONG if has_keys else Tone.FAINT),
        Cell(f"   {told}" if told else "", Tone.FAINT),
    ]


def list_facts(
    look: Look, found: FoundFrames | None, shown: int, list_key: str | None, *, follows: bool
) -> Iterator[str]:
    """Yield what is said of the list: how many frames it shows, of how many, and from where on there are any."""
    recent = look.scene.recent
    if found is None:
        yield "looking at the frames …"
        return
    every = len(in_ring(found.frames, look.scene))
    yield f"{units.count(shown)} of {units.count(every)}" if shown != every else units.count(shown)
    if look.choice is not None and look.choice.suspended:
        yield units.count_of(len(in_ring(found.matches, look.scene)), "match", "matches")
    if list_key:
        yield f"list {visible(units.list_key(list_key))} alone"
    if recent.first_frame > 1:
        yield f"kept from frame {units.count(recent.first_frame)}"
    if behind := found.behind(recent):
        yield f"{units.count(behind)} not looked at yet"
    if follows and look.live:
        yield "following"


def field_facts(shown: ShownFrame | None) -> Iterator[str]:
    """Yield which frame the fields are of."""
    if shown is not None:
        yield f"frame {units.count(shown.number)}"


def byte_facts(shown: ShownFrame | None) -> Iterator[str]:
    """Yield how many bytes there are, and how many of them are others than before."""
    if shown is None:
        return
    yield units.count(len(shown.packet))
    if shown.changed is not None and shown.before is not None:
        yield f"{units.count(int(shown.changed.sum()))} others than in {units.count(shown.before)}"


def in_ring(numbers: I64, scene: Scene) -> I64:
    """Return the numbers of the frames that a scene has, of some that rise."""
    recent = scene.recent
    return numbers[np.searchsorted(numbers, recent.first_frame) : np.searchsorted(numbers, recent.stop_frame)]
