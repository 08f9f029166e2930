"""Findings that many identifiers of a CAN channel have alike: one for all of them, which says what is worst."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from dissectors.can.pdo import EXTENDED
from nvscope.enumeration import first_few
from nvscope.findings.badness import badness
from nvscope.findings.cob_ids import OF_ONE_LIST
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import cob_id, count_of

_MANY = 5
_NAMED = 4


def taken_together(findings: Iterable[Finding], keys: Mapping[int, ListKey]) -> list[Finding]:
    """Return findings with those of one code and channel, where many lists on CAN have them, as one.

    ``keys`` are those of the lists that were seen, by number. What is said of the worst (``badness``) stands for all,
    with how many there are; all of them are its ``parts``.
    """
    left, alike = [], defaultdict(list)
    for finding in findings:
        key = None if finding.list_number is None else keys[finding.list_number]
        if key is None or key.transport is not Transport.CAN or finding.kind in OF_ONE_LIST:
            left.append(finding)
        else:
            alike[finding.code, str(key.port)].append(finding)
    for (_, channel), found in alike.items():
        left += found if len(found) < _MANY else [_one(found, channel, keys)]
    return left


def _one(found: Sequence[Finding], channel: str, keys: Mapping[int, ListKey]) -> Finding:
    worst = max(found, key=lambda finding: badness(finding.code, finding.extent, finding.count))
    named = first_few([_identifier(finding, keys) for finding in found], _NAMED)
    message = (
        f"{count_of(len(found), 'identifier')} of {channel} show this: {named}. {_identifier(worst, keys)}: "
        f"{worst.message}"
    )
    first = [finding.first_ns for finding in found if finding.first_ns is not None]
    last = [finding.last_ns for finding in found if finding.last_ns is not None]
    frames = sorted({frame for finding in found for frame in finding.frames})
    return replace(
        worst,
        message=message,
        count=sum(finding.count for finding in found),
        first_ns=min(first, default=None),
        last_ns=max(last, default=None),
        frames=tuple(frames[:FRAMES_KEPT]),
        list_number=None,
        node=None,
        subindex=None,
        channel=channel,
        parts=tuple(found),
    )


def _identifier(finding: Finding, keys: Mapping[int, ListKey]) -> str:
    """Return the COB-ID that a finding is about."""
    if finding.list_number is None:
        raise ValueError(f"{finding.code} is of no list")
    word = keys[finding.list_number].identifier
    if word & EXTENDED:
        return cob_id(word & ~EXTENDED, extended=True)
    return cob_id(word + (finding.subindex or 0))
