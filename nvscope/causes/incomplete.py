"""Telegrams that the capture lacks though they were on the network: capture-incomplete."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from math import prod

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import Case, Draft, Explained, longest_ns, slack_ns
from nvscope.causes.chance import longest_by_chance
from nvscope.causes.gaps import SHORT_GAP, Losses, end_of_losses, lacking, losses_in, since_of
from nvscope.causes.kind import CauseKind
from nvscope.causes.lost_answers import long_runs
from nvscope.causes.moments import PAIR, Moments, together
from nvscope.causes.node_streams import NodeStream
from nvscope.causes.rates import rates_in_words
from nvscope.causes.spans import MOMENT_NS, touching
from nvscope.causes.words import moment
from nvscope.engine.runs import distinct, rows_by
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT
from nvscope.findings.capture import CAPTURE_DROPS
from nvscope.findings.timing import JITTER, LATE, TORN_CYCLE
from nvscope.tracker.kept_rows import LOSS_OF_STREAM
from nvscope.units import count, count_of, percent

CAPTURE_INCOMPLETE = CauseKind(
    "capture-incomplete",
    "not captured",
    "The capture lacks telegrams that were on the network: loss that it shows is its own.",
    "Drops that the capturing program tells, an interface without a cable, several senders that lose at the same "
    "moments, or all lists that lose the same share.",
    "Capture with more room: a faster mirror port, one direction only, a capture filter, a larger buffer.",
    measured="{lost} not captured",
    by_moments=True,
)

_SENDERS = 3
_LEAST_MOMENTS = 2
_BY_CHANCE = 3
_EXPECTED, _FACTOR = 10, 3
_LIST_BITS = 32
_LONG = 10  # a pause of so many intervals is no loss of moments
_MOST_COMBINED = 24  # of more senders, chance is reckoned with those that lose most
_EFFECTS = (TORN_CYCLE, JITTER, LATE, BOOT_UP_UNANSWERED)


def judge_incomplete_captures(case: Case) -> Iterator[Explained]:
    """Explain losses that are the capture's own: told by itself, alike in all lists, or of several senders at once."""
    losses = losses_in(case)
    if not len(losses):
        return
    drops = sum(source.drops or 0 for source in case.facts.sources)
    if drops and 2 * drops >= losses.total:
        told = (
            f"the capture itself tells of {count_of(drops, 'dropped packet')}, for {count(losses.total)} lost telegrams"
        )
        yield _draft(case, losses, losses, [told], everywhere=True)
        return
    is_alike = _alike(case, losses)
    moments = _moments(case, losses)
    if is_alike:
        longest = _longest_by_chance(case, losses)
        own = losses.take((losses.lost <= longest) | (moments.own if moments else np.False_))
        told = "all lists of several senders lose about the same share"
        yield _draft(case, own, losses, [told], everywhere=True, moments=moments, longest=longest)
    elif moments:
        chosen = moments.own | _beside(moments)
        told = (
            f"up to {moments.senders().max()} senders lose within 0.1 s of each other, {count_of(len(moments), 'time')}"
        )
        rates = rates_in_words(case, moments.began_ns)
        own = losses.take(chosen | _between(chosen, losses))
        yield _draft(case, own, losses, [told, rates], events=moments.first, moments=moments)


def _alike(case: Case, losses: Losses) -> bool:
    """Tell whether the lists that should lose some at the mean share do so, about as many as they should."""
    short = np.flatnonzero(losses.lost <= SHORT_GAP)
    lost: dict[tuple[int, ...], int] = defaultdict(int)
    for place, own in rows_by((losses.node[short], losses.list[short])):
        lost[place] = int(losses.lost[short[own]].sum())
    sent: dict[tuple[int, ...], int] = defaultdict(int)
    for node, streams in case.streams_of_node.items():
        for one in streams:
            if _is_counted(one):
                sent[node, one.list.number] += one.stream.telegrams
    total = sum(sent.values()) + sum(lost.values())
    share = sum(lost.values()) / total if total else 0.0
    should = {place: share * (telegrams + lost[place]) for place, telegrams in sent.items()}
    # What a node with one counter lost is booked anywhere in it, and within one sending not at all.
    large = [
        place for place, expected in should.items() if expected >= _EXPECTED and not case.counts_as_a_whole(place[0])
    ]
    if len(large) < _SENDERS or len({node for node, _ in large}) < 2:
        return False
    return all(should[place] / _FACTOR <= lost[place] <= should[place] * _FACTOR for place in large)


def _longest_by_chance(case: Case, losses: Losses) -> int:
    """Return how many telegrams in a row go missing where each does for itself, with the mean share of single ones."""
    sent = sum(one.stream.telegrams for streams in case.streams_of_node.values() for one in streams)
    return longest_by_chance(losses.take(losses.lost <= SHORT_GAP).total, sent)


def _moments(case: Case, losses: Losses) -> Moments | None:
    """Return the moments in which several senders lose, where there are more than by chance."""
    senders = np.minimum(_sending(case, losses), _SENDERS)
    if not (senders > 1).any():
        return None
    sure = together(losses, senders)
    if len(sure) < _LEAST_MOMENTS:
        return None
    expected = _expected(case, losses, int(senders[senders > 1].min()))
    if 2 * len(sure.place) <= len(losses) and len(sure) <= _BY_CHANCE * expected + 1:
        return None
    # Where some moments are sure, two senders that lose several telegrams at once are another one.
    number, rest = sure.number, np.flatnonzero(~sure.own)
    pairs = together(losses.take(rest), np.full(len(rest), PAIR))
    of_pair = pairs.number
    several = np.flatnonzero(of_pair >= 0)
    several = several[pairs.senders(SHORT_GAP)[of_pair[several]] >= PAIR]
    number[rest[several]] = of_pair[several] + len(sure)
    return Moments.of(losses, number).without_outages(_slack_ns(case, losses), SHORT_GAP).widened()


def _slack_ns(case: Case, losses: Losses) -> I64:
    """Return by how much telegrams of the list of each loss may be late."""
    found = np.zeros(len(losses), np.int64)
    for number in distinct(losses.list).tolist():
        found[losses.list == number] = slack_ns([case.lists[number]])
    return found


def _sending(case: Case, losses: Losses) -> I64:
    """Return how many nodes sent lists that tell what is lost, at the time of each loss.

    From their first telegram to their last one; not while all of their lists pause.
    """
    due_ns, sending = losses.due_ns, np.zeros(len(losses), np.int64)
    for streams in case.streams_of_node.values():
        counted = [one for one in streams if _is_counted(one)]
        if not counted:
            continue
        first_ns = min(one.stream.first_ns for one in counted)
        last_ns = max(one.stream.last_ns for one in counted)
        sends = (due_ns >= first_ns) & (due_ns <= last_ns)
        cyclic = [one for one in counted if one.nominal_ns]
        if len(cyclic) == len(counted):
            sends &= ~np.logical_and.reduce([_pausing(case, one, due_ns) for one in cyclic])
        sending += sends
    return sending


def _pausing(case: Case, one: NodeStream, times_ns: I64) -> Bool:
    """Tell at which times a stream has been silent for long, and goes on to be."""
    pauses = case.pauses(one.list.number, one.stream)
    found: Bool = np.zeros(len(times_ns), np.bool_)
    for pause in pauses:
        if pause.until_ns is None or pause.until_ns - pause.since_ns > _LONG * one.nominal_ns:
            found |= (times_ns > pause.since_ns) & (times_ns < (pause.until_ns or case.end_ns))
    return found


def _expected(case: Case, losses: Losses, at_once: int) -> float:
    """Return in how many moments so many senders would lose by chance, were their losses independent."""
    duration_ns = max(case.end_ns - case.start_ns, 1)
    most = np.sort(np.bincount(losses.node))[::-1][:_MOST_COMBINED]
    shares = [min(1.0, 2 * MOMENT_NS * int(one) / duration_ns) for one in most if one]
    return sum(prod(some) for some in combinations(shares, at_once)) * duration_ns / (2 * MOMENT_NS)


def _beside(moments: Moments) -> Bool:
    """Tell which losses may have been in one of the moments, as far as anybody knows when they were."""
    losses, began_ns = moments.losses, moments.began_ns
    return touching(losses.first_ns, losses.until_ns, began_ns, began_ns)


def _between(chosen: Bool, losses: Losses) -> Bool:
    """Tell which are single losses between the first and last of those chosen, of lists that lost nothing outside."""
    due_ns = losses.due_ns
    inside = (due_ns >= due_ns[chosen].min()) & (due_ns <= due_ns[chosen].max())
    place = losses.node << _LIST_BITS | losses.list
    between: Bool = (losses.lost == 1) & ~np.isin(place, place[~inside])
    return between


def _draft(
    case: Case, own: Losses, losses: Losses, told: Sequence[str], *, everywhere: bool = False,
    events: Losses | None = None, moments: Moments | None = None, longest: int = 2,
) -> Explained:  # fmt: skip
    symptoms = case.symptoms
    events = own if events is None else events
    since_ns, last_ns = since_of(events), int(symptoms.time_ns[own.row].max())
    lists = case.lists_of(own.row)
    chosen = case.only(own.row) | case.free(CAPTURE_DROPS)
    length_ns = symptoms.time_ns - symptoms.since_ns
    short = length_ns <= int(length_ns[own.row].max()) + slack_ns(lists)  # a longer pause is another matter
    effects = case.free(*_EFFECTS) & ~_asked_in_vain(case)
    if everywhere:
        chosen |= effects & _uncounted(case)
    chosen |= case.touching(effects & short & ~_late_by_itself(case), own.row, longest_ns(lists))
    if moments:
        chosen |= case.free(NO_ACKNOWLEDGEMENT) & _within_moments(case, moments)
    chosen |= _single_waits(case, *((case.start_ns, case.end_ns) if everywhere else (since_ns, last_ns)), longest)
    draft = Draft(
        CAPTURE_INCOMPLETE, f"The capture lacks {count_of(own.total, 'telegram')}, since {moment(case, since_ns)}",
        CAPTURE_INCOMPLETE.next_step,
        [told[0], f"{percent(own.total, losses.total)} of all that is missing", *told[1:]], lists, since_ns=since_ns,
        until_ns=end_of_losses(case, events, slack_ns(lists)),
    )  # fmt: skip
    return draft, chosen


def _late_by_itself(case: Case) -> Bool:
    """Tell which intervals are long though a Counter that can be trusted says that nothing of them was lost."""
    symptoms = case.symptoms
    rows = np.flatnonzero(symptoms.of_kinds(LATE, JITTER) & (symptoms.detail & LOSS_OF_STREAM == 0))
    return case.only([row for one, own in _by_stream(case, rows) if one is None or _tells(case, one) for row in own])


def _by_stream(case: Case, rows: I64) -> Iterator[tuple[NodeStream | None, list[int]]]:
    """Yield the streams that some symptoms are of, with the rows of each."""
    symptoms = case.symptoms
    for place, own in rows_by((symptoms.list[rows], symptoms.node[rows], symptoms.subindex[rows])):
        yield case.stream_at(place[0], place[1], place[2]), rows[own].tolist()


def _uncounted(case: Case) -> Bool:
    """Tell which long intervals and torn cycles may hold a single loss that no Counter tells of their list."""
    symptoms = case.symptoms
    rows = np.flatnonzero(symptoms.of_kinds(LATE, JITTER))
    late = [
        row for one, own in _by_stream(case, rows) if one is not None and not _tells(case, one) for row in own
    ]  # fmt: skip
    silent = {
        (node, one.list.number) for node, streams in case.streams_of_node.items() for one in streams
        if not _tells(case, one)
    }  # fmt: skip
    rows = np.flatnonzero(symptoms.of_kinds(TORN_CYCLE))
    places = zip(symptoms.node[rows].tolist(), symptoms.list[rows].tolist(), strict=True)
    torn = [row for row, place in zip(rows.tolist(), places, strict=True) if place in silent]
    return lacking(case, case.only(late)) | case.only(torn)


def _tells(case: Case, one: NodeStream) -> bool:
    """Tell whether the Counter of a stream tells what is missing of it, and not of another one of its node."""
    return _is_counted(one) and not case.counts_as_a_whole(one.stream.node)


def _is_counted(one: NodeStream) -> bool:
    return one.stream.counter_scope != "unused" and not one.stream.erratic


def _asked_in_vain(case: Case) -> Bool:
    """Tell which symptoms are of boot-up requests for lists that nobody ever sent."""
    unsent = [entry.number for entry in case.facts.summary.lists if not entry.senders]
    asked: Bool = case.symptoms.of_kinds(BOOT_UP_UNANSWERED) & np.isin(case.symptoms.list, unsent)
    return asked


def _within_moments(case: Case, moments: Moments) -> Bool:
    """Tell which symptoms began in one of the moments in which the capture lacks telegrams."""
    since_ns = case.symptoms.since_ns
    return touching(since_ns, since_ns, moments.began_ns - MOMENT_NS, moments.ended_ns + MOMENT_NS)


def _single_waits(case: Case, since_ns: int, until_ns: int, longest: int) -> Bool:
    """Tell which waits ended without an acknowledgement in a time, but for longer runs of one stream."""
    waits = case.free(NO_ACKNOWLEDGEMENT) & case.overlapping(since_ns, until_ns)
    return waits & ~long_runs(case, waits, longest)
