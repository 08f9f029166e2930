"""What readers do not answer, or reject."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import PAUSE_PERCENT, Case, Draft, Explained, slack_ns
from nvscope.causes.chance import longest_by_chance
from nvscope.causes.gaps import clusters
from nvscope.causes.held_back import looked_for
from nvscope.causes.kind import MOST_APART, CauseKind
from nvscope.causes.late_answers import answered_all, how_late, late_answers
from nvscope.causes.losses import losses_at_senders, losses_of_only_lists
from nvscope.causes.lost_answers import answers_lost
from nvscope.causes.successions import of_successions
from nvscope.causes.words import lists_in_words, moment, span_in_words
from nvscope.engine.runs import distinct
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NEGATIVE_ACKNOWLEDGEMENT, NO_ACKNOWLEDGEMENT, SEND_REJECTED
from nvscope.findings.facts import AnyList
from nvscope.tracker.summary import ListSummary
from nvscope.units import count, count_of, duration

READER_REJECTS = CauseKind(
    "reader-rejects",
    "rejected",
    "A reader rejects what it gets: the checksum of its own definition of the list is another one.",
    "Acknowledgements with 'invalid checksum' (Flags bit 2).",
    "Export the definition from the sender's project, import it at the reader, build and download.",
    measured="{negative_acknowledgements} rejected",
)
READER_WITHOUT_PROGRAM = CauseKind(
    "reader-without-program",
    "nobody listens",
    "A node that telegrams are sent to has nobody listening at the port.",
    "ICMP port unreachable, sent by that node or by a router in front of it.",
    "Whether its application runs, and whether its list is read at this port.",
)
READER_SILENT = CauseKind(
    "reader-silent",
    "unanswered",
    "A reader that usually acknowledges a list did not do so for some telegrams, or not in time.",
    "Telegrams that stayed without acknowledgement beside others that got one; or acknowledgements that came late.",
    "The log of the reader at that time: whether its program stood still or its cable was out.",
    measured="{missing_acknowledgements} unanswered",
)
REQUEST_UNANSWERED = CauseKind(
    "boot-up-unanswered",
    "boot-up unanswered",
    "A node asked for the values of a list at its start, and nobody sent them.",
    "Boot-up requests after which no data telegram of the list came in time.",
    "Whether the sender of the list runs, and answers requests ('transmit on boot-up').",
)

_RUN, _TWO = 3, 2
_ICMP_NS, _DISTANCES = 2_000_000_000, 3
"""Many hosts send a message of ICMP a second at most: after the first ones nobody knows how many are kept back."""

_NOTHING_ELSE = "it sent nothing else in that time"
_GONE = "Its power, its cable and switch port; then the log of its program at that time."
_TOO_SLOW = "The load of the reader: interval and priority of the task that reads the list. Then the network between."
_TOO_FAST = "Why the sender sends one telegram so soon behind another: several at once, or a minimum gap of 0."


def judge_rejections(case: Case) -> Iterator[Explained]:
    """Explain negative acknowledgements, by list and reader; of many lists of a reader, as one."""
    symptoms = case.symptoms
    by_reader: dict[int, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
    for row in np.flatnonzero(case.free(NEGATIVE_ACKNOWLEDGEMENT)).tolist():
        by_reader[int(symptoms.peer[row])][int(symptoms.list[row])].append(row)
    for reader, of_lists in by_reader.items():
        together = reader >= 0 and len(of_lists) > MOST_APART
        for numbers in [[*of_lists]] if together else [[number] for number in of_lists]:
            own = [row for number in numbers for row in of_lists[number]]
            lists = [case.lists[number] for number in numbers]
            who = f"Node {case.address(reader)}" if reader >= 0 else "A reader"
            since_ns = int(symptoms.time_ns[own].min())
            others = "its definitions of these lists are other ones" if together else (
                "its definition of the list is another one"
            )  # fmt: skip
            draft = Draft(
                READER_REJECTS, f"{who} rejects {lists_in_words(case, lists)} since {moment(case, since_ns)}",
                READER_REJECTS.next_step, [f"{count_of(len(own), 'negative acknowledgement')}: {others}"],
                lists, [reader] if reader >= 0 else [], since_ns=since_ns, until_ns=_end_of_many(case, lists, own),
            )  # fmt: skip
            yield draft, case.only(own)


def judge_without_program(case: Case) -> Iterator[Explained]:
    """Explain telegrams that came back as undeliverable, by who says so."""
    symptoms = case.symptoms
    places: dict[int, list[int]] = defaultdict(list)
    for row in np.flatnonzero(case.free(SEND_REJECTED)).tolist():
        places[int(symptoms.detail[row])].append(row)
    for told_by, own in places.items():
        lists = [case.lists[number] for number in distinct(symptoms.list[own]).tolist()]
        towards = distinct(symptoms.peer[own])
        since_ns = int(symptoms.time_ns[own].min())
        chosen = case.only(own)
        waits = (
            case.free(NO_ACKNOWLEDGEMENT) & np.isin(symptoms.peer, towards) & np.isin(symptoms.list, symptoms.list[own])
        )
        chosen |= waits & (symptoms.time_ns >= since_ns)
        ports = sorted({entry.key.port for entry in lists if isinstance(entry, ListSummary)})
        name = case.address(told_by) if 0 <= told_by < len(case.facts.summary.addresses) else "a node"
        at_port = f"at port {ports[0]}" if len(ports) == 1 else f"at {len(ports)} ports"
        times_ns = symptoms.time_ns[np.asarray(own)]
        until_ns = case.end_of(times_ns, max(slack_ns(lists), _between_ns(case, own)))
        has, when = "has" if until_ns is None else "had", span_in_words(case, since_ns, until_ns)
        title = f"Node {name} {has} no program {at_port} for {lists_in_words(case, lists)} {when}"
        checked = [f"it says so itself (ICMP), {count_of(len(own), 'time')}"]
        draft = Draft(
            READER_WITHOUT_PROGRAM, title, READER_WITHOUT_PROGRAM.next_step, checked, lists,
            [told_by] if 0 <= told_by < len(case.facts.summary.addresses) else [], since_ns=since_ns,
            until_ns=until_ns,
        )  # fmt: skip
        yield draft, chosen


def _between_ns(case: Case, own: Sequence[int]) -> int:
    """Return for how long nothing comes back although all is as before."""
    distances_ns = np.diff(np.sort(case.symptoms.time_ns[np.asarray(own)]))
    return _ICMP_NS if len(distances_ns) < _TWO else _DISTANCES * int(np.median(distances_ns))


class _Run(NamedTuple):
    """Telegrams of a list that a reader did not acknowledge, at least three in a row; or single ones."""

    readers: tuple[int, ...]
    list_number: int
    rows: Sequence[int]
    in_a_row: bool
    since_ns: int
    until_ns: int


def judge_silent_readers(case: Case) -> Iterator[Explained]:
    """Explain what stayed without acknowledgement: runs each for itself, all others of a reader and list as one."""
    symptoms = case.symptoms
    places: dict[tuple[tuple[int, ...], int], list[int]] = defaultdict(list)
    for row in np.flatnonzero(case.free(NO_ACKNOWLEDGEMENT) & ~_lost_on_the_way(case) & ~of_successions(case)).tolist():
        number, peer = int(symptoms.list[row]), int(symptoms.peer[row])
        entry = case.lists[number]
        assert isinstance(entry, ListSummary), "nobody acknowledges on CAN"
        readers = (peer,) if peer in entry.readers or not entry.readers else tuple(entry.readers)
        places[readers, number].append(row)
    runs: list[_Run] = []
    for (readers, number), rows in places.items():
        in_a_row, single = _runs(case, rows)
        for own in [*in_a_row, *([single] if single else [])]:
            since_ns, until_ns = int(symptoms.since_ns[own].min()), int(symptoms.time_ns[own].max())
            runs.append(_Run(readers, number, own, own is not single, since_ns, until_ns))
    for together in _overlapping(runs):
        yield _silent(case, together)


def _lost_on_the_way(case: Case) -> Bool:
    """Tell which acknowledgements are missing because their reader's link loses what it sends."""
    found: Bool = np.zeros(len(case.owner), np.bool_)
    if not case.free(NO_ACKNOWLEDGEMENT).any():
        return found
    for node, losses in [*losses_at_senders(case).items(), *losses_of_only_lists(case).items()]:
        for cluster in clusters(losses):
            found |= answers_lost(case, node, cluster)
    return found


def _runs(case: Case, rows: Sequence[int]) -> tuple[list[list[int]], list[int]]:
    """Return waits of a list: those of at least three telegrams in a row, and all others."""
    symptoms = case.symptoms
    by_stream: dict[tuple[int, int], list[int]] = defaultdict(list)
    for row in rows:
        by_stream[int(symptoms.node[row]), int(symptoms.subindex[row])].append(row)
    runs, rest = [], []
    for own in by_stream.values():
        own.sort(key=lambda row: int(symptoms.since_ns[row]))
        at = own[0]
        sent = case.stream_at(int(symptoms.list[at]), int(symptoms.node[at]), int(symptoms.subindex[at]))
        assert sent is not None, "what waits for an acknowledgement is on UDP"
        parts = [[own[0]]]
        place = sent.list.number, sent.stream.node, sent.stream.subindex
        for before, row in pairwise(own):
            interval_ns = int(symptoms.since_ns[row] - symptoms.since_ns[before])
            usual_ns = sent.nominal_ns or sent.stream.intervals.p95 or interval_ns
            # The capture may lack telegrams between: what ended a wait is the next one that it has.
            follows = interval_ns <= usual_ns * 3 // 2 or symptoms.since_ns[row] <= symptoms.time_ns[before]
            beside = int(symptoms.since_ns[before]), int(symptoms.since_ns[row])
            if follows or beside in case.long_pauses.get(place, ()):
                parts[-1].append(row)
            else:
                parts.append([row])
        runs += [part for part in parts if len(part) >= _RUN]
        rest += [row for part in parts if len(part) < _RUN for row in part]
    # Single ones make some runs by chance: these are no other matter.
    telegrams = sum(stream.telegrams for stream in case.lists[int(case.symptoms.list[rows[0]])].streams)
    longest = longest_by_chance(len(rest), telegrams - len(rest))
    rest += [row for part in runs if len(part) <= longest for row in part]
    return [part for part in runs if len(part) > longest], sorted(rest)


def _overlapping(runs: Sequence[_Run]) -> list[list[_Run]]:
    """Return runs of the same reader that overlap together."""
    found: list[list[_Run]] = []
    for run in sorted(runs, key=lambda one: one.since_ns):
        for known in found:
            last_ns = max(one.until_ns for one in known)
            if known[0].readers == run.readers and known[0].in_a_row and run.in_a_row and run.since_ns <= last_ns:
                known.append(run)
                break
        else:
            found.append([run])
    return found


def _silent(case: Case, runs: Sequence[_Run]) -> Explained:
    readers = runs[0].readers
    rows = [row for run in runs for row in run.rows]
    lists = [case.lists[number] for number in dict.fromkeys(run.list_number for run in runs)]
    since_ns, last_ns = min(run.since_ns for run in runs), max(run.until_ns for run in runs)
    in_a_row = runs[0].in_a_row
    which = lists_in_words(case, lists)
    spells = case.unreached.of_reader(readers[0], since_ns, last_ns) if in_a_row else []
    meanwhile = _meanwhile(case, readers, since_ns, last_ns)
    last_ns = max([last_ns, *(one.until_ns or case.end_ns for one in spells)])
    over = case.end_ns - last_ns > slack_ns(lists)
    until_ns = _answered_again(case, lists, readers, last_ns) if in_a_row and over else None
    if not in_a_row and (len(rows) > _TWO or not over):  # two have a distance, and no usual one
        until_ns = _end_of_many(case, lists, rows)
    elif not in_a_row:
        until_ns = last_ns
    late = late_answers(case, lists, readers, since_ns, last_ns)
    is_late = answered_all(case, readers, lists) or 2 * len(late) >= len(rows)
    who, many = f"Node {case.address(readers[0])}", count_of(len(readers), "reader")
    if is_late:
        told = f"{who if len(readers) == 1 else many} answered too late for"
    else:
        told = f"{who} did not answer for" if len(readers) == 1 else f"None of {many} answered for"
    if in_a_row and until_ns is not None:
        title = f"{told} {which} from {moment(case, since_ns)} to {moment(case, last_ns)}"
    elif in_a_row:
        title = f"{told} {which} since {moment(case, since_ns)}"
    else:
        title = f"{told} {count_of(len(rows), 'telegram')} of {which}"
    if late and is_late:
        checked = [how_late(case, rows, late)]
    elif is_late:
        checked = [
            "it sent as many acknowledgements as there were telegrams: some came when the next telegram was out "
            "already, and senders count these as missing"
        ]
    else:
        checked = [*_usual_answers(case, readers, lists), meanwhile, looked_for(case, spells)]
    step = READER_SILENT.next_step
    if is_late:
        step = _TOO_SLOW if late else _TOO_FAST
    elif in_a_row and meanwhile == _NOTHING_ELSE:
        step = _GONE
    draft = Draft(
        READER_SILENT, title, step, [one for one in checked if one],
        [*lists, *(case.lists[one.list] for one in spells)],
        [reader for reader in readers if reader >= 0], since_ns=since_ns, until_ns=until_ns,
    )  # fmt: skip
    chosen = case.only([*rows, *late]) if is_late else case.only(rows)
    return draft, chosen | case.unreached.symptoms_of(spells)


def _usual_answers(case: Case, readers: Sequence[int], lists: Sequence[AnyList]) -> list[str]:
    """Return how many telegrams of the lists readers answered, and how fast."""
    answers = case.witness.evidence.answers
    own = _of_readers(case, readers, lists)
    total = int(answers.columns.column("count")[own].sum())
    if not total:
        return []
    usual = answers.latencies.figures(np.where(own, 0, -1)).get(0)
    took = f", in {duration(usual.p50)}" if usual is not None and usual.p50 is not None else ""
    return [f"it answered the {count(total)} others{took}"]


def _of_readers(case: Case, readers: Sequence[int], lists: Sequence[AnyList]) -> Bool:
    """Tell which pairs of those that acknowledge are readers of some lists."""
    numbers, nodes = (word.astype(np.int64) for word in case.witness.evidence.answers.pairs.words)
    own: Bool = np.isin(numbers, [entry.number for entry in lists]) & np.isin(nodes, readers)
    return own


def _meanwhile(case: Case, readers: Sequence[int], since_ns: int, until_ns: int) -> str:
    """Return what else readers did in the time in question."""
    if len(readers) != 1 or readers[0] < 0:
        return ""
    reader = readers[0]
    sent = any(
        one.nominal_ns and one.stream.first_ns < since_ns
        and one.stream.last_ns > until_ns - one.nominal_ns * PAUSE_PERCENT // 100
        and not any(pause.since_ns <= since_ns and (pause.until_ns or until_ns) >= until_ns
                    for pause in case.pauses(one.list.number, one.stream))
        for one in case.streams_of_node.get(reader, ())
    )  # fmt: skip
    if sent:
        return "it went on sending its own lists: its program ran"
    if case.life.sent_between(reader, since_ns + 1, until_ns):
        return "it sent other frames in that time: it has power and cable"
    return _NOTHING_ELSE


def judge_boot_up(case: Case) -> Iterator[Explained]:
    """Explain boot-up requests that nobody answered, by list."""
    symptoms = case.symptoms
    for number in distinct(symptoms.list[case.free(BOOT_UP_UNANSWERED)]).tolist():
        own = np.flatnonzero(case.free(BOOT_UP_UNANSWERED) & (symptoms.list == number))
        entry = case.lists[number]
        askers = [node for node in distinct(symptoms.peer[own]).tolist() if node >= 0]
        since_ns = int(symptoms.since_ns[own].min())
        senders = [case.address(node) for node in getattr(entry, "senders", ())]
        who = f"node {case.address(askers[0])}" if len(askers) == 1 else count_of(len(askers), "node")
        name = lists_in_words(case, [entry])
        checked = [f"the list is sent by {senders[0]}" if senders else "nobody ever sent the list"]
        draft = Draft(
            REQUEST_UNANSWERED, f"Nobody answered {who}, which asked for {name} at {moment(case, since_ns)}",
            REQUEST_UNANSWERED.next_step, checked, [entry], askers, since_ns=since_ns,
            until_ns=_end_of_many(case, [entry], own),
        )  # fmt: skip
        yield draft, case.only(own)


def _answered_again(case: Case, lists: Sequence[AnyList], readers: Sequence[int], last_ns: int) -> int | None:
    """Return when a run ended; None where nothing was acknowledged any more."""
    answers = case.witness.evidence.answers
    own = _of_readers(case, readers, lists)
    later = answers.columns.column("last_ns")[own]
    return last_ns if (later > last_ns).any() else None


def _end_of_many(case: Case, lists: Sequence[AnyList], rows: Sequence[int] | I64) -> int | None:
    """Return when events that come again and again ended; None where they go on as far as one can tell."""
    return case.end_of(case.symptoms.time_ns[np.asarray(rows)], slack_ns(lists))
