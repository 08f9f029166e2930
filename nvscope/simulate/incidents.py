"""Incidents: what happens to nodes, lists and the capture at some time, as tables of a scenario."""

from __future__ import annotations

from dataclasses import dataclass

from nvscope.simulate.plan import MAX_DATA_BYTES, U8_MAX, U16_MAX
from nvscope.toml_table import DURATION, FLAG, LENGTH, SPAN, TEXT, array, integer, key, number


@dataclass(frozen=True, kw_only=True)
class Restart:
    """A node starts again: its counters begin anew. What it would have sent during the outage is never sent."""

    node: str = key(TEXT, "the node")
    list: str = key(TEXT, "only this list begins anew", default="")
    at_ns: int = key(LENGTH, "when", name="at")
    outage_ns: int = key(LENGTH, "how long it sends nothing", default=0, name="outage")


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A node sends no more, be it one list or all of them; what else comes of it goes on."""

    node: str = key(TEXT, "the node; all that send the list if it is not given", default="")
    at_ns: int = key(LENGTH, "when", name="at")
    list: str = key(TEXT, "only this list", default="")


@dataclass(frozen=True, kw_only=True)
class PowerOff:
    """A node without power: nothing of it is seen, be it telegrams, answers or ARP. Back, its counters begin anew."""

    node: str = key(TEXT, "the node")
    at_ns: int = key(LENGTH, "when", name="at")
    until_ns: int | None = key(LENGTH, "when it is back", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class Unplugged:
    """A node without its cable: nothing of it is seen, while its program runs on and counts what it sends."""

    node: str = key(TEXT, "the node")
    at_ns: int = key(LENGTH, "when", name="at")
    until_ns: int | None = key(LENGTH, "when it is back", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class HeldBack:
    """A list whose sender finds its only reader no more: it asks for it (ARP), and its stack sends nothing of the list.

    What is not sent is counted.
    """

    list: str = key(TEXT, "the list; its destination is one node")
    from_ns: int = key(LENGTH, "since when", name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class Pause:
    """A sending is held up, and all later ones with it; nothing is lost."""

    list: str = key(TEXT, "the list; all lists of the node if it is not given", default="")
    node: str = key(TEXT, "the node; all that send the list if it is not given", default="")
    at_ns: int = key(LENGTH, "sendings due from this time on", name="at")
    by_ns: int = key(LENGTH, "how long", name="by")


@dataclass(frozen=True, kw_only=True)
class Burst:
    """Extra sendings in quick succession after the first one due at a time."""

    list: str = key(TEXT, "the list")
    at_ns: int = key(LENGTH, "when", name="at")
    count: int = key(integer(1, 10_000), "how many extra ones")
    gap_ns: int = key(LENGTH, "from one to the next", name="gap")


@dataclass(frozen=True, kw_only=True)
class SecondSender:
    """Another node sends the same list for some time. What is not given is as in the list."""

    list: str = key(TEXT, "the list")
    node: str = key(TEXT, "the other node")
    from_ns: int = key(LENGTH, "when it starts", default=0, name="from")
    until_ns: int | None = key(LENGTH, "when it stops", default=None, name="until")
    phase_ns: int = key(LENGTH, "when its first sending is due, from its start", default=7_000_000, name="phase")
    interval_ns: int | None = key(LENGTH, "its interval", default=None, name="interval")
    data_bytes: tuple[int, ...] = key(
        array(integer(0, MAX_DATA_BYTES), single=True), "data bytes of its telegrams", default=(), name="bytes"
    )
    items: tuple[int, ...] = key(array(integer(0, U16_MAX), single=True), "their Items", default=())
    checksum: tuple[int, ...] = key(array(integer(0, U8_MAX), single=True), "their signature", default=())
    counts_along: bool = key(
        FLAG, "its Counter is the next one of the list's sender, as of who wants to pass for it; needs wild",
        default=False,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Scan:
    """A host that looks for lists: it asks for one after the other by boot-up requests, and nobody has them."""

    node: str = key(TEXT, "who looks")
    index: int = key(integer(0, U16_MAX), "identifier of the first list that it asks for")
    count: int = key(integer(1, 10_000), "for so many lists, one identifier behind the other")
    port: tuple[int, ...] = key(
        array(integer(1, U16_MAX), single=True), "UDP ports on which it asks for each of them", default=(1202,)
    )
    interval_ns: int = key(SPAN, "from one request to the next", name="interval")
    from_ns: int = key(LENGTH, "when it begins", default=0, name="from")


@dataclass(frozen=True, kw_only=True)
class ClockStep:
    """The capturing computer's clock is set: all later frames get earlier or later times."""

    at_ns: int = key(LENGTH, "when", name="at")
    by_ns: int = key(DURATION, "by how much; negative sets it back", name="by")


@dataclass(frozen=True, kw_only=True)
class Mirrored:
    """A mirror port shows every frame twice."""

    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")
    delay_ns: int = key(LENGTH, "how much later the copy comes", default=2_000, name="delay")


@dataclass(frozen=True, kw_only=True)
class CaptureLoss:
    """The capture lacks frames of everybody, CAN excepted; who they were sent to received them. Needs wild."""

    at: tuple[int, ...] = key(array(LENGTH, single=True), "moments from which on all frames are lacking", default=())
    lasting_ns: int = key(LENGTH, "how long each of these moments is", default=30_000_000, name="lasting")
    probability: float = key(number(0, 1), "each frame by itself, with this probability", default=0.0)
    from_ns: int = key(LENGTH, "only those from this time on", default=0, name="from")
    until_ns: int | None = key(LENGTH, "only those before this time", default=None, name="until")
    drops: int = key(
        integer(0, 2**32 - 1), "how many the capture says that it dropped, which pcapng files can say", default=0
    )
