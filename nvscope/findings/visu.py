"""NV8xx: the web visualization's requests and replies."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding, all_events
from nvscope.findings.kind import FindingKind, Severity
from nvscope.findings.visu_refusals import NEXT_OF_THE_LIST, Statuses, next_step, refused_reads, refused_writes
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.visu.events import VisuEvent
    from nvscope.tracker.visu.names import OtherNames
    from nvscope.tracker.visu.state import Subject, VisuCounts
    from nvscope.tracker.visu.writes import Write

_MOST_SHOWN = 60
"""So many characters of a value stand in a sentence."""

VISU_WRITE = FindingKind(
    "NV801",
    "visu-write",
    Severity.NOTE,
    meaning=(
        "A web visualization client wrote a variable. The protocol knows no user and no password for that: whoever "
        "reaches the web server can write."
    ),
    causes=("an operator at a panel or browser", "a script or gateway", "somebody who should not be there"),
    next_steps=(
        "Check that the address of the client is one that may write.",
        "Keep the web server in a network of its own, or behind a gateway that asks for a password.",
    ),
    protocol="visu",
)
VISU_ERROR = FindingKind(
    "NV802",
    "visu-error",
    Severity.ERROR,
    meaning=(
        "The controller refused to write a variable for a web visualization, or its web server answered a request with "
        "another HTTP status than 200. Variables that it cannot read (???) are told below the table of WebVisu."
    ),
    causes=(
        "addresses of an older download: they change with every build",
        "a variable that does not exist, or cannot be written",
        "too many variables in one request, or a malformed one",
        "a page under another path or address (404, 301, 302), a login (401, 403), a web server in trouble (500, 503)",
    ),
    next_steps=(
        NEXT_OF_THE_LIST,
        "Where an HTTP status is named: check path and address of the page, and look at the web server's own log.",
    ),
    protocol="visu",
)
VISU_PASSWORD_IN_CLEAR = FindingKind(
    "NV803",
    "visu-password-in-clear",
    Severity.WARNING,
    meaning=(
        "The web visualization transmits its passwords in clear: they are ordinary variables that clients poll. "
        "Anybody who sees the traffic knows them, and so does this capture."
    ),
    causes=("the way the V2.3 web visualization works; not a fault of the project",),
    next_steps=(
        "Treat the capture as confidential; passwords are masked in what is shown here.",
        "Do not rely on these passwords; separate the network, and use none of them elsewhere.",
    ),
    of_security=True,
    protocol="visu",
)
VISU_COUNT_MISMATCH = FindingKind(
    "NV804",
    "visu-count-mismatch",
    Severity.WARNING,
    meaning=(
        "The number of values differs from what was declared or asked for. Values are assigned by position, so all "
        "behind the first missing one may belong to another variable."
    ),
    causes=(
        "a client that declares another number of entries than it sends",
        "a STRING with the separator '|' in it, which looks like one more field",
        "a reply that was cut off",
    ),
    next_steps=("Look at request and reply; ask for STRINGs one at a time.",),
    protocol="visu",
)
VISU_SLOW = FindingKind(
    "NV805",
    "visu-slow",
    Severity.NOTE,
    meaning="The controller's web server took long to answer.",
    causes=(
        "a new connection for each request",
        "large requests, or many clients",
        "a controller whose cycle leaves little time for communication",
    ),
    next_steps=("Ask for fewer variables, less often, from fewer clients; look at the controller's load.",),
    protocol="visu",
)
VISU_OTHER_NAMES = FindingKind(
    "NV806",
    "visu-other-names",
    Severity.WARNING,
    meaning=(
        "A controller's own list says that variables lie elsewhere than what was known before does. What came before "
        "that list may be called by wrong names here, and pages that were loaded before show, and write, other "
        "variables than they say. What the list contradicts is not believed any more."
    ),
    causes=(
        "the program was changed and downloaded: addresses change with every build",
        "given files of an older download, or of another controller",
        "a gateway that passes one address on to several controllers",
    ),
    next_steps=(
        "Reload the pages that were open before the download, and give the XML files of the current one.",
        "Of several controllers, give each its own files: [webvisu.controllers] of the project file.",
    ),
    protocol="visu",
)


def judge_visu(facts: Facts, counts: VisuCounts) -> Iterator[Finding]:
    """Yield a finding for each variable that a client wrote, and for each client and server with trouble."""
    from dissectors import address
    from nvscope.tracker.visu.events import VisuEvent, event_parts

    kinds = {
        VisuEvent.WRITTEN: VISU_WRITE, VisuEvent.REFUSED: VISU_ERROR, VisuEvent.STATUS: VISU_ERROR,
        VisuEvent.PASSWORD_SEEN: VISU_PASSWORD_IN_CLEAR, VisuEvent.MISCOUNTED: VISU_COUNT_MISMATCH,
        VisuEvent.SLOW: VISU_SLOW, VisuEvent.UNANSWERED: VISU_SLOW, VisuEvent.LATE: VISU_SLOW,
        VisuEvent.OTHER_NAMES: VISU_OTHER_NAMES,
    }  # fmt: skip
    subjects = list(counts.subjects)
    found: dict[tuple[FindingKind, Subject], dict[VisuEvent, Events]] = defaultdict(dict)
    statuses: dict[Subject, list[tuple[int, int]]] = defaultdict(list)
    log = counts.events
    for word, number, events in zip(log.keys.high.tolist(), log.keys.low.tolist(), all_events(log.rows), strict=True):
        event, status = event_parts(word)
        parts = found[kinds[event], subjects[number]]
        before = parts.get(event)
        parts[event] = events if before is None else before.among(events)
        if status:
            statuses[subjects[number]].append((status, events.count))
    nodes = {text: number for number, text in enumerate(facts.summary.addresses)}
    last = {
        (address.text(*one.client), address.text(*one.server), one.variable): one for one in counts.writes.kept
    }  # fmt: skip
    for (kind, subject), parts in found.items():
        together = parts[VisuEvent.LATE] if kind is VISU_SLOW else _together(parts.values())
        variable = f"visu/{subject.server}/{subject.variable}" if subject.variable else f"visu/{subject.server}"
        refused = tuple(sorted(statuses[subject])) if kind is VISU_ERROR else ()
        if kind is VISU_ERROR:
            message = f"{_refused(subject, refused)}."
        elif kind is VISU_OTHER_NAMES:
            message = _contradicted(subject.server, together.count, counts.other_names[subject])
        else:
            message = _sentence(kind, subject, parts, last.get(subject))
        yield Finding(
            kind, message, together.count, together.first_ns, together.last_ns, together.frames,
            node=nodes.get(subject.client), variable=variable, hint=next_step(refused) if refused else "",
            statuses=refused,
        )  # fmt: skip


def _refused(subject: Subject, statuses: Statuses) -> str:
    client, server, variable = subject
    if variable:
        return refused_writes(client, server, [variable], statuses)
    return refused_reads(client, server, statuses)


def _together(parts: Iterable[Events]) -> Events:
    first, *others = parts
    for other in others:
        first = first.among(other)
    return first


def _sentence(
    kind: FindingKind, subject: Subject, parts: Mapping[VisuEvent, Events], last: Write | None
) -> str:  # fmt: skip
    from nvscope.tracker.visu.events import VisuEvent

    client, server, variable = subject
    counts = {event: events.count for event, events in parts.items()}
    total = sum(counts.values())
    if kind is VISU_WRITE:
        return f"{client} wrote {variable} of {server} {_times(total)}{_over(last, total)}."
    if kind is VISU_PASSWORD_IN_CLEAR:
        return f"{client} and {server} transmitted the password {variable} in clear {_times(total)}."
    if kind is VISU_COUNT_MISMATCH:
        messages = count_of(total, "request or reply", "requests and replies")
        return f"{messages} between {client} and {server}: more or fewer values than declared or asked for."
    slow, unanswered = counts.get(VisuEvent.SLOW, 0), counts.get(VisuEvent.UNANSWERED, 0)
    told = []
    if slow:
        told.append(f"took more than 1 s for {count_of(slow, 'reply', 'replies')} to {client}")
    if unanswered:
        told.append(f"ended the connection without a reply to {count_of(unanswered, 'request')} of {client}")
    return f"{server} {' and '.join(told)}."


def _contradicted(server: str, times: int, other: OtherNames) -> str:
    """Return what a list says otherwise than those known before."""
    older = ", which is older" if _older(other.stamp_before, other.stamp) else ""
    than = f"{other.file} says{older}" if other.file else "it said before"
    variables = count_of(other.differing, "variable")
    begin = f"{server} has"
    if times > 1:
        begin = f"{server} sent {count(times)} lists of variables that contradict what was known; the first one has"
    example = f"{other.name} is {other.place.text} and not {other.place_before.text}"
    return f"{begin} {variables} at other places than {than}: {example}."


def _older(stamp: str, other: str) -> bool:
    """Tell whether a time-stamp is older than another one; they begin with a number that grows."""
    first, second = (text.partition(",")[0].strip() for text in (stamp, other))
    return first.isdecimal() and second.isdecimal() and int(first) < int(second)


def _over(write: Write | None, total: int) -> str:
    """Return what was written over what, where somebody may know it."""
    if write is None or write.is_secret:
        return ""
    old, new = (one and (one if len(one) <= _MOST_SHOWN else f"{one[:_MOST_SHOWN]}…") for one in (write.old, write.new))
    before = "" if old is None else f"{old} → "
    became = "" if write.outcome in ("confirmed", "open") else f", {write.outcome}"
    return f"{', the last one kept' if total > 1 else ''}: {before}{new}{became}"


def _times(number: int) -> str:
    return {1: "once", 2: "twice"}.get(number, f"{count(number)} times")
