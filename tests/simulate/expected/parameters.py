"""Expected findings of the Parameter Manager: what the rules of the tests say of the frames themselves."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tests.oracle.frame import Frame
from tests.oracle.rules.parameter import parameters


def expected_of_parameters(frames: Iterable[Frame]) -> list[dict[str, Any]]:
    """Return the findings on requests and replies, by code, who asks and what is asked for."""
    return [
        {"code": code, "list": None, "node": node, "subindex": None, "variable": variable, "count": count}
        for code, node, variable, count, *_ in parameters(frames)[1]
    ]
