"""Where it may be sent to without being told that it may."""

from __future__ import annotations

import pytest

from nvscope.plc.permission import is_near, plain_address


@pytest.mark.parametrize(
    ("address", "near"),
    [
        ("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("10.0.0.1", True), ("172.16.0.1", True),
        ("172.31.255.255", True), ("192.168.1.20", True), ("169.254.3.4", True), ("fd00::1", True), ("fe80::1", True),
        ("fe80::1%eth0", True), ("::ffff:10.0.0.1", True),
        ("172.32.0.1", False), ("192.0.2.1", False), ("8.8.8.8", False), ("100.64.0.1", False), ("0.0.0.0", False),
        ("224.0.0.1", False), ("255.255.255.255", False), ("2001:db8::1", False), ("ff02::1", False), ("::", False),
        ("::ffff:8.8.8.8", False), ("11.0.0.1", False), ("240.0.0.1", False),
    ],
)  # fmt: skip
def test_private_networks_are_near(address: str, near: bool) -> None:
    assert is_near(address) is near


def test_a_node_is_known_without_its_interface() -> None:
    assert [str(plain_address(one)) for one in ("fe80::1%eth0", "::ffff:10.0.0.1", "10.0.0.1")] == [
        "fe80::1", "10.0.0.1", "10.0.0.1",
    ]  # fmt: skip
