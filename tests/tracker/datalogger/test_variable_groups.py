"""Groups of variables are those that rows connect, whatever the order of the rows."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.datalogger.variable_groups import VariableGroups
from tests.laws import examples

VARIABLES = 7
ROWS = st.lists(st.sets(st.integers(0, VARIABLES - 1), max_size=4), max_size=8)


def connected(rows: list[set[int]]) -> list[set[int]]:
    """Return groups by the plain rule: sets that share a variable are one."""
    found: list[set[int]] = []
    for row in filter(None, rows):
        found = [one for one in found if not one & row] + [row.union(*(one for one in found if one & row))]
    return found


@examples(200)
@given(rows=ROWS)
def test_variables_are_together_that_rows_connect(rows: list[set[int]]) -> None:
    groups = VariableGroups(VARIABLES)
    for number, row in enumerate(rows):
        before = set(groups.of.tolist())
        gone = groups.join(np.array(sorted(row), np.int64))
        assert set(gone) == before - set(groups.of.tolist())
        expected = {min(one): one for one in connected(rows[: number + 1])}
        assert groups.there == sorted(expected)
        for group, own in expected.items():
            assert set(np.flatnonzero(groups.of == group).tolist()) == own
            assert groups.are_one(np.array(sorted(own)))
    for one in ({0, 1}, {2}, set(), {3, 4, 5}):
        known = any(one <= own for own in connected(rows)) or not one
        assert groups.are_one(np.array(sorted(one), np.int64)) == known
