"""What came of the rules' own tests, for people: what is wrong first, what is as expected in a line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope import units
from nvscope.check.self_test import Tested
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Line, Tone, wrap


def lines(found: Sequence[Tested], width: int) -> Iterator[Line]:
    """Yield a line for each test that did not come out as expected, and how many did."""
    wrong = [one for one in found if one.wrong]
    for one in wrong:
        name = Cell(visible(one.test.rule.id), Tone.STRONG)
        yield from wrap([Cell("✗", Tone.ERROR), Cell(" "), name, Cell(f"  {visible(one.wrong)}")], width, hanging=2)
        yield from wrap([Cell(visible(one.test.where), Tone.FAINT)], width, 2, 2)
    if wrong:
        yield []
    fine = len(found) - len(wrong)
    told = f"{units.count(fine)} of {units.count_of(len(found), 'test')} came out as expected"
    yield [Cell("✗", Tone.ERROR) if wrong else Cell("●", Tone.GOOD), Cell(" "), Cell(told, Tone.STRONG)]
