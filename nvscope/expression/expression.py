"""Expressions, compiled: names become fields, literals become values of their types, and a mask comes out.

As in Wireshark: a comparison with a field that a telegram lacks is false, ``!=`` too, while ``!(x == 1)`` is true.
Where a name stands for several fields (``udp.port``), ``!=`` wants all of them to differ, everything else one that
fits; ``any`` and ``all`` in front say what is wanted instead. A value alone asks whether it exists and, where it was
computed, whether it is not 0.

Unlike Wireshark: a BOOL alone asks whether it is true (``nv.flags.ack``), and a part that a value does not have whole
does not exist. Numbers compared with times and durations are seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from itertools import pairwise
from typing import TypeVar, cast

from msgspec import Struct

from dissectors.batch import Bool
from nvscope.expression import literals, spans
from nvscope.expression.byte_pattern import BytePattern
from nvscope.expression.comparison import compare, compare_names, told
from nvscope.expression.literals import Unfit
from nvscope.expression.masks import Test, all_of, any_of, odd_of, over, over_pairs, present
from nvscope.expression.mistake import Span
from nvscope.expression.over_time import Age, Before, Changed, Edge, Held, Subject, carrying
from nvscope.expression.pattern import Pattern, PatternError
from nvscope.expression.syntax import Node, parse, span_of
from nvscope.expression.terms import NUMBERS, TESTS, WORDS, Terms, Typed, Written
from nvscope.expression.typed_columns import BytesColumn, FieldType, NameTable, TextColumn
from nvscope.expression.values import Evaluate, Moments, Operands, Read, both_known

_SIGNS = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
Compiled = TypeVar("Compiled")
_RELATIONS = {"comparison", "member", "stranger", "contains", "matches"}


class Expression(Struct, frozen=True):
    """A compiled expression. ``fields`` are the names of the fields that it may read, in the order they occur.

    ``remembers``: it has functions of time. ``momentary``: some of them are true at the moment of a change, and so
    each moment at which the whole is true is one by itself. ``ages``: what it says changes as time passes, also where
    nothing of what it names comes. ``lasting`` are the fields whose values last.
    """

    text: str
    fields: tuple[str, ...]
    test: Test
    remembers: bool = False
    momentary: bool = False
    ages: bool = False
    lasting: tuple[str, ...] = ()

    def mask(self, read: Read, moments: Moments | None = None) -> Bool:
        """Return in which telegrams the expression holds; ``read`` gives a field's column and where it exists.

        A field is read at most once, and not at all where what stands in front of it has decided already.
        ``moments`` are needed by one that ``remembers``.
        """
        return self.test(Operands(read, moments))

    def told(self, read: Read, moments: Moments | None = None) -> tuple[Bool, Bool | None]:
        """Return in which telegrams it holds, and of which that can be told at all; None: of all.

        It can, where all is known that lasts, and something of the rest, and what values of before it asks for.
        """
        operands = Operands(read, moments)
        true = self.test(operands)
        return true, reduce(both_known, operands.before, Subject(self.fields, self.lasting).known(operands))


def compile_expression(text: str, names: NameTable, *, over_time: bool = False) -> Expression:
    """Compile an expression over the fields of a table; ExpressionError, with the place, where it cannot be.

    ``over_time``: it may have functions of time. Then it is asked of all telegrams in their order, each once: it
    remembers what was before.
    """
    compiler = _Compiler(text, names, over_time=over_time)
    test = compiler.test(parse(text))
    fields = tuple(compiler.fields)
    # Further occurrences of a field have names of their own, which stand in no table.
    lasting = tuple(name for name in fields if (named := names.get(name)) is not None and named.lasts)
    return Expression(text, fields, test, compiler.remembers, compiler.momentary, compiler.ages, lasting)


class _Compiler(Terms):
    """Compiles the tests of one expression."""

    def __init__(self, text: str, names: NameTable, *, over_time: bool) -> None:
        super().__init__(text, names)
        self._over_time = over_time
        self.remembers = self.momentary = self.ages = False

    def test(self, node: Node) -> Test:
        """Return the test that a tree is; a value becomes the test whether it exists, is true, or is not 0."""
        children = cast("list[Node]", node.children)
        match node.data:
            case "disjunction":
                return any_of([self.test(child) for child in children], every=self._over_time)
            case "exclusive":
                return odd_of([self.test(child) for child in children])
            case "conjunction":
                return all_of([self.test(child) for child in children], every=self._over_time)
            case "inversion":
                inverted = self.test(children[0])
                return lambda operands: ~inverted(operands)
            case "change":
                return self._change(*children)
            case "held":
                return self._held(*children)
            case "some" | "every":
                return self._quantified(children[0], everyone=node.data == "every")
            case "comparison" | "member" | "stranger" | "contains" | "matches":
                return self._relation(node)
        return self._presence(node)

    def _quantified(self, node: Node, *, everyone: bool) -> Test:
        if node.data not in _RELATIONS:
            word = "all" if everyone else "any"
            raise self._error(
                f"{word} needs a comparison behind it", span_of(node), f"for example {word} ip.addr == 10.0.0.1"
            )
        return self._relation(node, everyone=everyone)

    def _relation(self, node: Node, *, everyone: bool | None = None) -> Test:
        """Return the test of a comparison; ``everyone``: whether all values of a name have to fit, None: as usual."""
        children = cast("list[Node]", node.children)
        match node.data:
            case "comparison":
                return self._chain(node, everyone)
            case "contains":
                return self._contains(*children, everyone=bool(everyone))
            case "matches":
                return self._matches(*children, everyone=bool(everyone))
        return self._member(*children, wanted=node.data == "member", everyone=everyone)

    def _chain(self, node: Node, everyone: bool | None) -> Test:
        values = [self._value(cast("Node", child)) for child in node.children[::2]]
        signs = [str(sign).lower() for sign in node.children[1::2]]
        pairs = zip(pairwise(values), signs, strict=True)
        tests = [self._comparison(_SIGNS.get(sign, sign), *pair, everyone) for pair, sign in pairs]
        return all_of(tests, every=self._over_time)

    def _comparison(
        self, sign: str, left: Typed | Written, right: Typed | Written, everyone: bool | None = None
    ) -> Test:
        if isinstance(left, Written):
            if isinstance(right, Written):
                raise self._constant(left.span, right.span)
            turned = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}.get(sign, sign)
            return self._comparison(turned, right, left, everyone)
        if left.type is FieldType.BOOL and sign not in ("==", "!="):
            raise self._error("true is neither below nor above false", Span(left.span.start, right.span.stop))
        everyone = sign == "!=" if everyone is None else everyone
        if isinstance(right, Written):
            value = self._fit(right, left)
            if sign in ("==", "!="):
                self._one_of_its_texts(right, left, value)
            if isinstance(value, literals.Network) and not value.is_single and sign not in ("==", "!="):
                raise self._error("a network is neither below nor above an address", right.span)
            if left.any_case and isinstance(value, str) and sign in ("==", "!="):
                return over(lambda column: compare_names(sign, column, value), left.evaluate, everyone=everyone)
            return over(lambda column: compare(sign, column, value), left.evaluate, everyone=everyone)
        self._check_comparable(left, right)
        return over_pairs(lambda a, b: compare(sign, a, b), left.evaluate, right.evaluate, everyone=everyone)

    def _check_comparable(self, left: Typed, right: Typed) -> None:
        if left.type is not right.type and not (left.type in NUMBERS and right.type in NUMBERS):
            raise self._error(
                f"{WORDS[left.type]} cannot be compared with {WORDS[right.type]}",
                Span(left.span.start, right.span.stop),
                f"{self._of(left)} is {WORDS[left.type]}, {self._of(right)} is {WORDS[right.type]}",
            )

    def _member(self, node: Node, elements: Node, *, wanted: bool, everyone: bool | None) -> Test:
        value = self._typed(node, "in needs a field on its left side")
        if everyone is None and not wanted:
            # As in Wireshark the opposite of in, which is true for what does not exist.
            inside = self._membership(value, elements)
            return lambda operands: ~inside(operands)
        if everyone is None or everyone is not wanted:
            return self._membership(value, elements) if wanted else self._outside(value, elements)
        parts = [Typed(value.type, _nth(value.evaluate, at), value.span) for at in range(value.count)]
        outside = any_of([self._outside(part, elements) for part in parts])
        return (lambda operands: present(value.evaluate, operands) & ~outside(operands)) if everyone else outside

    def _outside(self, value: Typed, elements: Node) -> Test:
        """Return the test whether there is such a value, and it is not in the set."""
        inside = self._membership(value, elements)
        return lambda operands: present(value.evaluate, operands) & ~inside(operands)

    def _membership(self, value: Typed, elements: Node) -> Test:
        """Return the test whether one of the values is in the set."""
        tests: list[Test] = []
        for element in cast("list[Node]", elements.children):
            if element.data == "range":
                low, high = (self._value(cast("Node", child)) for child in element.children)
                tests.append(self._range(value, low, high))
            else:
                tests.append(self._comparison("==", value, self._value(element)))
        return any_of(tests)

    def _range(self, value: Typed, low: Typed | Written, high: Typed | Written) -> Test:
        if value.type is FieldType.BOOL:
            raise self._error("there is no range of true and false", Span(low.span.start, high.span.stop))
        if isinstance(low, Written) and isinstance(high, Written):
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
        parts = [Typed(value.type, _nth(value.evaluate, at), value.span) for at in range(value.count)]
        within = [all_of([self._comparison(">=", part, low), self._comparison("<=", part, high)]) for part in parts]
        return any_of(within)

    def _contains(self, node: Node, wanted_node: Node, *, everyone: bool) -> Test:
        value = self._typed(node, "contains needs a field on its left side")
        if value.type not in (FieldType.TEXT, FieldType.BYTES):
            raise self._error(f"contains is for texts and bytes, and this is {WORDS[value.type]}", value.span)
        right = self._value(wanted_node)
        if isinstance(right, Typed):
            raise self._error("contains needs a text or bytes written out on its right side", right.span)
        wanted = self._fit(right, value)
        if isinstance(wanted, bytes):
            search = lambda column: spans.contains(cast("BytesColumn", column), wanted)  # noqa: E731
            return over(search, value.evaluate, everyone=everyone)
        assert isinstance(wanted, str)
        within = lambda column: told(cast("TextColumn", column), lambda text: wanted in text)  # noqa: E731
        return over(within, value.evaluate, everyone=everyone)

    def _matches(self, node: Node, pattern_node: Node, *, everyone: bool) -> Test:
        value = self._typed(node, "matches needs a field on its left side")
        if value.type not in (FieldType.TEXT, FieldType.BYTES):
            raise self._error(f"matches is for texts and bytes, and this is {WORDS[value.type]}", value.span)
        right = self._value(pattern_node)
        if isinstance(right, Typed):
            raise self._error("matches needs a pattern written out on its right side", right.span)
        try:
            if value.type is FieldType.BYTES:
                search = BytePattern(literals.byte_text(right.constant)).found_in
                return over(lambda column: search(cast("BytesColumn", column)), value.evaluate, everyone=everyone)
            pattern = Pattern(literals.string(right.constant))
        except Unfit as error:
            raise self._error(str(error), right.span) from None
        except PatternError as error:
            # Only in a raw text does every character stand for itself.
            offset = 2 + error.position if right.constant.kind == "raw_string" else 0
            start = min(right.span.start + offset, right.span.stop - 1)
            raise self._error(str(error), Span(start, right.span.stop)) from None
        return over(lambda column: told(cast("TextColumn", column), pattern.search), value.evaluate, everyone=everyone)

    # --- functions of time

    def _change(self, word: object, argument: Node) -> Test:
        name = str(word).lower()
        self.momentary = True
        if name == "changed" and argument.data not in TESTS:
            value, subject = self._subject(name, argument, lambda: self._one_value(name, argument))
            return Changed(value.evaluate, subject)
        test, subject = self._subject(name, argument, lambda: self._truth(name, argument))
        return Edge(test, subject, rises=name != "fell", falls=name != "rose")

    def _held(self, word: object, argument: Node, length: Node) -> Test:
        self.ages = True
        test, subject = self._subject(str(word).lower(), argument, lambda: self._truth(str(word).lower(), argument))
        told = self._value(length)
        if isinstance(told, Typed):
            raise self._error("how long it has to be so is written out", told.span, "for example held(x, 2s)")
        try:
            length_ns = literals.fit(told.constant, FieldType.DURATION)
        except Unfit as error:
            raise self._error(str(error), told.span, "for example held(x, 2s)") from None
        assert isinstance(length_ns, int)
        if length_ns <= 0:
            raise self._error("it has to be so for more than 0 s", told.span, "for example held(x, 2s)")
        return Held(test, subject, length_ns)

    def _before(self, word: object, argument: object, *, span: Span) -> Typed:
        node = cast("Node", argument)
        value, subject = self._subject("last", node, lambda: self._one_value("last", node))
        if value.type is FieldType.BYTES:
            raise self._error("last is for numbers, times, texts and addresses, and this is bytes", value.span)
        evaluate = Before(value.evaluate, subject)
        return Typed(value.type, evaluate, span, values=value.values, texts=value.texts)

    def _age(self, word: object, argument: object, *, span: Span) -> Typed:
        node = cast("Node", argument)
        self.ages = True
        name = str(node.children[0]) if node.data == "name" else ""
        known = self._known(name) if name else None
        if known is not None and not known[1].test:
            value, subject = self._subject("age", node, lambda: self._one_value("age", node))
            return Typed(FieldType.DURATION, Age(carrying(value.evaluate, subject), subject), span, is_computed=True)
        test, subject = self._subject("age", node, lambda: self.test(node))
        return Typed(FieldType.DURATION, Age(test, subject), span, is_computed=True)

    def _truth(self, word: str, node: Node) -> Test:
        """Return the test that something is true; a value that is there says nothing of that."""
        known = self._known(str(node.children[0])) if node.data == "name" else None
        if node.data not in TESTS and not (known and known[1].test):
            value = self._value(node)
            if isinstance(value, Typed) and value.type is not FieldType.BOOL and not value.is_computed:
                what = f"{word} is for what is true or false, and this is {WORDS[value.type]}"
                raise self._error(what, value.span, f"compare it: {word}(x > 1); changed(x) is for values")
        return self.test(node)

    def _one_value(self, word: str, node: Node) -> Typed:
        value = self._typed(node, f"{word} needs a field between its parentheses")
        if value.count > 1:
            raise self._error(f"{word} is for one field, and this stands for {value.count}", value.span)
        return value

    def _subject(self, word: str, node: Node, compiles: Callable[[], Compiled]) -> tuple[Compiled, Subject]:
        """Return what a function of time is of, compiled, and what it names."""
        if not self._over_time:
            what = f"{word} looks at what was before, and a filter looks at each telegram alone"
            raise self._error(what, span_of(node), "it is for --trigger and for rules")
        self.remembers = True
        before, self.fields = self.fields, {}
        try:
            compiled = compiles()
            named = tuple(self.fields)
        finally:
            self.fields = {**before, **self.fields}
        return compiled, Subject(named, tuple(name for name in named if self._names[name].lasts))

    def _presence(self, node: Node) -> Test:
        if node.data == "name" and (named := self._known(str(node.children[0]))) and named[1].test:
            return self.test(parse(named[1].test))
        value = self._typed(node, "a value alone is no test")
        if value.type is FieldType.BOOL:
            return over(lambda column: cast("Bool", column), value.evaluate)
        if value.is_computed:
            return over(lambda column: cast("Bool", column != 0), value.evaluate)
        return lambda operands: present(value.evaluate, operands)


def _nth(evaluate: Evaluate, at: int) -> Evaluate:
    return lambda operands: evaluate(operands)[at : at + 1]
