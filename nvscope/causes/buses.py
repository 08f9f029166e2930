"""What happens on a CAN bus as a whole: bus-off, bus-errors, bus-overloaded, and cycles of which frames are missing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.error import RESTARTED
from nvscope.causes.case import Case, Draft, Explained, slack_ns
from nvscope.causes.cut_cycles import cycles_cut
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, lists_in_words, moment, span_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.can_bus import BUS_LOAD, ERROR_FRAMES
from nvscope.findings.kind import Severity
from nvscope.findings.timing import BURST, JITTER, LATE, STOPPED
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.event_columns import EventTable
from nvscope.units import count_of, duration

BUS_OFF = CauseKind(
    "bus-off",
    "bus off",
    "A CAN controller left the bus: its transmit errors went on, and it neither sent nor received until it came back.",
    "Error frames that say 'bus off', and what says that it came back.",
    "The plug, cable and bit rate of the device that left; its termination.",
)
BUS_ERRORS = CauseKind(
    "bus-errors",
    "errors on the bus",
    "Nodes of a CAN bus reject what others send, and frames are repeated.",
    "Error frames without a bus-off.",
    "The resistance between CAN_H and CAN_L with the power off: about 60 ohms; then bit rates and sample points.",
)
BUS_OVERLOADED = CauseKind(
    "bus-overloaded",
    "bus overloaded",
    "A CAN bus was busy for most of some seconds: frames of low priority come late or not at all.",
    "The bits of each second, held against the bit rate.",
    "Lengthen the intervals of the busiest identifiers first.",
)
INCOMPLETE_CYCLES = CauseKind(
    "incomplete-cycles",
    "incomplete cycles",
    "A list over several frames came without all of them.",
    "Cycles in which identifiers of the list are missing.",
    "Error counters and receive buffers of the device that records, then the sender's transmit queue.",
    by_moments=True,
)

_BEFORE_NS = _S_NS = 1_000_000_000
_THEN = (LATE, JITTER, BURST, INCOMPLETE_CYCLE)
_FEW = 4
_MEANWHILE = (*_THEN, STOPPED)


def _of_channel(case: Case, channel: int) -> Bool:
    """Tell which symptoms are of a channel, or of a list on it."""
    numbers = [entry.number for entry in case.lists_on(channel)]
    told: Bool = (case.symptoms.channel == channel) | np.isin(case.symptoms.list, numbers)
    return told


def judge_buses_off(case: Case) -> Iterator[Explained]:
    """Explain what a bus-off brings about, one cause each."""
    table = case.witness.evidence.columns["buses"].table()
    off = table.kind == EventKind.BUS_OFF
    errors = (table.kind == EventKind.ERROR_FRAME) | off
    for channel, time_ns in zip(table.channel[off].tolist(), table.time_ns[off].tolist(), strict=True):
        own = _of_channel(case, channel)
        if not (case.free(ERROR_FRAMES) & own).any():
            continue
        before = errors & (table.channel == channel) & (table.time_ns <= time_ns)
        since_ns = int(table.time_ns[before & (table.time_ns >= time_ns - _BEFORE_NS)].min())
        until_ns, told = _back(table, channel, time_ns)
        slack = slack_ns(case.lists_on(channel))
        if until_ns is not None and not told and _stays_away(case, own, since_ns, until_ns, slack):
            until_ns = None  # frames of others came, and nothing said that it was back
        chosen = case.free(ERROR_FRAMES, *_MEANWHILE) & own
        chosen &= case.overlapping(since_ns, None if until_ns is None else until_ns + slack)
        # What has stopped since then sent its last frame up to an interval before.
        chosen |= case.free(STOPPED) & own & (until_ns is None) & (case.symptoms.time_ns >= since_ns - slack)
        chosen |= cycles_cut(case, since_ns) & own
        name = case.channel_name(channel)
        checked = [
            f"back after {duration(until_ns - time_ns)}" if until_ns is not None else "it did not come back"
        ]  # fmt: skip
        title = f"A controller of {name} left the bus at {moment(case, time_ns)}"
        lists = case.lists_of(chosen)
        draft = Draft(
            BUS_OFF, title, BUS_OFF.next_step, checked, lists, channel=name, since_ns=since_ns, until_ns=until_ns
        )  # fmt: skip
        yield draft, chosen


def _back(table: EventTable, channel: int, off_ns: int) -> tuple[int | None, bool]:
    """Return when a controller came back that had left the bus, None where nothing shows it, and whether it said so.

    What it says decides: frames of others go on meanwhile, where another one than the one that records has left.
    """
    later = (table.channel == channel) & (table.time_ns >= off_ns)
    again = table.time_ns[later & (table.kind == EventKind.BUS_OFF) & (table.time_ns > off_ns)]
    said = later & (table.kind == EventKind.ERROR_FRAME) & (table.detail & RESTARTED != 0)
    said &= table.time_ns < again.min(initial=np.iinfo(np.int64).max)
    if said.any():
        return int(table.time_ns[said].min()), True
    back = np.flatnonzero(later & (table.kind == EventKind.BUS_BACK))
    if not len(back):
        return None, False
    first = back[np.argmin(table.time_ns[back])]
    return int(table.time_ns[first]), bool(table.detail[first])


def _stays_away(case: Case, own: Bool, since_ns: int, until_ns: int, slack: int) -> bool:
    """Tell whether lists of a channel have ended with a bus-off, up to an interval before it or before it was over."""
    ended = own & case.symptoms.of_kinds(STOPPED)
    ended &= (case.symptoms.time_ns >= since_ns - slack) & (case.symptoms.time_ns <= until_ns)
    return bool(ended.any())


def judge_bus_errors(case: Case) -> Iterator[Explained]:
    """Explain error frames without a bus-off, and what is late or incomplete at their moments, one cause a channel."""
    symptoms = case.symptoms
    for channel in distinct(symptoms.channel[case.free(ERROR_FRAMES)]).tolist():
        told = case.free(ERROR_FRAMES) & (symptoms.channel == channel)
        times_ns = np.union1d(symptoms.since_ns[told], symptoms.time_ns[told])
        draft, chosen = _condition(case, BUS_ERRORS, channel, told, times_ns, "Nodes of {name} reject frames")
        if case.findings[int(symptoms.finding[told][0])].count <= _FEW:
            draft.at_most = Severity.NOTE  # each bus has some, as where somebody plugs in
        yield draft, chosen


def judge_overloads(case: Case) -> Iterator[Explained]:
    """Explain overload, and what is late or incomplete in its seconds, one cause a channel."""
    symptoms = case.symptoms
    for channel in distinct(symptoms.channel[case.free(BUS_LOAD)]).tolist():
        told = case.free(BUS_LOAD) & (symptoms.channel == channel)
        times_ns = _full_seconds(case, case.channel_name(channel))
        times_ns = times_ns if len(times_ns) else symptoms.time_ns[told]
        yield _condition(case, BUS_OVERLOADED, channel, told, times_ns, "{name} is overloaded")


def _full_seconds(case: Case, name: str) -> I64:
    """Return when the seconds in which a bus was overloaded began and ended, rising."""
    for bus in case.facts.summary.can.buses:
        if bus.channel == name and bus.load is not None:
            above = bus.load.second_ns[bus.load.second > case.facts.limits.bus_load_percent]
            return np.unique(np.concatenate([above, above + _S_NS]))
    return np.empty(0, np.int64)


def _condition(case: Case, kind: CauseKind, channel: int, told: Bool, times_ns: I64, title: str) -> Explained:
    """Return the cause of what is wrong with a bus at some times, and of what is late or incomplete then."""
    name, finding = case.channel_name(channel), case.findings[int(case.symptoms.finding[told][0])]
    since_ns, last_ns = int(times_ns.min()), min(int(times_ns.max()), case.end_ns)
    # What overloads a bus stops with it; who stops while there are errors stops by itself.
    beside = _MEANWHILE if kind is BUS_OVERLOADED else _THEN
    chosen = told | (case.free(*beside) & _of_channel(case, channel) & _near(case, np.sort(times_ns)))
    until_ns = case.end_of_many(since_ns, last_ns, len(times_ns))
    checked = [finding.message]
    if kind is BUS_OVERLOADED:
        checked.append(f"so in {count_of(finding.count, 'second')}")
    draft = Draft(
        kind, f"{title.format(name=name)} {span_in_words(case, since_ns, until_ns)}", kind.next_step, checked,
        case.lists_of(chosen), channel=name, since_ns=since_ns, until_ns=until_ns,
    )  # fmt: skip
    return draft, chosen


def _near(case: Case, times: I64) -> Bool:
    """Tell which symptoms lie within a second of one of some times, which rise."""
    place = np.searchsorted(times, case.symptoms.since_ns - _BEFORE_NS)
    near: Bool = np.append(times, np.iinfo(np.int64).max)[place] <= case.symptoms.time_ns + _BEFORE_NS
    return near


def judge_incomplete_cycles(case: Case) -> Iterator[Explained]:
    """Explain lists on CAN of which frames are missing, one cause a list."""
    symptoms = case.symptoms
    for number in distinct(symptoms.list[case.free(INCOMPLETE_CYCLE)]).tolist():
        if number < 0:
            continue
        own = case.free(INCOMPLETE_CYCLE, LATE, JITTER) & (symptoms.list == number)
        told = case.free(INCOMPLETE_CYCLE) & (symptoms.list == number)
        entry = case.lists[number]
        since_ns = int(symptoms.since_ns[told].min())
        which = lists_in_words(case, [entry])
        checked = []
        missing = np.bitwise_or.reduce(symptoms.detail[told])
        if missing > 0:
            parts = [str(bit) for bit in range(62) if int(missing) >> bit & 1]
            checked.append(f"missing: SubIndex {', '.join(parts)}")
        draft = Draft(
            INCOMPLETE_CYCLES, f"{capitalised(which)} came incomplete, {count_of(int(told.sum()), 'time')}",
            INCOMPLETE_CYCLES.next_step, checked, [entry], channel=str(entry.key.port), since_ns=since_ns,
            until_ns=case.end_of(symptoms.time_ns[told], slack_ns([entry])),
        )  # fmt: skip
        yield draft, own
