"""Checks of who is there: lists that come, lists that must not, and who sends them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from nvscope.check.check import Check, Evidence
from nvscope.check.counted_while import CountedWhile, telegrams_of, watch_at_times
from nvscope.check.doubt import BEGAN_LATER, doubt
from nvscope.check.parameters import Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.list_key import ListKey
from nvscope.toml_table import LENGTH, TEXT, array
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.figures import Of
from nvscope.tracker.stream_summary import StreamSummary

_SECOND_NS = 1_000_000_000
_TOO_SHORT = "the capture is shorter than the rule needs"


def _first_ns(known: Evidence, counted: CountedWhile | None) -> Mapping[ListKey, int]:
    """Return when each list came the first time, behind the warm-up or before; or while it is ``counted``."""
    if counted is not None:
        came = {key: counted.first_ns(number) for number, key in known.keys.items()}
        return {key: first_ns for key, first_ns in came.items() if first_ns is not None}
    found = {one.key: min(stream.first_ns for stream in one.streams) for one in known.summary.lists if one.streams}
    return found | {
        one.key: min(stream.first_ns for stream in one.streams) for one in known.summary.can.lists if one.streams
    }


def _first_frames(known: Evidence, streams: Iterable[StreamSummary], nodes: Collection[str]) -> tuple[int, ...]:
    """Return the first frame of each of some nodes in some streams, the first of them in front."""
    frames: dict[int, int] = {}
    for one in streams:
        frame = known.first_frame(one.stream)
        if frame is not None and known.summary.addresses[one.node] in nodes:
            frames[one.node] = min(frame, frames.get(one.node, frame))
    return tuple(sorted(frames.values())[:FRAMES_KEPT])


def _frames_of(known: Evidence, key: ListKey) -> tuple[int, ...]:
    """Return the first frame of a list, nothing where none came."""
    own = [stream.stream for one in known.summary.lists if one.key == key for stream in one.streams]
    own += [stream.stream for one in known.summary.can.lists if one.key == key for stream in one.streams]
    frames = [known.first_frame(one) for one in own]
    return tuple(sorted(one for one in frames if one is not None)[:1])


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
        yield Judged(
            verdict, key, reason=reason, worst=worst_s, limit=limit_s, unit="s", first_ns=came_ns,
            frames=_frames_of(known, key) if verdict is Verdict.FAIL else (),
        )  # fmt: skip


def _is_too_short(known: Evidence, within_ns: int | None) -> bool:
    if known.since_ns is None or known.until_ns is None:
        return True
    return within_ns is not None and known.until_ns - known.since_ns < within_ns


def _absent(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    counted = told["watched"]
    first = _first_ns(known, counted)
    subjects = [one for one in known.of(Of.LIST, lists) if one.list is not None]
    came = {known.keys[one.list]: telegrams_of(one, counted) for one in subjects if one.list is not None}
    for key in sorted(lists):
        telegrams = came.get(key, 0)
        verdict = Verdict.FAIL if telegrams else Verdict.PASS
        yield Judged(
            verdict, key, worst=telegrams, limit=0, unit="telegrams", count=telegrams,
            first_ns=max(first[key], known.since_ns or 0) if telegrams and key in first else None,
            frames=_frames_of(known, key) if telegrams and counted is None else (),
        )  # fmt: skip


def _single_sender(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    named = set(told["senders"])
    for entry in known.summary.lists:
        if entry.key not in lists:
            continue
        sending = [one for one in entry.streams if one.telegrams]
        senders = [known.summary.addresses[node] for node in dict.fromkeys(one.node for one in sending)]
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
        begins = sorted((one.first_ns, known.summary.addresses[one.node]) for one in sending)
        others = [first_ns for first_ns, node in begins if node in (strangers or [begins[-1][1]])]
        frames = _first_frames(known, sending, strangers or [begins[-1][1]]) if fails else ()
        # One that is alone and not named is one too many.
        worst, limit = (len(strangers), 0) if strangers and len(senders) == 1 else (len(senders), 1)
        yield Judged(
            Verdict.FAIL if fails else Verdict.PASS, entry.key, reason=reason, worst=worst, limit=limit,
            unit="senders", count=len(senders) if fails else 0,
            first_ns=max(min(others), known.since_ns or 0) if fails and others else None, frames=frames,
        )  # fmt: skip


def _known_nodes(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    named = set(told["nodes"]) or set(known.project.node_names)
    if not named:
        yield Judged(Verdict.INCONCLUSIVE, reason="no node is named, neither by the rule nor by the project")
        return
    begins: dict[str, int] = {}
    sending = [one for entry in known.summary.lists if entry.key in lists for one in entry.streams if one.telegrams]
    for one in sending:
        node = known.summary.addresses[one.node]
        begins[node] = min(one.first_ns, begins.get(node, one.first_ns))
    if not begins:
        yield Judged(Verdict.INCONCLUSIVE, reason="nobody sends anything that has an address", vacuous=True)
        return
    strangers = [one for one in begins if not {one, known.project.node_names.get(one, one)} & named]
    yield Judged(
        Verdict.FAIL if strangers else Verdict.PASS, reason=f"not named: {', '.join(strangers)}" if strangers else "",
        worst=len(strangers), limit=0, unit="nodes", count=len(strangers),
        first_ns=max(min(begins[one] for one in strangers), known.since_ns or 0) if strangers else None,
        frames=_first_frames(known, sending, strangers),
    )  # fmt: skip


CHECKS = (
    Check(
        "present", "list", "A list is sent.", "time of its first telegram", "none came until then",
        'check = "present"\nlist = "axis"\nwithin = "2s"', _present,
        (Parameter("within", LENGTH, "by when its first telegram has to be there; else at all", None),), watch_at_times,
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
    ),
    Check(
        "known_nodes", "capture", "Nobody sends who is not known.", "nodes that send and are not named", "there is one",
        'check = "known_nodes"\nnodes = ["192.168.1.10", "press-2"]', _known_nodes,
        (Parameter("nodes", array(TEXT, single=True), "addresses or names; else those of the project", ()),),
    ),
)  # fmt: skip
