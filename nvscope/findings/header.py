"""NV1xx: what is wrong with single telegrams."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.findings.finding import Facts, Finding
from nvscope.units import count_of

_SENTENCES = {
    101: "{telegrams} shorter than the 20 bytes of the header.",
    102: "{telegrams} whose Length is not that of the UDP payload.",
    103: "{telegrams} of a service that is not known.",
    104: "{telegrams} with reserved bits set in Flags.",
    105: "{telegrams} whose Length fits once its two bytes are swapped: perhaps a big-endian header.",
    106: "{telegrams} whose identity begins with the character '0' in place of a binary 0.",
    107: "{telegrams} of which only the first bytes were captured.",
}


def judge_headers(facts: Facts) -> Iterator[Finding]:
    """Yield NV101 to NV107, by list, sender and SubIndex."""
    for code, sentence in _SENTENCES.items():
        for list_number, node, subindex, events in facts.logged(code):
            message = sentence.format(telegrams=count_of(events.count, "telegram"))
            if list_number is None:
                message += " They belong to the Parameter Manager, not to a list."
            yield Finding(
                f"NV{code}", message, events.count, events.first_ns, events.last_ns, events.frames,
                list_number, node, subindex,
            )  # fmt: skip
