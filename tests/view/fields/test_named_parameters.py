"""Filters by the names and values of parameters that the project describes."""

from __future__ import annotations

import struct

import pytest

from nvscope.definition.parameters import ParameterDefinition, Parameters
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import String
from nvscope.protocols.table import PROTOCOLS, fields_of
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields.verdicts import Names
from nvscope.view.fields.vocabulary import vocabulary
from tests.laws import some
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame, peel
from tests.oracle.parameter_traffic import parameter_traffic
from tests.oracle.rules.telegram import telegram as telegram_of
from tests.packets import Batches, Shown, batch_of

HMI, PRESS, SAW = "10.0.0.1", "10.0.0.2", "192.168.1.10"
KNOWN = Parameters(
    (
        ParameterDefinition(0x2000, 1, "rSpeed", SCALARS["REAL"], PRESS),
        ParameterDefinition(0x2000, 1, "of others", SCALARS["INT"]),
        ParameterDefinition(0x2001, 0, "", SCALARS["INT"]),
        ParameterDefinition(7, 0, "sName", String(3)),
    )
)


def chosen(frames: list[Frame], expression: str, parameters: Parameters | None = KNOWN) -> list[int]:
    """Return the numbers of the frames that an expression chooses."""
    fields = vocabulary(names=Names(parameters=parameters), fields=fields_of(PROTOCOLS))
    shown = Shown(Batches([batch_of(frames)]), chosen=DisplayFilter(expression, fields))
    return [number for rows in shown for number in rows.frame_number.tolist()]


def frame(service: int, index: int, subindex: int, data: bytes = b"", items: int = 1, partner: str = PRESS) -> Frame:
    ends = (HMI, partner) if service in (1, 3) else (partner, HMI)
    return data_frame(0, *ends, telegram(service, index, subindex, items=items, data=data))


FRAMES = [
    frame(1, 0x2000, 1),
    frame(2, 0x2000, 1, struct.pack("<f", 12.5)),
    frame(3, 0x2000, 1, b"\x2a\0", partner=SAW),
    frame(23, 0x2000, 1, partner=SAW),
    frame(3, 0x2001, 0, b"\1\0\2\0", 2),
    frame(3, 0x2000, 1, b"\1\2"),
    frame(2, 7, 0, b"ab\0c"),
    frame(0, 0x2000, 1, struct.pack("<f", 12.5)),
    frame(4, 0x2000, 1, struct.pack("<f", 12.5)),
    frame(1, 0x3000, 1),
]
FRAMES.append(FRAMES[1]._replace(data=FRAMES[1].data[:-1]))


@pytest.mark.parametrize(
    ("expression", "numbers"),
    [
        ('sdo.name == "rSpeed"', [1, 2, 6, 9, 11]),
        ('sdo.name == "of others"', [3, 4]),
        ("sdo.name", [1, 2, 3, 4, 6, 7, 9, 11]),
        ('sdo.name matches "speed$"', [1, 2, 6, 9, 11]),
        ('sdo.text == "12.5"', [2]),
        ('sdo.text == "42"', [3]),
        ('sdo.text == "[0] = 1, [1] = 2"', [5]),
        ('sdo.text == "\'ab\'" && sdo.name == "sName"', [7]),
        ("sdo.text", [2, 3, 5, 7]),
        ("sdo.value && !sdo.text", [6, 9, 11]),
    ],
)
def test_an_expression_over_parameters(expression: str, numbers: list[int]) -> None:
    assert chosen(FRAMES, expression) == numbers


@pytest.mark.parametrize("parameters", [None, Parameters()])
def test_without_a_project_nothing_has_a_name(parameters: Parameters | None) -> None:
    assert chosen(FRAMES, "sdo.name || sdo.text", parameters) == []


@pytest.mark.parametrize("seed", some(range(40)))
def test_a_telegram_is_about_the_parameter_of_whoever_is_asked(seed: int) -> None:
    frames = parameter_traffic(seed)
    expected = []
    for number, one in enumerate(frames, 1):
        content = peel(one)
        seen = telegram_of(number, 0, content) if content is not None and hasattr(content, "payload") else None
        if seen is None or seen.list_key is not None:
            continue
        node = seen.destination if seen.service in (1, 3) else seen.source
        known = KNOWN.of(str(node), seen.index, seen.subindex)
        if known is not None and known.name:
            expected.append(number)
    assert chosen(frames, "sdo.name") == expected
