"""Telegrams from addresses where none of the plant's should be."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.findings.security_plants import analysed, found_in, told_in
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import BOOT_UP, SECOND, A, B, C, Wire

PUBLIC, DOCUMENTATION = "8.8.4.4", "203.0.113.9"


def plant(stranger: str | None = PUBLIC, to: str = B, others: tuple[str, ...] = (A, B)) -> list[Frame]:
    """Return telegrams of some nodes, each of a list of its own, and of a stranger to one of them."""
    wire = Wire()
    for number in range(10):
        for list_id, source in enumerate(others, 1):
            wire.data(number * SECOND, number + 1, source=source, list_id=list_id)
        if stranger is not None:
            wire.data(number * SECOND + 1000, number + 1, source=stranger, list_id=9, to=to)
    return wire.frames


def test_a_public_address_among_private_ones_is_outside(tmp_path: Path) -> None:
    found = analysed(plant(), tmp_path)
    (finding,) = [one for one in found.findings if one.code == "NV965"]
    assert finding.message == (
        f"{PUBLIC} sent 10 telegrams of lists: a public address, where all 2 others that send and receive have private "
        "ones."
    )
    assert (finding.first_ns, finding.frames, finding.list_number, finding.hint) == (1000, (3,), None, "")
    assert found.happened is not None
    (cause,) = found.happened.causes
    assert cause.findings == (finding,)


def test_what_is_broadcast_comes_through_no_router(tmp_path: Path) -> None:
    (finding,) = found_in(plant(to="255.255.255.255"), tmp_path)
    assert finding.hint.startswith("10 of them are broadcast, which routers do not let through")


@pytest.mark.parametrize(
    "frames",
    [
        plant(stranger=None),
        plant(stranger="192.168.7.7"),  # another private subnet: without the project's word, two are usual
        plant(stranger=DOCUMENTATION),
        plant(stranger="169.254.3.3"),  # no DHCP server was there
        plant(others=(A,), to=A),  # one other alone may be the odd one
        plant(others=(A, B, "1.1.1.1")),  # a plant with public addresses
        plant(others=("1.1.1.2", "1.1.1.3"), to="1.1.1.2"),
        plant(to="8.8.8.8"),  # a receiver is public, too
        plant(stranger="2001:4860::9", to="2001:4860::8", others=(A, B)),  # hosts in a LAN have such addresses
    ],
)
def test_where_nobody_says_so_nothing_else_is_outside(frames: list[Frame], tmp_path: Path) -> None:
    assert not told_in(frames, tmp_path)


def test_where_nodes_are_left_out_nobody_knows_whether_all_others_are_private(tmp_path: Path) -> None:
    frames = plant(others=(A, B, "1.1.1.1"))
    assert not told_in(frames, tmp_path, "[limits]\nmax_streams = 3")
    # What the project says holds whoever else there is.
    (told,) = told_in(frames, tmp_path, '[security]\nsubnets = "10.0.0.0/8"\n[limits]\nmax_streams = 3')
    assert told[0] == "NV965"


def test_the_project_says_what_is_inside(tmp_path: Path) -> None:
    frames = plant(stranger="192.168.7.7")
    (told,) = told_in(frames, tmp_path, '[security]\nsubnets = "10.0.0.0/8"')
    assert told == ("NV965", "192.168.7.7 sent 10 telegrams of lists: outside 10.0.0.0/8.", 10)
    assert not told_in(frames, tmp_path, '[security]\nsubnets = ["10.0.0.0/8", "192.168.7.0/24"]')
    # The public one may be inside, too; and of IPv6 nothing is said.
    assert not told_in(plant(), tmp_path, '[security]\nsubnets = ["10.0.0.0/8", "8.8.4.0/24"]')
    assert not told_in(plant(stranger="fd00::9", to="fd00::8"), tmp_path, '[security]\nsubnets = ["10.0.0.0/8"]')


def test_a_host_that_has_a_link_local_address_too_is_not_outside(tmp_path: Path) -> None:
    """Every host has one with IPv6, and no router lets it through."""
    wire = Wire()
    for number in range(10):
        wire.data(number * SECOND, number + 1, source="fd00::1", to="ff02::1", list_id=1)
        wire.data(number * SECOND + 9, number + 1, source="fe80::1", to="ff02::1", list_id=2)
        wire.data(number * SECOND + 99, number + 1, source="fd01::1", to="ff02::1", list_id=3)
    (finding,) = found_in(wire.frames, tmp_path, '[security]\nsubnets = "fd00::/64"')
    assert finding.message.startswith("fd01::1 sent 10 telegrams of lists: outside fd00::/64.")


def test_of_very_many_nodes_outside_one_finding_tells(tmp_path: Path) -> None:
    frames = [
        data_frame(number * 1000, f"172.16.{number // 100}.{number % 100}", B, telegram(list_id=number, counter=1))
        for number in range(300)
    ]
    (finding,) = found_in(frames, tmp_path, '[security]\nsubnets = "10.0.0.0/8"')
    assert finding.message == (
        "300 nodes (172.16.0.0, 172.16.0.1, 172.16.0.2 and 297 more) sent 300 telegrams of lists: outside 10.0.0.0/8."
    )
    assert (finding.count, finding.node, finding.frames) == (300, None, tuple(range(1, 11)))
    assert (finding.first_ns, finding.last_ns) == (0, 299_000)
    assert len(found_in(frames[:8], tmp_path, '[security]\nsubnets = "10.0.0.0/8"')) == 8


def test_requests_and_answers_are_telegrams_too(tmp_path: Path) -> None:
    frames = plant(stranger=None)
    frames.append(data_frame(SECOND, PUBLIC, A, telegram(BOOT_UP, 1, data=b"")))
    frames.append(data_frame(2 * SECOND, C, A, telegram(1, 0x2000, data=b"")))
    told = told_in(frames, tmp_path, f'[security]\nsubnets = ["{A}/32", "{B}/32"]')
    assert told == [
        ("NV965", f"{PUBLIC} sent 1 telegram of lists: outside {A}/32, {B}/32.", 1),
        ("NV965", f"{C} sent 1 request of the Parameter Manager: outside {A}/32, {B}/32.", 1),
    ]
