"""Where time stands still in a capture and samples are lost for it: the rule, packet by packet.

A sample is taken once at each instant. Where a clock is set back by no more than a second, telegrams come behind times
that were there already: of those that follow each other so, the samples that were due between them are lost, and the
next one says so. A single one may have been captured out of order.
"""

from __future__ import annotations

from collections.abc import Sequence

from tests.datalogger.oracle import SET_BACK_NS, DefinedList, copies, counts_for
from tests.datalogger.oracle_losses import Packet


def standing(packets: Sequence[Packet], lists: Sequence[DefinedList], sampling_ns: int) -> tuple[set[int], int]:
    """Return the places of the telegrams of lists that show it, one for each time; and how many samples are lost."""
    by_index = {one.index: one for one in lists}
    seen_twice = set().union(*(copies(packets, one) for one in lists))
    found: set[int] = set()
    count = 0
    now: int | None = None
    own: list[int] = []

    def over() -> int:
        times = [packets[place].time_ns for place in own]
        late = [place for place in own if packets[place].time_ns - times[0] >= sampling_ns]
        found.update(late[:1])
        lost = max((time - times[0] for time in times), default=0) // sampling_ns
        own.clear()
        return lost

    for place, packet in enumerate(packets):
        time_ns = packet.time_ns
        if now is None or time_ns > now or time_ns < now - SET_BACK_NS:
            now = time_ns
            count += over()
        elif time_ns < now and place not in seen_twice and counts_for(packet, by_index.get(packet.index)):
            own.append(place)
    return found, count + over()
