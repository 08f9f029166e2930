"""A filter asked of whole batches chooses what it chooses of telegrams one by one, for any traffic and cut."""

from __future__ import annotations

import numpy as np
import pytest

from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.view.display_filter import DisplayFilter, PacketChoice
from nvscope.view.fields.vocabulary import vocabulary
from tests.dissectors.test_sorter import traffic
from tests.laws import some
from tests.packets import Batches, batch_of
from tests.packets import cut as cut_into
from tests.view.fields.test_frame import rows_of

EXPRESSIONS = [
    "nv.index == 7",
    "nv.items > 3",
    "!(nv.items > 3)",
    "nv.length == 20 || !nv.length",
    "nv.flags.ack",
    "nv.fault",
    'nv.fault == "length" && nv.index != 7',
    "nv.truncated",
    "nv.broadcast && ip.src != 10.0.0.1",
    'nv.service contains "Ack"',
    "ip.version == 6",
    "udp.dstport == 1202 && udp.length > 40",
    "udp.port == 1202",
    "nv.counter > 100",
    "nv.counter & 1 == 1 && nv.index in {1..20}",
    "frame.number % 3 == 0",
    "frame.len > 90",
    "frame.time_delta < 1ms",
    "frame.time_relative > 1",
    "nv.data[0] == 00",
    'list.key == "udp/1202/7"',
    "list.id == 7 || !list.port",
    "node.address == 10.0.0.0/8",
]


@pytest.mark.parametrize("seed", some(range(16)))
def test_the_same_as_of_telegrams(seed: int) -> None:
    frames = traffic(seed)
    packets = batch_of(frames)
    telling = 0
    for expression in EXPRESSIONS:
        chosen = DisplayFilter(expression, vocabulary())
        expected = [number for rows in rows_of(frames) for number in rows.take(chosen(rows)).frame_number.tolist()]
        for cut in (len(packets), 29):
            reading = Reading(choose=PacketChoice(chosen))
            masks = [told.chosen for told in run(Batches(cut_into(packets, cut)), reading, ())]
            assert (np.flatnonzero(np.concatenate(masks)) + 1).tolist() == expected, expression
        telling += 0 < len(expected) < len(packets)
    assert telling > 5
