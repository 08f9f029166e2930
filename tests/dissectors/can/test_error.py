"""Error frames against ``linux/can/error.h``, read by hand."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType
from dissectors.can.error import (
    CLASSES,
    CONTROLLER_BITS,
    LOCATIONS,
    PROTOCOL_BITS,
    TRANSCEIVER_STATES,
    classes_of,
    describe_error,
    error_details,
)
from dissectors.can.frame import CanBatch, dissect_can
from tests.oracle.frame import Frame
from tests.packets import batch_of

ERROR = 0x2000_0000
HEADER = Path("/usr/include/linux/can/error.h")


def frames_of(*frames: tuple[int, bytes]) -> CanBatch:
    raws = [struct.pack(">IBBBB", word, 8, 0, 0, 0) + data for word, data in frames]
    return dissect_can(batch_of([Frame(0, LinkType.CAN_SOCKETCAN, raw, len(raw)) for raw in raws]))


@pytest.mark.skipif(not HEADER.is_file(), reason="no headers of Linux")
def test_tables_are_those_of_linux() -> None:
    numbers = {
        name: int(value, 16)
        for name, value in re.findall(r"#define (CAN_ERR_\w+)\s+(0x[0-9A-Fa-f]+)U?", HEADER.read_text("utf-8"))
    }

    def of(prefix: str, *but: str) -> set[int]:
        return {
            value
            for name, value in numbers.items()
            if name.startswith(prefix) and not (but and name.startswith(but)) and value
        }

    details = ("CAN_ERR_LOSTARB_", "CAN_ERR_CRTL_", "CAN_ERR_PROT_", "CAN_ERR_TRX_", "CAN_ERR_DLC")
    assert {bit.mask for bit in CLASSES} >= of("CAN_ERR_", *details)
    assert {bit.mask for bit in CONTROLLER_BITS} == of("CAN_ERR_CRTL_")
    assert {bit.mask for bit in PROTOCOL_BITS} == of("CAN_ERR_PROT_", "CAN_ERR_PROT_LOC_")
    assert set(LOCATIONS) == of("CAN_ERR_PROT_LOC_")
    assert set(TRANSCEIVER_STATES) == of("CAN_ERR_TRX_")


def test_a_bus_goes_off_and_comes_back() -> None:
    frames = frames_of(
        (ERROR | 0x204, bytes([0, 0x08, 0, 0, 0, 0, 97, 3])),
        (0x123, bytes(8)),
        (ERROR | 0x204, bytes([0, 0x20, 0, 0, 0, 0, 130, 3])),
        (ERROR | 0x040, bytes(8)),
        (ERROR | 0x100, bytes(8)),
        (ERROR | 0x004, bytes([0, 0x40, 0, 0, 0, 0, 0, 0])),
    )
    assert classes_of(frames).tolist() == [0x204, 0, 0x204, 0x40, 0x100, 4]
    details = error_details(frames)
    assert details.position.tolist() == [0, 2, 3, 4, 5]
    assert details.bus_off.tolist() == [False, False, True, False, False]
    assert details.recovered.tolist() == [False, False, False, True, True]
    assert details.controller.tolist() == [8, 0x20, 0, 0, 0x40]
    assert list(zip(details.tx_errors.tolist(), details.rx_errors.tolist(), strict=True))[:2] == [(97, 3), (130, 3)]


@pytest.mark.parametrize(
    ("classes", "data", "text"),
    [
        (0x001, "", "transmit timeout"),
        (0x002, "0c", "lost arbitration: at bit 12"),
        (0x002, "00", "lost arbitration"),
        (0x004, "0020", "controller problem: error passive by transmit errors"),
        (0x004, "0005", "controller problem: receive buffer overflow, receive errors reached the warning level"),
        (0x088, "00000419", "protocol violation: bit stuffing error, at acknowledge slot; bus error"),
        (0x008, "000080ff", "protocol violation: while sending, at 0xFF"),
        (0x010, "0000000084", "transceiver problem: CAN high: no wire, CAN low: short to CAN high"),
        (0x010, "0000000003", "transceiver problem: 0x03"),
        (0x060, "", "no acknowledgement on transmission; bus off"),
        (0x300, "000000000000807f", "controller restarted; error counters: transmit 128, receive 127"),
        (0x400, "ff", "an error of no known class"),
        (0, "ff", "error frame, class not recorded"),
    ],
)
def test_error_frames_in_words(classes: int, data: str, text: str) -> None:
    assert describe_error(classes, bytes.fromhex(data)) == text


@given(st.lists(st.tuples(st.integers(0, 0xFFFF_FFFF), st.binary(max_size=10)), max_size=10))
def test_any_frames_are_read(drawn: list[tuple[int, bytes]]) -> None:
    frames = frames_of(*drawn)
    details = error_details(frames)
    assert details.position.tolist() == [place for place, (word, _) in enumerate(drawn) if word & ERROR]
    for row, place in enumerate(details.position.tolist()):
        word, data = drawn[place]
        filled = data.ljust(8, b"\0")
        assert details.classes[row] == word & 0x3FF == classes_of(frames)[place]
        assert details.controller[row] == (filled[1] if word & 4 else 0)
        assert details.protocol[row] == (filled[2] if word & 8 else 0)
        assert details.location[row] == (filled[3] if word & 8 else 0)
        assert details.transceiver[row] == (filled[4] if word & 16 else 0)
        if word & 0x3FF:
            assert (details.tx_errors[row], details.rx_errors[row]) == (filled[6], filled[7])
        assert describe_error(word & 0x1FFF_FFFF, data)
