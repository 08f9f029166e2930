"""CANopen's identifiers and the words for its frames."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.can.canopen import (
    FUNCTION_NAMES,
    MAX_COB_ID,
    NO_FUNCTION,
    PREDEFINED,
    describe,
    emergency_text,
    function_of,
    node_of,
)


def functions(identifiers: list[int], extended: bool = False) -> list[str]:
    codes = function_of(np.array(identifiers, np.uint32), np.full(len(identifiers), extended))
    assert codes.dtype == np.uint8
    return [FUNCTION_NAMES[code] for code in codes.tolist()]


def test_every_base_identifier_has_the_function_of_its_range() -> None:
    identifiers = np.arange(MAX_COB_ID + 1, dtype=np.uint32)
    codes = function_of(identifiers, np.zeros(len(identifiers), np.bool_))
    nodes = node_of(identifiers, np.zeros(len(identifiers), np.bool_))
    for identifier, code, node in zip(range(MAX_COB_ID + 1), codes.tolist(), nodes.tolist(), strict=True):
        mine = [service for service in PREDEFINED if service.first <= identifier <= service.last]
        assert FUNCTION_NAMES[code] == (mine[0].name if mine else "")
        # CiA 301: the four upper bits are the function code, the seven lower ones the node-ID
        by_node = bool(mine) and mine[0].name not in ("NMT", "SYNC", "TIME", "LSS")
        assert node == (identifier & 0x7F if by_node else 0)


def test_only_base_identifiers_have_a_function() -> None:
    assert functions([0x000, 0x080, 0x181, 0x705], extended=True) == [""] * 4
    assert functions([0x800, 0x1FFF_FFFF]) == ["", ""]
    assert functions([0x180, 0x181, 0x1FF, 0x200]) == ["", "TPDO1", "TPDO1", ""]
    assert node_of(np.array([0x705, 0x705, 0x80000], np.uint32), np.array([False, True, False])).tolist() == [5, 0, 0]
    assert FUNCTION_NAMES[NO_FUNCTION] == ""


@pytest.mark.parametrize(
    ("identifier", "data", "text"),
    [
        (0x000, "0105", "NMT: start, node 5"),
        (0x000, "8100", "NMT: reset node, all nodes"),
        (0x000, "0305", "NMT: command 3, node 5"),
        (0x000, "01", "NMT: too short"),
        (0x080, "", "SYNC"),
        (0x080, "07", "SYNC: counter 7"),
        (
            0x085,
            "3081110000000000",
            "EMCY node 5: 0x8130 life guard or heartbeat error; register generic, communication",
        ),
        (0x085, "0000000000000000", "EMCY node 5: 0x0000 no error; register clear"),
        (0x085, "42ff800102030405", "EMCY node 5: 0xFF42 device specific; register manufacturer; 01 02 03 04 05"),
        (0x085, "3081", "EMCY node 5: too short"),
        (0x100, "000000005630", "TIME: 2017-11-17 00:00:00.000"),
        (0x100, "40771b0000000000", "TIME: 1984-01-01 00:30:00.000"),
        (0x181, "0102", "TPDO1 node 1"),
        (0x601, "4018100100000000", "SDO request node 1: read 1018:01"),
        (0x581, "4318100178563412", "SDO answer node 1: read 1018:01 = 78 56 34 12"),
        (0x581, "4108100005000000", "SDO answer node 1: read 1008:00, 5 bytes"),
        (0x601, "2b40600006000000", "SDO request node 1: write 6040:00 = 06 00"),
        (0x601, "2240600006000000", "SDO request node 1: write 6040:00 = 06 00 00 00"),
        (0x581, "6040600000000000", "SDO answer node 1: written 6040:00"),
        (0x601, "7000000000000000", "SDO request node 1: read segment"),
        (0x581, "8018100900000206", "SDO answer node 1: abort 1018:09: object does not exist (0x06020000)"),
        (0x581, "8018100901000000", "SDO answer node 1: abort 1018:09: unknown reason (0x00000001)"),
        (0x581, "80181009", "SDO answer node 1: abort 1018:09, too short"),
        (0x581, "e0", "SDO answer node 1: command 0xE0"),
        (0x581, "", "SDO answer node 1: too short"),
        (0x705, "00", "heartbeat node 5: boot-up"),
        (0x705, "05", "heartbeat node 5: operational"),
        (0x705, "ff", "heartbeat node 5: pre-operational"),
        (0x705, "09", "heartbeat node 5: state 9"),
        (0x7E5, "0401", "LSS: switch state of all"),
        (0x7E4, "1100", "LSS: answer, configure node-ID"),
        (0x180, "00", ""),
        (0x800, "00", ""),
        (-1, "00", ""),
    ],
)
def test_frames_in_words(identifier: int, data: str, text: str) -> None:
    assert describe(identifier, bytes.fromhex(data)) == text


def test_remote_frames_ask() -> None:
    assert describe(0x705, b"", remote=True) == "heartbeat node 5: asked for"
    assert describe(0x185, b"", remote=True) == "TPDO1 node 5: asked for"
    assert describe(0x180, b"", remote=True) == ""


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x0000, "no error"),
        (0x00FF, "no error"),
        (0x1000, "generic error"),
        (0x1042, "generic error"),
        (0x1100, ""),
        (0x2310, "current, output side"),
        (0x2900, "current"),
        (0x8150, "CAN-ID collision"),
        (0x8180, "communication"),
        (0x8F00, "monitoring"),
        (0x9012, "external error"),
        (0x9100, ""),
        (0xA000, ""),
        (0xF012, "additional functions"),
        (0xF100, ""),
        (0xFFFF, "device specific"),
    ],
)
def test_emergency_codes_fall_back_to_their_class(code: int, text: str) -> None:
    assert emergency_text(code) == text


@given(st.integers(0, MAX_COB_ID), st.binary(max_size=10), st.booleans())
def test_any_frame_has_words_or_none(identifier: int, data: bytes, remote: bool) -> None:
    text = describe(identifier, data, remote)
    assert bool(text) == any(service.first <= identifier <= service.last for service in PREDEFINED)
    assert text.isprintable()
