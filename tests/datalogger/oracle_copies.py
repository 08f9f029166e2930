"""Which telegrams of one stream are copies of others, and no cycles: the rules, telegram by telegram.

A *repeat* has the Counter and the bytes of one of the 64 telegrams before it, which came within a second of it; all
others are *new*. Of a Counter that comes round within these, only the one directly before counts. Between two new ones
there is room for as many cycles as intervals, less one, or less what a Counter counts on that moves with the intervals.
Where more repeats come, by more than a quarter, those are copies that come sooner than half an interval behind the
cycle before them. Behind the last new one, a copy comes sooner than a quarter of an interval, or as late as copies
usually do. What comes at once is a copy anyway, and so is a repeat whose Counter is behind the newest one by no more
than 64: it tells what was. A sender that begins anew, with 0 or 1, or further back, has no newer one.

What a list is sent at, its stream tells (``interval``). Where there is no interval, a copy comes at once; or each
telegram has one, equally late; or its Counter is known to move whatever the values do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from tests.datalogger.oracle_losses import Packet, Sequenced

MS = 1_000_000
SECOND_NS = 1000 * MS
RECENT = 64
ENOUGH = 5


@dataclass
class Span:
    """A new telegram, the repeats behind it, and the next new one, None behind the last: by places in the stream."""

    begin: int
    repeats: list[int]
    end: int | None = None


def copies_in(stream: Sequence[Packet], defined_ns: int | None) -> set[int]:
    """Return the places of copies in a stream."""
    times = [packet.time_ns for packet in stream]
    repeated = originals(stream)
    spans: list[Span] = []
    for place in range(len(stream)):
        if place in repeated:
            spans[-1].repeats.append(place)
            continue
        if spans:
            spans[-1].end = place
        spans.append(Span(place, []))
    if not repeated:
        return set()
    past = set() if comes_round(stream, recent(stream)) else behind_newest(stream) & repeated.keys()
    late = {place: abs(times[place] - times[original]) for place, original in repeated.items()}
    at_once = soon(times, defined_ns)
    interval_ns = interval(stream, spans, defined_ns)
    if interval_ns is None:
        return without_interval(stream, spans, repeated, late, at_once, defined_ns, past)
    found = {place for place in repeated if late[place] < at_once} | past
    rooms = room(stream, spans, interval_ns)
    for span in spans[:-1]:
        assert span.end is not None
        cycles = rooms[span.begin]
        is_longer = 2 * (times[span.end] - times[span.begin]) >= interval_ns
        if not is_longer or len(span.repeats) <= cycles + cycles // 4:
            continue
        if len(span.repeats) > 1 and evenly(times, span, 4):
            continue
        last_ns = times[span.begin]
        for place in span.repeats:
            if cycles and 2 * (times[place] - last_ns) >= interval_ns:
                last_ns, cycles = times[place], cycles - 1
            else:
                found.add(place)
    usual = usually([late[place] for place in found])
    last_ns = times[spans[-1].begin]
    for place in spans[-1].repeats:
        is_usual = usual is not None and usual[0] <= late[place] <= usual[1]
        if is_usual or 4 * abs(times[place] - last_ns) < interval_ns:
            found.add(place)
        else:
            last_ns = times[place]
    return found


def originals(stream: Sequence[Packet]) -> dict[int, int]:
    """Return the repeats, and which telegram each one repeats."""
    found = recent(stream)
    if comes_round(stream, found):
        return {place: before for place, before in found.items() if place - before == 1}
    return found


def behind_newest(stream: Sequence[Packet]) -> set[int]:
    """Return the places of those whose Counter is behind the newest one; what begins anew is the newest."""
    sequence = Sequenced()
    steps = [
        sequence.step(packet.counter, place, zero_is_regular=False, repeated=False)[0]
        for place, packet in enumerate(stream)
    ]
    return {place for place, step in enumerate(steps) if step in ("duplicate", "overtaken")}


def recent(stream: Sequence[Packet]) -> dict[int, int]:
    found: dict[int, int] = {}
    last: dict[object, int] = {}
    for place, packet in enumerate(stream):
        before = last.get(packet.content)
        last[packet.content] = place
        if before is None or place - before > RECENT or abs(packet.time_ns - stream[before].time_ns) > SECOND_NS:
            continue
        found[place] = before
    return found


def long_ago(stream: Sequence[Packet]) -> set[int]:
    """Return the places of those that are new since what they are as came more than a second ago."""
    found: set[int] = set()
    last: dict[object, int] = {}
    for place, packet in enumerate(stream):
        before = last.get(packet.content)
        last[packet.content] = place
        if before is not None and place - before <= RECENT and abs(packet.time_ns - stream[before].time_ns) > SECOND_NS:
            found.add(place)
    return found


def comes_round(stream: Sequence[Packet], repeated: dict[int, int]) -> bool:
    """Tell whether a sender has few Counters: then what is not directly behind the other is no repeat.

    New telegrams use them again within 128 telegrams, five times or more; or more than eight old ones come in a row.
    """
    last: dict[int, int] = {}
    used = late = newest = 0
    for place, packet in enumerate(stream):
        if place in repeated:
            late += packet.content != stream[newest].content
            if late > 8:
                return True
            continue
        newest, late = place, 0
        used += packet.counter in last and place - last[packet.counter] <= 2 * RECENT
        last[packet.counter] = place
    return used >= ENOUGH


def interval(stream: Sequence[Packet], spans: Sequence[Span], defined_ns: int | None) -> int | None:
    times = [packet.time_ns for packet in stream]
    closed = [span for span in spans if span.end is not None]
    old = long_ago(stream)
    telling = [span for span in closed if span.begin not in old and span.end not in old]
    long = [times[span.end] - times[span.begin] for span in telling if span.end is not None]
    direct = [ns for ns, span in zip(long, telling, strict=True) if not span.repeats]
    often = 2 * len(direct) >= len(telling)
    of_direct = median_if_regular(direct)
    of_all = median_if_regular([now - then for then, now in pairwise(times)])
    if often and of_direct is not None:
        return of_direct if of_all is None else min(of_direct, of_all)
    of_new = median_if_regular(long)
    if of_new is not None and are_copied(stream, closed) and 4 * (defined_ns or of_new) >= 3 * of_new:
        return of_new
    if defined_ns and 1 < len(closed) < ENOUGH and len(stream) <= 3 * ENOUGH:
        lasted = [times[span.end] - times[span.begin] for span in closed if span.end is not None]
        near = all(4 * abs(ns - defined_ns) <= defined_ns for ns in lasted)
        if near and not any(span.repeats and evenly(times, span, 8) for span in closed):
            return defined_ns
    of_pairs = median_if_regular([now - then for then, now in zip(times, times[2:], strict=False)])
    if of_all is None and of_pairs is not None and defined_ns and 4 * abs(of_pairs - defined_ns) <= defined_ns:
        short = [2 * (now - then) < of_pairs for then, now in pairwise(times)]
        in_turn = sum(one != other for one, other in pairwise(short))
        if 10 * in_turn >= 9 * (len(short) - 1):
            return of_pairs
    return of_all


def are_copied(stream: Sequence[Packet], closed: Sequence[Span]) -> bool:
    """Tell whether new telegrams are repeated as no sender sends cycles."""
    times = [packet.time_ns for packet in stream]
    if counts_by_itself(stream, closed):
        return True
    every = list(originals(stream))
    news = sorted(set(range(len(stream))) - set(every))
    late = [place for place in every if stream[place].content != stream[max(n for n in news if n < place)].content]
    if len(late) >= ENOUGH and 2 * len(late) >= len(every):
        return True
    old = long_ago(stream)
    with_repeats = [span for span in closed if span.repeats and span.begin not in old and span.end not in old]
    if len(with_repeats) < ENOUGH:
        return False
    # How late what comes next is behind a new telegram, and what comes next behind that.
    first = [times[span.begin + 1] - times[span.begin] for span in with_repeats]
    then = [times[span.begin + 2] - times[span.begin + 1] for span in with_repeats]
    near = sum(4 * min(one, other) <= one + other for one, other in zip(first, then, strict=True))
    if 10 * near >= 9 * len(with_repeats):
        return True
    # Cycles of about a second are repeats where they come sooner: that is why those are shorter than the others.
    if 4 * share(first, 90) > 3 * SECOND_NS or len(with_repeats) < 2 * ENOUGH:
        return False
    return 16 * share(first, 90) < 15 * share(then, 10) or 16 * share(then, 90) < 15 * share(first, 10)


def counts_by_itself(stream: Sequence[Packet], closed: Sequence[Span]) -> bool:
    """Tell whether the Counter moves where nothing else does."""
    found = 0
    for span in closed:
        assert span.end is not None
        one, other = stream[span.begin], stream[span.end]
        found += one.content[1:] == other.content[1:] and (other.counter - one.counter) % 65_536 == 1
    return found >= ENOUGH and not comes_round(stream, recent(stream))


def room(stream: Sequence[Packet], spans: Sequence[Span], interval_ns: int) -> dict[int, int]:
    """Return for how many cycles there is room behind each new telegram that another one follows."""
    told: dict[int, tuple[int, int]] = {}
    for span in spans:
        if span.end is not None:
            # 1.4 intervals are two.
            intervals = (5 * (stream[span.end].time_ns - stream[span.begin].time_ns) + 3 * interval_ns) // (
                5 * interval_ns
            )
            told[span.begin] = intervals, (stream[span.end].counter - stream[span.begin].counter) % 65_536
    direct = [span.begin for span in spans if span.end is not None and not span.repeats]
    if len(direct) < ENOUGH:
        direct = list(told)
    counting = sum(told[begin][0] == told[begin][1] for begin in direct)
    counts = 10 * counting >= 9 * len(direct)
    return {
        begin: max(0, intervals - (steps if counts and 1 <= steps <= RECENT else 1))
        for begin, (intervals, steps) in told.items()
    }


def without_interval(
    stream: Sequence[Packet], spans: Sequence[Span], repeated: dict[int, int], late: dict[int, int], at_once: int,
    defined_ns: int | None, past: set[int],
) -> set[int]:  # fmt: skip
    found = {place for place, late_ns in late.items() if late_ns < at_once} | past
    closed = [span for span in spans if span.end is not None]
    if counts_by_itself(stream, closed):
        for span in closed:
            back = (stream[span.begin].counter - stream[span.begin + 1].counter) % 65_536
            # A sender that begins anew does so with 0 or 1.
            if span.repeats and (back == 0 or (back <= RECENT and stream[span.begin + 1].counter > 1)):
                found |= set(span.repeats)
    once = closed and 9 * (len(spans) - 1) <= 10 * len(repeated) <= 10 * len(spans)
    of_new = [place for place, original in repeated.items() if original not in repeated]
    usual = usually(list(late.values()))
    if once and 10 * len(of_new) >= 9 * len(repeated) and usual is not None:
        # What comes from a telegram to the next new one; a cycle of a slow value comes as late as that.
        onward = [stream[span.end].time_ns - stream[span.end - 1].time_ns for span in closed if span.end is not None]
        cycle_ns = min(share(onward, 50), defined_ns or share(onward, 50))
        if 2 * usual[1] < cycle_ns:
            found |= {place for place, late_ns in late.items() if usual[0] <= late_ns <= usual[1]}
    return found


def soon(times: Sequence[int], defined_ns: int | None) -> int:
    gaps = [now - then for then, now in pairwise(times)]
    most = min(2 * MS, defined_ns // 4) if defined_ns else 2 * MS
    return min(most, share(gaps, 90) // 8) if len(gaps) >= ENOUGH else most


def evenly(times: Sequence[int], span: Span, off: int) -> bool:
    """Tell whether telegrams are as far apart as they would be if all were cycles, to one part in ``off``."""
    assert span.end is not None
    gaps = [times[place + 1] - times[place] for place in range(span.begin, span.end)]
    whole = times[span.end] - times[span.begin]
    return all((off - 1) * whole <= off * gap * len(gaps) <= (off + 1) * whole for gap in gaps)


def share(values: Sequence[int], percent: int) -> int:
    return sorted(values)[(len(values) - 1) * percent // 100]


def median_if_regular(values: Sequence[int]) -> int | None:
    if len(values) < ENOUGH:
        return None
    middle = share(values, 50)
    return middle if middle > 0 and 2 * (share(values, 95) - share(values, 5)) <= middle else None


def usually(late: Sequence[int]) -> tuple[int, int] | None:
    """Return between which times copies come behind what they are of."""
    if len(late) < ENOUGH or share(late, 95) - share(late, 5) > max(MS, share(late, 50) // 8):
        return None
    around = MS + share(late, 50) // 16
    return share(late, 5) - around, share(late, 95) + around
