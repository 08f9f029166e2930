"""What senders hold back while they look for a reader that is gone, in words."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.causes.case import Case
from nvscope.causes.unreached import Spell, span_of
from nvscope.causes.words import lists_in_words, span_in_words


def lists_and_time(case: Case, spells: Sequence[Spell]) -> tuple[str, str]:
    """Return which lists were held back, and since when, or from when to when."""
    lists = [case.lists[number] for number in dict.fromkeys(one.list for one in spells)]
    return lists_in_words(case, lists), span_in_words(case, *span_of(spells))


def looked_for(case: Case, spells: Sequence[Spell]) -> str:
    """Return who looked for a reader in vain, and what did not come of it; "" if nobody did."""
    if not spells:
        return ""
    senders = [case.address(one) for one in dict.fromkeys(one.sender for one in spells)]
    lists, when = lists_and_time(case, spells)
    if len(senders) == 1:
        return f"{senders[0]} asks for its address in vain (ARP): it cannot send {lists} {when}"
    return f"{len(senders)} senders ask for its address in vain (ARP): they cannot send {lists} {when}"
