"""NV1xx: what is wrong with single telegrams."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.event_kinds import EventKind
from nvscope.units import count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts

SHORT_TELEGRAM = FindingKind(
    "NV101",
    "short-telegram",
    Severity.ERROR,
    meaning="A datagram begins like a telegram but is shorter than the 20-byte header. Nobody can use it.",
    causes=(
        "home-made sender code that builds the header incompletely, or sends before its buffer is filled",
        "a different protocol on the same port whose first four bytes happen to look the same",
    ),
    next_steps=(
        "Look at the bytes with `nvscope packets -x` and find out which program runs at the sender's address.",
        "If it is a library for PCs, compare its header with that of a controller's telegram in this capture.",
    ),
    from_event=EventKind.SHORT,
)
LENGTH_MISMATCH = FindingKind(
    "NV102",
    "length-mismatch",
    Severity.ERROR,
    meaning=(
        "The Length field of the header is not the size of the UDP payload. The telegram counts as malformed: its "
        "values must not be expected to arrive, even though the datagram itself does."
    ),
    causes=(
        "home-made sender code that counts the data without the 20 header bytes",
        "a header of another size: which one would fit nearly all telegrams of a sender is said",
        "a sender that transmits STRINGs at their actual length but keeps the Length of the declared one",
        "padding, or a second telegram, behind the first one in the same datagram",
    ),
    next_steps=(
        "Compare Length and that of UDP, which has 8 bytes more than its payload (`nvscope packets -e nv.length -e "
        "udp.length`): a difference of 20 is the header, one that varies is a STRING.",
        "Correct the sender; no setting of the readers helps.",
    ),
    from_event=EventKind.LENGTH_MISMATCH,
)
UNKNOWN_SERVICE = FindingKind(
    "NV103",
    "unknown-service",
    Severity.WARNING,
    meaning="The ID field holds a number that is none of the documented services (0 to 6, 20 to 28, 100).",
    causes=(
        "home-made sender code that writes ID big-endian, so that 5 becomes 83886080",
        "another protocol that uses the same identity, for example one of a safety library",
        "a header that is shifted by a byte or two",
    ),
    next_steps=(
        "Look at the header with `nvscope packets -V -x`: do the fields behind ID make sense?",
        "If the other telegrams of this sender are good, ask its vendor what the service is.",
    ),
    from_event=EventKind.UNKNOWN_SERVICE,
)
RESERVED_FLAGS = FindingKind(
    "NV104",
    "reserved-flags",
    Severity.NOTE,
    meaning=(
        "Bits 3 to 7 of Flags are undocumented, and at least one of them is set. Everything else is judged as usual."
    ),
    causes=(
        "a sender that writes a 32-bit counter over the 16-bit Counter, Flags and Checksum",
        "memory that the sender does not clear before it builds a telegram",
        "a runtime newer than the public description",
    ),
    next_steps=(
        "See whether Flags changes when Counter wraps (NV404 then says so): that is a 32-bit counter.",
        "If a controller sends it and the readers get their values, leave it as it is.",
    ),
    from_event=EventKind.RESERVED_FLAGS,
)
BIG_ENDIAN_HEADER = FindingKind(
    "NV105",
    "big-endian-header",
    Severity.WARNING,
    meaning=(
        "The Length field fits the payload only with its two bytes swapped, so perhaps the whole header is big-endian. "
        "The telegram stays malformed: no controller is known to send or to accept such a header."
    ),
    causes=(
        "a sender programmed for network byte order",
        "a header of another size whose bytes look so by chance: a public npm sender writes 18 bytes per header "
        "when its list is not packed",
    ),
    next_steps=(
        "Look at Index and SubIndex (`nvscope packets -e nv.index -e nv.subindex`): if they too make sense only when "
        "swapped, the sender is big-endian.",
        "Correct the sender: all fields are little-endian.",
    ),
    from_event=EventKind.LENGTH_BYTE_SWAPPED,
)
ASCII_IDENTITY = FindingKind(
    "NV106",
    "ascii-identity",
    Severity.WARNING,
    meaning=(
        "The identity begins with the character '0' (30 hex) where controllers send a binary zero (00). Here it is "
        "read all the same; a controller may ignore it."
    ),
    causes=("home-made sender code that takes the printed '3S-0' of the protocol description literally",),
    next_steps=("Make the sender begin its telegrams with 00 2D 53 33.",),
    from_event=EventKind.ASCII_IDENTITY,
)
TRUNCATED_BY_CAPTURE = FindingKind(
    "NV107",
    "truncated-by-capture",
    Severity.NOTE,
    meaning=(
        "The recording kept only the first bytes of the telegram. Counters and findings are complete where the header "
        "was kept; values behind the cut cannot be shown."
    ),
    causes=("a snap length (`-s`) in tcpdump, dumpcap, a switch or a probe", "a probe that cuts payloads on purpose"),
    next_steps=(
        "Record again without a snap length (`-s 0` of dumpcap and tcpdump); telegrams seldom have more than 276 bytes "
        "of payload.",
    ),
    from_event=EventKind.TRUNCATED,
)

_SENTENCES = {
    SHORT_TELEGRAM: "{telegrams} shorter than the 20 bytes of the header.",
    LENGTH_MISMATCH: "{telegrams} whose Length is not that of the UDP payload.",
    UNKNOWN_SERVICE: "{telegrams} of a service that is not known.",
    RESERVED_FLAGS: "{telegrams} with reserved bits set in Flags.",
    BIG_ENDIAN_HEADER: "{telegrams} whose Length fits once its two bytes are swapped: perhaps a big-endian header.",
    ASCII_IDENTITY: "{telegrams} whose identity begins with the character '0' in place of a binary 0.",
    TRUNCATED_BY_CAPTURE: "{telegrams} of which only the first bytes were captured.",
}

_OF_LENGTH = (LENGTH_MISMATCH, BIG_ENDIAN_HEADER)


def judge_headers(facts: Facts) -> Iterator[Finding]:
    """Yield what is wrong with telegrams, by list, sender and SubIndex; headers of another size by list and sender."""
    foreign = _foreign(facts)
    yield from foreign.values()
    for kind, sentence in _SENTENCES.items():
        for list_number, node, subindex, events in facts.logged(kind):
            if kind in _OF_LENGTH and (list_number, node) in foreign:
                continue
            telegrams = count_of(events.count, "telegram")
            if list_number is not None:
                message = sentence.format(telegrams=telegrams)
            else:
                # Nothing but their sender tells such findings apart.
                sender = "" if node is None else f" from {facts.address(node)}"
                belongs = "It belongs" if events.count == 1 else "They belong"
                told = sentence.format(telegrams=telegrams + sender)
                message = f"{told} {belongs} to the Parameter Manager, not to a list."
            yield Finding(
                kind, message, events.count, events.first_ns, events.last_ns, events.frames,
                list_number, node, subindex,
            )  # fmt: skip


def _foreign(facts: Facts) -> dict[tuple[int, int], Finding]:
    """Return one finding for each sender of a list with headers of another size, whatever their bytes look like."""
    places: dict[tuple[int, int], list[Events]] = defaultdict(list)
    for list_number, node, _, events in facts.logged(LENGTH_MISMATCH):
        if list_number is not None and node is not None:
            places[list_number, node].append(events)
    if not places:
        return {}
    for list_number, node, _, events in facts.logged(BIG_ENDIAN_HEADER):
        if list_number is not None and node is not None and (list_number, node) in places:
            places[list_number, node].append(events)
    # Not before it is needed: `explain` reads the rows above without what this takes.
    from nvscope.findings.foreign_headers import foreign_header, is_foreign, telegrams_of

    telegrams = telegrams_of(facts, places)
    found = {}
    for place in telegrams:
        parts = places[place]
        malformed = sum(events.count for events in parts)
        header = foreign_header(facts, *place) if is_foreign(malformed, telegrams[place]) else None
        if header is not None:
            events = parts[0]
            for part in parts[1:]:
                events = events.among(part)
            message = (
                f"{_SENTENCES[LENGTH_MISMATCH].format(telegrams=count_of(malformed, 'telegram'))[:-1]}: {header.words}."
            )
            found[place] = Finding(
                LENGTH_MISMATCH,
                message,
                malformed,
                events.first_ns,
                events.last_ns,
                events.frames,
                *place,
                hint="Correct the sender, or take another one: no controller reads such telegrams.",
            )
    return found
