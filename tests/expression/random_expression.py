"""Random expressions, each as its text and as a function of one row that tells what it means.

The function knows nothing of the parser: it is put together beside the text, from what the README says of expressions
and from Wireshark, in plain Python. ``strength`` is how strongly the outermost operator binds; weaker parts get
parentheses, equally strong ones on the right too.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address
from typing import Any

from hypothesis import strategies as st

from tests.expression.table import EITHER, Row

OR, XOR, AND, NOT, COMPARISON, COMMON, SUM, PRODUCT, SIGN, ATOM = range(10)
WIDEST = 2**63 - 1


@dataclass(frozen=True)
class Said:
    """A value or a test: a value's ``meaning`` is a list of the values that exist."""

    text: str
    strength: int
    meaning: Callable[[Row], Any]

    def at_least(self, strength: int) -> str:
        return self.text if self.strength >= strength else f"({self.text})"


def field(name: str) -> Said:
    names = EITHER.get(name, (name,))
    return Said(name, ATOM, lambda row: [row[part] for part in names if part in row])


def literal(text: str, value: Any) -> Said:
    return Said(text, ATOM, lambda _: [value])


def fields(*names: str) -> st.SearchStrategy[Said]:
    return st.sampled_from(names).map(field)


def _whole(sign: str, a: int, b: int) -> int | None:
    if max(abs(a), abs(b)) > WIDEST:
        return None
    if sign in "/%":
        if b == 0:
            return None
        quotient = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        return quotient if sign == "/" else a - quotient * b
    compute = {"+": operator.add, "-": operator.sub, "*": operator.mul}[sign]
    return compute(a, b) if abs(compute(float(a), float(b))) < 9.2e18 else None


def _real(sign: str, a: float, b: float) -> float | None:
    if sign == "/":
        return None if b == 0 else float(a) / float(b)
    found: float = {"+": operator.add, "-": operator.sub, "*": operator.mul}[sign](float(a), float(b))
    return found


def _binary(sign: str, strength: int, left: Said, right: Said, compute: Callable[[Any, Any], Any]) -> Said:
    def meaning(row: Row) -> list[Any]:
        found = [compute(a, b) for a in left.meaning(row) for b in right.meaning(row)]
        return [value for value in found if value is not None]

    return Said(f"{left.at_least(strength)} {sign} {right.at_least(strength + 1)}", strength, meaning)


def _numbers(name: st.SearchStrategy[Said], literals: st.SearchStrategy[Said], signs: str, rule: Any) -> Any:
    def extend(inner: st.SearchStrategy[Said]) -> st.SearchStrategy[Said]:
        def put(sign: str, left: Said, right: Said) -> Said:
            return _binary(sign, SUM if sign in "+-" else PRODUCT, left, right, lambda a, b: rule(sign, a, b))

        return st.one_of(
            st.builds(put, st.sampled_from(signs), inner, st.one_of(inner, literals)),
            st.builds(put, st.sampled_from(signs), literals, inner),
        )

    return st.recursive(name, extend, max_leaves=4)


WHOLE_LITERALS = st.sampled_from(
    [literal("0", 0), literal("1", 1), literal("7", 7), literal("0x10", 16), literal("-3", -3), literal("300", 300)]
).map(lambda said: Said(said.text, SIGN if said.text.startswith("-") else ATOM, said.meaning))
WHOLE_FIELDS = fields("n.byte", "n.word", "n.lword", "n.dint", "n.small")
UNSIGNED = fields("n.byte", "n.word", "n.lword", "n.small")
BITS = st.builds(
    lambda left, mask: _binary("&", COMMON, left, mask, operator.and_),
    UNSIGNED,
    st.one_of(UNSIGNED, st.sampled_from([literal("1", 1), literal("0x06", 6), literal("0xffff", 65535)])),
)
WHOLE = _numbers(st.one_of(WHOLE_FIELDS, WHOLE_FIELDS, BITS), WHOLE_LITERALS, "+-*/%", _whole)
REAL_LITERALS = st.sampled_from([literal("0.5", 0.5), literal("2", 2), literal("1e3", 1000.0), literal("7.0", 7.0)])
REAL = _numbers(fields("n.lreal"), REAL_LITERALS, "+-*/", _real)

SECOND = 10**9
DURATION_LITERALS = st.sampled_from(
    [
        literal("5", 5 * SECOND), literal("0.05", SECOND // 20), literal("50ms", SECOND // 20), literal("1ns", 1),
        literal("T#1s", SECOND), literal("-1s", -SECOND), literal("1m30s", 90 * SECOND), literal("2 * 3", 6 * SECOND),
    ]
).map(lambda said: Said(said.text, SIGN if said.text.startswith("-") else PRODUCT, said.meaning))  # fmt: skip
DURATION = _numbers(fields("t.took"), DURATION_LITERALS, "+-", _whole)
TIME_LITERALS = st.sampled_from(
    [
        literal('"1970-01-01"', 0), literal('"2023-11-14 22:13:20"', 1_700_000_000 * SECOND),
        literal('"2023-11-14T23:13:20.000000001+01:00"', 1_700_000_000 * SECOND + 1), literal("1", SECOND),
        literal("1700000000.5", 1_700_000_000 * SECOND + SECOND // 2),
    ]
)  # fmt: skip
TIME = st.one_of(
    fields("t.at"),
    st.builds(lambda at, by: _binary("-", SUM, at, by, lambda a, b: _whole("-", a, b)), fields("t.at"), DURATION),
)
ADDRESS = fields("a.src", "a.dst", "a.addr")
ADDRESSES = [(4, 0x0A000001), (4, 0x0A000002), (4, 0x0A000080), (6, 1), (6, 0x20010DB8 << 96 | 1)]
ADDRESS_LITERALS = st.sampled_from(ADDRESSES).map(lambda pair: literal(_address(*pair), pair))


def _address(version: int, number: int) -> str:
    return str(IPv4Address(number) if version == 4 else IPv6Address(number))


def _part(value: Said, text: str, cut: Callable[[int], tuple[int, int]]) -> Said:
    def meaning(row: Row) -> list[Any]:
        found = []
        for whole in value.meaning(row):
            begin, end = cut(len(whole))
            if 0 <= begin < end <= len(whole):
                found.append(whole[begin:end])
        return found

    return Said(f"{value.text}[{text}]", ATOM, meaning)


PARTS: list[tuple[str, Callable[[int], tuple[int, int]]]] = [
    ("0", lambda size: (0, 1)),
    ("-1", lambda size: (size - 1, size)),
    ("1:2", lambda size: (1, 3)),
    ("-3:2", lambda size: (size - 3, size - 1)),
    ("1-2", lambda size: (1, 3)),
    ("1--1", lambda size: (1, size)),
    ("-2--1", lambda size: (size - 2, size)),
    ("2:", lambda size: (2, size)),
    (":2", lambda size: (0, 2)),
    ("-2:", lambda size: (size - 2, size)),
]
JOINED = [("0", "1:2"), ("-1", "0", "-2--1"), ("2:", ":2")]


def _parts(value: Said, texts: tuple[str, ...]) -> Said:
    def meaning(row: Row) -> list[Any]:
        found = []
        for whole in value.meaning(row):
            one = [piece for text in texts for piece in _part(literal("", whole), text, dict(PARTS)[text]).meaning(row)]
            if len(one) == len(texts):
                found.append(type(whole)().join(one))
        return found

    return Said(f"{value.text}[{', '.join(texts)}]", ATOM, meaning)


def _with_parts(whole: st.SearchStrategy[Said]) -> st.SearchStrategy[Said]:
    return st.one_of(
        whole,
        st.builds(lambda value, part: _part(value, *part), whole, st.sampled_from(PARTS)),
        st.builds(_parts, whole, st.sampled_from(JOINED)),
    )


BYTES = _with_parts(_with_parts(fields("b.data", "b.more", "b.any")))
BYTES_LITERALS = st.sampled_from(
    [
        literal("01:02", b"\1\2"), literal("00", b"\0"), literal("0x0102", b"\1\2"), literal('"ab"', b"ab"),
        literal("ab", b"\xab"), literal("61:62:00:01:02:FF", b"ab\0\1\2\xff"), literal(r'"\x01\002"', b"\1\2"),
        literal("ff", b"\xff"),
    ]
)  # fmt: skip
TEXT = _with_parts(fields("s.name", "s.other"))
TEXT_LITERALS = st.sampled_from(
    [literal('"press"', "press"), literal('r"p"', "p"), literal('""', ""), literal(r'"\x50ress 1"', "Press 1")]
)

COMPARE = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
WORDS = {"==": "eq", "!=": "ne", "<": "lt", "<=": "le", ">": "gt", ">=": "ge"}


def _holds(sign: str, a: Any, b: Any) -> bool:
    if isinstance(a, tuple) and sign not in ("==", "!="):
        return a[0] == b[0] and bool(COMPARE[sign](a[1], b[1]))
    if isinstance(a, bytes):
        return bool(COMPARE[sign]((len(a), a), (len(b), b)))
    return bool(COMPARE[sign](a, b))


def _comparison(sign: str, word: bool, left: Said, right: Said) -> Said:
    def meaning(row: Row) -> bool:
        pairs = [_holds(sign, a, b) for a in left.meaning(row) for b in right.meaning(row)]
        return bool(pairs) and (all(pairs) if sign == "!=" else any(pairs))

    written = WORDS[sign] if word else sign
    return Said(f"{left.at_least(COMMON)} {written} {right.at_least(COMMON)}", COMPARISON, meaning)


def _member(left: Said, elements: list[tuple[str, Callable[[Any], bool]]], wanted: bool) -> Said:
    def meaning(row: Row) -> bool:
        values = left.meaning(row)
        inside = any(holds(value) for value in values for _, holds in elements)
        return inside is wanted

    listed = ", ".join(text for text, _ in elements)
    return Said(f"{left.at_least(COMMON)} {'in' if wanted else 'not in'} {{{listed}}}", COMPARISON, meaning)


def _found(word: str, left: Said, text: str, holds: Callable[[Any], bool]) -> Said:
    return Said(f"{left.text} {word} {text}", COMPARISON, lambda row: any(map(holds, left.meaning(row))))


WHOLE_ELEMENTS: list[tuple[str, Callable[[Any], bool]]] = [
    ("1", lambda a: a == 1),
    ("2..7", lambda a: 2 <= a <= 7),
    ("-9 .. -1", lambda a: -9 <= a <= -1),
    ("0x80", lambda a: a == 128),
    ("18446744073709551615", lambda a: a == 2**64 - 1),
]
ADDRESS_ELEMENTS: list[tuple[str, Callable[[Any], bool]]] = [
    ("10.0.0.0/30", lambda a: a[0] == 4 and a[1] >> 2 == 0x0A000000 >> 2),
    ("10.0.0.2..10.0.0.255", lambda a: a[0] == 4 and 0x0A000002 <= a[1] <= 0x0A0000FF),
    ("::/0", lambda a: a[0] == 6),
    ("2001:db8::/32", lambda a: a[0] == 6 and a[1] >> 96 == 0x20010DB8),
    ("::1", lambda a: a == (6, 1)),
]
BYTES_ELEMENTS: list[tuple[str, Callable[[Any], bool]]] = [
    ("00", lambda a: a == b"\0"),
    ("02..01:02", lambda a: (1, b"\2") <= (len(a), a) <= (2, b"\1\2")),
]
TEXT_ELEMENTS: list[tuple[str, Callable[[Any], bool]]] = [
    ('"a".."pump"', lambda a: "a" <= a <= "pump"),
    ('"ü"', lambda a: a == "ü"),
]


def _compared(values: Any, literals: Any, elements: list[tuple[str, Callable[[Any], bool]]]) -> Any:
    kinds = [
        st.builds(_comparison, st.sampled_from(list(COMPARE)), st.booleans(), values, st.one_of(values, literals)),
        st.builds(_comparison, st.sampled_from(list(COMPARE)), st.booleans(), literals, values),
    ]
    if elements:
        chosen = st.lists(st.sampled_from(elements), min_size=1, max_size=3)
        kinds.append(st.builds(_member, values, chosen, st.booleans()))
    return st.one_of(kinds)


def _nonzero(value: Said) -> Said:
    return Said(value.text, value.strength, lambda row: any(number != 0 for number in value.meaning(row)))


def _exists(value: Said) -> Said:
    return Said(value.text, value.strength, lambda row: bool(value.meaning(row)))


def _is_true(value: Said) -> Said:
    return Said(value.text, ATOM, lambda row: any(value.meaning(row)))


BOOL_FIELDS = fields("f.on", "f.ready", "f.sent")
BOOL_LITERALS = st.sampled_from([literal("1", True), literal("False", False), literal("true", True)])
BYTES_PATTERNS = ["^ab", r"\x00{2}", "[b-c]a", r"[^\x00]\xff$", "^$", "(a|ba)b+$", ".{4}", "B\x00?A"]
PATTERNS = ["^p", "S+", r"\d$", "(a|u)m?p", "^$", "[^a-z]", "^p.{3}s$"]
BYTES_WANTED = [("00:01", b"\0\1"), ('"ab"', b"ab"), ("00", b"\0"), ("62:61:62:61:62", b"babab"), ('""', b"")]

SIMPLE: st.SearchStrategy[Said] = st.one_of(
    _compared(WHOLE, WHOLE_LITERALS, WHOLE_ELEMENTS),
    _compared(REAL, REAL_LITERALS, []),
    _compared(fields("n.byte", "n.dint"), st.builds(lambda real: real, REAL), []),
    _compared(DURATION, DURATION_LITERALS, []),
    _compared(TIME, TIME_LITERALS, []),
    _compared(ADDRESS, ADDRESS_LITERALS, ADDRESS_ELEMENTS),
    _compared(BYTES, BYTES_LITERALS, BYTES_ELEMENTS),
    _compared(TEXT, TEXT_LITERALS, TEXT_ELEMENTS),
    st.builds(
        _comparison, st.sampled_from(["==", "!="]), st.booleans(), BOOL_FIELDS, st.one_of(BOOL_FIELDS, BOOL_LITERALS)
    ),
    st.builds(lambda v, w: _found("contains", v, w[0], lambda a: w[1] in a), BYTES, st.sampled_from(BYTES_WANTED)),
    st.builds(
        lambda v, w: _found("contains", v, f'"{w}"', lambda a: w in a), TEXT, st.sampled_from(["p", "ss", "", "ü"])
    ),
    st.builds(
        lambda v, p: _found("matches", v, f'r"{p}"', lambda a: re.search(p, a, re.IGNORECASE) is not None),
        TEXT,
        st.sampled_from(PATTERNS),
    ),
    st.builds(
        lambda v, p: _found(
            "matches", v, f'r"{p}"', lambda a: re.search(p.encode(), a, re.IGNORECASE | re.DOTALL) is not None
        ),
        BYTES,
        st.sampled_from(BYTES_PATTERNS),
    ),
    BOOL_FIELDS.map(_is_true),
    BITS.map(_nonzero),
    st.one_of(WHOLE_FIELDS, ADDRESS, BYTES, TEXT, fields("t.at", "n.lreal")).map(_exists),
)


def _joined(inner: st.SearchStrategy[Said]) -> st.SearchStrategy[Said]:
    signs: dict[tuple[str, str], tuple[int, Callable[[bool, bool], bool]]] = {
        ("||", "or"): (OR, lambda a, b: a or b),
        ("^^", "xor"): (XOR, lambda a, b: a != b),
        ("&&", "and"): (AND, lambda a, b: a and b),
    }

    def put(written: tuple[str, str], word: bool, left: Said, right: Said) -> Said:
        strength, join = signs[written]
        text = f"{left.at_least(strength)} {written[word]} {right.at_least(strength + 1)}"
        return Said(text, strength, lambda row: join(bool(left.meaning(row)), bool(right.meaning(row))))

    def turn(word: bool, value: Said) -> Said:
        return Said(f"{'not ' if word else '!'}{value.at_least(NOT)}", NOT, lambda row: not value.meaning(row))

    return st.one_of(
        st.builds(put, st.sampled_from(list(signs)), st.booleans(), inner, inner), st.builds(turn, st.booleans(), inner)
    )


TESTS: st.SearchStrategy[Said] = st.recursive(SIMPLE, _joined, max_leaves=5)
