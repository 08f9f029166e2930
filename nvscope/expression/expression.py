"""Expressions, compiled: names become fields, literals become values of their types, and a mask comes out.

As in Wireshark: a comparison with a field that a telegram lacks is false, ``!=`` too, while ``!(x == 1)`` is true.
Where a name stands for several fields (``udp.port``), ``!=`` wants all of them to differ, everything else one that
fits. A value alone asks whether it exists and, where it was computed, whether it is not 0.

Unlike Wireshark: a BOOL alone asks whether it is true (``nv.flags.ack``), and a part that a value does not have whole
does not exist. Numbers compared with times and durations are seconds.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import cast

import numpy as np
from lark import Token

from dissectors.batch import Bool
from nvscope.expression import literals, spans
from nvscope.expression.columns import BytesColumn, FieldType, NameTable, TextColumn
from nvscope.expression.comparison import compare, told
from nvscope.expression.literals import Constant, LiteralKind, Number, Unfit, Value
from nvscope.expression.masks import Test, all_of, any_of, odd_of, over, over_pairs, present
from nvscope.expression.mistake import ExpressionError, Span
from nvscope.expression.names import nearest
from nvscope.expression.pattern import Pattern, PatternError
from nvscope.expression.syntax import Node, parse, span_of
from nvscope.expression.values import (
    Compute,
    Evaluate,
    Operand,
    Operands,
    Part,
    Read,
    common_bits,
    computed,
    real_arithmetic,
    whole_arithmetic,
)

_SIGNS = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
_WORDS = {
    FieldType.UNSIGNED: "a whole number",
    FieldType.SIGNED: "a whole number",
    FieldType.REAL: "a number",
    FieldType.TIME: "a time",
    FieldType.DURATION: "a duration",
    FieldType.ADDRESS: "an address",
    FieldType.BYTES: "bytes",
    FieldType.BOOL: "true or false",
    FieldType.TEXT: "a text",
}
_WHOLE = (FieldType.UNSIGNED, FieldType.SIGNED)
_NUMBERS = (*_WHOLE, FieldType.REAL)
_MAX_FOLDED_BITS = 4096
_MAX_VALUES = 64

_S, _R, _D, _T = FieldType.SIGNED, FieldType.REAL, FieldType.DURATION, FieldType.TIME
_ARITHMETIC = {
    **{(_S, sign, _S): _S for sign in "+-*/%"},
    **{(a, sign, b): _R for sign in "+-*/" for a, b in ((_R, _R), (_R, _S), (_S, _R))},
    **{(_D, sign, _D): _D for sign in "+-"},
    (_D, "*", _S): _D,
    (_S, "*", _D): _D,
    (_D, "/", _S): _D,
    (_T, "+", _D): _T,
    (_D, "+", _T): _T,
    (_T, "-", _D): _T,
    (_T, "-", _T): _D,
}
"""What comes out of which signs between which types."""

_TESTS = {
    "disjunction", "exclusive", "conjunction", "inversion", "comparison", "member", "stranger", "contains", "matches",
}  # fmt: skip
_LITERALS = {"digits", "colons", "iec_time", "string", "raw_string"}


@dataclass(frozen=True, slots=True)
class Expression:
    """A compiled expression. ``fields`` are the names of the fields that it may read, in the order they occur."""

    text: str
    fields: tuple[str, ...]
    test: Test

    def mask(self, read: Read) -> Bool:
        """Return in which telegrams the expression holds; ``read`` gives a field's column and where it exists.

        A field is read at most once, and not at all where what stands in front of it has decided already.
        """
        return self.test(Operands(read))


def compile_expression(text: str, names: NameTable) -> Expression:
    """Compile an expression over the fields of a table; ExpressionError, with the place, where it cannot be."""
    compiler = _Compiler(text, names)
    test = compiler.test(parse(text))
    return Expression(text, tuple(compiler.fields), test)


@dataclass(frozen=True, slots=True)
class _Typed:
    """A value that differs from telegram to telegram; ``count`` of them where a name stands for several fields."""

    type: FieldType
    evaluate: Evaluate
    span: Span
    count: int = 1
    is_computed: bool = False


@dataclass(frozen=True, slots=True)
class _Written:
    """A value that stands in the expression. ``is_name``: it may have been meant as the name of a field."""

    constant: Constant
    span: Span
    is_name: bool = False


class _Compiler:
    """Compiles one expression; ``fields`` collects the fields it names."""

    def __init__(self, text: str, names: NameTable) -> None:
        self._text = text
        self._names = names
        self._lower = {name.lower(): name for name in names}
        self.fields: dict[str, None] = {}

    # --- tests

    def test(self, node: Node) -> Test:
        """Return the test that a tree is; a value becomes the test whether it exists, is true, or is not 0."""
        children = cast("list[Node]", node.children)
        match node.data:
            case "disjunction":
                return any_of([self.test(child) for child in children])
            case "exclusive":
                return odd_of([self.test(child) for child in children])
            case "conjunction":
                return all_of([self.test(child) for child in children])
            case "inversion":
                inverted = self.test(children[0])
                return lambda operands: ~inverted(operands)
            case "comparison":
                return self._chain(node)
            case "member" | "stranger":
                return self._member(*children, wanted=node.data == "member")
            case "contains":
                return self._contains(*children)
            case "matches":
                return self._matches(*children)
        return self._presence(node)

    def _chain(self, node: Node) -> Test:
        values = [self._value(cast("Node", child)) for child in node.children[::2]]
        signs = [str(sign).lower() for sign in node.children[1::2]]
        pairs = zip(pairwise(values), signs, strict=True)
        return all_of([self._comparison(_SIGNS.get(sign, sign), *pair) for pair, sign in pairs])

    def _comparison(self, sign: str, left: _Typed | _Written, right: _Typed | _Written) -> Test:
        if isinstance(left, _Written):
            if isinstance(right, _Written):
                raise self._constant(left.span, right.span)
            turned = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}.get(sign, sign)
            return self._comparison(turned, right, left)
        if left.type is FieldType.BOOL and sign not in ("==", "!="):
            raise self._error("true is neither below nor above false", Span(left.span.start, right.span.stop))
        if isinstance(right, _Written):
            value = self._fit(right, left)
            if isinstance(value, literals.Network) and not value.is_single and sign not in ("==", "!="):
                raise self._error("a network is neither below nor above an address", right.span)
            return over(lambda column: compare(sign, column, value), left.evaluate, everyone=sign == "!=")
        self._check_comparable(left, right)
        return over_pairs(lambda a, b: compare(sign, a, b), left.evaluate, right.evaluate, everyone=sign == "!=")

    def _check_comparable(self, left: _Typed, right: _Typed) -> None:
        if left.type is not right.type and not (left.type in _NUMBERS and right.type in _NUMBERS):
            raise self._error(
                f"{_WORDS[left.type]} cannot be compared with {_WORDS[right.type]}",
                Span(left.span.start, right.span.stop),
                f"{self._of(left)} is {_WORDS[left.type]}, {self._of(right)} is {_WORDS[right.type]}",
            )

    def _member(self, node: Node, elements: Node, *, wanted: bool) -> Test:
        value = self._typed(node, "in needs a field on its left side")
        tests: list[Test] = []
        for element in cast("list[Node]", elements.children):
            if element.data == "range":
                low, high = (self._value(cast("Node", child)) for child in element.children)
                tests.append(self._range(value, low, high))
            else:
                tests.append(self._comparison("==", value, self._value(element)))
        member = any_of(tests)
        if wanted:
            return member
        # As a comparison, it is false for what does not exist.
        return lambda operands: present(value.evaluate, operands) & ~member(operands)

    def _range(self, value: _Typed, low: _Typed | _Written, high: _Typed | _Written) -> Test:
        if value.type is FieldType.BOOL:
            raise self._error("there is no range of true and false", Span(low.span.start, high.span.stop))
        if isinstance(low, _Written) and isinstance(high, _Written):
            least, most = self._fit(low, value), self._fit(high, value)
            if isinstance(least, literals.Network) and isinstance(most, literals.Network):
                if not (least.is_single and most.is_single and least.is_ipv4 == most.is_ipv4):
                    raise self._error("a range goes from one address to another", Span(low.span.start, high.span.stop))
                reverse = (least.high, least.low) > (most.high, most.low)
            else:
                keys = [(len(end), end) if isinstance(end, bytes) else end for end in (least, most)]
                reverse = keys[0] > keys[1]  # type: ignore[operator]  # both are of the same type
            if reverse:
                raise self._error("the range ends below where it begins", Span(low.span.start, high.span.stop))
            return over(lambda column: compare(">=", column, least) & compare("<=", column, most), value.evaluate)
        # The same one of several values has to be above the one and below the other.
        parts = [_Typed(value.type, _nth(value.evaluate, at), value.span) for at in range(value.count)]
        within = [all_of([self._comparison(">=", part, low), self._comparison("<=", part, high)]) for part in parts]
        return any_of(within)

    def _contains(self, node: Node, wanted_node: Node) -> Test:
        value = self._typed(node, "contains needs a field on its left side")
        if value.type not in (FieldType.TEXT, FieldType.BYTES):
            raise self._error(f"contains is for texts and bytes, and this is {_WORDS[value.type]}", value.span)
        right = self._value(wanted_node)
        if isinstance(right, _Typed):
            raise self._error("contains needs a text or bytes written out on its right side", right.span)
        wanted = self._fit(right, value)
        if isinstance(wanted, bytes):
            return over(lambda column: spans.contains(cast("BytesColumn", column), wanted), value.evaluate)
        assert isinstance(wanted, str)
        return over(lambda column: told(cast("TextColumn", column), lambda text: wanted in text), value.evaluate)

    def _matches(self, node: Node, pattern_node: Node) -> Test:
        value = self._typed(node, "matches needs a field on its left side")
        if value.type is not FieldType.TEXT:
            hint = "contains finds bytes: nv.data contains 01:02" if value.type is FieldType.BYTES else ""
            raise self._error(f"matches is for texts, and this is {_WORDS[value.type]}", value.span, hint)
        right = self._value(pattern_node)
        if isinstance(right, _Typed):
            raise self._error("matches needs a pattern written out on its right side", right.span)
        try:
            pattern = Pattern(literals.string(right.constant))
        except Unfit as error:
            raise self._error(str(error), right.span) from None
        except PatternError as error:
            # Only in a raw text does every character stand for itself.
            offset = 2 + error.position if right.constant.kind == "raw_string" else 0
            start = min(right.span.start + offset, right.span.stop - 1)
            raise self._error(str(error), Span(start, right.span.stop)) from None
        return over(lambda column: told(cast("TextColumn", column), pattern.search), value.evaluate)

    def _presence(self, node: Node) -> Test:
        value = self._typed(node, "a value alone is no test")
        if value.type is FieldType.BOOL:
            return over(lambda column: cast("Bool", column), value.evaluate)
        if value.is_computed:
            return over(lambda column: cast("Bool", column != 0), value.evaluate)
        return lambda operands: present(value.evaluate, operands)

    # --- values

    def _typed(self, node: Node, otherwise: str) -> _Typed:
        value = self._value(node)
        if isinstance(value, _Written):
            if value.is_name:
                raise self._unknown(value.constant.text, value.span)
            raise self._error(otherwise, value.span, "for example nv.index == 7")
        return value

    def _value(self, node: Node) -> _Typed | _Written:
        span = span_of(node)
        if node.data in _TESTS:
            raise self._error("a test stands where a value should", span)
        if node.data in _LITERALS:
            return _Written(Constant(cast("LiteralKind", str(node.data)), str(node.children[0])), span)
        match node.data:
            case "name":
                return self._named(str(node.children[0]), span)
            case "slice":
                return self._slice(node, span)
            case "negative":
                zero = _Written(Constant("number", "0"), span)
                return self._arithmetic("-", zero, self._value(cast("Node", node.children[1])), span)
            case "positive":
                zero = _Written(Constant("number", "0"), span)
                return self._arithmetic("+", zero, self._value(cast("Node", node.children[1])), span)
            case "common":
                return self._common([self._value(cast("Node", child)) for child in node.children], span)
        result = self._value(cast("Node", node.children[0]))
        for sign, operand in zip(node.children[1::2], node.children[2::2], strict=True):
            right = self._value(cast("Node", operand))
            result = self._arithmetic(str(sign), result, right, Span(span.start, right.span.stop))
        return result

    def _named(self, text: str, span: Span) -> _Typed | _Written:
        name = text if text in self._names else self._lower.get(text.lower())
        if name is None:
            if text.lower() in ("true", "false"):
                return _Written(Constant("bool", text), span)
            if re.fullmatch(r"([0-9a-f]{2})+", text, re.IGNORECASE | re.ASCII):
                return _Written(Constant("digits", text), span, is_name=True)
            raise self._unknown(text, span)
        named = self._names[name]
        if named.refused:
            raise self._error(f"{name} cannot stand in an expression: {named.refused}", span)
        parts = named.either or (name,)
        self.fields.update(dict.fromkeys(parts))
        return _Typed(named.type, lambda operands: [operands[part] for part in parts], span, len(parts))

    def _unknown(self, text: str, span: Span) -> ExpressionError:
        return self._error(f"no field is called {text[:60]}", span, nearest(text, self._names))

    def _slice(self, node: Node, span: Span) -> _Typed | _Written:
        inner, *parts = cast("list[Node]", node.children)
        if all(part.data == "at" for part in parts):
            whole = self._lower.get(re.sub(r"\s", "", self._text[span.start : span.stop]).lower())
            if whole is not None:
                return self._named(whole, span)
        value = self._typed(inner, "only fields have parts")
        if len(parts) > 1:
            raise self._error("one part at a time", span)
        if value.type not in (FieldType.BYTES, FieldType.TEXT):
            raise self._error(f"only bytes and texts have parts, and this is {_WORDS[value.type]}", span)
        part = self._part(parts[0])
        evaluate = value.evaluate
        return _Typed(
            value.type, lambda operands: [part.of(operand) for operand in evaluate(operands)], span, value.count
        )

    def _part(self, node: Node) -> Part:
        tokens = cast("list[Token]", node.children)
        places = [int(token) for token in tokens if token.type == "PLACE"]
        start = places[0]
        match node.data:
            case "at":
                return Part(start, length=1)
            case "onwards":
                return Part(start)
            case "first":
                start, places = 0, [0, *places]
        end = places[1]
        if node.data == "through":
            if (start < 0) == (end < 0) and end < start:
                raise self._error("the part ends before it begins", span_of(node))
            return Part(start) if end == -1 else Part(start, stop=end + 1)
        if end < 1:
            raise self._error("a part has at least one byte or character", span_of(node))
        return Part(start, length=end)

    def _common(self, values: list[_Typed | _Written], span: Span) -> _Typed | _Written:
        result = values[0]
        for value in values[1:]:
            if isinstance(result, _Written) and isinstance(value, _Written):
                raise self._constant(result.span, value.span)
            left, right = (self._operand(side, FieldType.SIGNED) for side in (result, value))
            for side, whole in ((result, left), (value, right)):
                if whole.type not in _WHOLE:
                    raise self._error(f"& is for whole numbers, and this is {_WORDS[whole.type]}", side.span)
            if isinstance(result, _Written):
                left, right = right, left
            result = self._computed(FieldType.SIGNED, common_bits, left, right, Span(span.start, value.span.stop))
        return result

    def _arithmetic(
        self, sign: str, left: _Typed | _Written, right: _Typed | _Written, span: Span
    ) -> _Typed | _Written:
        if isinstance(left, _Written) and isinstance(right, _Written):
            return self._folded(sign, left, right, span)
        left_type = left.type if isinstance(left, _Typed) else self._literal_type(sign, left, right)
        right_type = right.type if isinstance(right, _Typed) else self._literal_type(sign, right, left)
        whole = dict.fromkeys(_WHOLE, FieldType.SIGNED)
        result = _ARITHMETIC.get((whole.get(left_type, left_type), sign, whole.get(right_type, right_type)))
        if result is None:
            raise self._error(f"{sign} is not defined for {_WORDS[left_type]} and {_WORDS[right_type]}", span)
        compute = real_arithmetic if result is FieldType.REAL else whole_arithmetic
        a, b = self._operand(left, left_type), self._operand(right, right_type)
        return self._computed(result, lambda x, y: compute(sign, x, y), a, b, span)

    def _literal_type(self, sign: str, literal: _Written, other: _Typed | _Written) -> FieldType:
        """Return the type in which a literal is computed with, which depends on the other side."""
        assert isinstance(other, _Typed)
        if other.type is FieldType.TIME:
            return FieldType.TIME if literal.constant.kind in ("string", "raw_string") else FieldType.DURATION
        if other.type is FieldType.DURATION:
            return FieldType.SIGNED if sign in "*/" else FieldType.DURATION
        if other.type in _NUMBERS:
            number = self._number(literal)
            return FieldType.SIGNED if isinstance(number, int) else FieldType.REAL
        return other.type

    def _number(self, literal: _Written) -> Number:
        try:
            return literals.number(literal.constant)
        except Unfit as error:
            if literal.is_name:
                raise self._unknown(literal.constant.text, literal.span) from None
            raise self._error(str(error), literal.span) from None

    def _folded(self, sign: str, left: _Written, right: _Written, span: Span) -> _Written:
        """Compute with two literals: numbers exactly, whole ones as for fields; durations added and subtracted."""
        text = self._text[span.start : span.stop]
        try:
            lengths = [literals.duration_ns(side.constant) for side in (left, right)]
        except Unfit as error:
            raise self._error(str(error), span) from None
        if lengths[1] is not None and (lengths[0] is not None or left.constant.value == 0) and sign in "+-":
            amount = (lengths[0] or 0) + (lengths[1] if sign == "+" else -lengths[1])
            return _Written(Constant("duration", text, amount), span)
        a, b = self._number(left), self._number(right)
        if sign in "/%" and b == 0:
            raise self._error("a division by zero", span)
        result: Number
        if sign in "+-*":
            result = {"+": a + b, "-": a - b, "*": a * b}[sign]
        elif isinstance(a, int) and isinstance(b, int):
            quotient = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
            result = quotient if sign == "/" else a - quotient * b
        elif sign == "%":
            raise self._error("% is for whole numbers", span)
        else:
            result = Fraction(a) / b
        if max(abs(result.numerator), result.denominator).bit_length() > _MAX_FOLDED_BITS:
            raise self._error("the number has too many digits", span)
        return _Written(Constant("number", text, result), span)

    def _computed(self, kind: FieldType, compute: Compute, left: _Typed, right: _Typed, span: Span) -> _Typed:
        count = left.count * right.count
        if count > _MAX_VALUES:
            raise self._error(f"names that stand for several fields make more than {_MAX_VALUES} combinations", span)
        return _Typed(kind, computed(compute, left.evaluate, right.evaluate), span, count, is_computed=True)

    # --- literals

    def _operand(self, value: _Typed | _Written, kind: FieldType) -> _Typed:
        """Return a value to compute with; a literal becomes a column of one row, which numpy repeats."""
        if isinstance(value, _Typed):
            return value
        try:
            fitted = literals.fit(value.constant, kind)
        except Unfit as error:
            raise self._error(str(error), value.span) from None
        if isinstance(fitted, int) and not -(1 << 63) <= fitted < 1 << 63:
            raise self._error(f"{value.constant.text[:60]} does not fit into 64 bits with a sign", value.span)
        column = np.array([fitted], np.float64 if kind is FieldType.REAL else np.int64)
        return _Typed(kind, lambda _: [Operand(column)], value.span)

    def _fit(self, literal: _Written, other: _Typed) -> Value:
        try:
            return literals.fit(literal.constant, other.type)
        except Unfit as error:
            if literal.is_name:
                raise self._unknown(literal.constant.text, literal.span) from None
            raise self._error(str(error), literal.span, f"{self._of(other)} is {_WORDS[other.type]}") from None

    # --- mistakes

    def _of(self, value: _Typed | _Written) -> str:
        return _shortened(self._text[value.span.start : value.span.stop], 60)

    def _constant(self, left: Span, right: Span) -> ExpressionError:
        return self._error(
            "no field on either side", Span(left.start, right.stop), "one side has to differ between telegrams"
        )

    def _error(self, what: str, span: Span, next_step: str = "") -> ExpressionError:
        return ExpressionError(_shortened(what, 200), self._text, span, next_step=next_step)


def _nth(evaluate: Evaluate, at: int) -> Evaluate:
    return lambda operands: evaluate(operands)[at : at + 1]


def _shortened(text: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - 1] + "…"
