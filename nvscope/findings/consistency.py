"""NV401 to NV404: senders that disagree with each other, or with themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.enumeration import first_few
from nvscope.findings.finding import Events, Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.event_kinds import EventKind
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.several_senders import SendersTogether
    from nvscope.tracker.summary import ListSummary

SEVERAL_SENDERS = FindingKind(
    "NV401",
    "several-senders",
    Severity.ERROR,
    meaning=(
        "More than one node sends this list, in the same recording where there are several. Readers take whatever "
        "comes, so the values alternate between the senders."
    ),
    causes=(
        "one list identifier used for two lists",
        "a copied project, a spare controller, or a test program on a PC that still runs",
        "a list with both 'read' and 'write' switched on (V2.3)",
        "a redundant pair of controllers, where it may be intended",
    ),
    next_steps=(
        "Find each sender by its address, and the hardware (`nvscope packets -e ip.src -e eth.src -e nv.index`).",
        "Give one of the lists another identifier, or stop one sender.",
        "If both shall send, let them use two lists and choose in the reader's program.",
    ),
)
SHAPE_CHANGED = FindingKind(
    "NV402",
    "shape-changed",
    Severity.ERROR,
    meaning=(
        "Items or Length of a telegram differ from the telegram before it with the same list and SubIndex. At least "
        "one of the two does not fit the readers' definition; what they make of it is undefined."
    ),
    causes=(
        "two senders with different definitions of the list",
        "a download in between that changed the list",
        "a PC library that sends STRINGs at their actual length",
    ),
    next_steps=(
        "See whether the shape changes with the sender (NV401), once (a download) or all the time (STRINGs).",
        "Give all sides the same definition; fill up STRINGs to their declared length + 1.",
    ),
    from_event=EventKind.SHAPE_CHANGED,
)
CHECKSUM_CHANGED = FindingKind(
    "NV403",
    "checksum-changed",
    Severity.ERROR,
    meaning=(
        "The Checksum of a telegram differs from the one known for this list and SubIndex. It is a signature of the "
        "definition, not of the values: readers that check it reject the telegram."
    ),
    causes=(
        "two senders with different definitions of the list",
        "the sender was downloaded with a changed definition during the capture",
        "home-made sender code that computes a checksum of the data",
    ),
    next_steps=(
        "Find who differs, and since when: the frames say so.",
        "Export the definition from the writing project, import it everywhere, build and download all.",
    ),
    from_event=EventKind.CHECKSUM_CHANGED,
)
CHECKSUM_FLAG = FindingKind(
    "NV404",
    "checksum-flag",
    Severity.WARNING,
    meaning=(
        "Checksum is not 0 although Flags says that there is none, or Flags changes just as Counter wraps: the "
        "last header bytes do not hold what their names say."
    ),
    causes=(
        "a sender that writes a 32-bit counter over bytes 16 to 19: its carry lands in Flags and Checksum",
        "header bytes that the sender does not clear",
    ),
    next_steps=(
        "If Flags changed at the wrap of Counter, have the sender write a 16-bit counter: as it is, it will "
        "ask for acknowledgements and checksums by accident.",
        "Otherwise clear both bytes in the sender.",
    ),
    from_event=EventKind.FLAGS_INCONSISTENT,
)


_COMPARED = (SHAPE_CHANGED, CHECKSUM_CHANGED)
"""What follows from another telegram of the list, which the limit of streams may have left out."""


def judge_consistency(facts: Facts) -> Iterator[Finding]:
    """Yield several senders by list, all else by list, sender and SubIndex."""
    lists = {entry.number: entry for entry in facts.summary.lists}
    several = facts.state.lists.several_senders.together(facts.state.lists.flows)
    for entry in facts.summary.lists:
        if entry.number in several:
            yield _several_senders(facts, entry, several[entry.number])
    for kind, sentence in _SENTENCES.items():
        for list_number, node, subindex, events in facts.logged(kind):
            assert list_number is not None
            assert subindex is not None
            if kind in _COMPARED and facts.misses_data(list_number):
                continue
            message = sentence(facts, lists[list_number], subindex, events)
            yield Finding(
                kind, message, events.count, events.first_ns, events.last_ns, events.frames,
                list_number, node, subindex,
            )  # fmt: skip


def _several_senders(facts: Facts, entry: ListSummary, together: SendersTogether) -> Finding:
    """Each sender but the first is an event, at its first data telegram of a recording in which others send too."""
    names = [facts.address(node) for node in entry.senders if node in together.nodes]
    at_least = "At least " if facts.misses_data(entry.number) else ""
    return Finding(
        SEVERAL_SENDERS, f"{at_least}{count(len(names))} nodes send this list: {first_few(names, 4)}.",
        together.further, together.first_ns, together.last_ns, together.frames, entry.number,
    )  # fmt: skip


def _shape(facts: Facts, entry: ListSummary, subindex: int, events: Events) -> str:
    """Return the same for every sender of a SubIndex: a telegram is compared with the one before it, of any of them."""
    own = facts.streams_of_place[entry.number, subindex]
    if len(own) > _MOST_SENDERS:
        return f"Consecutive telegrams differ in Items or Length; {count(len(own))} nodes send them."
    shapes = [f"{count_of(stream.items, 'item')} in {stream.length} bytes" for stream in own]
    if len(own) == 1:
        return f"Consecutive telegrams differ in Items or Length; the last has {shapes[0]}."
    senders = ", ".join(f"{shape} from {facts.address(stream.node)}" for stream, shape in zip(own, shapes, strict=True))
    return f"Consecutive telegrams differ in Items or Length; the last ones have {senders}."


def _checksum(facts: Facts, entry: ListSummary, subindex: int, events: Events) -> str:
    reference = facts.reference_checksum(entry.number, subindex)
    return (
        f"{count_of(events.count, 'telegram')} with another checksum than 16#{reference:02X}, the first one seen: "
        "the definitions of the list differ."
    )


def _flags(facts: Facts, entry: ListSummary, subindex: int, events: Events) -> str:
    return (
        f"{count_of(events.count, 'telegram')} with a checksum but without its flag, or with Flags that change as "
        "Counter wraps: the sender writes its counter over them."
    )


_MOST_SENDERS = 4

_SENTENCES = {SHAPE_CHANGED: _shape, CHECKSUM_CHANGED: _checksum, CHECKSUM_FLAG: _flags}
