"""What in definitions will not work on the wire, or only with luck: found before anything is sent.

Each rule is a row of ``RULES``: the word by which it is known (the code, where a report finds the same), what it finds,
why that matters, and what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal

from msgspec import Struct

from nvscope.definition import codes
from nvscope.definition import lint_searches as searches
from nvscope.definition.lint_searches import Packed, Place, Subject
from nvscope.definition.model import AssumedBase, Definition, Problem
from nvscope.definition.syntax import FileSyntax

Severity = Literal["error", "warning", "note"]


class Rule(Struct, frozen=True):
    """One kind of mistake: ``summary`` is what it finds in a few words, ``why`` and ``next_step`` are sentences."""

    id: str
    severity: Severity
    summary: str
    why: str
    next_step: str
    find: Callable[[Subject], Iterator[Place]]


class Mistake(Struct, frozen=True):
    """A rule, and where it found something."""

    rule: Rule
    place: Place


def lint(files: Sequence[FileSyntax], definition: Definition) -> list[Mistake]:
    """Return the mistakes by file, line and column; ``definition`` is what follows from the files.

    Of global variables with neither identifier nor network settings nobody knows whether they are sent: only what no
    controller compiles is told of them. Raises ConfigurationError for a list that cannot be packed.
    """
    problems = [flaw for flaw in definition.flaws_of(definition.lists) if isinstance(flaw, Problem)]
    with_settings = {
        entry.source.position(entry.offset) for file in files for entry in file.lists if any(entry.settings)
    }
    sent = [entry for entry in definition.lists if entry.list_id is not None or entry.position in with_settings]
    nameless = [entry for entry in definition.lists if entry.list_id is None]
    assumed = [flaw for flaw in definition.flaws_of(sent) if isinstance(flaw, AssumedBase)]
    lists = [Packed.of(entry) for entry in sent]
    subject = Subject(files, lists, nameless, definition.left_out, problems, assumed)
    # A list over several connections is there once for each of them.
    found = dict.fromkeys(Mistake(rule, place) for rule in RULES for place in rule.find(subject))
    order = {name: place for place, name in enumerate(dict.fromkeys(_names_of(files)))}
    return sorted(
        found,
        key=lambda each: (
            order.get(each.place.position.file, len(order)),
            each.place.position.line,
            each.place.position.column,
        ),
    )


def _names_of(files: Sequence[FileSyntax]) -> Iterator[str]:
    for file in files:
        yield from (declared.source.file for declared in file.types)
        yield from (declared.source.file for declared in file.lists)


RULES = (
    Rule(
        "unreadable", "error", "a file, or a declaration in it, that cannot be read",
        "It was left out: what it declares is missing in the lists that need it.",
        "Correct it, or leave the file out.",
        searches.find_left_out,
    ),
    Rule(
        "contradiction", "error", "what cannot be: bounds exchanged, a name twice, a type that contains itself",
        "No controller compiles it; what has such a type is of unknown size, and so is what follows it.",
        "Correct the declaration.",
        searches.find_contradictions,
    ),
    Rule(
        "duplicate-identifier", "error", "two lists with one identifier on one port",
        "A telegram tells nothing but the identifier: a reader takes the telegrams of the one list for those of the "
        "other.",
        "Give one of them another identifier. Are they two versions of one list? `nvscope gvl diff` shows where.",
        searches.find_duplicates,
    ),
    Rule(
        "unknown-size", "error", "an element whose size nobody knows: pointer, BIT, function block",
        "It cannot be decoded, nor anything behind it where the list is packed or it may be several elements, and "
        "partners of another kind may place that elsewhere.",
        "Put a plain variable into the list and copy the value, or name the file that declares the type.",
        searches.find_unknown_sizes,
    ),
    Rule(
        "union", "warning", "a UNION",
        "How a UNION is sent is described nowhere; it is taken for the bytes of its largest member.",
        "Put the member that matters into the list instead.",
        searches.find_unions,
    ),
    Rule(
        "empty-list", "warning", "a list without variables",
        "Nothing is sent for it, so a reader that waits for the list waits for ever.",
        "Declare variables, or switch the network properties of the list off.",
        searches.each_list(searches.tell_empty),
    ),
    Rule(
        "identifier-missing", "note", "a list whose identifier no file tells",
        "Its telegrams cannot be found among those of other lists. Without network settings perhaps it is not sent at "
        "all: then nothing else is said of it.",
        "Export the list with its network settings (.gvl), or give the identifier in nvscope.toml.",
        searches.find_identifiers_missing,
    ),
    Rule(
        "identifier-over-255", "note", "an identifier over 255",
        "Controllers take 16 bits, but home-made partners often read or write one byte only.",
        "Use identifiers up to 255 where a partner is no controller.",
        searches.each_list(searches.tell_identifier_large),
    ),
    Rule(
        "never-sent", "warning", "no transmission mode at all",
        "Telegrams of the list appear only when a reader asks for them.",
        "Choose cyclic transmission, or transmission on change or on an event.",
        searches.each_list(searches.tell_never_sent),
    ),
    Rule(
        "interval-zero", "warning", "cyclic transmission with an interval of 0",
        "The list is sent in each task cycle, or never; which of them depends on the controller.",
        "Choose an interval: a multiple of the task's cycle.",
        searches.each_list(searches.tell_interval_zero),
    ),
    Rule(
        "interval-below-gap", "warning", "an interval shorter than the minimum gap",
        "The list cannot be sent as often as its interval says, and readers that wait for that call it late.",
        "Make the interval longer, or the minimum gap shorter.",
        searches.each_list(searches.tell_interval_short),
    ),
    Rule(
        "cut-variable", "warning", "an array or structure that is cut between telegrams",
        "Telegrams are sent and received one by one: a reader can hold parts of different cycles (torn data).",
        "Pack the list if it is not packed, and move the variable to where it fits into one telegram of 256 bytes; or "
        "send a cycle number in each part and compare.",
        searches.find_cut,
    ),
    Rule(
        "long-string", "warning", "a STRING that alone is longer than a telegram",
        "It travels alone in a longer telegram, which not every partner takes, and the string functions of most "
        "controllers end at 255 characters.",
        "Declare it no longer than needed: STRING(255) and WSTRING(127) are the longest that fit.",
        searches.find_long_elements,
    ),
    Rule(
        "many-telegrams", "warning", f"a list of more than {searches.MOST_TELEGRAMS} telegrams",
        f"They are sent at once, and receivers take a limited number per task cycle "
        f"(one vendor: {searches.MOST_TELEGRAMS}); the rest is lost.",
        "Pack the list, or cut it into several with different intervals.",
        searches.find_many_telegrams,
    ),
    Rule(
        "size-by-name", "note", "an array bound or STRING length that is a constant or expression",
        "The constant belongs to the project, not to the list: where the two sides have different values, everything "
        "behind the variable lies elsewhere.",
        "Make sure that the constant is the same on both sides, or write the number.",
        searches.find_sizes_by_name,
    ),
    Rule(
        "initial-value", "warning", "an initial value that its type, or subrange, cannot hold",
        "A compiler refuses it, or takes its bits for another value: what runs is not what is written.",
        "Correct the value, or export the list again.",
        searches.find_initial_values,
    ),
    Rule(
        "assumed-base", "note", "an enumeration whose base type the export leaves out",
        "PLCopen XML has no place for it: where it is not INT, everything behind the variable lies elsewhere.",
        "Declare the enumeration in ST text, or compare its size with the project.",
        searches.find_assumed_bases,
    ),
    Rule(
        "acknowledge-broadcast", "warning", "acknowledgements of a list that is sent to many",
        "Each reader has to answer every telegram. A partner that cannot do that, such as a program on a PC, leaves "
        "the sender with an error that names nobody.",
        "Send it to one reader's address, or switch acknowledgement off.",
        searches.each_list(searches.tell_acknowledged_broadcast),
    ),
    Rule(
        "checksum-broadcast", "warning", "a checksum of a list that is sent to many",
        "How the checksum is computed is published nowhere. Controllers of the family compare it with that of their "
        "own definition; a partner of another kind cannot send it.",
        "Keep it if all partners are such controllers; else switch the checksum off on all sides.",
        searches.each_list(searches.tell_checksum_broadcast),
    ),
    Rule(
        codes.COB_ID_OVERLAP, "error", "two lists on CAN that take the same COB-IDs",
        "A list takes one COB-ID for each frame, counted up from its identifier: readers take frames of the one list "
        "for those of the other.",
        "Choose identifiers at least as far apart as each list has frames; leave some room to grow.",
        searches.find_can_overlaps,
    ),
    Rule(
        codes.CANOPEN_COLLISION, "error", "a list on CAN that takes COB-IDs of CANopen",
        "On a bus with CANopen devices these take its frames for theirs, with any effect up to a stop.",
        "Choose an identifier that no device of this bus uses, and look at the whole range of the list.",
        searches.find_can_services,
    ),
    Rule(
        "can-identifier", "error", "a list on CAN that takes COB-IDs beyond 0x7FF",
        "Base frames have 11 bits for the identifier.",
        "Choose a lower identifier.",
        searches.find_can_identifiers,
    ),
    Rule(
        "can-long-element", "warning", "an element on CAN that is longer than a frame",
        "How it is cut into frames is described nowhere; the COB-IDs behind it are a guess.",
        "Send it in parts of up to 8 bytes.",
        searches.find_can_long,
    ),
    Rule(
        "can-unsupported", "warning", "a setting that does not exist on CAN: checksum, acknowledgement, event",
        "Frames have no header that could carry it; it has no effect.",
        "Switch it off.",
        searches.each_list(searches.tell_can_unsupported),
    ),
)  # fmt: skip
"""All rules; their words are stable."""
