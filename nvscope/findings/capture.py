"""NV9xx: what the capture itself lacks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding, all_events, events_of
from nvscope.findings.kind import FindingKind, Severity
from nvscope.units import count, count_of, duration, percent

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.findings.finding import Events
    from nvscope.tracker.events import EventLog
    from nvscope.tracker.mirrored import Recorded

CAPTURE_DROPS = FindingKind(
    "NV901",
    "capture-drops",
    Severity.WARNING,
    meaning=(
        "The recording says that frames were dropped while capturing. Gaps and missing acknowledgements in this report "
        "may be gaps of the capture, not of the plant."
    ),
    causes=(
        "a computer or disk too slow for the traffic",
        "a mirror port that carries more than its own speed: drops in the switch are counted nowhere in the file",
    ),
    next_steps=(
        "Record again with a larger buffer (`-B` of dumpcap and tcpdump), and on Ethernet with a capture filter (for "
        "instance `udp port 1202 or icmp or arp`).",
        "Mirror fewer ports, or use a faster one.",
    ),
    of_capture=True,
)
CLOCK_STEP = FindingKind(
    "NV902",
    "clock-step",
    Severity.WARNING,
    meaning=(
        "The time stamps go back by more than 1 ms. Intervals, timeouts and the order of events around that moment are "
        "not reliable. Less than that is no finding: several queues or interfaces wrote their frames in a slightly "
        "wrong order."
    ),
    causes=(
        "the clock of the capturing computer was set (NTP, PTP, by hand) during the recording",
        "files merged from computers whose clocks differ",
        "several interfaces or computers, whose frames were written one after the other",
    ),
    next_steps=("Synchronize the clock before recording; sort or merge files by time (`reordercap`, `mergecap`).",),
    of_capture=True,
)
TRUNCATED_FILE = FindingKind(
    "NV903",
    "truncated-file",
    Severity.WARNING,
    meaning="The file ends in the middle of a record, or holds some that cannot be read. What could be read was.",
    causes=(
        "a line of a text log that was edited, or torn by a full disk",
        "the recording program was killed, or the disk was full",
        "the file was copied while it was being written, or a transfer broke off",
    ),
    next_steps=(
        "Copy the file again from where it was recorded; stop the recording first. Of a stream: why its writer ended.",
    ),
    of_capture=True,
)
UNSUPPORTED_LINK_TYPE = FindingKind(
    "NV904",
    "unsupported-link-type",
    Severity.WARNING,
    meaning="Frames of a link layer were met that is not understood here. They are counted among the other frames.",
    causes=(
        "a capture on a special interface: USB, WLAN in monitor mode, a vendor's bus or probe",
        "an encapsulated mirror, which wraps the frames",
    ),
    next_steps=(
        "Record on an Ethernet interface, or convert the file to Ethernet frames (`editcap -T`, if they are).",
    ),
    of_capture=True,
)
MIRRORED_TWICE = FindingKind(
    "NV905",
    "mirrored-twice",
    Severity.WARNING,
    meaning=(
        "Nearly every telegram (more than 80 %) of a recording is there twice. The mirror port shows each frame two "
        "times; figures for loss are right, counts of telegrams are double."
    ),
    causes=(
        "both directions, or both ports of a conversation, are mirrored: a frame is copied going in and going out",
        "a capture on 'any', on a bridge and its members, or on a VLAN and its parent interface",
    ),
    next_steps=(
        "Mirror one direction only (receive), or capture on one interface.",
        "Or remove the copies from this file: `editcap -d` or `editcap -w 0.001`.",
    ),
    of_capture=True,
)
LIMIT_REACHED = FindingKind(
    "NV906",
    "limit-reached",
    Severity.WARNING,
    meaning=(
        "There was more of something (streams, identifiers, connections) than is kept: memory is bounded, so that no "
        "traffic can use it up. What came beyond the limit is left out of the figures; it is said of what, and how "
        "much. What cannot be known without it is unknown ('?', null in JSON), and no finding: the counters of a "
        "sender of which streams are missing, and the acknowledgements and errors of a list that is not all there."
    ),
    causes=(
        "a scan of ports or addresses, or traffic made to look like many senders",
        "captures of many plants read as one",
        "a plant larger than the limits were chosen for",
    ),
    next_steps=(
        "Look at who the many are, with `nvscope packets`: senders that are no devices of the plant are one matter, "
        "too many devices another.",
        "Read a part at a time: fewer files, or captures with a capture filter for the port of interest.",
        "Where the plant is as large as that, raise the limit: `--max-streams`, or max_streams in the table [limits] "
        "of the project file.",
    ),
    of_capture=True,
)
CARRIER_LOST = FindingKind(
    "NV907",
    "carrier-lost",
    Severity.NOTE,
    meaning=(
        "The interface that captures had no cable, or nobody at its other end, for a time. Nothing could be seen then: "
        "silence and gaps of that time are those of the capture, not of the plant."
    ),
    causes=(
        "the cable of the capturing computer was pulled or moved to another port",
        "the switch was restarted, or its mirror port was switched off",
        "a bad plug or cable",
    ),
    next_steps=(
        "Compare the times with those of losses and of senders that stopped: what falls together needs no other cause.",
        "If nobody was at the cable, read the log of the switch, and change cable and port.",
    ),
    of_capture=True,
)


def judge_capture(facts: Facts) -> Iterator[Finding]:
    """Yield what the capture lacks, each a finding about the whole of it."""
    yield from _drops(facts)
    yield from _carrier(facts)
    yield from _set_unseen(facts)
    steps_back = facts.state.capture.steps_back.rows
    for events in (events_of(steps_back, row) for row in range(len(steps_back))):
        step = duration(facts.state.capture.longest_step_back_ns)
        message = (
            f"{count_of(events.count, 'frame')} with a time more than 1 ms before that of the frame in front: by up to "
            f"{step}."
        )
        yield Finding(CLOCK_STEP, message, events.count, events.first_ns, events.last_ns, events.frames)
    yield from _truncated(facts)
    yield from _unsupported(facts)
    yield from _mirrored(facts)
    yield from _left_out(facts)


def _whole(facts: Facts, kind: FindingKind, events: int, message: str) -> Finding:
    return Finding(kind, message, events, facts.summary.start_ns, facts.summary.end_ns)


def _drops(facts: Facts) -> Iterator[Finding]:
    drops = sum(source.drops or 0 for source in facts.sources)
    if drops:
        seen = facts.state.capture.frames
        share = percent(drops, drops + seen)
        yield _whole(facts, CAPTURE_DROPS, drops, f"The capture lost {count_of(drops, 'frame')} of its own ({share}).")


def _carrier(facts: Facts) -> Iterator[Finding]:
    """Tell when interfaces had no cable, each by itself: what others saw meanwhile is as good as ever."""
    for source in facts.sources:
        times = source.without_carrier
        if not times:
            continue
        until_ns = [facts.at_ns if end_ns is None else end_ns for _, end_ns in times]
        whole_ns = sum(max(end_ns - start_ns, 0) for (start_ns, _), end_ns in zip(times, until_ns, strict=True))
        now = ", and it is still so" if times[-1][1] is None else ""
        message = f"{source.path} had no carrier for {duration(whole_ns)}, {_times(len(times))}{now}."
        yield Finding(CARRIER_LOST, message, len(times), times[0][0], max(until_ns[-1], times[0][0]))


def _set_unseen(facts: Facts) -> Iterator[Finding]:
    """Tell that a clock was set though no frame shows it: forward, or while nothing came."""
    steps = max((source.clock_steps for source in facts.sources), default=0)  # all look at one clock
    if steps and not len(facts.state.capture.steps_back.rows):
        message = f"The clock of this machine was set {_times(steps)} while it was watched; no frame's time goes back."
        yield _whole(facts, CLOCK_STEP, steps, message)


def _times(number: int) -> str:
    return "once" if number == 1 else f"{count(number)} times"


def _truncated(facts: Facts) -> Iterator[Finding]:
    cut = [source for source in facts.sources if source.truncation]
    if cut:
        where = "; ".join(f"{source.path}: {source.truncation.message}" for source in cut if source.truncation)
        torn = sum(not source.truncation.is_whole for source in cut if source.truncation)
        what = f"{count_of(torn, 'file')} could not be read whole: {where}." if torn else f"{where}."
        yield _whole(facts, TRUNCATED_FILE, len(cut), what)


def _unsupported(facts: Facts) -> Iterator[Finding]:
    from dissectors.batch import LinkType

    unsupported = facts.state.capture.unsupported
    if unsupported:
        frames = sum(unsupported.values())
        known = {link.value: link.name for link in LinkType}
        links = ", ".join(f"{link} ({known[link]})" if link in known else str(link) for link in sorted(unsupported))
        message = f"{count_of(frames, 'frame')} of link type {links} were not looked into."
        yield _whole(facts, UNSUPPORTED_LINK_TYPE, frames, message)


def _mirrored(facts: Facts) -> Iterator[Finding]:
    """Compare the repeated telegrams of each recording with the others: where it is mirrored twice, half are repeated.

    A sender that does not count repeats its telegrams by itself, as long as its values stay what they are. What the
    limit has left out may all have been others, and all in one recording.
    """
    state = facts.state
    recordings = state.senders.mirrored.recordings(state.senders.loss.streams, state.memory.columns)
    twice = [one for one in recordings if _is_mirrored(facts, one)]
    if not twice:
        return
    repeated, telegrams = sum(one.repeated for one in twice), sum(one.telegrams for one in twice)
    where = "" if len(recordings) == 1 else f", in {count(len(twice))} of {count_of(len(recordings), 'recording')}"
    message = (
        f"{count(repeated)} of {count_of(telegrams, 'telegram')} equal the one before, byte for byte{where}: "
        "the capture seems to see each frame more than once."
    )
    start_ns = facts.summary.start_ns if twice[0] is recordings[0] else twice[0].start_ns
    end_ns = facts.summary.end_ns if twice[-1] is recordings[-1] else twice[-1].end_ns
    yield Finding(MIRRORED_TWICE, message, repeated, start_ns, end_ns)


def _is_mirrored(facts: Facts, recorded: Recorded) -> bool:
    others = recorded.telegrams - recorded.repeated + facts.telegrams_left_out
    return 100 * recorded.repeated > facts.limits.mirrored_percent * others


def _left_out(facts: Facts) -> Iterator[Finding]:
    """Tell of the frames of further streams and identifiers than are told apart."""
    from dissectors.carried import Carrier
    from nvscope.tracker.event_kinds import FRAMES_KEPT

    log, identifiers = facts.state.capture.left_out, facts.state.buses.load.identifiers.left_out
    elsewhere = facts.state.capture.elsewhere.rows
    told: list[Events] = []
    parts = []
    by_carrier = {carrier: events_of(log.rows, row) for row, carrier in enumerate(log.keys.high.tolist())}
    for carrier, noun, what in (
        (Carrier.UDP, "telegram", "of further senders, receivers, lists or SubIndexes"),
        (Carrier.CAN, "data frame", "of further identifiers"),
        (Carrier.NONE, "message", "on further telegrams that came back"),
    ):
        if carrier in by_carrier:
            told.append(by_carrier[carrier])
            parts.append(f"{count_of(told[-1].count, noun)} {what}")
    if len(identifiers.rows) and Carrier.CAN not in by_carrier:  # frames without data
        told += (events_of(identifiers.rows, row) for row in range(len(identifiers.rows)))
        beyond = sum(events.count for events in told[-len(identifiers.rows) :])
        parts.append(f"{count_of(beyond, 'frame')} of further identifiers on CAN")
    if len(elsewhere):
        told.append(events_of(elsewhere, 0))
        parts.append(f"{count_of(told[-1].count, 'telegram')} to further receivers, counted for their streams alone")
    for events, what in _parameters_left_out(facts):
        told.append(events)
        parts.append(what)
    for events, what in _pages_left_out(facts):
        told.append(events)
        parts.append(what)
    takeovers = [*all_events(facts.state.lists.counter_takeovers.left_out.rows)]
    if takeovers:
        told += takeovers
        beyond = sum(events.count for events in takeovers)
        parts.append(f"{count_of(beyond, 'telegram')} of further pairs of senders that count along")
    if not told:
        return
    frames = sorted(frame for events in told for frame in events.frames)[:FRAMES_KEPT]
    message = (
        f"The first {count_of(facts.state.keys.most, 'stream')}, and as many other kinds of telegrams, are told apart. "
        f"Left out: {'; '.join(parts)}."
    )
    yield Finding(
        LIMIT_REACHED, message, sum(events.count for events in told), min(events.first_ns for events in told),
        max(events.last_ns for events in told), tuple(frames),
    )  # fmt: skip


def _parameters_left_out(facts: Facts) -> Iterator[tuple[Events, str]]:
    """Yield what was left out of the Parameter Manager's conversations, and what it is in words."""
    known = facts.state.parameters.known
    if known is None or not len(known.left_out.rows):
        return
    from nvscope.tracker.parameter.transactions import MOST_OPEN, Beyond
    from nvscope.tracker.parameter.writes import MOST_WRITES

    nouns: dict[int, tuple[str, str]] = {
        Beyond.PAIR: ("Parameter Manager message", "between further nodes"),
        Beyond.OPEN: ("Parameter Manager request", f"beyond the {count(MOST_OPEN)} that are waited for at a time"),
        Beyond.REPLY: ("Parameter Manager reply", "that may be to one of these"),
        Beyond.PARAMETER: ("event", "of further parameters"),
        Beyond.WRITE: ("Parameter Manager write", f"beyond the {count(MOST_WRITES)} that are kept"),
        Beyond.VALUE: ("value", "of further parameters"),
    }
    yield from _in_words(known.left_out, nouns)


def _pages_left_out(facts: Facts) -> Iterator[tuple[Events, str]]:
    """Yield what was left out of web visualization, and what it is in words."""
    other = facts.state.others.get("visu")
    known = getattr(other, "known", None)
    if known is None or not len(known.left_out.rows):
        return
    from nvscope.tracker.streams import MOST_CONNECTIONS
    from nvscope.tracker.visu.limits import MOST_HELD_BYTES, MOST_NAMES, MOST_POLLED, MOST_WAITING, Beyond
    from nvscope.tracker.visu.writes import MOST_WRITES

    nouns: dict[int, tuple[str, str]] = {
        Beyond.PAIR: ("web visualization message", "between further clients and servers"),
        Beyond.VARIABLE: ("further variable", "of web visualization"),
        Beyond.FINDING: ("event", "of further variables of web visualization"),
        Beyond.WRITE: ("variable", f"written beyond the first {count(MOST_WRITES)}"),
        Beyond.CONNECTION: ("connection", f"of web visualization beyond {count(MOST_CONNECTIONS)} at a time"),
        Beyond.WAITING: (
            "web visualization request",
            f"beyond the {count(MOST_WAITING)} of a connection that are waited for",
        ),
        Beyond.HELD: ("HTTP message", f"beyond the {MOST_HELD_BYTES >> 20} MiB held of those that are not whole"),
        Beyond.NAMES: ("list", f"of variables of web visualization beyond {count(MOST_NAMES)} names"),
        Beyond.POLLED: ("read", f"beyond the {count(MOST_POLLED)} whose interval is measured"),
        Beyond.UNREAD: ("web visualization message", "that nobody reads: too long, or in an unknown coding"),
    }
    if facts.security is not None and facts.security.hours:  # else nobody asks when something was written
        nouns[Beyond.WRITE_MINUTE] = "write", "of web visualization, whose time is not compared with the hours"
    yield from _in_words(known.left_out, nouns)


def _in_words(log: EventLog, nouns: Mapping[int, tuple[str, str]]) -> Iterator[tuple[Events, str]]:
    """Yield what was left out by kind, those of which there are words, each with these."""
    (whats,) = log.keys.words
    for what, events in sorted(zip(whats.tolist(), all_events(log.rows), strict=True), key=lambda one: one[0]):
        if what not in nouns:
            continue
        noun, where = nouns[what]
        plural = f"{noun[:-1]}ies" if noun.endswith("y") else ""
        yield events, f"{count_of(events.count, noun, plural)} {where}"
