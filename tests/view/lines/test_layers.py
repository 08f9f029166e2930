"""Layers of a packet: where each begins and ends."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from nvscope.view.lines.layers import layers_of_datagram
from tests.laws import examples
from tests.oracle.builders import LINKS
from tests.oracle.traffic import generate
from tests.packets import Batches, Shown, batch_of


@given(st.integers(0, 10_000), st.sampled_from([*LINKS, None]))
@examples(30)
def test_layers_lie_one_behind_the_other_up_to_the_payload(seed: int, link: int | None) -> None:
    for rows in Shown(Batches([batch_of(generate(seed, frames=100, link=link))])):
        for packet_row, payload in zip(rows.telegrams.datagram.row, rows.telegrams.datagram.payload, strict=True):
            packet = rows.packets.packet(int(packet_row))
            payload_at = int(payload - rows.packets.offset[packet_row])
            found = layers_of_datagram(packet, int(rows.packets.link[packet_row]), payload_at)
            assert found[0].start == 0
            assert found[-1].stop == payload_at
            assert all(before.stop == after.start for before, after in pairwise(found))
            names = [layer.layout.name for layer in found if layer.layout]
            assert names[-1] == "udp"
            assert names[-2] in ("ip", "ipv6")
            assert set(names[:-2]) <= {"eth", "vlan", "sll", "sll2", "null"}
