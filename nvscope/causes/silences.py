"""Nodes and lists of which nothing comes any more, or for a while: node-silent, program-stopped, list-stopped."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import Bool
from nvscope.causes.canopen_nodes import canopen_node_of, last_signs
from nvscope.causes.case import NOBODY, PAUSE_PERCENT, Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.kind import CauseKind
from nvscope.causes.node_streams import NodeStream, Pause
from nvscope.causes.outages import OF_CABLE
from nvscope.causes.receivers import hidden_by_switch
from nvscope.causes.silent_together import (
    NodeSilence,
    cyclic_lists_of,
    draft_of_several,
    going_in_words,
    heard_of,
    of_one_event,
    others_go_on,
    span_of,
)
from nvscope.causes.symptoms import OF_SILENCE
from nvscope.causes.unplugged import was_unplugged
from nvscope.causes.words import capitalised, lists_in_words, moment
from nvscope.engine.runs import rows_by
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT, SEND_REJECTED
from nvscope.findings.facts import AnyList
from nvscope.findings.kind import Severity
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.parameter import SDO_TIMEOUT
from nvscope.findings.timing import STOPPED, TORN_CYCLE
from nvscope.list_key import Transport
from nvscope.units import duration

NODE_SILENT = CauseKind(
    "node-silent",
    "silent",
    "A node that sent cyclic lists sends nothing at all any more, or sent nothing for a while.",
    "All its cyclic streams pause at once, and no frame of it of any kind comes meanwhile, ARP included. "
    "Three that fall silent at one moment, or all that there are, are one cause: what they share.",
    "Its power and LEDs, then its cable and switch port. Its task comes last.",
    at_least=Severity.ERROR,
    measured="silent for {time}",
)
PROGRAM_STOPPED = CauseKind(
    "program-stopped",
    "program stopped",
    "A node is there, and sends none of its cyclic lists any more, or sent none for a while.",
    "All its cyclic streams pause at once, while other frames of it (ARP, ICMP, TCP) go on as before. "
    "Less sure of a node that sends no cyclic list: its missing answers tell then.",
    "Its run/stop switch and the state of its application: stopped, halted at a breakpoint, or in an exception.",
    at_least=Severity.ERROR,
)
LIST_STOPPED = CauseKind(
    "list-stopped",
    "silent",
    "A list, or a part of it, is not sent any more, while its sender goes on with others.",
    "The streams of the list are silent for more than ten intervals, other streams of the node are not. On CAN, of an "
    "identifier that no definition knows, an error only where it came steadily from the beginning on.",
    "The task that the list is sent from, and what enables its sending (event, variable, 'transmit on change').",
    measured="silent for {time}",
)

_HALTED = "Its application: a breakpoint, a stop, a download? Its counters were kept, so it had power. Then its cable."

_WAITS = (NO_ACKNOWLEDGEMENT, BOOT_UP_UNANSWERED, SEND_REJECTED, SDO_TIMEOUT)
_SHORTEST = 10  # a pause with an end is told from ten of the longest interval on
_HALVES_BEFORE, _HALVES_AFTER = 3, 5  # of the longest interval: frames so near to a pause prove nothing


_INTERVALS_UNSURE = 3
_MOVING_NS = 60_000_000_000
"""A download takes so long at most: what begins elsewhere behind an end is the same."""

_NO_ROWS = np.empty(0, np.int64)


def judge_nodes(case: Case, kind: CauseKind) -> Iterator[Explained]:
    """Explain the silences of nodes; ``kind`` is NODE_SILENT or PROGRAM_STOPPED."""
    found = [
        silence
        for node, streams in case.streams_of_node.items() for silence in _silences(case, node, streams)
        if _goes_on(case, silence) == (kind is PROGRAM_STOPPED)
    ]  # fmt: skip
    for members in of_one_event(case, found) if kind is NODE_SILENT else ([one] for one in found):
        chosen = np.logical_or.reduce([_explained(case, one.node, one.pause) for one in members])
        if not chosen.any():
            continue
        if len(members) > 1:
            alone = not others_go_on(case, members)
            if alone:
                chosen |= _of_everybody(case, members)
            yield draft_of_several(case, kind, members, chosen, alone=alone), chosen
        else:
            yield _draft(case, kind, members[0], chosen), chosen


def _of_everybody(case: Case, members: Sequence[NodeSilence]) -> Bool:
    """Tell what else was missing while all nodes were silent, of those that are not told to have been."""
    since_ns, until_ns = span_of(members)
    if until_ns is None:
        return case.only([])
    room_ns = max(one.longest_ns for one in members) * PAUSE_PERCENT // 100
    symptoms = case.symptoms
    began, ended = np.abs(symptoms.since_ns - since_ns) <= room_ns, np.abs(symptoms.time_ns - until_ns) <= room_ns
    everybody: Bool = case.free(*OF_SILENCE, *_WAITS) & began & ended
    return everybody


def _goes_on(case: Case, silence: NodeSilence) -> bool:
    """Tell whether other frames of a node than those of its cyclic lists come while it is silent."""
    pause, half_ns = silence.pause, silence.longest_ns // 2
    end_ns = case.end_ns if pause.until_ns is None else pause.until_ns
    after_ns = pause.since_ns + _HALVES_BEFORE * half_ns
    before_ns = end_ns if pause.until_ns is None else end_ns - _HALVES_AFTER * half_ns
    if before_ns >= after_ns and case.life.sent_between(silence.node, after_ns, before_ns):
        return True  # however late: who sends has power and a cable
    return pause.until_ns is None and case.last_acknowledgement_ns.get(silence.node, after_ns) > after_ns


class _Timed(NamedTuple):
    """A cyclic stream with its pauses, by their beginning."""

    one: NodeStream
    pauses: Sequence[Pause]
    begins_ns: Sequence[int]

    @staticmethod
    def of(case: Case, one: NodeStream) -> _Timed:
        pauses = case.pauses(one.list.number, one.stream)
        return _Timed(one, pauses, [pause.since_ns for pause in pauses])

    def is_sent_at(self, time_ns: int) -> bool:
        """Tell whether the stream was sent until then: it had begun, and did not pause already."""
        long_before_ns = time_ns - self.one.nominal_ns * PAUSE_PERCENT // 100
        place = bisect_left(self.begins_ns, long_before_ns) - 1
        until_ns = self.pauses[place].until_ns if place >= 0 else time_ns
        return self.one.stream.first_ns <= time_ns and until_ns is not None and until_ns <= time_ns


def _silences(case: Case, node: int, streams: Sequence[NodeStream]) -> list[NodeSilence]:
    """Return when all cyclic streams that a node sent at a time paused together."""
    timed = [_Timed.of(case, one) for one in streams if one.nominal_ns]
    timed.sort(key=lambda own: own.one.nominal_ns)
    found = []
    for place, own in enumerate(timed):
        for pause in own.pauses:
            # The fastest stream tells it: of lists that began later, or had ended before, nothing is known then.
            if any(faster.is_sent_at(pause.since_ns) for faster in timed[:place]):
                continue
            slower = [other.one for other in timed[place + 1 :] if other.is_sent_at(pause.since_ns)]
            if (silence := _silence(case, node, (own.one, pause), slower, streams)) is not None:
                found.append(silence)
    return found


def _silence(
    case: Case, node: int, first: tuple[NodeStream, Pause], others: Sequence[NodeStream], streams: Sequence[NodeStream]
) -> NodeSilence | None:
    """Return the silence of a node of which the fastest stream with its pause tells, None where it is none."""
    others_paused = _all_paused(case, first[1], others)
    if others_paused is None or case.unreached.is_unreached(*first):
        return None
    paused = _back_in_time(case, [first, *others_paused])
    longest_ns = max(one.nominal_ns for one, _ in paused)
    last = max((own for _, own in paused), key=lambda own: own.since_ns)
    until_ns = min((own.until_ns for _, own in paused if own.until_ns is not None), default=None)
    away = any(own.until_ns is None for _, own in paused)
    others_ns = [one.stream.last_ns for one in streams if not one.nominal_ns]
    if until_ns is None and any(one > last.since_ns + longest_ns * 3 // 2 for one in others_ns):
        return None
    if until_ns is not None and not away and until_ns - last.since_ns <= _SHORTEST * longest_ns:
        return None
    if was_unplugged(case, last.since_ns, until_ns, _INTERVALS_UNSURE * longest_ns):
        return None
    if until_ns is None and not (case.free(STOPPED) & (case.symptoms.node == node)).any():
        return None
    return NodeSilence(node, Pause(last.since_ns, until_ns, last.frame), paused[0][0].nominal_ns, longest_ns)


def _back_in_time(case: Case, paused: Sequence[tuple[NodeStream, Pause]]) -> Sequence[tuple[NodeStream, Pause]]:
    """Return streams without those that did not come back with the others, although they were due: these stopped."""
    ends_ns = [pause.until_ns for _, pause in paused if pause.until_ns is not None]
    if not ends_ns:
        return paused
    room_ns = case.end_ns - min(ends_ns)
    return [
        (one, pause) for one, pause in paused
        if pause.until_ns is not None or room_ns <= one.nominal_ns * PAUSE_PERCENT // 100
    ]  # fmt: skip


def _all_paused(case: Case, pause: Pause, streams: Sequence[NodeStream]) -> list[tuple[NodeStream, Pause]] | None:
    """Return which pause each of some streams made meanwhile, None where one went on.

    Those that are held back since their reader is not found say nothing.
    """
    found = []
    for one in streams:
        meanwhile = _meanwhile(case.pauses(one.list.number, one.stream), pause)
        if meanwhile is None:
            return None  # of very many streams, the first that went on tells it
        if not case.unreached.is_unreached(one, meanwhile):
            found.append((one, meanwhile))
    return found


def _meanwhile(pauses: Sequence[Pause], pause: Pause) -> Pause | None:
    """Return which of a stream's pauses overlaps one of another stream."""
    for one in pauses:
        if (pause.until_ns is None or one.since_ns < pause.until_ns) and (
            one.until_ns is None or one.until_ns > pause.since_ns
        ):
            return one
    return None


def _explained(case: Case, node: int, pause: Pause) -> Bool:
    """Tell what a silence of a node explains: its own, and the waits for it."""
    symptoms, meanwhile = case.symptoms, case.overlapping(pause.since_ns, pause.until_ns)
    own = case.free(*OF_SILENCE) & (symptoms.node == node) & meanwhile
    own |= _ended_with(case, node, pause)
    # A cycle that is torn alone is no silence.
    if not (own & ~symptoms.of_kinds(TORN_CYCLE)).any():
        return case.only([])
    waits = case.free(*_WAITS) & ((symptoms.node == node) | case.waits_for(node)) & meanwhile
    alone = case.lists_of_one_sender.get(node, ())
    waits |= case.free(BOOT_UP_UNANSWERED) & np.isin(symptoms.list, alone) & meanwhile
    explained: Bool = own | waits
    return explained


def _ended_with(case: Case, node: int, pause: Pause) -> Bool:
    """Tell which streams of a node ended with its silence: all of one that goes on, and those not yet due again."""
    rows = np.flatnonzero(case.free(STOPPED) & (case.symptoms.node == node))
    if pause.until_ns is not None:
        slack = case.nominal_ns(rows) * PAUSE_PERCENT // 100
        ended_ns = case.symptoms.time_ns[rows]
        rows = rows[(ended_ns >= pause.since_ns - slack) & (ended_ns < pause.until_ns)
                    & (case.end_ns - pause.until_ns <= slack)]  # fmt: skip
    return case.only(rows)


def _draft(case: Case, kind: CauseKind, silence: NodeSilence, chosen: Bool) -> Draft:
    node, pause = silence.node, silence.pause
    timed = cyclic_lists_of(case, [silence])
    name, which = case.address(node), lists_in_words(case, timed)
    since, checked = moment(case, pause.since_ns), []
    others = case.going_on.beside(node, pause.since_ns, pause.until_ns, case.end_ns)
    what = "is silent" if kind is NODE_SILENT else "sends none of its lists"
    past = "was silent" if kind is NODE_SILENT else "sent none of its lists"
    if pause.until_ns is None:
        title = f"Node {name} {what} since {since} ({which})"
    else:
        title = f"Node {name} {past} from {since} to {moment(case, pause.until_ns)} ({which})"
    if kind is NODE_SILENT:
        when = "afterwards" if pause.until_ns is None else f"for {duration(pause.until_ns - pause.since_ns)}"
        checked.append(f"nothing of it came {when}{heard_of(case, 'it sends')}")
    else:
        checked.append("other frames of it (ARP, ICMP, TCP …) go on: it has power and cable")
        refused = chosen & case.free(SEND_REJECTED) & (case.symptoms.detail == node)
        if refused.any():
            checked.insert(0, "it says itself that no program listens at its port (ICMP)")
    if others:
        checked.append(going_in_words(others))
    step = kind.next_step
    if kind is NODE_SILENT and (hidden := hidden_by_switch(case, node)):
        checked.append(hidden)
        step = f"Whether a mirror port shows it: a switch keeps from others what is for one station. {step}"
    if pause.until_ns is not None:
        lost = case.free(TELEGRAM_GAP) & chosen
        if kind is NODE_SILENT:
            step = OF_CABLE if lost.any() else _HALTED
        checked.append(
            ("its counters went on meanwhile: its program ran, cable or switch port did not" if kind is NODE_SILENT
             else "its counters went on meanwhile: it counted what did not come out") if lost.any()
            else "its counters stood still meanwhile: it did not send"
        )  # fmt: skip
    return Draft(kind, title, step, checked, timed, [node], since_ns=pause.since_ns, until_ns=pause.until_ns)


def judge_lists(case: Case) -> Iterator[Explained]:
    """Explain lists that stop while their sender goes on; on CAN, where no frame names its sender, those together."""
    symptoms = case.symptoms
    ended = np.flatnonzero(case.free(STOPPED) & ~case.unreached.symptoms)
    told = symptoms.of_kinds(STOPPED, TORN_CYCLE, NO_ACKNOWLEDGEMENT, BOOT_UP_UNANSWERED)
    rows_of = dict(rows_by((symptoms.list,))) if len(ended) else {}
    groups: dict[tuple[int, int], list[int]] = defaultdict(list)
    for row in ended.tolist():
        entry = case.lists[int(symptoms.list[row])]
        on_can = entry.key.transport is Transport.CAN
        place = (-1, _channel(case, entry)) if on_can else (int(symptoms.node[row]), entry.number)
        groups[place].append(row)
    for (node, _), rows in groups.items():
        for together in _together(case, rows):
            lists: list[AnyList] = [case.lists[number] for number in dict.fromkeys(symptoms.list[together].tolist())]
            since_ns = int(symptoms.time_ns[together].max())
            # Their own rows alone: where very many lists stop, all rows would be gone through for each.
            own = np.concatenate([rows_of.get((entry.number,), _NO_ROWS) for entry in lists])
            own = own[(case.owner[own] == NOBODY) & told[own] & (symptoms.time_ns[own] >= since_ns - slack_ns(lists))]
            own = own[(symptoms.node[own] == node) | (symptoms.node[own] < 0)]
            yield _list_draft(case, node, lists, since_ns, case.only(np.append(own, together)))


def _channel(case: Case, entry: AnyList) -> int:
    return case.channels.index(str(entry.key.port)) if str(entry.key.port) in case.channels else -1


def _together(case: Case, rows: Sequence[int]) -> list[list[int]]:
    """Return symptoms by silences that begin within two and a half intervals of each other."""
    time_ns, found = case.symptoms.time_ns, [[min(rows, key=lambda row: int(case.symptoms.time_ns[row]))]]
    for row in sorted(rows, key=lambda row: int(time_ns[row]))[1:]:
        before = found[-1][-1]
        lists = [case.lists[int(case.symptoms.list[one])] for one in (before, row)]
        if time_ns[row] - time_ns[before] <= slack_ns(lists):
            found[-1].append(row)
        else:
            found.append([row])
    return found


def _list_draft(case: Case, node: int, lists: Sequence[AnyList], since_ns: int, chosen: Bool) -> Explained:
    which, since, checked = lists_in_words(case, lists), moment(case, since_ns), []
    next_step = LIST_STOPPED.next_step
    if node >= 0:
        own = {entry.number for entry in lists} | case.going_on.lists_ended_by(node, since_ns + slack_ns(lists))
        others = [case.lists[number] for number in case.going_on.lists_behind(node, since_ns) if number not in own]
        title = f"Node {case.address(node)} sends {which} no more since {since}"
        channel = None
        if others:
            checked.append(f"it goes on with {lists_in_words(case, others)}")
        elif not case.life.sent_between(node, since_ns + 1, case.end_ns):
            checked.append(
                "nothing else of it has come since then, and nothing else was due: perhaps all of it is gone"
            )
            next_step = NODE_SILENT.next_step
    else:
        title = f"{capitalised(which)} {'is' if len(lists) == 1 else 'are'} silent since {since}"
        channel = str(lists[0].key.port)
        if device := canopen_node_of(case, lists, channel):
            title = f"CANopen node {device.node} sends {which} no more since {since}"
            checked += last_signs(case, device, since_ns, slack_ns(lists))
        elif len(lists) > 1:
            checked.append("they ended together: one device?")
    steady = [entry for entry in lists if not case.is_nobodys(entry) or case.is_steady(entry, since_ns)]
    if steady:
        checked.append(_how_steady(case, lists, since_ns))
    else:
        checked.append("no definition knows it, and it was not there all the time before: it may have been done")
    step = _moved_to(case, node, lists, since_ns) or next_step
    if case.are_nobodys(lists):
        them = "them" if len(lists) > 1 else "it"
        step = f"Power and plug of the device that sends {them}, then its program; a definition would name {them}."
    draft = Draft(
        LIST_STOPPED, title, step, [one for one in checked if one], lists,
        [node] if node >= 0 else [], channel, since_ns=since_ns,
        at_most=Severity.ERROR if steady else Severity.NOTE,
    )  # fmt: skip
    return draft, chosen


def _moved_to(case: Case, node: int, lists: Sequence[AnyList], since_ns: int) -> str:
    """Return what to do where a node sends a list on another port now, "" where it does not."""
    ended = {entry.key.identifier: entry.key.port for entry in lists}
    for one in case.streams_of_node.get(node, ()):
        key = one.list.key
        moved = key.identifier in ended and key.port != ended[key.identifier]
        if moved and abs(one.stream.first_ns - since_ns) <= max(slack_ns(lists), _MOVING_NS):
            return (
                f"The port of the list in the network settings of its sender: it comes on UDP {key.port} now, and not "
                f"on {ended[key.identifier]}."
            )
    return ""


def _how_steady(case: Case, lists: Sequence[AnyList], until_ns: int) -> str:
    """Return for how long lists had come as usual, where their sender has no name."""
    if any(entry.key.transport is not Transport.CAN for entry in lists):
        return ""
    first_ns = min(stream.first_ns for entry in lists for stream in entry.streams)
    every = f", about every {duration(longest_ns(lists))}" if len(lists) == 1 else ""
    return f"before that, {'they' if len(lists) > 1 else 'it'} came for {duration(until_ns - first_ns)}{every}"
