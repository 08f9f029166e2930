"""Layouts that are proposed from values, against lists whose layout is known; and drafts, read again."""

from __future__ import annotations

import random
import struct
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition import infer as module
from nvscope.definition.field_evidence import Candidate
from nvscope.definition.gvl_text import drafted, gvl_text
from nvscope.definition.infer import GUESS, SURE, Proposal, infer, least_first_bytes
from nvscope.definition.load import load_definitions
from nvscope.definition.packing import pack
from nvscope.definition.segmentation import Segmentation, probabilities, segmentations
from tests.definition.realistic import realistic_list, telegrams_of
from tests.laws import examples

ROWS = 200
TIMES_NS = np.arange(ROWS) * 50_000_000


def proposed(seed: int) -> tuple[set[tuple[int, int]], Proposal]:
    """Return the spans that a random list has, and what is proposed from its telegrams."""
    types, movements = realistic_list(seed)
    data = telegrams_of(types, movements, ROWS, seed)
    spans, offset = set(), 0
    for kind in types:
        spans.add((offset, kind.size_bytes))
        offset += kind.size_bytes
    return spans, infer(len(types), data, data, TIMES_NS)


def test_most_fields_of_usual_lists_are_found_and_sure_ones_nearly_always() -> None:
    found, right = Counter[str](), Counter[str]()
    for seed in range(40):
        spans, proposal = proposed(seed)
        for field in proposal.layouts[0].fields:
            found[field.grade] += 1
            right[field.grade] += (field.offset, field.size_bytes) in spans
    assert right.total() > 0.85 * found.total()
    # Of most integers the sign is a guess.
    assert found[SURE] > 0.2 * found.total()
    assert right[SURE] >= 0.98 * found[SURE]


@examples(20)
@given(st.binary(min_size=1, max_size=40), st.integers(1, 12), st.integers(1, 40), st.integers(0, 99))
def test_whatever_is_proposed_fills_the_telegram(raw: bytes, rows: int, items: int, seed: int) -> None:
    choice = random.Random(seed)
    data = np.array([[byte if choice.random() < 0.8 else choice.randrange(256) for byte in raw] for _ in range(rows)])
    table = data.astype(np.uint8)
    proposal = infer(items, table, table, np.arange(rows) * 1_000_000)
    assert bool(proposal.layouts) != bool(proposal.reason)
    if items <= len(raw):
        assert proposal.layouts or items < 3
    for layout in proposal.layouts:
        assert len(layout.fields) == items
        ends = [field.offset + field.size_bytes for field in layout.fields]
        assert [field.offset for field in layout.fields] == [0, *ends[:-1]]
        assert ends[-1] == len(raw)
        assert all(0 <= field.probability <= 1.000001 for field in layout.fields)
        assert all(field.evidence.isascii() and field.evidence.isprintable() for field in layout.fields)
        if rows < 8:
            assert {field.grade for field in layout.fields} == {GUESS}


def test_what_speaks_for_a_field_is_said() -> None:
    rows = [
        struct.pack("<BHf11sI", number % 3 == 0, 1000 + number, 20 + 5 * np.sin(number / 9), b"Anlage 3", 50 * number)
        for number in range(ROWS)
    ]
    data = np.frombuffer(b"".join(rows), np.uint8).reshape(ROWS, -1)
    (best, *_) = infer(5, data, data, TIMES_NS).layouts
    assert [(field.offset, field.type.name, field.evidence) for field in best.fields] == [
        (0, "BOOL", "FALSE and TRUE only"),
        (1, "UINT", "counts by 1, 1000 to 1199; the sign is a guess"),
        (3, "REAL", "REAL 15 to 24.9994, smooth"),
        (7, "STRING(10)", "text 'Anlage 3'"),
        (18, "TIME", "milliseconds, running with the clock"),
    ]
    assert [field.grade for field in best.fields] == ["likely", "likely", SURE, SURE, "likely"]


def test_the_sign_of_a_number_that_changes_it_is_no_guess() -> None:
    """Numbers around 0 are signed, or they would jump from one end of their range to the other."""
    data = np.frombuffer(
        struct.pack(f"<{ROWS}i", *(round(40 * np.sin(number / 9)) for number in range(ROWS))), np.uint8
    )
    (field,) = infer(1, data.reshape(ROWS, 4), data.reshape(ROWS, 4), TIMES_NS).layouts[0].fields
    assert (field.type.name, field.grade, field.evidence) == ("DINT", SURE, "-40 to 40")


def test_the_rule_of_packing_says_how_large_a_first_field_is() -> None:
    assert least_first_bytes([256]) == 1
    assert least_first_bytes([256, 250]) == 7
    assert least_first_bytes([300]) == 0
    zeros = np.zeros((ROWS, 9), np.uint8)
    first = infer(2, zeros, zeros, TIMES_NS, least_first_bytes=7).layouts[0].fields[0]
    assert first.size_bytes >= 7


@pytest.mark.parametrize("packed", [True, False])
def test_a_draft_gives_the_telegrams_on_the_wire(tmp_path: Path, packed: bool) -> None:
    telegrams = [(0, proposed(0)[1])] if packed else [(number, _lone(number)) for number in range(3)]
    draft = drafted(
        7, 1300, "10.0.0.255", telegrams, acknowledge=True, checksum=False, interval_ns=49_700_000, notes=["]]> *) {x"]
    )
    assert draft.problem == ""
    path = tmp_path / "draft.gvl"
    path.write_text(gvl_text(draft), encoding="utf-8")
    (entry,) = load_definitions([str(path)]).lists
    assert (entry.list_id, entry.port, entry.address, entry.pack) == (7, 1300, "10.0.0.255", packed)
    assert (entry.acknowledge, entry.checksum, entry.cyclic, entry.interval_ns) == (True, False, True, 50_000_000)
    assert [(layout.items, layout.length - 20) for layout in pack(entry)] == [
        (proposal.items, proposal.size_bytes) for _, proposal in telegrams
    ]


def _lone(number: int) -> Proposal:
    data = telegrams_of(*realistic_list(number), ROWS, number)[:, : 2 + number]
    return infer(1, data, data, TIMES_NS)


def test_a_draft_that_would_be_packed_differently_says_so() -> None:
    zeros = np.zeros((ROWS, 8), np.uint8)
    told = infer(8, zeros, zeros, TIMES_NS)
    draft = drafted(7, 1202, "", [(0, told), (1, told)], acknowledge=False, checksum=False, interval_ns=None)
    assert "cut elsewhere" in draft.problem
    assert draft.problem in gvl_text(draft)
    gap = drafted(7, 1202, "", [(0, told), (2, told)], acknowledge=False, checksum=False, interval_ns=None)
    assert "SubIndex 1 was not captured" in gap.problem


SPANS = st.integers(1, 6).flatmap(
    lambda size: st.tuples(
        st.just(size),
        st.integers(1, 5),
        st.lists(
            st.tuples(st.integers(0, size - 1), st.sampled_from([1, 1, 2, size]), st.integers(0, 20)).filter(
                lambda entry: entry[0] + entry[1] <= size
            ),
            max_size=25,
        ),
    )
)


@given(SPANS)
def test_segmentations_are_the_cheapest_of_all_there_are(drawn: tuple[int, int, list[tuple[int, int, int]]]) -> None:
    size, items, spans = drawn
    found = [Candidate(offset, width, (("BYTE", float(price)),)) for offset, width, price in sorted(spans)]

    def ways(offset: int, left: int) -> list[tuple[int, ...]]:
        if not left:
            return [()] if offset == size else []
        return [
            (number, *rest)
            for number, entry in enumerate(found)
            if entry.offset == offset
            for rest in ways(entry.end, left - 1)
        ]

    every = ways(0, items)
    prices = sorted(sum(found[number].price for number in way) for way in every)
    best = segmentations(found, size, items, 3)
    assert [one.price for one in best] == prices[:3]
    told = [tuple(map(id, one.fields)) for one in best]
    assert [sum(field.price for field in one.fields) for one in best] == prices[:3]
    assert len(set(told)) == len(told)
    assert set(told) <= {tuple(id(found[number]) for number in way) for way in every}
    weights = [2.0 ** -sum(found[number].price for number in way) for way in every]
    share = [
        sum(weight for way, weight in zip(every, weights, strict=True) if number in way) / (sum(weights) or 1)
        for number in range(len(found))
    ]
    assert probabilities(found, size, items).tolist() == pytest.approx(share, abs=1e-9)


LARGE = 1_400


@pytest.mark.parametrize("fill", ["zeros", "noise", "text", "specks"])
@pytest.mark.parametrize("items", [1, 2, 20, 350])
def test_large_telegrams_have_no_more_candidates_than_bytes_ask_for(
    fill: str, items: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is looked at grows with the bytes, not with the square of them, whatever a sender puts into them."""
    data = np.zeros((20, LARGE), np.uint8)
    if fill == "noise":
        data = np.random.default_rng(1).integers(0, 256, data.shape).astype(np.uint8)
    elif fill != "zeros":
        data[:, : -2 if fill == "text" else None : 1 if fill == "text" else 7] = 65
    looked_at: list[int] = []

    def counted(found: list[Candidate], *rest: int) -> list[Segmentation]:
        looked_at.append(len(found))
        return segmentations(found, *rest)

    monkeypatch.setattr(module, "segmentations", counted)
    proposal = infer(items, data, data, TIMES_NS[:20])
    assert sum(looked_at) <= (2 if items == 1 else 30 * LARGE)
    assert bool(proposal.layouts) != bool(proposal.reason)
    if items == 1:
        assert [(field.offset, field.size_bytes) for field in proposal.layouts[0].fields] == [(0, LARGE)]
