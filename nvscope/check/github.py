"""Verdicts as annotations of GitHub's workflows: a line of stdout each, at the rule that is broken."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.check.run import Checked
from nvscope.check.verdict import Verdict
from nvscope.check.words import sentence, shown
from nvscope.view.escape import visible

_KINDS = {"error": "error", "warning": "warning", "note": "notice"}


def annotation_lines(found: Checked) -> Iterator[str]:
    """Yield a line for each rule that is broken, or could not be decided."""
    for decided in found.decided:
        if decided.verdict is Verdict.PASS:
            continue
        rule = decided.rule
        kind = _KINDS[rule.severity] if decided.verdict is Verdict.FAIL else "warning"
        told = sentence(found, shown(decided)[0]) or decided.verdict.value
        place = f"file={_property(rule.path)},line={rule.line},title={_property(rule.id)}"
        yield f"::{kind} {place}::{_data(told)}"


def _data(text: str) -> str:
    return visible(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
