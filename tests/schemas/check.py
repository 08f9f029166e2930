"""The schemas of rules, of what comes of them, and of what differs between captures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nvscope.analysis.comparison import KINDS
from nvscope.check.catalogue import CATALOGUE
from nvscope.check.parameters import REQUIRED
from nvscope.check.rules import COMMON, DEFAULTS, SEVERITIES, TEST
from nvscope.check.verdict import Verdict
from nvscope.check.who_asks import PROTOCOLS
from nvscope.toml_table import ValueKind
from tests.schemas.report import capture
from tests.schemas.shapes import (
    LIST_KEY,
    SUBINDEX,
    Schema,
    document,
    headed,
    maybe,
    number,
    record,
    several,
    text,
    time,
    whole,
    word,
)


def check() -> Schema:
    """Return the schema of ``check --json``."""
    verdict = word([one.value for one in Verdict])
    subject = {
        "list": maybe(LIST_KEY),
        "node": maybe(
            text("address of the sender, where it is a stream; of who asks, or writes, where it is about requests")
        ),
        "subindex": maybe(SUBINDEX | {"description": "of the stream"}),
        "variable": maybe(text("name of the variable; of a pair, of both")),
        "channel": maybe(text("the CAN channel")),
        "protocol": maybe(word(PROTOCOLS) | {"description": "of requests; null where it is about none"}),
        "partner": maybe(text("address of who is asked; null of writes, which are to whomever")),
        "port": maybe(whole("on which that is asked")),
        "verdict": verdict,
        "reason": text("why it is so, where the numbers do not say it"),
        "worst": maybe(number("the value nearest to the limit, or farthest beyond it, in the unit")),
        "limit": maybe(number()),
        "margin": maybe(number("how far the worst value is from the limit; negative: broken")),
        "margin_percent": maybe(number("the same in percent of the limit; null where that is 0")),
        "unit": word(
            (
                "ratio",
                "telegrams",
                "events",
                "s",
                "senders",
                "nodes",
                "findings",
                "causes",
                "frames",
                "per second",
                "s per second",
                "requests",
                "writes",
                "",
            )
        ),
        "count": whole("how often it was broken"),
        "first_ns": maybe(time("when it was broken first, or when what was looked for came")),
        "frames": several(whole("", 1), "the first ten"),
        "frames_cut": whole("how many more there are"),
    }
    rule = {
        "id": text(), "check": word(CATALOGUE), "severity": word(SEVERITIES), "verdict": verdict,
        "description": text(), "file": text(), "line": whole(),
        "subjects": several(record(subject), "as lists are"),
    }  # fmt: skip
    return document(
        "check", "`nvscope check --json`: whether captures keep the rules of a team, each with its margin",
        {
            "capture": capture(), "verdict": verdict,
            "counts": record({one.value: whole() for one in Verdict}),
            "rules": several(record(rule), "in the order of their files"),
        },
    )  # fmt: skip


def captures_difference() -> Schema:
    """Return the schema of ``diff --json``."""
    one = {
        "kind": word(KINDS),
        "list": maybe(LIST_KEY),
        "node": maybe(text("address of the sender; null where it is about all of them")),
        "subindex": maybe(SUBINDEX | {"description": "null where the list has but one"}),
        "what": text("what differs; of kind figure its name"),
        "a": maybe(text("what it is in A, in words; null where it is not there")),
        "b": maybe(text("what it is in B")),
        "why": text("by what it is no chance; empty where it is a fact"),
    }
    return document(
        "captures-diff", "`nvscope diff --json`: what differs between two captures of a plant",
        {"a": capture(), "b": capture(), "differences": several(record(one), "by list, those of no list last")},
    )  # fmt: skip


def rules() -> Schema:
    """Return the schema of a rule file, as editors read it."""
    of_rules = []
    for one in CATALOGUE.values():
        keys = {name: _key(*told) for name, told in COMMON.items() if name != "check"}
        own = {told.name: _key(told.kind, told.help, told.default) for told in one.parameters}
        required = ["id", "check", *(told.name for told in one.parameters if told.default is REQUIRED)]
        properties = {"check": {"const": one.name, "description": one.help}, **keys, **own}
        left_out = [key for key in properties if key not in required]
        of_rules.append(
            record(properties, left_out) | {"title": one.name, "description": f"{one.help} Fails when {one.fails}."}
        )
    schema = record(
        {
            "include": {"type": ["string", "array"], "items": {"type": "string"}},
            "defaults": record({name: _key(*told) for name, told in DEFAULTS.items()}, DEFAULTS),
            "rule": several({"anyOf": of_rules}),
            "test": several(
                record(
                    {name: _key(*told) for name, told in TEST.items()}, [one for one in TEST if TEST[one][2] is None]
                ),
                "tests of rules, which `nvscope check --self-test` runs",
            ),
        },
        ["include", "defaults", "rule", "test"],
    )
    return headed("rules", "`nvscope check --rules`: a file of rules, as editors check it", schema)


def _key(kind: ValueKind, told: str, default: Any) -> Schema:
    assert kind.schema, kind.name
    schema: Mapping[str, Any] = kind.schema
    return {**schema, "description": f"{told} ({kind.name})"}
