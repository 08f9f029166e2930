"""Checks of who is there: lists that come, lists that must not, and who sends them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from msgspec import Struct

from nvscope.check.check import Check, Evidence
from nvscope.check.counted_while import CountedWhile, telegrams_of, watch_at_times
from nvscope.check.doubt import BEGAN_LATER, doubt
from nvscope.check.first_telegrams import FirstTelegrams, watch_first
from nvscope.check.parameters import Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.list_key import ListKey
from nvscope.toml_table import LENGTH, TEXT, array
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.figures import Of
from nvscope.tracker.stream_summary import StreamSummary

_SECOND_NS = 1_000_000_000
_TOO_SHORT = "the capture is shorter than the rule needs"


def _first_ns(known: Evidence, watched: FirstTelegrams | None) -> Mapping[ListKey, int]:
    """Return when each list came the first time, behind the warm-up or before; or while it is ``watched``."""
    found: dict[ListKey, int] = {}
    streams = [(one.key, stream.stream, stream.first_ns) for one in known.summary.lists for stream in one.streams]
    streams += [(one.key, stream.stream, stream.first_ns) for one in known.summary.can.lists for stream in one.streams]
    for key, stream, first_ns in streams:
        first = (first_ns, 0) if watched is None else watched.of(stream)
        if first is not None:
            found[key] = min(first[0], found.get(key, first[0]))
    return found


class _Sent(Struct, frozen=True):
    """The first telegram of a stream that is judged: who sent it, when, and its frame."""

    node: int
    address: str
    first_ns: int
    frame: int


def _sent(known: Evidence, streams: Iterable[StreamSummary], watched: FirstTelegrams | None) -> list[_Sent]:
    """Return what some streams have sent, of those that have sent anything."""
    first_of = known.first_telegram if watched is None else watched.of
    first = ((one, first_of(one.stream)) for one in streams if one.telegrams)
    return [_Sent(one.node, known.summary.addresses[one.node], *at) for one, at in first if at is not None]


def _first_frames(sent: Iterable[_Sent], nodes: Collection[str]) -> tuple[int, ...]:
    """Return the first frame of each of some nodes, the first of them in front."""
    frames: dict[int, int] = {}
    for one in sent:
        if one.address in nodes:
            frames[one.node] = min(one.frame, frames.get(one.node, one.frame))
    return tuple(sorted(frames.values())[:FRAMES_KEPT])


def _first_of(known: Evidence, key: ListKey) -> tuple[int, int] | None:
    """Return when the first telegram of a list came, and its frame; None where none did."""
    own = [stream.stream for one in known.summary.lists if one.key == key for stream in one.streams]
    own += [stream.stream for one in known.summary.can.lists if one.key == key for stream in one.streams]
    return min((first for one in own if (first := known.first_telegram(one)) is not None), default=None)


def _present(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    first, within_ns = _first_ns(known, told["watched"]), told["within"]
    limit_s = None if within_ns is None else within_ns / _SECOND_NS
    for key in sorted(lists):
        came_ns = first.get(key)
        took_ns = None if came_ns is None or known.since_ns is None else max(came_ns - known.since_ns, 0)
        verdict, reason = Verdict.FAIL, "" if came_ns is not None else "it never came"
        if took_ns is not None and (within_ns is None or took_ns <= within_ns):
            verdict = Verdict.PASS
        elif _is_too_short(known, within_ns):
            verdict, reason = Verdict.INCONCLUSIVE, _TOO_SHORT
        elif came_ns is None and (why := doubt(known, None)):
            verdict, reason = Verdict.INCONCLUSIVE, why
        elif came_ns is not None and known.since_ns is not None and known.began_between(known.since_ns, came_ns):
            verdict, reason = Verdict.INCONCLUSIVE, BEGAN_LATER
        worst_s = None if took_ns is None else took_ns / _SECOND_NS
        first_of = _first_of(known, key) if verdict is Verdict.FAIL else None
        yield Judged(
            verdict, key, reason=reason, worst=worst_s, limit=limit_s, unit="s", first_ns=came_ns,
            frames=first_of[1:] if first_of else (),
        )  # fmt: skip


def _is_too_short(known: Evidence, within_ns: int | None) -> bool:
    if known.since_ns is None or known.until_ns is None:
        return True
    return within_ns is not None and known.until_ns - known.since_ns < within_ns


def _absent(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    counted: CountedWhile | None = told["watched"]
    subjects = {known.keys[one.list]: one for one in known.of(Of.LIST, lists) if one.list is not None}
    for key in sorted(lists):
        own = subjects.get(key)
        telegrams = 0 if own is None else telegrams_of(own, counted)
        first = None
        if own is not None and telegrams:
            first = _first_of(known, key) if counted is None else counted.first(own.list)
        yield Judged(
            Verdict.FAIL if telegrams else Verdict.PASS, key, worst=telegrams, limit=0, unit="telegrams",
            count=telegrams, first_ns=first[0] if first else None, frames=first[1:] if first else (),
        )  # fmt: skip


def _single_sender(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    named = set(told["senders"])
    for entry in known.summary.lists:
        if entry.key not in lists:
            continue
        sending = _sent(known, entry.streams, told["watched"])
        senders = list(dict.fromkeys(one.address for one in sending))
        if not senders:
            continue
        strangers = (
            [one for one in senders if not {one, known.project.node_names.get(one, one)} & named] if named else []
        )
        fails = len(senders) > 1 or bool(strangers)
        reason = f"{', '.join(senders)} send it" if len(senders) > 1 else ""
        if strangers:
            verb = "send it, and are not named" if len(strangers) > 1 else "sends it, and is not named"
            reason = f"{', '.join(strangers)} {verb}"
        begins = sorted((one.first_ns, one.address) for one in sending)
        others = [first_ns for first_ns, node in begins if node in (strangers or [begins[-1][1]])]
        frames = _first_frames(sending, strangers or [begins[-1][1]]) if fails else ()
        # One that is alone and not named is one too many.
        worst, limit = (len(strangers), 0) if strangers and len(senders) == 1 else (len(senders), 1)
        yield Judged(
            Verdict.FAIL if fails else Verdict.PASS, entry.key, reason=reason, worst=worst, limit=limit,
            unit="senders", count=len(senders) if fails else 0,
            first_ns=min(others) if fails and others else None, frames=frames,
        )  # fmt: skip


def _known_nodes(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    named = set(told["nodes"]) or set(known.project.node_names)
    if not named:
        yield Judged(Verdict.INCONCLUSIVE, reason="no node is named, neither by the rule nor by the project")
        return
    begins: dict[str, int] = {}
    streams = (one for entry in known.summary.lists if entry.key in lists for one in entry.streams)
    sending = _sent(known, streams, told["watched"])
    for one in sending:
        begins[one.address] = min(one.first_ns, begins.get(one.address, one.first_ns))
    if not begins:
        yield Judged(Verdict.INCONCLUSIVE, reason="nobody sends anything that has an address", vacuous=True)
        return
    strangers = [one for one in begins if not {one, known.project.node_names.get(one, one)} & named]
    yield Judged(
        Verdict.FAIL if strangers else Verdict.PASS, reason=f"not named: {', '.join(strangers)}" if strangers else "",
        worst=len(strangers), limit=0, unit="nodes", count=len(strangers),
        first_ns=min(begins[one] for one in strangers) if strangers else None,
        frames=_first_frames(sending, strangers),
    )  # fmt: skip


CHECKS = (
    Check(
        "present", "list", "A list is sent.", "time of its first telegram", "none came until then",
        'check = "present"\nlist = "axis"\nwithin = "2s"', _present,
        (Parameter("within", LENGTH, "by when its first telegram has to be there; else at all", None),), watch_first,
        at_times=True,
    ),
    Check(
        "absent", "list", "A list is not sent.", "its telegrams", "there is one", 'check = "absent"\nlist = "old"',
        _absent, (), watch_at_times, at_times=True,
    ),
    Check(
        "single_sender", "list", "One node sends a list, and no other one.", "how many nodes send it",
        "there are several, or one that is not named",
        'check = "single_sender"\nlist = "axis"\nsenders = ["press-1"]', _single_sender,
        (Parameter("senders", array(TEXT, single=True), "addresses or names of nodes that may; else any one", ()),),
        watch_first, at_times=True,
    ),
    Check(
        "known_nodes", "capture", "Nobody sends who is not known.", "nodes that send and are not named", "there is one",
        'check = "known_nodes"\nnodes = ["192.168.1.10", "press-2"]', _known_nodes,
        (Parameter("nodes", array(TEXT, single=True), "addresses or names; else those of the project", ()),),
        watch_first, at_times=True,
    ),
)  # fmt: skip
