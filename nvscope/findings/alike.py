"""Findings that many identifiers of a CAN channel have alike: one finding instead of one for each."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from dissectors.can.pdo import EXTENDED
from nvscope.findings.cob_ids import CANOPEN_COLLISION, COB_ID_OVERLAP
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import cob_id, count_of

_MANY = 5
_NAMED = 4
_ALONE = (COB_ID_OVERLAP, CANOPEN_COLLISION)
"""These say something else of each list."""


def taken_together(findings: Iterable[Finding], keys: Mapping[int, ListKey]) -> list[Finding]:
    """Return findings with those of one code and channel, where many lists on CAN have them, as one.

    ``keys`` are those of the lists that were seen, by number. What is said of the one with the most events stands for
    all, with how many there are.
    """
    left, alike = [], defaultdict(list)
    for finding in findings:
        key = None if finding.list_number is None else keys[finding.list_number]
        if key is None or key.transport is not Transport.CAN or finding.kind in _ALONE:
            left.append(finding)
        else:
            alike[finding.code, str(key.port)].append(finding)
    for (_, channel), found in alike.items():
        left += found if len(found) < _MANY else [_one(found, channel, keys)]
    return left


def _one(found: Sequence[Finding], channel: str, keys: Mapping[int, ListKey]) -> Finding:
    most = max(found, key=lambda finding: finding.count)
    named = ", ".join(_identifier(finding, keys) for finding in found[:_NAMED])
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    message = (
        f"{count_of(len(found), 'identifier')} of {channel} show this: {named}{more}. {_identifier(most, keys)}: "
        f"{most.message}"
    )
    first = [finding.first_ns for finding in found if finding.first_ns is not None]
    last = [finding.last_ns for finding in found if finding.last_ns is not None]
    frames = sorted({frame for finding in found for frame in finding.frames})
    return replace(
        most,
        message=message,
        count=sum(finding.count for finding in found),
        first_ns=min(first, default=None),
        last_ns=max(last, default=None),
        frames=tuple(frames[:FRAMES_KEPT]),
        list_number=None,
        node=None,
        subindex=None,
        channel=channel,
        lists=tuple(dict.fromkeys(finding.list_number for finding in found if finding.list_number is not None)),
    )


def _identifier(finding: Finding, keys: Mapping[int, ListKey]) -> str:
    """Return the COB-ID that a finding is about."""
    if finding.list_number is None:
        raise ValueError(f"{finding.code} is of no list")
    word = keys[finding.list_number].identifier
    if word & EXTENDED:
        return cob_id(word & ~EXTENDED, extended=True)
    return cob_id(word + (finding.subindex or 0))
