"""With which findings and causes telegrams are looked at: together where one explains the other, else each alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors import address
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_source
from nvscope.causes.cause import Cause
from nvscope.causes.definitions import DEFINITION_DIFFERS
from nvscope.findings.kind import Severity
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields.shown import NONE, looks
from nvscope.view.fields.verdicts import Verdicts, verdict_fields
from nvscope.view.fields.vocabulary import vocabulary
from tests.laws import examples
from tests.packets import Shown

PLANT = str(Path(__file__).parents[3] / "captures" / "plant.pcapng.gz")
PRESS, BENCH, HMI = "192.168.1.10", "192.168.1.99", "192.168.1.20"

TELEGRAMS, NUMBERS = 6, 4
Pairs = set[tuple[int, int]]
SHOWN = st.sets(st.tuples(st.integers(0, TELEGRAMS - 1), st.integers(0, NUMBERS - 1)))
CAUSE_OF = st.lists(st.integers(NONE, NUMBERS - 1), min_size=NUMBERS, max_size=NUMBERS)


def columns(pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    ordered = sorted(pairs)
    return np.array([at for at, _ in ordered], np.int64), np.array([number for _, number in ordered], np.int64)


def looked_at(findings: Pairs | None, causes: Pairs | None, cause_of: list[int]) -> list[tuple[int, int, int]]:
    """Return position, finding and cause of each look."""
    found = looks(
        TELEGRAMS, None if findings is None else columns(findings), None if causes is None else columns(causes),
        np.array(cause_of, np.int64),
    )  # fmt: skip
    assert found.position.tolist() == sorted(found.position.tolist())
    return list(zip(*(column.tolist() for column in found), strict=True))


@given(SHOWN, SHOWN, CAUSE_OF)
@examples(300)
def test_a_finding_is_looked_at_with_the_cause_that_explains_it(
    findings: Pairs, causes: Pairs, cause_of: list[int]
) -> None:
    expected = []
    for at in range(TELEGRAMS):
        shown = {number for place, number in causes if place == at}
        own = [
            (at, finding, cause_of[finding] if cause_of[finding] in shown else NONE)
            for place, finding in findings if place == at
        ]  # fmt: skip
        own += [(at, NONE, cause) for cause in shown - {cause for _, _, cause in own}]
        expected += own or [(at, NONE, NONE)]
    assert sorted(looked_at(findings, causes, cause_of)) == sorted(expected)


@given(SHOWN, SHOWN, CAUSE_OF)
@examples(100)
def test_who_asks_for_one_alone_sees_the_same_of_it(findings: Pairs, causes: Pairs, cause_of: list[int]) -> None:
    both = looked_at(findings, causes, cause_of)
    alone = looked_at(findings, None, cause_of), looked_at(None, causes, cause_of)
    assert {(at, finding) for at, finding, _ in both if finding != NONE} == findings
    assert {(at, finding) for at, finding, _ in alone[0] if finding != NONE} == findings
    assert {(at, cause) for at, _, cause in both if cause != NONE} == causes
    assert {(at, cause) for at, _, cause in alone[1] if cause != NONE} == causes
    assert {at for at, _, _ in both} == {at for at, _, _ in alone[0]} == set(range(TELEGRAMS))


def chosen(expression: str, lists: Iterable[str], nodes: Iterable[str]) -> list[int]:
    """Return the frames that a filter chooses where one cause is known, which names no frame."""
    found = Inquiry([PLANT]).analyze()
    summary = found.summary
    keys = {str(entry.key): entry.key for entry in summary.lists}
    cause = Cause(
        DEFINITION_DIFFERS, Severity.ERROR, "Nothing fits", "", lists=tuple(keys[name] for name in lists),
        nodes=tuple(summary.addresses.index(node) for node in nodes),
    )  # fmt: skip
    verdicts = Verdicts(summary, [address.halves(text) for text in summary.addresses], found.findings, [cause])
    asked = DisplayFilter(expression, vocabulary(verdicts=verdicts), verdicts)
    return [number for rows in Shown(open_source([PLANT]), chosen=asked) for number in rows.frame_number.tolist()]


def frames(expression: str) -> list[int]:
    asked = Inquiry([PLANT]).filter(expression)
    return [number for rows in Shown(open_source([PLANT]), chosen=asked) for number in rows.frame_number.tolist()]


@pytest.mark.parametrize(
    ("lists", "nodes", "same"),
    [
        (["udp/1202/7"], [], "list.id == 7"),
        (["udp/1202/7", "udp/1202/9"], [], "list.id in {7, 9}"),
        (["udp/1202/7"], [BENCH], f"list.id == 7 && ip.src == {BENCH}"),
        (["udp/1202/3", "udp/1202/7"], [HMI], f"list.id in {{3, 7}} && ip.src == {HMI} || list.id == 7"),
        ([], [PRESS], f"list.id && ip.src == {PRESS}"),
        ([], [], "nv.index == 7000"),
    ],
)
def test_a_cause_that_names_no_frame_is_shown_by_its_lists_and_nodes(
    lists: list[str], nodes: list[str], same: str
) -> None:
    assert chosen("cause.kind", lists, nodes) == frames(same)


def test_what_is_known_of_causes_is_judged_and_for_filters_only() -> None:
    fields = {name: field for name, field in verdict_fields().items() if name.startswith("cause.")}
    assert list(fields) == ["cause.kind", "cause.severity", "cause.title"]
    assert all(field.judged for field in fields.values())
    assert len(fields["cause.kind"].texts) > 20
    assert not fields["cause.title"].texts
