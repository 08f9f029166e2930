"""Mistakes in definition files as data (schema ``nvscope.lint/1``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nvscope.definition.lint import RULES, Mistake, Rule
from nvscope.version import head

_SCHEMA = "nvscope.lint/1"


def lint_document(files: Sequence[str], lists: int, mistakes: Sequence[Mistake]) -> dict[str, Any]:
    """Return the mistakes that ``lint`` found in so many lists of files, and the rules that were broken.

    ``list`` is null for what belongs to a type.
    """
    broken = {mistake.rule.id for mistake in mistakes}
    return {
        **head(_SCHEMA),
        "files": list(files),
        "lists": lists,
        "mistakes": [_mistake(mistake) for mistake in mistakes],
        "rules": [_rule(rule) for rule in RULES if rule.id in broken],
    }


def rules_document() -> dict[str, Any]:
    """Return all rules, in the schema of mistakes."""
    return {**head(_SCHEMA), "rules": [_rule(rule) for rule in RULES]}


def _mistake(mistake: Mistake) -> dict[str, Any]:
    place = mistake.place
    return {
        "rule": mistake.rule.id,
        "severity": mistake.rule.severity,
        "file": place.position.file,
        "line": place.position.line,
        "column": place.position.column,
        "list": place.list_name or None,
        "message": place.message,
    }


def _rule(rule: Rule) -> dict[str, Any]:
    return {
        "id": rule.id,
        "severity": rule.severity,
        "summary": rule.summary,
        "why": rule.why,
        "next_step": rule.next_step,
    }
