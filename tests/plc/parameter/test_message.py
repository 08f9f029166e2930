"""Messages: the bytes that the document has, and whatever else is no message."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.netvar import Service
from nvscope.plc.parameter.message import Flaw, Message, read_message
from tests.laws import examples
from tests.plc.parameter.wire import READ, READ_REPLY, heard, said

U16 = st.integers(0, 0xFFFF)
SERVICES = [one for one in Service if one not in (0, 5, 6)]


@given(st.sampled_from(SERVICES), U16, U16, U16, U16, st.binary(max_size=300))
@examples(200)
def test_a_message_is_these_bytes_and_these_bytes_are_the_message(
    service: Service, index: int, subindex: int, counter: int, items: int, data: bytes
) -> None:
    message = Message(service, index, subindex, counter, items, data)
    assert message.packed() == said(service, index, subindex, counter, items, data)
    assert tuple(heard(message.packed())) == (service, index, subindex, counter, items, data)
    assert read_message(message.packed()) == message


@pytest.mark.parametrize(
    ("payload", "flaw"),
    [
        (b"", Flaw.NO_TELEGRAM),
        (bytes(40), Flaw.NO_TELEGRAM),
        (said(READ)[:19], Flaw.MALFORMED),
        (said(READ, length=21), Flaw.MALFORMED),
        (said(READ) + b"\0", Flaw.MALFORMED),
        (said(7), Flaw.MALFORMED),
        (said(29), Flaw.MALFORMED),
        (said(2**32 - 1), Flaw.MALFORMED),
        (said(READ, identity=b"3S-0"), Flaw.NO_TELEGRAM),
        (said(0), Flaw.OF_A_LIST),
        (said(5), Flaw.OF_A_LIST),
        (said(6), Flaw.OF_A_LIST),
    ],
)
def test_what_is_no_message_is_told(payload: bytes, flaw: Flaw) -> None:
    assert read_message(payload) is flaw


def test_an_identity_as_the_document_prints_it_is_taken() -> None:
    assert read_message(said(READ_REPLY, identity=b"0-S3")) == Message(Service.ODReadRequestReply, 0x2000, 1, 7)


@given(st.binary(max_size=60) | st.binary(max_size=40).map(lambda rest: b"\0-S3" + rest))
@examples(400)
def test_no_bytes_raise(payload: bytes) -> None:
    found = read_message(payload)
    if isinstance(found, Message):
        assert heard(found.packed())[:5] == heard(payload[:16] + payload[16:18] + b"\0\0" + payload[20:])[:5]
