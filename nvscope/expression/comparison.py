"""Columns compared with each other and with constants, all rows at once."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dissectors.batch import U64, Bool
from dissectors.headers import IPV4_HIGH, IPV4_LOW
from nvscope.expression import spans
from nvscope.expression.literals import Network, Value
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, Column, TextColumn

COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def compare(sign: str, left: Column, right: Column | Value) -> Bool:
    """Tell where a comparison holds between values of types that were found to fit."""
    found: Bool
    if isinstance(left, AddressColumn):
        assert isinstance(right, AddressColumn | Network)
        return _addresses(sign, left, right)
    if isinstance(left, BytesColumn):
        other = spans.constant_span(right) if isinstance(right, bytes) else right
        assert isinstance(other, BytesColumn)
        if sign in ("==", "!="):
            same = spans.equal(left, other)
            return same if sign == "==" else ~same
        found = COMPARE[sign](spans.order(left, other), 0)
        return found
    if isinstance(left, TextColumn):
        return _texts(sign, left, right)
    with np.errstate(all="ignore"):
        found = COMPARE[sign](left, right)
    return found


def compare_names(sign: str, left: Column, right: str) -> Bool:
    """Tell where names are, or are not, a name, whatever their case."""
    assert isinstance(left, TextColumn)
    wanted = right.casefold()
    return told(left, lambda text: (text.casefold() == wanted) == (sign == "=="))


def _texts(sign: str, left: TextColumn, right: Column | Value) -> Bool:
    found: Bool
    compare_two = COMPARE[sign]
    if isinstance(right, TextColumn):
        rank = {text: at for at, text in enumerate(sorted({*left.texts, *right.texts}))}
        ours, theirs = (np.array([rank[text] for text in side.texts], np.int64) for side in (left, right))
        found = compare_two(ours[left.code], theirs[right.code])
        return found
    return told(left, lambda text: bool(compare_two(text, right)))


def told(column: TextColumn, test: Callable[[str], bool]) -> Bool:
    """Ask something of every text once, and tell where the answer is yes."""
    answers = np.array([test(text) for text in column.texts], np.bool_)
    found: Bool = answers[column.code]
    return found


def _addresses(sign: str, left: AddressColumn, right: AddressColumn | Network) -> Bool:
    found: Bool
    if sign in ("==", "!="):
        same = _in_network(left, right) if isinstance(right, Network) else _same(left, right)
        return same if sign == "==" else ~same
    if isinstance(right, Network):
        right = AddressColumn(np.array([right.high], np.uint64), np.array([right.low], np.uint64))
    low_decides = left.high == right.high
    found = np.where(low_decides, COMPARE[sign](left.low, right.low), COMPARE[sign](left.high, right.high))
    # An IPv4 address is neither below nor above an IPv6 one.
    found &= _is_ipv4(left.high, left.low) == _is_ipv4(right.high, right.low)
    return found


def _same(left: AddressColumn, right: AddressColumn) -> Bool:
    found: Bool = (left.low == right.low) & (left.high == right.high)
    return found


def _in_network(column: AddressColumn, network: Network) -> Bool:
    found: Bool
    if network.is_single:
        found = column.low == np.uint64(network.low)
        found &= column.high == np.uint64(network.high)
    else:
        found = (column.low & np.uint64(network.low_mask)) == np.uint64(network.low)
        found &= (column.high & np.uint64(network.high_mask)) == np.uint64(network.high)
        if not network.is_ipv4:
            found &= ~_is_ipv4(column.high, column.low)
    return found


def _is_ipv4(high: U64, low: U64) -> Bool:
    found: Bool = (high == IPV4_HIGH) & ((low & IPV4_LOW) == IPV4_LOW)
    return found
