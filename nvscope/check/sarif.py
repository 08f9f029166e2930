"""Verdicts as SARIF 2.1.0, for code scanning: a rule is a descriptor, a subject that breaks it a result at its line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.words import command, sentence, shown
from nvscope.version import __version__
from nvscope.view.escape import visible

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_ABOUT = "https://pypi.org/project/nvscope/"
_MOST_SUBJECTS = 50


def sarif(found: Checked, *, inconclusive_fails: bool = False) -> dict[str, Any]:
    """Return the log; with ``inconclusive_fails``, what could not be decided is a failure, else it is open."""
    rules = list(found.decided)
    results = [
        _result(found, decided, number, judged, inconclusive_fails=inconclusive_fails)
        for number, decided in enumerate(rules)
        if decided.verdict is not Verdict.PASS
        for judged in shown(decided)[:_MOST_SUBJECTS]
    ]
    driver = {
        "name": "nvscope", "version": __version__, "informationUri": _ABOUT,
        "rules": [_descriptor(one) for one in rules],
    }  # fmt: skip
    return {"$schema": _SCHEMA, "version": "2.1.0", "runs": [{"tool": {"driver": driver}, "results": results}]}


def _descriptor(decided: Decided) -> Mapping[str, Any]:
    rule = decided.rule
    told: dict[str, Any] = {
        "id": visible(rule.id),
        "name": rule.check.name,
        "shortDescription": {"text": visible(rule.description) or rule.check.help},
        "fullDescription": {"text": f"{rule.check.help} It fails when {rule.check.fails}."},
        "defaultConfiguration": {"level": rule.severity},
    }
    return told


def _result(
    found: Checked, decided: Decided, number: int, judged: Judged, *, inconclusive_fails: bool
) -> Mapping[str, Any]:  # fmt: skip
    rule = decided.rule
    fails = decided.verdict is Verdict.FAIL or inconclusive_fails
    text = sentence(found, judged) or decided.verdict.value
    if shows := command(found, judged):
        text += f"\n{shows}"
    physical: dict[str, Any] = {"artifactLocation": {"uri": _uri(rule.path)}}
    if rule.line:
        physical["region"] = {"startLine": rule.line}
    return {
        "ruleId": visible(rule.id),
        "ruleIndex": number,
        "kind": "fail" if fails else "open",
        # What is open has no level.
        "level": rule.severity if fails else "none",
        "message": {"text": _plain(text)},
        "locations": [{"physicalLocation": physical}],
        "partialFingerprints": {"ruleAndSubject/v1": _fingerprint(decided, judged)},
    }


def _plain(text: str) -> str:
    """Return a text in which nothing is a placeholder or a link."""
    return text.replace("{", "{{").replace("}", "}}").replace("](", "] (")


def _fingerprint(decided: Decided, judged: Judged) -> str:
    """Return what tells a result from others, whenever it was: the rule and the subject."""
    parts: tuple[object, ...]
    parts = decided.rule.id, judged.list, judged.node, judged.subindex, judged.variable, judged.channel
    if judged.protocol is not None:
        parts = *parts, judged.protocol, judged.partner, judged.port
    return sha256("\0".join("" if one is None else str(one) for one in parts).encode("utf-8", "replace")).hexdigest()


def _uri(path: str) -> str:
    """Return the path as a reference: relative ones stay so, for whoever looks has the files elsewhere."""
    if Path(path).is_absolute():
        return Path(path).as_uri()
    return quote(os.fsencode(Path(path).as_posix()), safe="/")
