"""Tests over all telegrams at once, and how they are joined: each gives a mask."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np

from dissectors.batch import Bool
from nvscope.expression.typed_columns import Column
from nvscope.expression.values import Evaluate, Operands, both_known

Test = Callable[[Operands], Bool]


def over(ask: Callable[[Column], Bool], evaluate: Evaluate, *, everyone: bool = False) -> Test:
    """Return the test whether the answer is yes for one of the values that exist.

    With ``everyone``: for each of those that exist, and there is one.
    """

    def test(operands: Operands) -> Bool:
        answers = [(ask(operand.column), operand.known) for operand in evaluate(operands)]
        return _summary(answers, everyone=everyone)

    return test


def over_pairs(ask: Callable[[Column, Column], Bool], left: Evaluate, right: Evaluate, *, everyone: bool) -> Test:
    """Return the same test for every value of the left side with every one of the right side."""

    def test(operands: Operands) -> Bool:
        answers = [
            (ask(a.column, b.column), both_known(a.known, b.known)) for a in left(operands) for b in right(operands)
        ]
        return _summary(answers, everyone=everyone)

    return test


def _summary(answers: Sequence[tuple[Bool, Bool | None]], *, everyone: bool) -> Bool:
    if not everyone or len(answers) == 1:
        return reduce(np.bitwise_or, [yes if known is None else yes & known for yes, known in answers])
    all_yes = reduce(np.bitwise_and, [yes if known is None else yes | ~known for yes, known in answers])
    if any(known is None for _, known in answers):
        return all_yes
    return all_yes & reduce(np.bitwise_or, [known for _, known in answers if known is not None])


def present(evaluate: Evaluate, operands: Operands) -> Bool:
    """Tell where at least one of the values exists."""
    return reduce(np.bitwise_or, [operand.presence for operand in evaluate(operands)])


def all_of(tests: Sequence[Test], *, every: bool = False) -> Test:
    """Return the test whether all of some tests hold; where the first hold nowhere, the others read nothing.

    Unless ``every`` test is to be asked each time: some remember what was before.
    """

    def test(operands: Operands) -> Bool:
        mask = tests[0](operands)
        for other in tests[1:]:
            if not every and not mask.any():
                break
            mask = mask & other(operands)
        return mask

    return test


def any_of(tests: Sequence[Test], *, every: bool = False) -> Test:
    """Return the test whether one of some tests holds; where the first hold everywhere, the others read nothing.

    ``every`` is as for ``all_of``.
    """

    def test(operands: Operands) -> Bool:
        mask = tests[0](operands)
        for other in tests[1:]:
            if not every and mask.all():
                break
            mask = mask | other(operands)
        return mask

    return test


def odd_of(tests: Sequence[Test]) -> Test:
    """Return the test whether an odd number of some tests holds: of two, exactly one."""
    return lambda operands: reduce(np.bitwise_xor, [test(operands) for test in tests])
