"""Check of writes: who writes parameters of controllers, and variables of WebVisu, and which."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import Struct, field

from dissectors import address
from nvscope.check.asked_while import asks_beyond
from nvscope.check.check import Check, Evidence
from nvscope.check.kept_frames import first_of, frames_of
from nvscope.check.parameters import Parameter
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.who_asks import NODES_OR_NONE, PROTOCOLS, SDO, WHO, Asking, Nodes
from nvscope.check.written_places import PLACES, Places, Written
from nvscope.check.written_while import Times, WrittenWhile, watch_writes
from nvscope.enumeration import first_few
from nvscope.list_key import ListKey
from nvscope.units import count_of

if TYPE_CHECKING:  # most plants have no Parameter Manager, and then nothing of it is imported
    from nvscope.tracker.parameter.writes import Write

_MOST_SHOWN = 60
"""So many characters of a value are told."""

_MOST_NAMED = 3
_UNHEARD = "what nodes ask each other is not to be seen in this capture: others may have written"
_CUT = "bytes of its connections are missing: nobody knows whether it wrote something in there"
_AT_END = (
    "where the capture ends, a request of its has begun, or bytes of its connections are missing or still wait: nobody "
    "knows whether it wrote something in there"
)
_UNREAD = "a message of its is too long to be read, or in an unknown coding: nobody knows whether it wrote something"
_UNSEEN = "a reply confirms a write of {} of {} whose request is not in this capture"
_MALFORMED = "a request to write {} of {} is malformed, or its header is cut off: nobody knows whether it was taken"
_UNCLEAR = (
    "of a request nobody knows all variables: a text has | in it, or more is in it than its variables, or its length "
    "is unknown, or bytes of it came again as others"
)


class _Writer(Struct):
    """What one node wrote: how often, and what of it is not allowed, or may not be."""

    count: int = 0
    broken: list[tuple[Written, Times]] = field(default_factory=list)
    unknown: list[Written] = field(default_factory=list)


def _writes(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watched: WrittenWhile = told["watched"]
    asking, names = Asking(known, told), known.project.node_names
    who, what = Nodes(told["only_by"] or (), names), Places(told["only_to"], names)
    if asking.unknown:
        reason = f"no node is called {', '.join(asking.unknown)}"
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, vacuous=True)
        return
    writers: dict[tuple[str, str], _Writer] = defaultdict(_Writer)
    for written, times in watched.written(known):
        if written.pair not in asking:
            continue
        writer = writers[written.pair.protocol, written.pair.client]
        writer.count += times.count
        may = _may(written, who, what, told)
        if may is False:
            writer.broken.append((written, times))
        elif may is None:
            writer.unknown.append(written)
    at_end, unread, unclear = watched.lacking(), watched.unread, watched.unclear
    hidden = {
        (pair.protocol, pair.client): reason
        for pairs, reason in ((at_end, _AT_END), (watched.cut, _CUT), (unread, _UNREAD), (unclear, _UNCLEAR))
        for pair in pairs
        if pair in asking
    }
    for found, reason in ((watched.unseen(known), _UNSEEN), (watched.malformed(known), _MALFORMED)):
        for written, count in found:
            if written.pair not in asking:
                continue
            own = written.pair.protocol, written.pair.client
            if _may(written, who, what, told):
                writers[own].count += count
            else:
                hidden.setdefault(own, reason.format(written.called, written.pair.server))
    yield from _beyond(known, watched, anybody=bool(writers or hidden))
    kept = {} if known.parameters is None else {one.frame: one for one in known.parameters.writes.kept}
    for protocol, client in sorted({*writers, *hidden}, key=_order):
        subject = Judged(Verdict.PASS, node=client, protocol=protocol)
        writer = writers.get((protocol, client), _Writer())
        yield _judged(known, subject, writer, who, kept, hidden.get((protocol, client), ""))


def _order(writer: tuple[str, str]) -> tuple[object, ...]:
    return PROTOCOLS.index(writer[0]), address.order(*address.halves(writer[1]))


def _may(written: Written, who: Nodes, what: Places, told: Mapping[str, Any]) -> bool | None:
    """Tell whether a write is allowed; None where nobody knows, for something has no name, or nobody has one."""
    by: bool | None = True
    if told["only_by"] is not None:
        by = written.pair.client in who or (None if who.unknown else False)
    to = what.holds(written) if told["only_to"] else True
    if by is False or to is False:
        return False
    return None if by is None or to is None else True


def _beyond(known: Evidence, watched: WrittenWhile, *, anybody: bool) -> Iterator[Judged]:
    """Yield what is to be said beside single writers."""
    if not all(info.hears_answers for info in known.infos):
        yield Judged(Verdict.INCONCLUSIVE, reason=_UNHEARD)
    elif watched.left_out:
        told = count_of(watched.left_out, "write")
        yield Judged(Verdict.INCONCLUSIVE, reason=f"{told} of more parameters and variables than are told apart")
    elif asks_beyond(known, "PAIR"):
        yield Judged(Verdict.INCONCLUSIVE, reason="more nodes ask more others than are told apart")
    elif not anybody:
        yield Judged(Verdict.PASS, reason="nobody wrote anything", worst=0, limit=0, unit="writes")


def _judged(
    known: Evidence, subject: Judged, writer: _Writer, who: Nodes, kept: Mapping[int, Write], hidden: str
) -> Judged:  # fmt: skip
    """Judge what a node wrote; ``hidden`` is why nobody knows all of it, "" where all of it is known."""
    broken = sorted(writer.broken, key=lambda one: one[1].frames.kept)
    count = sum(times.count for _, times in broken)
    frames = first_of(times.frames.kept for _, times in broken)
    verdict, reason = Verdict.PASS, f"{count_of(writer.count, 'write')}, all of them allowed"
    if broken:
        verdict, reason = Verdict.FAIL, _told(known, broken, kept)
    elif writer.unknown:
        verdict, reason = Verdict.INCONCLUSIVE, f"nobody has named {_few([one.called for one in writer.unknown])}"
        if who.unknown:
            reason = f"no node is called {', '.join(who.unknown)}"
    elif hidden:
        verdict, reason = Verdict.INCONCLUSIVE, hidden
    return Judged(
        verdict, node=subject.node, protocol=subject.protocol, reason=reason, worst=count, limit=0, unit="writes",
        count=count, first_ns=frames[0][1] if frames else None, frames=frames_of(frames),
    )  # fmt: skip


def _told(known: Evidence, broken: Sequence[tuple[Written, Times]], kept: Mapping[int, Write]) -> str:
    """Return what was written first that was not allowed, and what else."""
    (first, times), *others = broken
    more = f"; and {_few([one.called for one, _ in others])}" if others else ""
    return f"{first.called} of {first.pair.server}: {_value(known, first, times, kept)}{more}"


def _few(names: Sequence[str]) -> str:
    return first_few(list(dict.fromkeys(names)), _MOST_NAMED)


def _value(known: Evidence, written: Written, times: Times, kept: Mapping[int, Write]) -> str:
    """Return what was written the first time, over what, and what came of it, as far as that is known."""
    frame, _ = times.frames.kept[0]
    if written.pair.protocol != SDO:
        pages = known.summary.others.get("visu_writes", ())
        page = next((one for one in pages if one.frame == frame and one.variable == written.called), None)
        if page is None or page.is_secret:
            return "a value that is not kept" if page is None else "a value that is hidden"
        before, after = (
            "?" if value is None else value[:_MOST_SHOWN] + "…" * (len(value) > _MOST_SHOWN)
            for value in (page.old, page.new)
        )
        return f"{before} → {after}, {page.outcome.value}"
    one = kept.get(frame)
    if one is None:
        return "a value that is not kept"
    from nvscope.view.documents.parameter_values import ParameterValues  # noqa: PLC0415

    parameters, values = known.project.definition.parameters, ParameterValues()
    named = parameters.of(one.partner, one.index, one.subindex) if parameters else None
    old, new = (
        "?" if value is None else values.told(named, value.data, value.items, value.size_bytes)[1]
        for value in (one.old, one.new)
    )
    return f"{old} → {new}, {one.outcome.value}"


CHECKS = (
    Check(
        "writes", "writer", "Parameters and variables of WebVisu are written only by whom they may be, and only these.",
        "writes that are not allowed", "there is one",
        'check = "writes"\nonly_by = ["hmi", "192.168.1.0/28"]\nonly_to = ["0x2000:*", "visu/*/PLC_PRG.*"]', _writes,
        (
            *WHO,
            Parameter(
                "only_by", NODES_OR_NONE,
                "who may write, by address, name, pattern or network, [] is nobody; without it, anybody", None,
            ),
            Parameter(
                "only_to", PLACES, "what may be written: 0x2000:1, names, patterns; sdo/NODE/… and visu/NODE/…", ()
            ),
        ),
        watch_writes, at_times=True, of_requests=True,
    ),
)  # fmt: skip
