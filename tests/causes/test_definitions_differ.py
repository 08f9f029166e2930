"""definition-differs: what is told where telegrams do not fit the only definition of their list."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from nvscope.causes.cause import Cause
from nvscope.definition.model import ListDefinition
from nvscope.definition.variables import Type
from nvscope.findings.misfit import Shape
from tests.causes.defined_plants import sent, told
from tests.definition.lists import BOOL, INT, LREAL, REAL, UDINT, list_of
from tests.findings.defined import SENT, mismatch


@pytest.mark.parametrize(
    ("types", "variable", "byte", "shift_bytes"),
    [
        ([BOOL, INT, REAL], "v2", 7, 8),
        ([BOOL, INT, REAL, UDINT, LREAL], "v4", 11, -4),
        ([BOOL, INT, INT, LREAL], "v3", 13, 2),
    ],
)
def test_the_first_variable_and_the_shift_are_data(
    types: list[Type], variable: str, byte: int, shift_bytes: int
) -> None:
    misfit = mismatch(list_of(types)).misfit
    assert misfit is not None
    assert (misfit.variable, misfit.byte, misfit.shift_bytes) == (variable, byte, shift_bytes)
    assert misfit.sent == Shape(4, 15)


def differing(sends: Sequence[Type], defines: Sequence[Type], directory: Path) -> Cause:
    """Return the cause that a list is defined otherwise than it is sent."""
    entry: ListDefinition = list_of(list(sends), list_id=12)
    (cause,) = told(sent(entry, 12), list_of(list(defines), list_id=12), directory=directory)
    assert cause.kind.name == "definition-differs"
    return cause


def test_a_variable_that_is_not_defined(tmp_path: Path) -> None:
    cause = differing(SENT, [BOOL, INT, LREAL], tmp_path)
    assert cause.title == "List test does not fit its definition since 0.0 s"
    assert list(cause.checked) == [
        "4 items in 15 bytes are sent, 3 in 11 are defined",
        "it would fit with one more variable of 4 bytes",
        "4 bytes more than up to the end of v2",
    ]


def test_a_variable_that_is_not_sent(tmp_path: Path) -> None:
    cause = differing([BOOL, INT, LREAL], SENT, tmp_path)
    assert list(cause.checked) == [
        "3 items in 11 bytes are sent, 4 in 15 are defined",
        "it would fit without v2",
        "v3 at byte 7 is the first that cannot be there, 4 bytes short",
    ]


def test_of_several_telegrams_the_subindex_is_told(tmp_path: Path) -> None:
    cause = differing([LREAL] * 40, [LREAL] * 39, tmp_path)
    assert cause.checked[0] == "8 items in 64 bytes are sent, 7 in 56 are defined (SubIndex 1)"


def test_a_telegram_more_than_is_defined(tmp_path: Path) -> None:
    cause = differing([LREAL] * 40, [LREAL] * 32, tmp_path)
    assert cause.checked[0] == "SubIndex 1 is sent, the definition ends with SubIndex 0"


def test_what_differs_in_pack_alone_says_what_to_set(tmp_path: Path) -> None:
    unpacked = list_of([BOOL, INT, REAL], list_id=12, pack=False)
    (cause,) = told(sent(unpacked, 12), list_of([BOOL, INT, REAL], list_id=12), directory=tmp_path)
    assert cause.checked[1] == "it would fit if the list were not packed"
    assert cause.next.startswith("Set Pack to FALSE in the definition")
