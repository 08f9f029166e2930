"""The key of a list: its text, its order, and what tables have for it."""

import pytest

from dissectors.can.pdo import EXTENDED
from nvscope.list_key import ANY_CHANNEL, ListKey, Transport, told_of


@pytest.mark.parametrize(
    ("key", "text"),
    [
        (ListKey.udp(1202, 7), "udp/1202/7"),
        (ListKey.udp(0, 0), "udp/0/0"),
        (ListKey.udp(65_535, 65_535), "udp/65535/65535"),
        (ListKey.can("can0", 0x181), "can/can0/385"),
        (ListKey.can("can0", 0x1900_0001 | EXTENDED), "can/can0/419430401x"),
        (ListKey.can(ANY_CHANNEL, 0x181), "can/*/385"),
        (ListKey.can("1202", 7), "can/1202/7"),
    ],
)
def test_a_key_is_written_with_its_transport(key: ListKey, text: str) -> None:
    assert (str(key), f"{key}") == (text, text)


def test_a_channel_with_the_name_of_a_port_is_no_port() -> None:
    assert ListKey.can("1202", 7) != ListKey.udp(1202, 7)
    assert {ListKey.can("1202", 7): "CAN", ListKey.udp(1202, 7): "UDP"}[ListKey.udp(1202, 7)] == "UDP"


def test_keys_sort_by_transport_then_port_then_identifier() -> None:
    """Numbers count as numbers, and an extended identifier is behind all standard ones."""
    expected = [
        ListKey.can("can0", 0x7FF), ListKey.can("can0", 1 | EXTENDED), ListKey.can("can1", 0x181),
        ListKey.udp(999, 70), ListKey.udp(1202, 7), ListKey.udp(1202, 10),
    ]  # fmt: skip
    assert sorted(expected[place] for place in (3, 0, 5, 2, 4, 1)) == expected


def test_what_is_told_of_a_channel_goes_before_what_is_told_of_any() -> None:
    own, anywhere, on_udp = ListKey.can("can0", 7), ListKey.can(ANY_CHANNEL, 7), ListKey.udp(1202, 7)
    assert told_of({own: 1, anywhere: 2}, own) == 1
    assert told_of({own: 1, anywhere: 2}, ListKey.can("can1", 7)) == 2
    assert told_of({own: 1}, ListKey.can("can1", 7)) is None
    assert told_of({anywhere: 2}, ListKey.can("can0", 8)) is None
    assert told_of({anywhere: 2}, on_udp) is None
    assert told_of({on_udp: 3}, on_udp) == 3
    assert told_of({own: 0, anywhere: 2}, own) == 0


@pytest.mark.parametrize("key", [ListKey.udp(1202, 7), ListKey.can("can0", 1 | EXTENDED), ListKey.can(ANY_CHANNEL, 7)])
def test_only_a_channel_can_be_any(key: ListKey) -> None:
    expected = ListKey.can(ANY_CHANNEL, key.identifier) if key.transport is Transport.CAN else key
    assert key.on_any_channel == expected
