"""Two literals computed with, before any telegram is looked at."""

from __future__ import annotations

from fractions import Fraction

from nvscope.expression.literals import Constant, Number, Unfit, duration_ns, is_pairs, number, seconds_ns

_MAX_BITS = 4096


def folded(sign: str, left: Constant, right: Constant, text: str) -> Constant:
    """Return the result of computing with two literals, written as ``text``; Unfit where they cannot be.

    Numbers exactly, whole ones as for fields; durations are added and subtracted, and a number beside one is seconds.
    What can be bytes with dashes between them remains that, be it a difference too or not.
    """
    try:
        return _result(sign, left, right, text)
    except Unfit:
        if is_pairs(text):
            return Constant("pairs", text)
        raise


def _result(sign: str, left: Constant, right: Constant, text: str) -> Constant:
    times = duration_ns(left), duration_ns(right)
    if sign in "+-" and times != (None, None):
        a_ns, b_ns = (seconds_ns(side) if ns is None else ns for ns, side in zip(times, (left, right), strict=True))
        return Constant("duration", text, a_ns + b_ns if sign == "+" else a_ns - b_ns)
    a, b = number(left), number(right)
    result: Number
    if sign in "/%" and b == 0:
        raise Unfit("a division by zero")
    if sign in "+-*":
        result = {"+": a + b, "-": a - b, "*": a * b}[sign]
    elif isinstance(a, int) and isinstance(b, int):
        quotient = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        result = quotient if sign == "/" else a - quotient * b
    elif sign == "%":
        raise Unfit("% is for whole numbers")
    else:
        result = Fraction(a) / b
    if max(abs(result.numerator), result.denominator).bit_length() > _MAX_BITS:
        raise Unfit("the number has too many digits")
    return Constant("number", text, result)
