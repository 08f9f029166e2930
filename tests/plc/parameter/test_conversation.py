"""A request and what comes of it, told with datagrams and times, without a socket."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.netvar import Service
from nvscope.plc.parameter.conversation import Conversation, Ending, Ignored, Outcome, Patience
from nvscope.plc.parameter.message import Message
from tests.laws import examples
from tests.plc.parameter.wire import BUSY, INDEX, READ, READ_REPLY, WRITE_REPLY, said

MS = 1_000_000
PARTNER = "10.0.0.2"
REQUEST = Message(Service.ODReadRequest, 0x2000, 1, 7)
ASKED = said(READ)


def asking(retries: int = 0) -> Conversation:
    """Return a conversation of which the request was sent at 0 ms."""
    found = Conversation(REQUEST, PARTNER, Patience(500 * MS, retries))
    assert (found.wait_until_ns, found.due(0), found.outcome) == (0, ASKED, None)
    return found


def over(conversation: Conversation) -> Outcome:
    assert conversation.outcome is not None
    assert conversation.due(10**12) is None
    return conversation.outcome


def test_the_answer_ends_it() -> None:
    one = asking()
    one.received(PARTNER, said(READ_REPLY, data=b"\1\2"), 3 * MS)
    found = over(one)
    assert (found.ending, found.latency_ns, found.transmissions) == (Ending.REPLIED, 3 * MS, 1)
    assert found.answer is not None
    assert found.answer.data == b"\1\2"


@pytest.mark.parametrize("error", range(20, 29))
def test_each_refusal_ends_it(error: int) -> None:
    one = asking(retries=3)
    one.received(PARTNER, said(error), MS)
    found = over(one)
    assert (found.ending, found.answer and found.answer.service) == (Ending.REFUSED, error)


@pytest.mark.parametrize(
    ("source", "payload", "why"),
    [
        ("10.0.0.3", said(READ_REPLY), Ignored.OTHER_NODE),
        (PARTNER, b"garbage", Ignored.NO_TELEGRAM),
        (PARTNER, said(READ_REPLY, length=1), Ignored.MALFORMED),
        (PARTNER, said(0, index=7, data=b"\0"), Ignored.OF_A_LIST),
        (PARTNER, said(READ_REPLY, counter=8), Ignored.OTHER_REQUEST),
        (PARTNER, said(READ_REPLY, index=0x2001), Ignored.OTHER_REQUEST),
        (PARTNER, said(READ_REPLY, subindex=2), Ignored.OTHER_REQUEST),
        (PARTNER, said(INDEX, counter=8), Ignored.OTHER_REQUEST),
        (PARTNER, said(WRITE_REPLY), Ignored.OTHER_SERVICE),
        (PARTNER, said(READ), Ignored.OTHER_SERVICE),
    ],
)
def test_what_is_no_answer_changes_nothing(source: str, payload: bytes, why: Ignored) -> None:
    one = asking()
    one.received(source, payload, MS)
    one.received(source, payload, 2 * MS)
    assert (one.outcome, one.due(499 * MS), one.wait_until_ns) == (None, None, 500 * MS)
    one.received(PARTNER, said(READ_REPLY), 499 * MS)
    found = over(one)
    assert (found.ending, dict(found.ignored)) == (Ending.REPLIED, {why: 2})
    assert found.others == (("10.0.0.3",) if why is Ignored.OTHER_NODE else ())


def test_silence_ends_it_at_the_timeout() -> None:
    one = asking()
    assert one.due(500 * MS - 1) is None
    assert one.outcome is None
    assert one.due(500 * MS) is None
    assert (over(one).ending, over(one).latency_ns) == (Ending.SILENT, None)


def test_the_same_is_asked_again_without_an_answer() -> None:
    one = asking(retries=2)
    assert [one.due(at * MS) for at in (499, 500, 501, 999, 1_000, 1_499)] == [None, ASKED, None, None, ASKED, None]
    one.received(PARTNER, said(READ_REPLY), 1_499 * MS)
    assert (over(one).transmissions, over(one).latency_ns) == (3, 499 * MS)


def test_busy_is_asked_again_within_the_timeout() -> None:
    one = asking()
    one.received(PARTNER, said(BUSY), MS)
    one.received(PARTNER, said(BUSY), 2 * MS)  # a duplicate
    assert one.wait_until_ns == 51 * MS
    assert [one.due(50 * MS), one.due(51 * MS), one.due(52 * MS)] == [None, ASKED, None]
    one.received(PARTNER, said(READ_REPLY), 53 * MS)
    found = over(one)
    assert (found.ending, found.busy, found.transmissions, found.latency_ns) == (Ending.REPLIED, 1, 2, 2 * MS)


def test_busy_to_the_end_is_told_as_that_and_is_not_asked_for_ever() -> None:
    one, at, sent = asking(), 0, 1
    while one.outcome is None:
        one.received(PARTNER, said(BUSY), at)
        at = one.wait_until_ns
        sent += one.due(at) is not None
    assert (over(one).ending, sent, at) == (Ending.BUSY, 10, 500 * MS)


def test_what_comes_back_undelivered_ends_it() -> None:
    one = asking()
    one.undelivered("port unreachable", said(READ, counter=6))
    assert one.outcome is None
    one.undelivered("port unreachable", ASKED[:8])
    assert (over(one).ending, over(one).why) == (Ending.UNDELIVERED, "port unreachable")


def test_what_came_back_undelivered_is_sent_again_if_so_many_are_left() -> None:
    one = asking(retries=1)
    one.undelivered("port unreachable")
    assert [one.due(499 * MS), one.due(500 * MS)] == [None, ASKED]
    assert one.due(1_000 * MS) is None
    assert over(one).ending is Ending.SILENT


def test_nothing_changes_what_is_over() -> None:
    one = asking()
    one.received(PARTNER, said(READ_REPLY), MS)
    found = over(one)
    one.received(PARTNER, said(INDEX), 2 * MS)
    one.undelivered("port unreachable")
    assert one.outcome is found


MESSAGES = st.builds(
    said, st.sampled_from([0, 1, 2, 3, 4, 5, 7, 20, 23, 28, 100, 101]), st.sampled_from([0x2000, 7]),
    st.sampled_from([1, 2]), st.sampled_from([7, 8]), data=st.binary(max_size=4),
)  # fmt: skip


@given(
    st.lists(st.tuples(st.integers(0, 300), st.sampled_from([PARTNER, "10.0.0.3"]), MESSAGES | st.binary(max_size=30))),
    st.integers(0, 3),
)
@examples(300)
def test_whatever_comes_it_ends_and_only_an_answer_to_it_is_one(
    came: Sequence[tuple[int, str, bytes]], retries: int
) -> None:
    one, at = asking(retries), 0
    for after, source, payload in came:
        at += after * MS
        one.due(at)
        before = one.outcome
        one.received(source, payload, at)
        if one.outcome is not before:
            assert source == PARTNER
            assert payload[:4] == ASKED[:4]
            assert (payload[8:12], payload[16:18]) == (ASKED[8:12], ASKED[16:18])
            assert payload[4] in (2, *range(20, 29))
    for _ in range(50):
        if one.outcome is not None:
            break
        at = max(one.wait_until_ns, at)
        one.due(at)
    assert one.outcome is not None
    assert one.outcome.transmissions <= (retries + 1) * 11
