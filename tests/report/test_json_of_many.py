"""JSON of many rows, which is written by columns, is that of the plain document."""

from __future__ import annotations

import json
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.findings.judge import judge
from nvscope.report import json as json_face
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.can_frames import batches_of_log
from tests.laws import examples
from tests.oracle.builders import DATA, MILLISECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate
from tests.packets import batch_of, tracked


def assert_alike(batches: Iterable[PacketBatch]) -> None:
    state = tracked(batches)
    summary = summarize(state)
    findings = judge(state, summary=summary)
    drawn, plain = (report_document(summary, findings, [], drawn=one) for one in (True, False))
    assert json_face.render(drawn) == json.dumps(plain, indent=2) + "\n"


def sent(row: int, list_id: int, subindex: int, sender: int) -> Frame:
    payload = telegram(DATA, list_id, subindex, counter=row % 7)
    return data_frame(START + row * MILLISECOND, f"10.0.{sender >> 8}.{sender & 255}", "255.255.255.255", payload)


@given(st.integers(0, 10_000))
@examples(20)
def test_of_any_traffic(seed: int) -> None:
    assert_alike([batch_of(generate(seed, frames=300))])


# At, below and above how many rows are written at once.
@pytest.mark.parametrize("many", [1, 127, 128, 129, 300])
def test_of_many_lists_with_several_streams(many: int) -> None:
    frames = [sent(row, 1 + row % many, row // many % 2, 1 + row // many // 2) for row in range(many * 4)]
    assert_alike([batch_of(frames)])


@pytest.mark.parametrize("many", [127, 128, 129, 300])
def test_of_a_list_with_many_streams_between_short_ones(many: int) -> None:
    subindexes = [sent(row, 2, row % many, 1) for row in range(2 * many)]
    senders = [sent(row, 4, 0, row) for row in range(many)]
    short = [sent(row, 1 + row % 5, 0, 1) for row in range(10)]
    assert_alike([batch_of(subindexes), batch_of(senders), batch_of(short)])


@pytest.mark.parametrize("many", [1, 129, 300])
def test_of_many_identifiers(many: int) -> None:
    lines = (f"({row // 1000}.{row % 1000:03}000) can{row % 2} {row % many:08X}#0102" for row in range(3 * many))
    batches, _ = batches_of_log("\n".join(lines))
    assert_alike(batches)
