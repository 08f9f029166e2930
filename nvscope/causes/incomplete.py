"""Telegrams that the capture lacks though they were on the network: capture-incomplete."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from math import prod

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.causes.case import MOMENT_NS, Case, Draft, Explained, NodeStream, longest_ns, slack_ns
from nvscope.causes.chance import longest_by_chance
from nvscope.causes.kind import CauseKind
from nvscope.causes.losses import Loss, end_of_losses, losses_in, since_of
from nvscope.causes.lost_answers import long_runs
from nvscope.causes.rates import rates_in_words
from nvscope.causes.words import moment
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT
from nvscope.findings.capture import CAPTURE_DROPS
from nvscope.findings.timing import JITTER, LATE, TORN_CYCLE
from nvscope.tracker.kept_rows import LOSS_OF_STREAM
from nvscope.units import count, count_of, percent

CAPTURE_INCOMPLETE = CauseKind(
    "capture-incomplete",
    "not captured",
    "The capture lacks telegrams that were on the network: loss that it shows is its own.",
    "Drops that the capturing program tells, several senders that lose at the same moments, or all lists that lose the "
    "same share. "
    "Less sure of when it ended where few telegrams are lost.",
    "Capture with more room: a faster mirror port, one direction only, a capture filter, a larger buffer.",
    measured="{lost} not captured",
)

_SENDERS, _PAIR = 3, 2
_LEAST_MOMENTS = 2
_BY_CHANCE = 3
_EXPECTED, _FACTOR = 10, 3
_SHORT_GAP = 3
_LONG = 10  # a pause of so many intervals is no loss of moments
_AWRY = 4  # an interval is some whole ones if it is off by less than a fourth of one
_MOST_COMBINED = 24  # of more senders, chance is reckoned with those that lose most
_EFFECTS = (TORN_CYCLE, JITTER, LATE, BOOT_UP_UNANSWERED)


def judge_incomplete_captures(case: Case) -> Iterator[Explained]:
    """Explain losses that are the capture's own: told by itself, alike in all lists, or of several senders at once."""
    losses = losses_in(case)
    if not losses:
        return
    drops = sum(source.drops or 0 for source in case.facts.sources)
    lost = sum(loss.lost for loss in losses)
    if drops and 2 * drops >= lost:
        told = f"the capture itself tells of {count_of(drops, 'dropped packet')}, for {count(lost)} lost telegrams"
        yield _draft(case, losses, losses, told, everywhere=True)
    elif _alike(case, losses):
        moments = _moments(case, losses)
        at_once = {loss.row for group in moments for loss in group}
        longest = _longest_by_chance(case, losses)
        own = [loss for loss in losses if loss.lost <= longest or loss.row in at_once]
        yield _draft(
            case,
            own,
            losses,
            "all lists of several senders lose about the same share",
            everywhere=True,
            moments=moments,
            longest=longest,
        )
    elif moments := _moments(case, losses):
        chosen = [loss for group in moments for loss in group] + _beside(moments, losses)
        senders = max(len({loss.node for loss in group}) for group in moments)
        told = f"up to {senders} senders lose within 0.1 s of each other, {count_of(len(moments), 'time')}"
        rates = rates_in_words(case, [group[0].due_ns for group in moments])
        began = [group[0] for group in moments]
        yield _draft(case, [*chosen, *_between(chosen, losses)], losses, told, rates, events=began, moments=moments)


def _alike(case: Case, losses: Sequence[Loss]) -> bool:
    """Tell whether the lists that should lose some at the mean share do so, about as many as they should."""
    lost: dict[tuple[int, int], int] = defaultdict(int)
    for loss in losses:
        if loss.lost <= _SHORT_GAP:
            lost[loss.node, loss.list] += loss.lost
    sent: dict[tuple[int, int], int] = defaultdict(int)
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


def _longest_by_chance(case: Case, losses: Sequence[Loss]) -> int:
    """Return how many telegrams in a row go missing where each does for itself, with the mean share of single ones."""
    sent = sum(one.stream.telegrams for streams in case.streams_of_node.values() for one in streams)
    return longest_by_chance(sum(loss.lost for loss in losses if loss.lost <= _SHORT_GAP), sent)


def _moments(case: Case, losses: Sequence[Loss]) -> list[list[Loss]]:
    """Return the moments in which several senders lose, where there are more than by chance."""
    senders = np.minimum(_sending(case, losses), _SENDERS)
    found = _together(losses, senders.tolist()) if (senders > 1).any() else []
    if len(found) < _LEAST_MOMENTS:
        return []
    in_moments = sum(len(group) for group in found)
    expected = _expected(case, losses, int(senders[senders > 1].min()))
    if 2 * in_moments <= len(losses) and len(found) <= _BY_CHANCE * expected + 1:
        return []
    # Where some moments are sure, two senders that lose several telegrams at once are another one.
    known = {loss.row for group in found for loss in group}
    pairs = _together([loss for loss in losses if loss.row not in known], [_PAIR] * (len(losses) - len(known)))
    found += [group for group in pairs if len({loss.node for loss in group if loss.lost >= _SHORT_GAP}) >= _PAIR]
    found = [_shared(case, group) for group in found]
    found.sort(key=lambda group: group[0].due_ns)
    return _widened(found, losses)


def _shared(case: Case, group: Sequence[Loss]) -> list[Loss]:
    """Return the losses of a moment without those that go on for long when nobody else loses: outages of a node."""
    ended: dict[int, int] = {}
    for loss in group:
        ended[loss.node] = max(ended.get(loss.node, loss.last_due_ns), loss.last_due_ns)
    last = sorted(ended.values())
    second_ns = last[-2] if len(last) > 1 else last[-1]
    return [
        loss for loss in group
        if loss.last_due_ns <= second_ns + 2 * MOMENT_NS + slack_ns([case.lists[loss.list]]) or loss.lost <= _SHORT_GAP
    ]  # fmt: skip


def _widened(found: Sequence[list[Loss]], losses: Sequence[Loss]) -> list[list[Loss]]:
    """Return moments with what else was lost from a moment before each to a moment after it."""
    known = {loss.row for group in found for loss in group}
    due_ns = [loss.due_ns for loss in losses]
    wide = []
    for group in found:
        own = list(group)
        first_ns, last_ns = own[0].due_ns - MOMENT_NS, max(loss.last_due_ns for loss in own) + MOMENT_NS
        for loss in losses[bisect_left(due_ns, first_ns) : bisect_right(due_ns, last_ns)]:
            if loss.row not in known and loss.last_due_ns <= last_ns:
                own.append(loss)
                known.add(loss.row)
        wide.append(sorted(own, key=lambda loss: loss.due_ns))
    return wide


def _sending(case: Case, losses: Sequence[Loss]) -> I64:
    """Return how many nodes sent lists that tell what is lost, at the time of each loss.

    From their first telegram to their last one; not while all of their lists pause.
    """
    due_ns = np.array([loss.due_ns for loss in losses], np.int64)
    sending = np.zeros(len(losses), np.int64)
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


def _together(losses: Sequence[Loss], senders: Sequence[int]) -> list[list[Loss]]:
    """Return losses, which are in the order of time, by moments in which ``senders``, of each, lose near each other.

    One sender alone makes no moment.
    """
    losses, senders = _beside_others(losses, senders)
    due_ns = np.array([loss.due_ns for loss in losses], np.int64)
    place = np.arange(len(losses))
    first = np.searchsorted(due_ns, due_ns - MOMENT_NS)
    losing = _losing(np.array([loss.node for loss in losses], np.int64), first)
    # Each window ends with a loss; those that overlap are one moment.
    ends = place[losing >= np.maximum(np.array(senders, np.int64), 2)]
    if not len(ends):
        return []
    begins = np.append(True, first[ends[1:]] > ends[:-1])
    start, stop = first[ends[begins]], np.append(ends[:-1][begins[1:]], ends[-1]) + 1
    return [list(losses[one:other]) for one, other in zip(start.tolist(), stop.tolist(), strict=True)]


def _losing(node: I64, first: I64) -> I64:
    """Return how many nodes lose from the loss ``first`` on, up to each of the losses in the order of time."""
    before: I64 = np.full(len(node), -1)  # the loss of the same node before each one
    order = np.argsort(node, kind="stable")
    same = node[order][1:] == node[order][:-1]
    before[order[1:][same]] = order[:-1][same]
    # A loss tells no other node while the one before it of the same node is in the window, too.
    place = np.arange(len(node))
    again = np.flatnonzero(before >= 0)
    change = np.zeros(len(node) + 1, np.int64)
    np.add.at(change, again, 1)
    np.add.at(change, np.maximum(np.searchsorted(first, before[again], "right"), again), -1)
    losing: I64 = place - first + 1 - np.cumsum(change[:-1])
    return losing


def _beside_others(losses: Sequence[Loss], senders: Sequence[int]) -> tuple[Sequence[Loss], Sequence[int]]:
    """Return the losses near which another node loses, too, and what is told of each: no others make a moment."""
    due_ns = np.array([loss.due_ns for loss in losses], np.int64)
    node = np.array([loss.node for loss in losses], np.int64)
    changes = np.append(0, np.cumsum(node[1:] != node[:-1]))
    first = np.searchsorted(due_ns, due_ns - MOMENT_NS)
    last = np.searchsorted(due_ns, due_ns + MOMENT_NS, "right") - 1
    several = np.flatnonzero(changes[last] > changes[first]).tolist()
    return [losses[place] for place in several], [senders[place] for place in several]


def _expected(case: Case, losses: Sequence[Loss], at_once: int) -> float:
    """Return in how many moments so many senders would lose by chance, were their losses independent."""
    duration_ns = max(case.end_ns - case.start_ns, 1)
    number: dict[int, int] = defaultdict(int)
    for loss in losses:
        number[loss.node] += 1
    most = sorted(number.values(), reverse=True)[:_MOST_COMBINED]
    shares = [min(1.0, 2 * MOMENT_NS * one / duration_ns) for one in most]
    return sum(prod(some) for some in combinations(shares, at_once)) * duration_ns / (2 * MOMENT_NS)


def _beside(moments: Sequence[Sequence[Loss]], losses: Sequence[Loss]) -> list[Loss]:
    """Return the losses that may have been in one of the moments, as far as anybody knows when they were."""
    began = np.array([group[0].due_ns for group in moments], np.int64)
    known = {loss.row for group in moments for loss in group}
    first = np.array([loss.may_be_ns[0] for loss in losses], np.int64)
    last = np.array([loss.may_be_ns[1] for loss in losses], np.int64)
    inside = np.searchsorted(began, last, "right") > np.searchsorted(began, first)
    return [loss for loss, chosen in zip(losses, inside.tolist(), strict=True) if chosen and loss.row not in known]


def _between(chosen: Sequence[Loss], losses: Sequence[Loss]) -> list[Loss]:
    """Return single losses between the first and the last moment, of lists that lost nothing outside."""
    first_ns, last_ns = min(loss.due_ns for loss in chosen), max(loss.due_ns for loss in chosen)
    outside = {(loss.node, loss.list) for loss in losses if not first_ns <= loss.due_ns <= last_ns}
    known = {loss.row for loss in chosen}
    return [
        loss for loss in losses
        if loss.row not in known and loss.lost == 1 and (loss.node, loss.list) not in outside
    ]  # fmt: skip


def _draft(
    case: Case, own: Sequence[Loss], losses: Sequence[Loss], *told: str, everywhere: bool = False,
    events: Sequence[Loss] = (), moments: Sequence[Sequence[Loss]] = (), longest: int = 2,
) -> Explained:  # fmt: skip
    symptoms = case.symptoms
    rows = np.array([loss.row for loss in own], np.int64)
    since_ns, last_ns = since_of(events or own), int(symptoms.time_ns[rows].max())
    lists = [case.lists[number] for number in dict.fromkeys(loss.list for loss in own)]
    chosen = case.only(rows) | case.free(CAPTURE_DROPS)
    length_ns = symptoms.time_ns - symptoms.since_ns
    short = length_ns <= int(length_ns[rows].max()) + slack_ns(lists)  # a longer pause is another matter
    in_moments = case.touching(rows, longest_ns(lists)) & short & ~_late_by_itself(case)
    chosen |= (
        case.free(*_EFFECTS) & ~_asked_in_vain(case) & (in_moments | (_uncounted(case) if everywhere else np.False_))
    )
    chosen |= case.free(NO_ACKNOWLEDGEMENT) & _within_moments(case, moments)
    chosen |= _single_waits(case, *((case.start_ns, case.end_ns) if everywhere else (since_ns, last_ns)), longest)
    lost, all_lost = sum(loss.lost for loss in own), sum(loss.lost for loss in losses)
    draft = Draft(
        CAPTURE_INCOMPLETE, f"The capture lacks {count_of(lost, 'telegram')}, since {moment(case, since_ns)}",
        CAPTURE_INCOMPLETE.next_step, [told[0], f"{percent(lost, all_lost)} of all that is missing", *told[1:]], lists,
        since_ns=since_ns, until_ns=end_of_losses(case, events or own, slack_ns(lists)),
    )  # fmt: skip
    return draft, chosen


def _late_by_itself(case: Case) -> Bool:
    """Tell which intervals are long though a Counter that can be trusted says that nothing of them was lost."""
    symptoms = case.symptoms
    rows = np.flatnonzero(symptoms.of_kinds(LATE, JITTER) & (symptoms.detail & LOSS_OF_STREAM == 0))
    return case.only([
        row for row, one in zip(rows.tolist(), case.streams_at(rows), strict=True)
        if one is None or (_is_counted(one) and not case.counts_as_a_whole(one.stream.node))
    ])  # fmt: skip


def _uncounted(case: Case) -> Bool:
    """Tell which long intervals may hold a single loss that no Counter tells: a few whole intervals."""
    symptoms = case.symptoms
    rows = np.flatnonzero(symptoms.of_kinds(LATE, JITTER))
    intervals_ns = symptoms.amount[rows].tolist()
    return case.only([
        row for row, amount, one in zip(rows.tolist(), intervals_ns, case.streams_at(rows), strict=True)
        if one is not None and one.nominal_ns and not _is_counted(one) and _is_whole(amount, one.nominal_ns)
    ])  # fmt: skip


def _is_whole(interval_ns: int, nominal_ns: int) -> bool:
    times = (interval_ns + nominal_ns // 2) // nominal_ns
    return times <= _SHORT_GAP + 1 and abs(interval_ns - times * nominal_ns) * _AWRY < nominal_ns


def _is_counted(one: NodeStream) -> bool:
    return one.stream.counter_scope != "unused" and not one.stream.erratic


def _asked_in_vain(case: Case) -> Bool:
    """Tell which symptoms are of boot-up requests for lists that nobody ever sent."""
    unsent = [entry.number for entry in case.facts.summary.lists if not entry.senders]
    asked: Bool = case.symptoms.of_kinds(BOOT_UP_UNANSWERED) & np.isin(case.symptoms.list, unsent)
    return asked


def _within_moments(case: Case, moments: Sequence[Sequence[Loss]]) -> Bool:
    """Tell which symptoms began in one of the moments in which the capture lacks telegrams."""
    began = np.array([group[0].due_ns - MOMENT_NS for group in moments], np.int64)
    ended = np.array([max(loss.last_due_ns for loss in group) + MOMENT_NS for group in moments], np.int64)
    since_ns = case.symptoms.since_ns
    inside: Bool = np.searchsorted(began, since_ns, "right") > np.searchsorted(np.sort(ended), since_ns)
    return inside


def _single_waits(case: Case, since_ns: int, until_ns: int, longest: int) -> Bool:
    """Tell which waits ended without an acknowledgement in a time, but for longer runs of one stream."""
    waits = case.free(NO_ACKNOWLEDGEMENT) & case.overlapping(since_ns, until_ns)
    return waits & ~long_runs(case, waits, longest)
