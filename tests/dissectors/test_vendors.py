"""Who made a device, by its hardware address."""

from __future__ import annotations

import pytest

from dissectors.vendors import vendor_of


@pytest.mark.parametrize(
    ("hardware", "vendor"),
    [
        (0x000105112233, "Beckhoff Automation GmbH"),
        (0x00A045112233, "PHOENIX CONTACT Electronics GmbH"),
        (0x001B1B445566, "Siemens AG"),
        (0x001BC5000123, "Converging Systems Inc"),  # of a block of 36 bits
        (0xFCD2B6E12345, "Univer S.p.A"),  # of one of 28
        (0x020105112233, ""),  # a local address is nobody's
        (0x010105112233, ""),  # nor is one of a group a device's
        (0xFFFFFFFFFFFF, ""),
    ],
)
def test_the_vendor_of_a_hardware_address(hardware: int, vendor: str) -> None:
    assert vendor_of(hardware) == vendor
