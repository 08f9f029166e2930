"""What one process hands over is what the other one receives, whatever there is room for."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import U8
from dissectors.stretches import Uncopied, together
from nvscope.capture.slots import Slots
from tests.laws import examples

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot copy a process")

_COLUMNS = st.builds(
    lambda values, kind, step: np.array(values, kind)[::step],
    st.lists(st.integers(0, 99), max_size=400), st.sampled_from(["u1", "<i8", "?", "<u2"]), st.integers(1, 3),
)  # fmt: skip
_VALUES = st.lists(st.tuples(st.lists(_COLUMNS, max_size=3), st.lists(st.binary(max_size=900), max_size=4)), max_size=8)


def uncopied(data: bytes) -> Uncopied:
    def copy(place: U8) -> None:
        place[:] = np.frombuffer(data, np.uint8)

    return Uncopied(len(data), copy)


def handed_over(slots: Slots, sent: Sequence[tuple[Any, Sequence[bytes]]]) -> list[tuple[Any, bytes]]:
    """Return what is received of values and data that another process sends."""
    copy = os.fork()
    if not copy:
        slots.send_here()
        for value, data in sent:
            slots.send(value, together([uncopied(one) for one in data]))
        slots.close()
        os._exit(0)
    slots.receive_here()
    found = [(value, bytes(data)) for value, data in slots.received()]
    slots.close()
    os.waitpid(copy, 0)
    return found


@given(sent=_VALUES, size_bytes=st.sampled_from([1, 64, 1000, 1 << 16]))
@examples(60)
def test_values_and_data_arrive_in_their_order(sent: list[Any], size_bytes: int) -> None:
    found = handed_over(Slots((), size_bytes), sent)
    assert len(found) == len(sent)
    for (columns, data), (sent_columns, sent_data) in zip(found, sent, strict=True):
        assert data == b"".join(sent_data)
        assert [(column.dtype, column.tolist()) for column in columns] == [
            (column.dtype, column.tolist()) for column in sent_columns
        ]


def test_columns_may_be_kept_when_the_next_ones_come() -> None:
    sent = [(np.full(100, number), ()) for number in range(20)]
    found = handed_over(Slots((), 1 << 16), sent)
    assert [set(column.tolist()) for column, _ in found] == [{number} for number in range(20)]


def test_an_object_that_both_have_is_not_handed_over() -> None:
    large, other = np.zeros(1 << 20), object()
    ((found, _),) = handed_over(Slots((large, other), 1 << 10), [(([large, 1], other), ())])
    assert found[0][0] is large
    assert found[0][1] == 1
    assert found[1] is other


def test_who_sends_hears_that_nobody_receives_any_more() -> None:
    slots = Slots((), 1 << 10)
    copy = os.fork()
    if not copy:
        slots.send_here()
        while slots.send(1):
            pass
        os._exit(7)
    slots.receive_here()
    received = slots.received()
    assert next(received).value == 1
    received.close()
    slots.close()
    assert os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]) == 7


def test_what_is_cut_off_is_the_end(capfd: pytest.CaptureFixture[str]) -> None:
    slots = Slots((), 1 << 10)
    copy = os.fork()
    if not copy:
        slots.send_here()
        slots.send(np.arange(9))
        os.kill(os.getpid(), 9)
    slots.receive_here()
    assert [one.value.tolist() for one in slots.received()] == [list(range(9))]
    slots.close()
    os.waitpid(copy, 0)
    assert capfd.readouterr() == ("", "")
