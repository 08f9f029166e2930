"""NV8xx: the web visualization's requests and replies."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding, all_events
from nvscope.findings.kind import FindingKind, Severity
from nvscope.findings.visu_lists import contradicted, unread, unusable
from nvscope.findings.visu_refusals import (
    NEXT_OF_THE_LIST,
    Statuses,
    next_step,
    refused_reads,
    refused_unread,
    refused_writes,
    together,
)
from nvscope.units import count, count_of, duration

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.visu.events import VisuEvent
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
        "behind the first missing one may belong to another variable. Or the head of a message says no one number of "
        "bytes, or its chunks are malformed, and nobody knows where it ends: server and capture may read different "
        "requests in it."
    ),
    causes=(
        "a client that declares another number of entries than it sends",
        "a STRING with the separator '|' in it, which looks like one more field",
        "a reply that was cut off",
        "a client or gateway that sends a wrong Content-Length or chunks, or somebody who hides requests that way",
    ),
    next_steps=("Look at request and reply; ask for STRINGs one at a time.",),
    protocol="visu",
)
VISU_SLOW = FindingKind(
    "NV805",
    "visu-slow",
    Severity.NOTE,
    meaning=(
        "The controller's web server took long to answer, or did not answer: the client waited no more, or the "
        "connection was ended."
    ),
    causes=(
        "a new connection for each request",
        "large requests, or many clients",
        "a controller whose cycle leaves little time for communication",
        "a web server that hangs: it accepts connections, and answers nothing",
        "a client that waits for too short a time",
    ),
    next_steps=(
        "Ask for fewer variables, less often, from fewer clients; look at the controller's load.",
        "If it answers nobody, its web server hangs: restart it, and see whether it hangs again at the same load.",
        "If it ends connections, look in its log for a restart, and count how many clients it serves at a time.",
    ),
    protocol="visu",
)
VISU_OTHER_NAMES = FindingKind(
    "NV806",
    "visu-other-names",
    Severity.WARNING,
    meaning=(
        "A controller's own list says that variables lie elsewhere than what was known before does, or it is newer "
        "than a given file by its time-stamp: addresses change with every download. What came before that list may be "
        "called by wrong names here, and pages that were loaded before show, and write, other variables than they say. "
        "What the list contradicts, or is newer than, is not believed any more."
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
VISU_UNREAD_LIST = FindingKind(
    "NV807",
    "visu-unread-list",
    Severity.WARNING,
    meaning=(
        "A controller sent a list of variables that cannot be used. Its variables have no names here, unless another "
        "list or a given file has them, and nobody knows which of them are passwords: of these, only STRINGs without a "
        "name are hidden, and no NV803 tells of them."
    ),
    causes=(
        "a file of the web server that is damaged, or was cut off when it was written",
        "a capture that lacks bytes of it, or a file that is too long to be read",
        "a name with a character that XML does not allow",
        "an error page or a login page in place of the list",
    ),
    next_steps=(
        "Give the XML files of the project: variables under [webvisu] of the project file.",
        "Load the list from the controller with a browser, and look whether that reads it.",
        "Where bytes of it are missing, record again, whole frames, while the page is loaded.",
    ),
    protocol="visu",
)

VISU_NOT_CAPTURED = FindingKind(
    "NV808",
    "visu-not-captured",
    Severity.WARNING,
    meaning=(
        "The capture lacks bytes of many requests and replies of web visualization pages: it is not known what was "
        "asked for, answered and written, and what is counted of them is too little."
    ),
    causes=(
        "a snap length: only the beginning of each frame was captured",
        "a mirror port or a buffer that was too slow",
        "only one of two ways, or one of two directions, was captured",
    ),
    next_steps=("Record again: whole frames (tcpdump and dumpcap: -s 0), both directions, and with a larger buffer.",),
    protocol="visu",
)

VISU_OTHER_ENCODING = FindingKind(
    "NV809",
    "visu-unknown-encoding",
    Severity.NOTE,
    meaning=(
        "A controller's page says an encoding of its texts (ENCODINGSTRING) in which they cannot be read here: its "
        "name is not known, or ASCII is not one byte a character in it, so that nothing would part values. Texts are "
        "read as before: as ISO-8859-1, unless another page said otherwise."
    ),
    causes=("a name that another program understands", "a page that was written by hand, or damaged"),
    next_steps=("Name the encoding that the texts have: encoding under [webvisu] of the project file.",),
    protocol="visu",
)

_MANY_PERCENT = 10
"""Where so many of all requests and replies lack bytes, what is said of the others is no picture of the whole."""


def judge_visu(facts: Facts, counts: VisuCounts) -> Iterator[Finding]:
    """Yield a finding for each variable that a client wrote, and for each client and server with trouble."""
    from dissectors import address
    from nvscope.tracker.visu.events import VisuEvent, event_parts
    from nvscope.tracker.visu.state import Subject

    kinds = {
        VisuEvent.WRITTEN: VISU_WRITE, VisuEvent.REFUSED: VISU_ERROR, VisuEvent.STATUS: VISU_ERROR,
        VisuEvent.PART_STATUS: VISU_ERROR,
        VisuEvent.PASSWORD_SEEN: VISU_PASSWORD_IN_CLEAR, VisuEvent.MISCOUNTED: VISU_COUNT_MISMATCH,
        VisuEvent.AMBIGUOUS: VISU_COUNT_MISMATCH, VisuEvent.UNBOUNDED: VISU_COUNT_MISMATCH,
        VisuEvent.SLOW: VISU_SLOW, VisuEvent.UNANSWERED: VISU_SLOW, VisuEvent.LATE: VISU_SLOW,
        VisuEvent.OTHER_NAMES: VISU_OTHER_NAMES, VisuEvent.UNREAD_LIST: VISU_UNREAD_LIST,
        VisuEvent.OTHER_ENCODING: VISU_OTHER_ENCODING, VisuEvent.CUT: VISU_NOT_CAPTURED,
        VisuEvent.GIVEN_UP: VISU_SLOW, VisuEvent.RESET: VISU_SLOW,
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
    given_up = dict(counts.given_up)
    for one in counts.leaving.given_up():
        subject = Subject(*counts.ends(one.pair), "")
        parts, over = found[VISU_SLOW, subject], Events(1, one.over_ns, one.over_ns, (one.asked_frame,))
        for event in (VisuEvent.GIVEN_UP, VisuEvent.LATE):
            before = parts.get(event)
            parts[event] = over if before is None else before.followed_by(over)
        least, most = given_up.get(subject, (one.waited_ns, one.waited_ns))
        given_up[subject] = min(least, one.waited_ns), max(most, one.waited_ns)
    nodes = {text: number for number, text in enumerate(facts.summary.addresses)}
    last = {
        (address.text(*one.client), address.text(*one.server), one.variable): one for one in counts.writes.kept
    }  # fmt: skip
    messages = counts.messages() if any(kind is VISU_NOT_CAPTURED for kind, _ in found) else {}
    for (kind, subject), parts in found.items():
        events = parts[VisuEvent.LATE] if kind is VISU_SLOW else _together(parts.values())
        variable = f"visu/{subject.server}/{subject.variable}" if subject.variable else f"visu/{subject.server}"
        refused = together([statuses[subject]]) if kind is VISU_ERROR else ()
        if kind is VISU_NOT_CAPTURED:
            every = messages[subject.client, subject.server]
            if 100 * events.count < _MANY_PERCENT * every:
                continue
            message = _not_captured(subject, events.count, every)
        elif kind is VISU_ERROR:
            message = f"{_refused(subject, refused, parts)}."
        elif kind is VISU_OTHER_NAMES:
            message = contradicted(subject.server, events.count, counts.other_names[subject])
        elif kind is VISU_UNREAD_LIST:
            message = unread(subject.server, events.count, counts.unread_lists[subject])
        elif kind is VISU_OTHER_ENCODING:
            message = unusable(subject.server, events.count, counts.other_encodings[subject])
        else:
            message = _sentence(kind, subject, parts, last.get(subject), given_up.get(subject))
        yield Finding(
            kind, message, events.count, events.first_ns, events.last_ns, events.frames,
            node=nodes.get(subject.client), variable=variable,
            hint=next_step(refused) if refused else _next_step(kind, parts), statuses=refused,
        )  # fmt: skip


def _refused(subject: Subject, statuses: Statuses, parts: Mapping[VisuEvent, Events]) -> str:
    from nvscope.tracker.visu.events import VisuEvent

    client, server, variable = subject
    if variable:
        return refused_writes(client, server, [variable], statuses)
    if VisuEvent.REFUSED in parts or VisuEvent.PART_STATUS in parts:
        return refused_unread(client, server, statuses, of_writes=VisuEvent.REFUSED in parts, alone=len(parts) == 1)
    return refused_reads(client, server, statuses)


def _together(parts: Iterable[Events]) -> Events:
    first, *others = parts
    for other in others:
        first = first.among(other)
    return first


def _sentence(
    kind: FindingKind, subject: Subject, parts: Mapping[VisuEvent, Events], last: Write | None,
    waited_ns: tuple[int, int] | None,
) -> str:  # fmt: skip
    from dissectors.webvisu import is_password
    from nvscope.tracker.visu.events import VisuEvent

    client, server, variable = subject
    counts = {event: events.count for event, events in parts.items()}
    total = sum(counts.values())
    if kind is VISU_WRITE:
        return f"{client} wrote {variable} of {server} {_times(total)}{_over(last, total)}."
    if kind is VISU_PASSWORD_IN_CLEAR:
        # What is called otherwise lies in the same bytes.
        what, place = (
            (f"the password {variable}", "") if is_password(variable) else ("bytes of a password", f", as {variable}")
        )
        return f"{client} and {server} transmitted {what} in clear {_times(total)}{place}."
    if kind is VISU_COUNT_MISMATCH:
        return _miscounted(client, server, counts)
    slow, unanswered = counts.get(VisuEvent.SLOW, 0), counts.get(VisuEvent.UNANSWERED, 0)
    told = []
    if slow:
        told.append(f"took more than 1 s for {count_of(slow, 'reply', 'replies')} to {client}")
    for verb, times in (("ended", unanswered), ("reset", counts.get(VisuEvent.RESET, 0))):
        if times:
            told.append(f"{verb} the connection without a reply to {count_of(times, 'request')} of {client}")
    found = [f"{server} {' and '.join(told)}"] if told else []
    given_up = counts.get(VisuEvent.GIVEN_UP, 0)
    if given_up:
        requests = count_of(given_up, "request")
        found.append(f"{client} gave up {requests} to {server} without a reply{_after(waited_ns)}")
    return f"{'; '.join(found)}."


def _after(waited_ns: tuple[int, int] | None) -> str:
    """Return how long a client waited, '' where nobody knows."""
    least, most = waited_ns or (0, 0)
    if not most:
        return ""
    shortest, longest = duration(least), duration(most)
    if not least:  # of one that closed its side with a request, nobody knows how long it waited
        return f" after up to {longest}"
    return f" after {longest}" if shortest == longest else f" after {shortest} to {longest}"


def _next_step(kind: FindingKind, parts: Mapping[VisuEvent, Events]) -> str:
    """Return what to do next, by what happened most often; '' where that is what the kind says first."""
    from nvscope.tracker.visu.events import VisuEvent

    if kind is not VISU_SLOW:
        return ""
    steps = {VisuEvent.GIVEN_UP: 1, VisuEvent.UNANSWERED: 2, VisuEvent.RESET: 2, VisuEvent.SLOW: 0}
    most = max(steps, key=lambda event: parts[event].count if event in parts else 0)
    return kind.next_steps[steps[most]] if steps[most] else ""


def _not_captured(subject: Subject, cut: int, every: int) -> str:
    messages = count_of(every, "request or reply", "requests and replies")
    return f"The capture lacks bytes of {count(cut)} of {messages} between {subject.client} and {subject.server}."


def _miscounted(client: str, server: str, counts: Mapping[VisuEvent, int]) -> str:
    """Return what is said of messages with wrong numbers of values, and of those that may be divided otherwise."""
    from nvscope.tracker.visu.events import VisuEvent

    what = {
        VisuEvent.MISCOUNTED: "more or fewer values than declared or asked for",
        VisuEvent.AMBIGUOUS: "several texts with | in them, of which nobody knows how far they go and what else is "
        "there",
        VisuEvent.UNBOUNDED: "no one number as Content-Length, or malformed chunks: nobody knows where they end",
    }
    first, *others = [(counts[event], text) for event, text in what.items() if counts.get(event)]
    more = "".join(f"; {count(times)} of them have {text}" for times, text in others)
    messages = count_of(sum(counts.values()), "request or reply", "requests and replies")
    return f"{messages} between {client} and {server}: {first[1]}{more}."


def _over(write: Write | None, total: int) -> str:
    """Return what was written over what, where somebody may know it."""
    if write is None or write.is_secret:
        return ""
    if write.new is None:
        return f"{', the last one kept' if total > 1 else ''}: a value that nobody knows"
    before = "" if write.old is None else f"{_short(write.old)} → "
    became = "" if write.outcome in ("confirmed", "open") else f", {write.outcome}"
    return f"{', the last one kept' if total > 1 else ''}: {before}{_short(write.new)}{became}"


def _short(value: str) -> str:
    return value if len(value) <= _MOST_SHOWN else f"{value[:_MOST_SHOWN]}…"


def _times(number: int) -> str:
    return {1: "once", 2: "twice"}.get(number, f"{count(number)} times")
