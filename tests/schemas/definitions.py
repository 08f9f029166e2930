"""The schemas of what definition files and the program's own tables tell: layouts, mistakes, differences, words."""

from __future__ import annotations

from typing import get_args

from nvscope.causes.catalogue import BY_NAME
from nvscope.check.catalogue import CATALOGUE as RULE_CHECKS
from nvscope.definition.byte_map import Relation
from nvscope.definition.difference import SETTINGS
from nvscope.definition.lint import RULES, Severity
from nvscope.doctor.checks import CHECKS
from nvscope.doctor.result import State
from nvscope.expression.typed_columns import FieldType
from nvscope.findings.catalogue import CATALOGUE
from nvscope.report.explain_column import MEANINGS
from nvscope.tracker.figures import FIGURES, Joins, Of, Unit
from nvscope.view.documents.verdicts import SEVERITIES
from tests.schemas.shapes import (
    PORT,
    SUBINDEX,
    Properties,
    Schema,
    document,
    duration,
    either,
    maybe,
    record,
    several,
    shared,
    text,
    truth,
    unknown,
    whole,
    word,
)

_IDENTIFIER = maybe(whole("null where no file tells it"))
_RULES = word([rule.id for rule in RULES])
_LINT_SEVERITY = word(get_args(Severity))


def layout() -> Schema:
    """Return the schema of ``gvl layout --json``."""
    element = {
        "offset": whole("from the first byte behind the header; null where nobody knows it"),
        "bytes": maybe(whole("null where nobody knows it", 1)),
        "name": text(),
        "type": text(),
    }
    telegram: Properties = {
        "subindex": maybe(SUBINDEX),
        "items": maybe(whole()),
        "length": maybe(whole("bytes with header; on CAN the DLC; null where nobody knows it")),
        "elements": several(record(element | {"offset": maybe(element["offset"])})),
    }
    entry: Properties = {
        "name": text(),
        "id": _IDENTIFIER,
        "protocol": text(),
        "port": PORT,
        "pack": truth(),
        "assumed": {"const": False},
        "interval_ns": maybe(duration()),
        "min_gap_ns": maybe(duration()),
        "file": text(),
        "data_bytes": maybe(whole("of all telegrams; null where nobody knows it")),
        "unknown": maybe(text("the first element whose size nobody knows")),
        "telegrams": several(shared("telegram")),
    }
    on_can = {
        **entry,
        "port": unknown(),
        "assumed": {"const": True, "description": "nobody has described how such a list is packed"},
        "telegrams": several(shared("can_telegram")),
    }
    cob_id = {"cob_id": maybe(whole("", 0))}
    parts = {
        "list": record(entry), "can_list": record(on_can), "telegram": record(telegram),
        "can_telegram": record({**telegram, **cob_id}),
    }  # fmt: skip
    about = "`nvscope gvl layout --json`: what lies where in each telegram of each list"
    lists = several({"oneOf": [shared("list"), shared("can_list")]})
    return document("layout", about, {"lists": lists}) | {"$defs": parts}


def lint() -> Schema:
    """Return the schema of ``gvl lint --json`` and of ``gvl lint --rules --json``."""
    mistake = {
        "rule": _RULES,
        "severity": _LINT_SEVERITY,
        "file": text(),
        "line": whole("0 is the file as a whole"),
        "column": whole(),
        "list": maybe(text("null for what belongs to a type")),
        "message": text(),
    }
    rule = {"id": _RULES, "severity": _LINT_SEVERITY, "summary": text(), "why": text(), "next_step": text()}
    rules = {"rules": several(record(rule), "those that were broken; all of them with --rules")}
    found = {"files": several(text()), "lists": whole(), "mistakes": several(record(mistake))}
    return either("lint", "`nvscope gvl lint --json`, also with --rules: mistakes in definition files, and the rules",
                  {**found, **rules}, rules)  # fmt: skip


def difference() -> Schema:
    """Return the schema of ``gvl diff --json``."""
    side = {
        "name": text(),
        "id": _IDENTIFIER,
        "protocol": text(),
        "port": maybe(PORT),
        "file": text(),
        "line": whole(),
    }
    setting: Schema = {"type": ["string", "integer", "boolean", "null"]}
    shape = {
        "items": maybe(whole("null on CAN, and where nobody knows it")),
        "length": maybe(whole("bytes with header; on CAN the DLC; null where nobody knows it")),
        "unknown": maybe(text("the first element from which on nobody knows what lies where")),
    }
    part = {"first": text(), "last": text(), "count": whole("", 1), "type": maybe(text("null where they differ"))}
    run = {
        "first": whole("first byte"),
        "last": whole("last byte"),
        "relation": word((relation.value for relation in Relation), "what B makes of the bytes of A"),
        "a": maybe(shared("part")),
        "b": maybe(shared("part")),
    }
    telegram = {
        "subindex": SUBINDEX,
        "cob_id": maybe(whole("of A; null where it is not on CAN, or nobody knows it")),
        "accepted": maybe(truth("whether Items and Length, on CAN the DLC, are as B wants them; null: nobody knows")),
        "same": maybe(truth("whether every byte means the same to both; null where nobody knows")),
        "a": maybe(shared("shape")),
        "b": maybe(shared("shape")),
        "bytes": several(record(run)),
    }
    changes = ("added", "removed", "moved", "retyped", "renamed")
    entry = {
        "a": shared("side"),
        "b": shared("side"),
        "same_on_wire": maybe(truth("null where nobody knows, since elements have no known size")),
        "identical": truth("not even a name differs; false where nobody knows"),
        "settings": several(record({"setting": word(SETTINGS), "a": setting, "b": setting})),
        "variables": several(
            record({"change": word(changes), "name": text(), "a": maybe(text()), "b": maybe(text())})
        ),
        "telegrams": several(record(telegram)),
    }  # fmt: skip
    parts = {"side": record(side), "shape": record(shape), "part": record(part)}
    return document(
        "diff", "`nvscope gvl diff --json`: what differs between two definitions, and which value lands where",
        {
            "same_on_wire": maybe(truth("null where nobody knows, and nothing that is known differs")),
            "lists": several(record(entry)),
            "only_a": several(shared("side")),
            "only_b": several(shared("side")),
        },
    ) | {"$defs": parts}  # fmt: skip


def explain() -> Schema:
    """Return the schema of ``explain --json``."""
    kinds = CATALOGUE.values()
    cause = {
        "kind": word(BY_NAME),
        "brief": text("what it does to a list, in the list's row"),
        "at_least": word(SEVERITIES, "how bad it is, whatever it explains"),
        "meaning": text("what happened"),
        "evidence": text("by what it is told"),
        "next": text("what to do first"),
    }
    finding = {
        "code": word(kind.code for kind in kinds),
        "name": word(kind.name for kind in kinds),
        "severity": word(SEVERITIES),
        "judged": truth("whether any report can have it"),
        "audited": truth("whether audits of DataLogger databases can have it"),
        "security": truth("whether it is about who should not be there"),
        "meaning": text(),
        "causes": several(text(), "the most usual one first"),
        "next_steps": several(text(), "in the order in which to take them"),
    }
    units = [unit for unit in get_args(Unit) if unit]
    figure = {
        "name": word(one.name for one in FIGURES),
        "unit": maybe(word(units)),
        "help": text(),
        "of": several(word(of.value for of in Of)),
        "joins": word((joins.value for joins in Joins), "how the figure of a whole follows from those of its parts"),
    }
    parameter = {
        "name": text(), "kind": text("what may stand there"), "help": text(),
        "default": text("what it is where it is left out, in words"),
    }  # fmt: skip
    check = {
        "name": word(RULE_CHECKS), "subject": text("what is judged, each by itself"), "help": text("what it is for"),
        "worst": text("what is measured"), "fails": text("when it fails"), "parameters": several(record(parameter)),
        "example": text("what stands in a file of rules behind the id"),
    }  # fmt: skip
    return document(
        "explain",
        "`nvscope explain --json`: causes, findings, figures, columns and checks, what they mean and what to do",
        {
            "causes": several(record(cause), "in the order in which they are judged"),
            "findings": several(record(finding)), "figures": several(record(figure)),
            "columns": several(record({"title": word(MEANINGS), "meaning": text()}), "of reports, that hold no figure"),
            "checks": several(record(check), "of rules"),
        },
    )  # fmt: skip


def doctor() -> Schema:
    """Return the schema of ``doctor --json``."""
    checks = [check.name for check in CHECKS]
    place = {
        "name": text("an interface, udp://ADDRESS:PORT, or a file"),
        "sees_all": truth("also what is not for this machine"),
        "frames": whole(),
        "drops": whole("lost while listening"),
        "failure": maybe(text("why it was not listened to, or not to the end")),
    }
    result = {
        "check": word(checks),
        "state": word(state.value for state in State),
        "about": maybe(text("the interface, port, address or number that it is about, null for all")),
        "seen": text(),
        "next": maybe(text("what to do; null where there is nothing to do")),
    }
    expected = {
        "ports": several(whole("UDP", 1, 65_535)), "lists": several(text("key, such as udp/1202/7")),
        "groups": several(text("multicast groups")),
    }  # fmt: skip
    return document(
        "doctor", "`nvscope doctor --json`: why nothing is seen, on this machine or in a capture",
        {
            "verdict": text("the answer in a sentence, without its full stop"),
            "state": word((State.PROBLEM.value, State.OK.value), "whether anything is a problem"),
            "live": truth("false where files were read"),
            "listened_ns": maybe(duration()),
            "expected": record(expected),
            "places": several(record(place)),
            "telegrams": whole("of lists, on expected ports, of others"),
            "left_out": whole("telegrams of more kinds than are told apart"),
            "results": several(record(result), "in the order of the checks"),
            "not_told": several(word(checks), "checks of which a file tells nothing"),
        },
    )  # fmt: skip


def fields() -> Schema:
    """Return the schema of ``keys --json``."""
    field = {
        "name": text(),
        "type": word(kind.value for kind in FieldType),
        "label": text(),
        "help": text(),
        "filter": truth("whether -Y may name it"),
        "output": truth("whether -e may name it"),
        "judged": truth("whether it is known only when the whole capture was read"),
    }
    return document(
        "fields", "`nvscope keys --fields --json`: the fields that -Y and -e may name",
        {
            "fields": several(record(field)),
            "unlisted": whole("how many elements of lists are not gone through: -Y and -e may name them too"),
        },
    )  # fmt: skip
