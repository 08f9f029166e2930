"""NV201 to NV207: what the steps of counters are found to be."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from tests.oracle.wire import Wire
from tests.packets import batch_of, document_of, tracked


def found(wire: Wire) -> dict[str, dict[str, Any]]:
    return {finding["code"]: finding for finding in document_of(tracked([batch_of(wire.frames)]))["findings"]}


def counted_by_node(*order: tuple[int, int]) -> Wire:
    """Return telegrams of one node and list: Counter and SubIndex of each."""
    wire = Wire()
    for number, (counter, subindex) in enumerate(order):
        wire.data(number * 100_000_000, counter, subindex=subindex)
    return wire


def test_a_gap_that_a_telegram_of_another_stream_fills_is_no_loss() -> None:
    # 6 of SubIndex 0 comes before 5 of SubIndex 1: lost on the one, taken back on the other.
    order = [(1, 0), (2, 1), (3, 0), (4, 1), (6, 0), (5, 1), (7, 0), (8, 1), (9, 0), (10, 1)]
    codes = found(counted_by_node(*order))
    assert {"NV203", "NV206"} <= codes.keys()
    assert "NV201" not in codes
    # The same with 8 lost for good.
    codes = found(counted_by_node(*(one for one in order if one[0] != 8)))
    assert {"NV201", "NV203", "NV206"} <= codes.keys()


def test_a_counter_that_is_written_byte_swapped_is_told_as_such() -> None:
    wire = Wire()
    for number in range(100, 400):
        value = number if number < 128 else (number & 0xFF) << 8 | number >> 8
        wire.data(number * 50_000_000, value)
    codes = found(wire)
    assert set(codes) == {"NV207"}
    # All but the step from 127 to 128: 298 of 299.
    assert "It is written byte-swapped: 100 % of its steps" in codes["NV207"]["message"]
    wire = Wire()
    for number in range(300):
        wire.data(number * 50_000_000, number * 7919 % 65536)
    assert "It does not count telegrams." in found(wire)["NV207"]["message"]


def test_a_sender_that_writes_its_counter_byte_swapped_may_pause() -> None:
    wire = Wire()
    for number in range(1_200):
        value = number if number < 128 else (number & 0xFF) << 8 | number >> 8
        wire.data(number * 50_000_000 + (number >= 600) * 3_600_000_000_000, value)
    codes = found(wire)
    assert "NV207" in codes
    assert not {"NV201", "NV202", "NV203", "NV204"} & codes.keys()
    assert "more than there was time for" not in codes["NV207"]["message"]


@pytest.mark.parametrize("repeated", [False, True], ids=["each once", "mirrored"])
def test_a_counter_of_a_whole_node_that_is_written_byte_swapped_is_told_as_such(repeated: bool) -> None:
    """No stream alone has a counter that goes on in any byte order; one of them is sent seldom, and pauses."""
    wire = Wire()
    for number in range(1_000):
        value = number if number < 128 else (number & 0xFF) << 8 | number >> 8
        time_ns = number * 50_000_000 + (number >= 600) * 3_600_000_000_000
        index = 9 if number % 60 == 7 else 7 + number % 2
        for copy in range(1 + repeated):
            wire.data(time_ns + copy * 1_000, value, list_id=index, data=struct.pack("<I", number))
    findings = document_of(tracked([batch_of(wire.frames)]))["findings"]
    told = [finding for finding in findings if finding["code"].startswith("NV20")]
    codes = {(finding["code"], finding["list"]) for finding in told}
    assert codes == {("NV207", f"udp/1202/{index}") for index in (7, 8, 9)}
    for finding in told:
        assert "byte-swapped: 100 % of the steps of all telegrams of the node are" in finding["message"]


def test_a_loss_that_looks_byte_swapped_once_is_a_loss() -> None:
    # 255 telegrams lost in an hour: one step by 256.
    wire = Wire()
    for number in range(40):
        wire.data(number * 50_000_000 + (number >= 20) * 3_600_000_000_000, number + (number >= 20) * 255)
    codes = found(wire)
    assert "NV201" in codes
    assert "NV207" not in codes


def test_telegrams_of_a_sender_that_does_not_count_are_no_mirrored_ones() -> None:
    wire = Wire()
    for number in range(40):
        wire.data(number * 50_000_000, 1, data=bytes(4))
    assert "NV905" not in found(wire)
    for number in range(40):
        wire.data(number * 50_000_000, 1 + number, list_id=8)
        wire.again(number * 50_000_000 + 2_000)
    assert found(wire)["NV905"]["message"].startswith("40 of 80 telegrams equal the one before")
