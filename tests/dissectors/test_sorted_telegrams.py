"""What varieties know of packets gives the telegrams that dissecting finds, in every column."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from dissectors.netvar import dissect
from dissectors.sorted_telegrams import SortedTelegrams
from dissectors.sorter import Sorter
from dissectors.transport import DatagramBatch
from dissectors.varieties import NO_TELEGRAM
from tests.dissectors.test_sorter import traffic
from tests.packets import batch_of


@pytest.mark.parametrize("seed", range(24))
def test_the_same_as_dissected(seed: int) -> None:
    packets = batch_of(traffic(seed))
    sorter = Sorter()
    sorter.sort(packets[: len(packets) // 2])
    told = sorter.sort(packets)
    expected = dissect(told.packets).telegrams
    found = SortedTelegrams(told, np.flatnonzero(told.variety != NO_TELEGRAM))
    assert len(found) == len(expected)
    for column in fields(DatagramBatch):
        assert getattr(found.datagram, column.name).tolist() == getattr(expected.datagram, column.name).tolist(), column
    assert found.fault.tolist() == expected.fault.tolist()
    assert found.truncated.tolist() == expected.truncated.tolist()
    assert found.ts_ns.tolist() == expected.ts_ns.tolist()
    assert found.header.tolist() == expected.header.tolist()
    some = np.arange(0, len(expected), 3)
    assert [found.payload(place) for place in some] == [expected.payload(place) for place in some]
    part = found.take(some)
    assert part.header.tolist() == expected.take(some).header.tolist()
    assert part.datagram.source_port.tolist() == expected.take(some).datagram.source_port.tolist()
