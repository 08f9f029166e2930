"""Batches that are made of packets hold these packets, and room behind them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PAD_BYTES, LinkType, PacketBatch
from tests.laws import examples


@given(st.lists(st.binary(max_size=40), max_size=8))
@examples(50)
def test_a_batch_of_packets_holds_them(packets: list[bytes]) -> None:
    times = list(range(5, 5 + len(packets)))
    batch = PacketBatch.of(packets, LinkType.RAW, times)
    assert [batch.packet(row) for row in range(len(batch))] == packets
    assert batch.ts_ns.tolist() == times
    assert batch.original.tolist() == batch.captured.tolist() == [len(packet) for packet in packets]
    assert batch.single_link == (LinkType.RAW if packets else None)
    assert len(batch.data) == sum(map(len, packets)) + PAD_BYTES
    assert PacketBatch.of(packets, LinkType.RAW).ts_ns.tolist() == [0] * len(packets)
