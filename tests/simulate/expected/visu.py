"""What a report must say of WebVisu pages: what the rules of the tests say of the frames themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from tests.oracle.frame import Frame
from tests.oracle.rules.visu import Visu, Written


@dataclass(frozen=True)
class ExpectedOfVisu:
    """Rows of ``visu``, what was written, and findings by code, who asks and what is asked for."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    writes: list[Written] = field(default_factory=list)
    findings: list[dict[str, Any]] = field(default_factory=list)


def expected_of_visu(frames: Iterable[Frame]) -> ExpectedOfVisu:
    """Return what is to be said where pages are looked for on the usual ports."""
    rules = Visu()
    for frame in frames:
        rules.observe(frame)
    findings = [
        {
            "code": one["code"], "list": None, "node": one["client"], "subindex": None, "variable": one["variable"],
            "count": one["count"],
        }
        for one in rules.findings()
    ]  # fmt: skip
    return ExpectedOfVisu(rules.rows(), rules.writes, findings)
