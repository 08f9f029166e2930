"""A process that hands something over, and dies meanwhile."""

from __future__ import annotations

import os
from typing import Any

import pytest

from nvscope.capture.slots import Slots


def let_it_die(monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Let a process that hands values over die when it has handed over so many."""
    sent: list[None] = []
    send = Slots.send

    def dying(slots: Slots, value: Any, data: Any = ()) -> bool:
        if len(sent) == after:
            os.kill(os.getpid(), 9)
        sent.append(None)
        return send(slots, value, data)

    monkeypatch.setattr(Slots, "send", dying)
