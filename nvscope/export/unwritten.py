"""What an export did not write, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from nvscope.findings.can import DLC_MISMATCH
from nvscope.findings.definition import DEFINITION_MISMATCH
from nvscope.list_key import Transport
from nvscope.units import count, count_of, list_key
from nvscope.view.escape import visible
from nvscope.view.rows.defined import DefinedTelegrams, LeftOut

_MOST_NAMED = 6
_REASONS = {
    LeftOut.MALFORMED: "malformed",
    LeftOut.UNFITTING: "not of the shape that the definition has ({code})",
    LeftOut.CUT: "not captured whole",
    LeftOut.UNLIKE_KNOWN_PART: "not even of the shape that the known part of the definition has",
}


def why_nothing(telegrams: DefinedTelegrams) -> str:
    """Return why not one telegram was written, where that is so."""
    if not telegrams.telegrams:
        return f"{count_of(telegrams.frames, 'frame')}, no telegram of a defined list"
    if not telegrams.chosen:
        of = f"none of {count(telegrams.telegrams)} telegrams" if telegrams.telegrams > 1 else "not the one telegram"
        return f"the filter chooses {of} of defined lists"
    frames = count_of(telegrams.frames, "frame")
    chosen = " that the filter chooses" if telegrams.chosen < telegrams.telegrams else ""
    if telegrams.chosen == 1:
        return f"{frames}, and the one telegram of a defined list{chosen} could not be decoded"
    return f"{frames}, none of {count(telegrams.chosen)} telegrams of defined lists{chosen} could be decoded"


ASSUMED_PACKING = "lists on CAN are packed as assumed: as on UDP, with 8 bytes in a frame; nothing documents it."


def left_out(telegrams: DefinedTelegrams) -> list[str]:
    """Return which telegrams were left out and why, a sentence a list; of many lists, the last are one."""
    known = telegrams.left_out
    names = {telegrams.keys[place.number]: place.layout.list.name for place in reversed(telegrams.places)}
    told = []
    for key, reasons in list(known.items())[:_MOST_NAMED]:
        kind = DLC_MISMATCH if key.transport is Transport.CAN else DEFINITION_MISMATCH
        told.append(f"{list_key(str(key))} {visible(names.get(key, ''))}: {_counted(reasons, kind.code)}.")
    if others := list(known.values())[_MOST_NAMED:]:
        total = {reason: sum(reasons.get(reason, 0) for reasons in others) for reason in LeftOut}
        summed = {reason: number for reason, number in total.items() if number}
        told.append(f"{count_of(len(others), 'more list')}: {_counted(summed)}.")
    return told


def no_part_of_cycles(telegrams: DefinedTelegrams) -> list[str]:
    """Return which bytes rows of cycles do not have: those of several telegrams of a list that nobody has described."""
    several = Counter((place.number, place.rest.name) for place in telegrams.places if place.rest is not None)
    names = {place.number: place.layout.list.name for place in telegrams.places}
    return [
        f"{visible(names[number])}: {visible(name)} are bytes of several telegrams, which a row of a cycle does not "
        "have; --rows telegram has them."
        for (number, name), places in several.items()
        if places > 1
    ][:_MOST_NAMED]


def beyond_time(number: int, instead: str = "the long form") -> str:
    """Return the sentence on times of 64 bits that no column of times holds; ``instead`` says what holds them."""
    what = count_of(number, "time of 64 bits is", "times of 64 bits are")
    return f"{what} beyond 292 years or the year 2262, and null; {instead} has the nanoseconds."


def _counted(reasons: Mapping[LeftOut, int], code: str = f"{DEFINITION_MISMATCH.code}, {DLC_MISMATCH.code}") -> str:
    """Return how many telegrams were left out, and why; ``code`` is the finding that tells of other shapes."""
    why = {reason: _REASONS[reason].format(code=code) for reason in reasons}
    if len(reasons) == 1:
        ((reason, number),) = reasons.items()
        return f"{count_of(number, 'telegram')} left out, {why[reason]}"
    told = ", ".join(f"{count(number)} {why[reason]}" for reason, number in reasons.items())
    return f"{count_of(sum(reasons.values()), 'telegram')} left out: {told}"
