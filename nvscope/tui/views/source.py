"""The source: what each one says of itself, what is kept of its frames, limits, and what the program takes."""

from __future__ import annotations

import time
from collections.abc import Sequence

from textual.app import ComposeResult

from nvscope.findings.capture import LIMIT_REACHED
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.own_load import OwnLoadMeter
from nvscope.tui.views.view import View
from nvscope.view.lines.plant.source_blocks import (
    Block,
    limits_block,
    lines_of,
    own_block,
    recording_block,
    ring_block,
    source_block,
)

_NARROWEST = 30
_REFRESH_S = 1.0


class SourceView(View):
    """Blocks of facts, told anew once a second even where nothing comes."""

    title = "Source"
    action = "view.source"

    def __init__(self) -> None:
        super().__init__(id="source")
        self._look: Look | None = None
        self._meter = OwnLoadMeter()
        self._load = self._meter.measure(0)
        self._measured_s = 0.0

    def compose(self) -> ComposeResult:
        self._lines = LinesView()
        yield self._lines

    def on_mount(self) -> None:
        self.set_interval(_REFRESH_S, self._tick)

    def _tick(self) -> None:
        # Measured behind other views, too: what it takes is known at once when somebody asks.
        self._load = self._meter.measure(self.app.draws)  # type: ignore[attr-defined]
        if self.display and self._look is not None:
            self.show(self._look)

    def show(self, look: Look) -> None:
        self._look = look
        self._lines.show(lines_of(self._blocks(look), max(self.size.width - 1, _NARROWEST)))

    def _blocks(self, look: Look) -> Sequence[Block]:
        scene = look.scene
        known = scene.snapshot
        left_out = sum(finding.count for finding in known.findings if finding.kind is LIMIT_REACHED)
        old_ns = time.monotonic_ns() - scene.made_ns if look.at_ns is None else None
        recording = self.app.recording  # type: ignore[attr-defined]
        most = scene.inquiry.reading().max_streams
        return [
            *(source_block(info, look.clock, scene.at_ns) for info in known.infos),
            *(
                []
                if recording is None
                else [
                    recording_block(
                        recording.path,
                        recording.frames,
                        recording.bytes,
                        recording.files,
                        recording.failure,
                        is_on=recording.is_on,
                    )
                ]
            ),
            ring_block(scene.recent, look.clock, scene.at_ns),
            limits_block(known.summary, most, left_out),
            own_block(self._load, scene.took_ns, old_ns),
        ]

    def on_resize(self) -> None:
        if self._look is not None:
            self.show(self._look)

    def act(self, action: str, told: str = "") -> bool:
        return self._lines.move(action)

    def copied(self) -> str:
        return "\n".join("".join(cell.text for cell in line) for line in self._lines.lines)
