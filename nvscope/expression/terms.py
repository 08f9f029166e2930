"""The values in an expression: fields, literals, parts of them and what is computed from them, each with its type."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import cast

import numpy as np
from lark import Token
from msgspec import Struct, field

from nvscope.expression import literals
from nvscope.expression.folding import folded
from nvscope.expression.literals import Constant, LiteralKind, Number, Unfit, Value
from nvscope.expression.mistake import ExpressionError, Span
from nvscope.expression.names import MAX_NAMES, nearest
from nvscope.expression.syntax import Node, span_of
from nvscope.expression.typed_columns import FieldType, Named, NameTable
from nvscope.expression.values import (
    Compute,
    Evaluate,
    Operand,
    Parts,
    Slice,
    common_bits,
    computed,
    counted,
    lengths,
    real_arithmetic,
    whole_arithmetic,
)
from nvscope.expression.words import words_of

WORDS = {
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
NUMBERS = (*_WHOLE, FieldType.REAL)
_MAX_VALUES = 4096
_MAX_PARTS = 8
_VARIABLE = "var."

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

TESTS = {
    "disjunction", "exclusive", "conjunction", "inversion", "comparison", "member", "stranger", "contains", "matches",
    "some", "every", "change", "held",
}  # fmt: skip
_HEXADECIMAL = re.compile(r"[0-9a-f]|(?:[0-9a-f]{2})+(?:\.(?:[0-9a-f]{2})+)*", re.IGNORECASE | re.ASCII)
_MOST_TEXTS = 5
_LITERALS = {"digits", "colons", "iec_time", "iec_date", "string", "raw_string"}


class Typed(Struct, frozen=True):
    """A value that differs from telegram to telegram; ``count`` of them where a name stands for several fields."""

    type: FieldType
    evaluate: Evaluate
    span: Span
    count: int = 1
    is_computed: bool = False
    values: Mapping[str, int] = field(default_factory=dict)
    texts: Sequence[str] = ()
    any_case: bool = False


class Written(Struct, frozen=True):
    """A value that stands in the expression. ``is_name``: it may have been meant as the name of a field."""

    constant: Constant
    span: Span
    is_name: bool = False


class Terms:
    """Compiles the values in one expression; ``fields`` collects the fields it names."""

    def __init__(self, text: str, names: NameTable) -> None:
        self._text = text
        self._names = words_of(names)
        self.fields: dict[str, None] = {}

    def _typed(self, node: Node, otherwise: str) -> Typed:
        value = self._value(node)
        if isinstance(value, Written):
            if value.is_name:
                raise self._unknown(value.constant.text, value.span)
            raise self._error(otherwise, value.span, "for example nv.index == 7")
        return value

    def _value(self, node: Node) -> Typed | Written:
        span = span_of(node)
        if node.data in TESTS:
            raise self._error("a test stands where a value should", span)
        if node.data in _LITERALS:
            return Written(Constant(cast("LiteralKind", str(node.data)), str(node.children[0])), span)
        match node.data:
            case "name":
                return self._named(str(node.children[0]), span)
            case "slice":
                return self._slice(node, span)
            case "function":
                return self._function(*node.children, span=span)
            case "before":
                return self._before(*node.children, span=span)
            case "age":
                return self._age(*node.children, span=span)
            case "negative":
                zero = Written(Constant("number", "0"), span)
                return self._arithmetic("-", zero, self._value(cast("Node", node.children[1])), span)
            case "positive":
                zero = Written(Constant("number", "0"), span)
                return self._arithmetic("+", zero, self._value(cast("Node", node.children[1])), span)
            case "common":
                return self._common([self._value(cast("Node", child)) for child in node.children], span)
        result = self._value(cast("Node", node.children[0]))
        for sign, operand in zip(node.children[1::2], node.children[2::2], strict=True):
            right = self._value(cast("Node", operand))
            result = self._arithmetic(str(sign), result, right, Span(span.start, right.span.stop))
        return result

    def _known(self, text: str) -> tuple[str, Named] | None:
        """Return the name that is meant, in its own spelling, and what it stands for; None where there is none."""
        name = self._names.spelled(text)
        return None if name is None else (name, self._names[name])

    def _named(self, text: str, span: Span) -> Typed | Written:
        known = self._known(text)
        if known is None:
            if text.lower() in ("true", "false"):
                return Written(Constant("bool", text), span)
            if _HEXADECIMAL.fullmatch(text):
                return Written(Constant("digits", text), span, is_name=True)
            raise self._unknown(text, span)
        name, named = known
        if named.refused:
            raise self._error(f"{name}: {named.refused}", span, named.instead)
        if named.test:
            hint = f"alone, {name} chooses the telegrams that have it; `nvscope keys --fields` lists what has values"
            raise self._error(f"{name} is a protocol and has no value", span, hint)
        parts = named.either or (name,)
        self.fields.update(dict.fromkeys(parts))
        evaluate = lambda operands: [operands[part] for part in parts]  # noqa: E731
        return Typed(named.type, evaluate, span, len(parts), named.counts, named.values, named.texts, named.any_case)

    def _unknown(self, text: str, span: Span) -> ExpressionError:
        offered = list(islice((name for name, named in self._names.items() if not named.refused), MAX_NAMES))
        if text.lower().startswith(_VARIABLE) and not any(name.startswith(_VARIABLE) for name in offered):
            raise self._error(
                f"no field is called {text[:60]}", span, "variables are known by their definitions: --gvl names them"
            )
        # Where a value stands, a word without a dot is more often a text.
        quoted = f'a text stands in quotes: "{text}"; ' if span.start and text.isidentifier() else ""
        return self._error(f"no field is called {text[:60]}", span, quoted + nearest(text, offered))

    def _function(self, word: Token | Node, argument: Token | Node, *, span: Span) -> Typed:
        name = str(word).lower()
        value = self._typed(cast("Node", argument), f"{name} needs a field between its parentheses")
        if name == "count":
            if value.is_computed:
                raise self._error("count is for fields, and this was computed", value.span)
            return Typed(FieldType.UNSIGNED, counted(value.evaluate), span, is_computed=True)
        if value.type not in (FieldType.BYTES, FieldType.TEXT):
            raise self._error(f"len is for bytes and texts, and this is {WORDS[value.type]}", value.span)
        return Typed(FieldType.UNSIGNED, lengths(value.evaluate), span, value.count, is_computed=True)

    def _before(self, word: object, argument: object, *, span: Span) -> Typed:
        """Return the value that another one had before."""
        raise NotImplementedError

    def _age(self, word: object, argument: object, *, span: Span) -> Typed:
        """Return how long ago something was so."""
        raise NotImplementedError

    def _slice(self, node: Node, span: Span) -> Typed | Written:
        inner, *parts = cast("list[Node]", node.children)
        if all(part.data == "at" for part in parts):
            whole = self._names.spelled(re.sub(r"\s", "", self._text[span.start : span.stop]))
            if whole is not None:
                return self._named(whole, span)
        value = self._typed(inner, "only fields have parts")
        if len(parts) > _MAX_PARTS:
            raise self._error(f"at most {_MAX_PARTS} parts are joined", span)
        if value.type not in (FieldType.BYTES, FieldType.TEXT):
            raise self._error(f"only bytes and texts have parts, and this is {WORDS[value.type]}", span)
        cut = Parts(tuple(self._part(part) for part in parts))
        evaluate = value.evaluate
        return Typed(
            value.type, lambda operands: [cut.of(operand) for operand in evaluate(operands)], span, value.count
        )

    def _part(self, node: Node) -> Slice:
        tokens = cast("list[Token]", node.children)
        places = [int(token) for token in tokens if token.type == "PLACE"]
        start = places[0]
        match node.data:
            case "at":
                return Slice(start, length=1)
            case "onwards":
                return Slice(start)
            case "first":
                start, places = 0, [0, *places]
        end = places[1]
        if node.data == "through":
            if (start < 0) == (end < 0) and end < start:
                raise self._error("the part ends before it begins", span_of(node))
            return Slice(start) if end == -1 else Slice(start, stop=end + 1)
        if end < 1:
            raise self._error("a part has at least one byte or character", span_of(node))
        return Slice(start, length=end)

    def _common(self, values: list[Typed | Written], span: Span) -> Typed | Written:
        result = values[0]
        for value in values[1:]:
            if isinstance(result, Written) and isinstance(value, Written):
                raise self._constant(result.span, value.span)
            left, right = (self._operand(side, FieldType.SIGNED) for side in (result, value))
            for side, whole in ((result, left), (value, right)):
                if whole.type not in _WHOLE:
                    raise self._error(f"& is for whole numbers, and this is {WORDS[whole.type]}", side.span)
            if isinstance(result, Written):
                left, right = right, left
            result = self._computed(FieldType.SIGNED, common_bits, left, right, Span(span.start, value.span.stop))
        return result

    def _arithmetic(self, sign: str, left: Typed | Written, right: Typed | Written, span: Span) -> Typed | Written:
        if isinstance(left, Written) and isinstance(right, Written):
            return self._folded(sign, left, right, span)
        left_type = left.type if isinstance(left, Typed) else self._literal_type(sign, left, right)
        right_type = right.type if isinstance(right, Typed) else self._literal_type(sign, right, left)
        whole = dict.fromkeys(_WHOLE, FieldType.SIGNED)
        result = _ARITHMETIC.get((whole.get(left_type, left_type), sign, whole.get(right_type, right_type)))
        if result is None:
            raise self._error(f"{sign} is not defined for {WORDS[left_type]} and {WORDS[right_type]}", span)
        compute = real_arithmetic if result is FieldType.REAL else whole_arithmetic
        a, b = self._operand(left, left_type), self._operand(right, right_type)
        return self._computed(result, lambda x, y: compute(sign, x, y), a, b, span)

    def _literal_type(self, sign: str, literal: Written, other: Typed | Written) -> FieldType:
        """Return the type in which a literal is computed with, which depends on the other side."""
        assert isinstance(other, Typed)
        if other.type is FieldType.TIME:
            return FieldType.TIME if literal.constant.kind in ("string", "raw_string") else FieldType.DURATION
        if other.type is FieldType.DURATION:
            return FieldType.SIGNED if sign in "*/" else FieldType.DURATION
        if other.type in NUMBERS:
            number = self._number(literal)
            return FieldType.SIGNED if isinstance(number, int) else FieldType.REAL
        return other.type

    def _number(self, literal: Written) -> Number:
        try:
            return literals.number(literal.constant)
        except Unfit as error:
            if literal.is_name:
                raise self._unknown(literal.constant.text, literal.span) from None
            raise self._error(str(error), literal.span) from None

    def _folded(self, sign: str, left: Written, right: Written, span: Span) -> Written:
        text = self._text[span.start : span.stop]
        try:
            return Written(folded(sign, left.constant, right.constant, text), span)
        except Unfit as error:
            for side in (left, right):
                if side.is_name:
                    raise self._unknown(side.constant.text, side.span) from None
            raise self._error(str(error), span) from None

    def _computed(self, kind: FieldType, compute: Compute, left: Typed, right: Typed, span: Span) -> Typed:
        count = left.count * right.count
        if count > _MAX_VALUES:
            raise self._error(f"names that stand for several fields make more than {_MAX_VALUES} combinations", span)
        return Typed(kind, computed(compute, left.evaluate, right.evaluate), span, count, is_computed=True)

    # --- literals

    def _operand(self, value: Typed | Written, kind: FieldType) -> Typed:
        """Return a value to compute with; a literal becomes a column of one row, which numpy repeats."""
        if isinstance(value, Typed):
            return value
        try:
            fitted = literals.fit(value.constant, kind)
        except Unfit as error:
            raise self._error(str(error), value.span) from None
        if isinstance(fitted, int) and not -(1 << 63) <= fitted < 1 << 63:
            raise self._error(f"{value.constant.text[:60]} does not fit into 64 bits with a sign", value.span)
        column = np.array([fitted], np.float64 if kind is FieldType.REAL else np.int64)
        return Typed(kind, lambda _: [Operand(column)], value.span)

    def _fit(self, literal: Written, other: Typed) -> Value:
        try:
            if other.values and literal.constant.kind in ("string", "raw_string"):
                return self._number_named(literal, other.values)
            return literals.fit(literal.constant, other.type)
        except Unfit as error:
            if literal.is_name:
                raise self._unknown(literal.constant.text, literal.span) from None
            raise self._error(str(error), literal.span, f"{self._of(other)} is {WORDS[other.type]}") from None

    def _one_of_its_texts(self, literal: Written, other: Typed, value: Value) -> None:
        """Raise ExpressionError for a text that a field never has: what asks for it would choose nothing, or all."""
        if other.texts and isinstance(value, str) and value not in other.texts:
            what = f"{self._of(other)} is never {literal.constant.text[:60]}"
            many = f"it may be {', '.join(other.texts[:_MOST_TEXTS])}, …"
            raise self._error(what, literal.span, nearest(value, other.texts, "it is one of", many))

    def _number_named(self, literal: Written, values: Mapping[str, int]) -> int:
        """Return the number that a name of one stands for, in any case."""
        wanted = literals.string(literal.constant)
        for name, number in values.items():
            if name.lower() == wanted.lower():
                return number
        what = f"{literal.constant.text[:60]} is none of its values"
        raise self._error(what, literal.span, nearest(wanted, values, "the values are", f"it has {len(values)} values"))

    # --- mistakes

    def _of(self, value: Typed | Written) -> str:
        return _shortened(self._text[value.span.start : value.span.stop], 60)

    def _constant(self, left: Span, right: Span) -> ExpressionError:
        return self._error(
            "no field on either side", Span(left.start, right.stop), "one side has to differ between telegrams"
        )

    def _error(self, what: str, span: Span, next_step: str = "") -> ExpressionError:
        return ExpressionError(_shortened(what, 200), self._text, span, next_step=next_step)


def _shortened(text: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - 1] + "…"
