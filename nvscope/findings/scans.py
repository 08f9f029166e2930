"""NV966: hosts that look for lists or controllers, told by how much they ask for that nobody has.

Nothing is counted for it: each list that a host asks for has a flow with its first request, and each parameter that
nobody answers is logged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import count

if TYPE_CHECKING:
    from nvscope.findings.asked_in_vain import Asked
    from nvscope.findings.facts import Facts

SCAN = FindingKind(
    "NV966",
    "scan",
    Severity.WARNING,
    meaning=(
        "Within a minute, one host asked by boot-up requests for at least 100 lists that nobody sends and no "
        "definition knows, or at least 100 addresses for parameters of which not one replies to anybody, or asked in "
        "vain on at least 20 ports. A reader that begins asks for the lists that it reads, over the few ports of the "
        "plant: those that are sent or defined do not count, however many; nor do partners that send lists, or that "
        "[nodes] of the project names, nor most of those of a host that go on being asked for the same in turn: it "
        "polls them, and this capture does not see their replies."
    ),
    causes=(
        "a tool that looks for lists or controllers, for an inventory or a test",
        "somebody who explores the plant",
        "a host that reads a hundred lists whose senders are off, or send to it alone and unseen by this capture",
        "a host that asks a hundred controllers once or twice, whose replies this capture does not see",
    ),
    next_steps=(
        "Ask who works at that host; find it by its hardware address.",
        "If it reads these lists, name them: by their definitions, or as what it reads in [nodes] of the project. If "
        "it asks these controllers, name them there.",
    ),
    of_security=True,
)

LEAST_LISTS = 100
"""So many lists that nobody has. A reader of a plant that is switched off asks for as many as it reads: some tens."""

LEAST_PARTNERS = 100
"""So many addresses that do not reply. A program asks the controllers of its plant: some tens, be they all off."""

LEAST_PORTS = 20
"""So many ports. The lists of a plant are sent over one, or a few."""

_WITHIN_NS = 60_000_000_000

_NAMED = 3


def judge_scans(facts: Facts) -> Iterator[Finding]:
    """Yield each host that asked for so much in vain within a minute."""
    if not facts.state.lists.acknowledgement.hears_answers:
        return  # what others were answered, nobody knows
    if facts.state.parameters.known is None and not _asks_enough(facts):
        return
    from nvscope.findings.asked_in_vain import dense, lists_in_vain, partners_in_vain, ports_in_vain

    ways = (
        (lists_in_vain(facts), LEAST_LISTS, "for {} lists that nobody sends ({})"),
        (partners_in_vain(facts), LEAST_PARTNERS, "{} addresses for parameters, of which not one replied ({})"),
        (ports_in_vain(facts), LEAST_PORTS, "in vain on {} ports ({})"),
    )
    for node in sorted({node for asked, _, _ in ways for node in asked}):
        told = [
            (of_way, least, words) for asked, least, words in ways
            if (of_way := dense(asked.get(node, ()), least, _WITHIN_NS))
        ]  # fmt: skip
        if not told:
            continue
        found = sorted({one for of_way, _, _ in told for one in of_way})
        frames = sorted(dict.fromkeys(one.frame for one in found if one.frame))
        what = " and ".join(words.format(count(len(of_way)), _shown(of_way)) for of_way, _, words in told)
        yield Finding(
            SCAN, f"{facts.address(node)} asked {what}, at least {count(told[0][1])} of them within a minute.",
            len(found), found[0].first_ns, found[-1].first_ns, tuple(frames[:FRAMES_KEPT]), node=node,
        )  # fmt: skip


def _asks_enough(facts: Facts) -> bool:
    """Tell whether so much was asked for that it can be a scan: else nothing further is imported."""
    import numpy as np

    from nvscope.engine.keys import FrameKind

    kinds = facts.state.lists.flows.column("kind")
    return int(np.count_nonzero(kinds == FrameKind.BOOT_UP_REQUEST)) >= LEAST_PORTS


def _shown(asked: Sequence[Asked]) -> str:
    named = ", ".join(one.what for one in asked[:_NAMED])
    return named + (" …" if len(asked) > _NAMED else "")
