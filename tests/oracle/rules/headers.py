"""Headers: senders whose telegrams have a Length that never fits, while another number always would."""

from __future__ import annotations

from collections import defaultdict

from tests.oracle.frame import Address
from tests.oracle.rules.findings import Finding
from tests.oracle.rules.keys import ListKey, Moment
from tests.oracle.rules.notes import Notes
from tests.oracle.rules.telegram import Telegram

OF_LENGTH = ("NV102", "NV105")
Place = tuple[ListKey, Address]


class Headers:
    """All telegrams of each sender of a list, and those of which Length is wrong."""

    def __init__(self) -> None:
        self.telegrams: dict[Place, int] = defaultdict(int)
        self.misfits: dict[Place, list[Telegram]] = defaultdict(list)

    def observe(self, seen: Telegram) -> None:
        if seen.list_key is not None:
            place = seen.list_key, seen.source
            self.telegrams[place] += 1
            if not seen.header_cut and seen.fault in OF_LENGTH:
                self.misfits[place].append(seen)

    def judge(self, notes: Notes) -> None:
        """Make one finding of those of a sender whose header has another size."""
        for (key, node), misfits in self.misfits.items():
            mostly = len(misfits) >= 3 and 10 * len(misfits) >= 9 * self.telegrams[key, node]
            if mostly and has_another_header(misfits) and any(seen.fault == "NV102" for seen in misfits):
                own = [
                    at for at in notes.findings if at[0] in OF_LENGTH and (at[1], at[2]) == (key, node)
                ]  # fmt: skip
                parts = [notes.findings.pop(at) for at in own]
                moments = sorted((one for part in parts for one in part.moments), key=lambda one: one.frame)
                moments[0] = Moment(min(part.moments[0].time for part in parts), moments[0].frame)
                moments[-1] = Moment(max(part.moments[-1].time for part in parts), moments[-1].frame)
                notes.findings["NV102", key, node, None] = Finding("NV102", key, node, None, moments)


def has_another_header(misfits: list[Telegram]) -> bool:
    """Tell whether some number in the header differs from the payload's size by the same in nine of ten telegrams."""
    for offset in range(8, 19):
        differences = [seen.length_bytes - seen.number(offset, 2) for seen in misfits]
        for difference in set(differences):
            small = -8 <= difference <= (20 if offset == 14 else 8)
            if small and 10 * differences.count(difference) >= 9 * len(misfits):
                return True
    return False
