"""Readers that senders do not find, where nothing else says that these are silent: nobody waited for their answers."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.causes.case import NOBODY, Case, Draft, Explained
from nvscope.causes.held_back import lists_and_time
from nvscope.causes.kind import CauseKind
from nvscope.causes.unreached import span_of

READER_NOT_FOUND = CauseKind(
    "reader-not-found",
    "reader not found",
    "A sender asks in vain for the address of the only node that it sends a list to, and cannot send it meanwhile.",
    "Its ARP requests, second by second, while the list pauses and nothing of the reader comes. Of a reader that used "
    "to acknowledge the list, all of it is told as reader-silent.",
    "Power, cable and switch port of the reader, and whether it has another address now.",
)
_NEXT = "Power, cable and switch port of {reader}; whether this is still its address."


def judge_readers_not_found(case: Case) -> Iterator[Explained]:
    """Explain lists that are held back since their only reader is not found, by reader."""
    for reader in dict.fromkeys(one.reader for one in case.unreached.spells):
        spells = [
            one for one in case.unreached.spells
            if one.reader == reader and (case.unreached.symptoms_of([one]) & (case.owner == NOBODY)).any()
        ]  # fmt: skip
        if not spells:
            continue
        which, when = lists_and_time(case, spells)
        senders = list(dict.fromkeys(one.sender for one in spells))
        since_ns, until_ns = span_of(spells)
        name, does = case.address(reader), "did" if until_ns is not None else "does" if len(senders) == 1 else "do"
        who = f"Node {case.address(senders[0])}" if len(senders) == 1 else f"{len(senders)} nodes"
        draft = Draft(
            READER_NOT_FOUND, f"{who} {does} not find node {name} {when}, which alone reads {which}",
            _NEXT.format(reader=name),
            [f"again and again it is asked who has the address {name} (ARP)", f"nothing of {name} came meanwhile"],
            [case.lists[number] for number in dict.fromkeys(one.list for one in spells)], [reader],
            since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        yield draft, case.unreached.symptoms_of(spells)
