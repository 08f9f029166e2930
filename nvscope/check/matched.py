"""Which lists each rule is for, and which rules can never be decided on these captures: for whoever writes rules."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope import units
from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Verdict
from nvscope.enumeration import first_few
from nvscope.list_key import ListKey
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.lines.text_width import display_width, shorten

_LONGEST_ID, _MOST_LISTS, _MOST_REASONS = 28, 12, 3


def lines(found: Checked, width: int) -> Iterator[Line]:
    """Yield for each rule the lists that it is for, and why it cannot be decided, where it cannot."""
    ids = [visible(one.rule.id) for one in found.decided]
    column = min(max(map(display_width, ids), default=0), _LONGEST_ID) + 2
    for name, decided in zip(ids, found.decided, strict=True):
        told = [Cell(f"{shorten(name, column - 2):<{column}}", Tone.STRONG), Cell(_matched(found, decided))]
        yield from wrap(told, width, hanging=column)
        reasons = list(dict.fromkeys(one.reason for one in decided.subjects if one.verdict is Verdict.INCONCLUSIVE))
        for reason in filter(None, reasons[:_MOST_REASONS]):
            yield from wrap([Cell(f"cannot be decided: {visible(reason)}", Tone.WARNING)], width, column, column)
    open_ = len(found.of(Verdict.INCONCLUSIVE))
    yield []
    told_all = f"{units.count_of(len(found.decided), 'rule')}, {units.count(open_)} of them cannot be decided here"
    yield from wrap([Cell(told_all, Tone.STRONG)], width)


def _matched(found: Checked, decided: Decided) -> str:
    rule = decided.rule
    variables = list(dict.fromkeys(one.variable for one in decided.subjects if one.variable))
    if variables:
        return f"{rule.check.name}: {first_few([*map(visible, variables)], _MOST_LISTS)}"
    if not rule.lists and rule.check.subject not in ("list", "stream"):
        return f"{rule.check.name}: {rule.check.subject}"
    names = [_name(found, key) for key in decided.lists]
    return f"{rule.check.name}: {first_few(names, _MOST_LISTS) or 'no list'}"


def _name(found: Checked, key: ListKey) -> str:
    name = found.names.get(key) or found.names.get(key.on_any_channel)
    short = units.list_key(str(key)).rpartition("/")[2]
    return f"{short} {visible(name)}" if name else short
