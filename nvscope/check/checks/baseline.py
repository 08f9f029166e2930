"""The check of everything that a file of rules says, as one verdict: what good captures taught."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from msgspec.structs import replace

from nvscope.check.check import Check, Evidence
from nvscope.check.parameters import REQUIRED, RULE_FILE, Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.list_key import ListKey
from nvscope.units import count_of


def _baseline(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    """Yield what breaks a rule of the file, or cannot be decided, and else the tightest of what is kept."""
    kept = []
    for one in told["inner"]:
        for subject in one.subjects:
            if subject.verdict is Verdict.PASS:
                kept.append((subject, one.rule.id))
                continue
            reason = f"{one.rule.id}: {subject.reason}" if subject.reason else one.rule.id
            yield replace(subject, reason=reason, vacuous=False)
    if len(kept) == sum(len(one.subjects) for one in told["inner"]) > 0:
        tightest, name = min(kept, key=lambda one: _margin(one[0]))
        number = len(told["inner"])
        rules = f"{count_of(number, 'rule')} of the file {'is' if number == 1 else 'are'} kept"
        yield replace(tightest, reason=f"{rules}, the tightest is {name}")


def _margin(one: Judged) -> float:
    return float("inf") if one.tightness is None else one.tightness


CHECKS = (
    Check(
        "baseline", "capture", "All rules of another file are kept, as those that good captures taught.",
        "the limit in it that is broken, or comes nearest to that", "any limit in it is broken",
        'check = "baseline"\nfile = "learnt.toml"', _baseline,
        (Parameter("file", RULE_FILE, "the file of rules, from where this one is", REQUIRED),),
    ),
)  # fmt: skip
