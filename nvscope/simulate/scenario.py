"""Scenario: a plant, its traffic and what goes wrong in it, as a file that can be read without running it.

A scenario is TOML. ``[[node]]``, ``[[list]]`` and ``[[reader]]`` describe who sends what to whom over UDP, ``[[bus]]``
and ``[[can_list]]`` what is sent over CAN; every other array of tables is a kind of fault or of foreign traffic. The
dataclasses below are the table of all keys: reading, messages and ``scenario_file.document`` come from them.

A telegram is named by its number: telegram 1 is the first one that its sender sends in that (list, SubIndex). A fault
that chooses telegrams does so by ``telegrams``, ``every`` or ``probability``, and takes all of them if none is given.

Unless ``wild`` is set, faults that change the order or the presence of telegrams keep away from each other, from
restarts and from the wrap of the counter, so that what an observer can know follows from what was put in: chosen
telegrams that are too near are an error, random ones are left alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property

from dissectors.can.frame import MAX_DATA_BYTES as MAX_PDO_BYTES
from dissectors.netvar import PARAMETER_ERRORS
from nvscope.errors import ConfigurationError
from nvscope.list_key import ListKey
from nvscope.simulate.can.tables import Bus, BusOff, BusOverload, CanList, CanTraffic, ErrorFrames
from nvscope.simulate.visu.tables import Page
from nvscope.toml_table import (
    DURATION,
    FLAG,
    LENGTH,
    MOMENT,
    SPAN,
    TEXT,
    Place,
    array,
    choice,
    integer,
    key,
    mapping,
    number,
    table_of,
    tables,
)

MAX_DATA_BYTES = 1452
PACKED_DATA_BYTES = 256
MAX_TELEGRAMS_PER_LIST = 1024
SLOWEST_NS = 31 * 86_400_000_000_000
U8_MAX, U16_MAX = 0xFF, 0xFFFF


@dataclass(frozen=True, kw_only=True)
class Node:
    """A controller or PC with an address. What it counts in Counter is a matter of the node, not of the list."""

    name: str = key(TEXT, "how the rest of the scenario calls it")
    address: str = key(TEXT, "IPv4 or IPv6 address; with wild, two nodes may have the same one")
    mac: str = key(TEXT, "hardware address; made from the node's number if empty", default="")
    counter: str = key(
        choice("stream", "telegram", "send", "list", "constant"),
        "what Counter counts: telegrams of a (list, SubIndex), as controllers do; all telegrams of the node; its sends "
        "of a whole list; telegrams of a list; nothing",
        default="stream",
    )
    first_value: int = key(integer(0, U16_MAX), "Counter of the first telegram", default=1)
    last_value: int = key(integer(0, U16_MAX), "highest Counter; 0 follows", default=U16_MAX)
    carry_into_flags: bool = key(
        FLAG,
        "a 32-bit counter written over Counter, Flags and Checksum, so that its carry lands in Flags",
        default=False,
    )
    byte_swapped: bool = key(FLAG, "Counter is written byte-swapped from 128 on", default=False)
    short_header: bool = key(
        FLAG,
        "a header of 18 bytes, as a public npm sender writes it: SubIndex in one byte, no Checksum. Its telegrams are "
        "malformed to everybody else",
        default=False,
    )
    changing_port: bool = key(FLAG, "a new source port for each telegram, as PC senders do", default=False)
    vlan: tuple[int, ...] = key(
        array(integer(0, 4095), single=True), "VLAN tags of its frames, the outer one first", default=()
    )
    ip_options: bool = key(FLAG, "its IPv4 headers carry an option (router alert)", default=False)


@dataclass(frozen=True, kw_only=True)
class ListPlan:
    """A network variables list: its telegrams, and when who sends them where."""

    name: str = key(TEXT, "how the rest of the scenario calls it")
    index: int = key(integer(0, U16_MAX), "list identifier")
    port: int = key(integer(1, U16_MAX), "UDP port", default=1202)
    sender: tuple[str, ...] = key(array(TEXT, single=True), "the node that sends it; several send it side by side")
    destination: str = key(
        TEXT,
        'where to: an address, a node, or "broadcast" (255.255.255.255; ff02::1 from IPv6 nodes)',
        default="broadcast",
    )
    packed: bool = key(FLAG, "several variables in one telegram; otherwise one telegram per variable", default=True)
    data_bytes: tuple[int, ...] = key(
        array(integer(0, MAX_DATA_BYTES), single=True),
        "data bytes of each telegram, by SubIndex",
        default=(),
        name="bytes",
    )
    total_bytes: int = key(
        integer(0, 64 * MAX_DATA_BYTES),
        "data bytes of the list, cut into telegrams of at most 256; instead of bytes",
        default=0,
    )
    element_bytes: int = key(
        integer(1, 255), "size of a variable, for total_bytes and for items that are not given", default=4
    )
    items: tuple[int, ...] = key(
        array(integer(0, U16_MAX), single=True),
        "variables in each telegram; if not given, what element_bytes gives (1 if not packed)",
        default=(),
    )
    interval_ns: int = key(LENGTH, "time from one sending of the list to the next", name="interval")
    mode: str = key(
        choice("cyclic", "on_change"),
        "on_change sends at random moments: intervals lie between a tenth and nearly twice the interval",
        default="cyclic",
    )
    jitter_ns: int = key(LENGTH, "each sending is late by 0 to this much", default=0, name="jitter")
    phase_ns: int = key(LENGTH, "when the first sending is due", default=0, name="phase")
    spacing_ns: int = key(
        LENGTH, "from one telegram of a sending to the next SubIndex", default=100_000, name="spacing"
    )
    from_ns: int = key(LENGTH, "when the sender starts", default=0, name="from")
    until_ns: int | None = key(LENGTH, "when the sender stops", default=None, name="until")
    acknowledge: bool = key(FLAG, "Flags bit 0: acknowledgement wanted", default=False)
    checksum: tuple[int, ...] = key(
        array(integer(0, U8_MAX), single=True),
        "signature of the definition, by SubIndex or one for all; sets bit 1",
        default=(),
    )
    values: str = key(
        choice("ramp", "constant", "noise"),
        "data: the first bytes count the telegrams; nothing ever changes; random bytes behind a counting one",
        default="ramp",
    )
    answers_boot_up: bool = key(FLAG, "a boot-up request is answered by a sending of the list", default=True)
    answer_delay_ns: int = key(LENGTH, "how long that takes", default=5_000_000, name="answer_delay")

    @property
    def list_key(self) -> ListKey:
        """What its telegrams are told by on the wire."""
        return ListKey.udp(self.port, self.index)

    @property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        """Items and data bytes of each telegram, by SubIndex."""
        sizes = self.data_bytes
        if self.total_bytes:
            full = PACKED_DATA_BYTES // self.element_bytes * self.element_bytes if self.packed else self.element_bytes
            count, rest = divmod(self.total_bytes, full)
            sizes = (full,) * count + ((rest,) if rest else ())
        items = self.items or tuple(max(size // self.element_bytes, 1) if self.packed else 1 for size in sizes)
        return tuple(zip(items, sizes, strict=True))


@dataclass(frozen=True, kw_only=True)
class Reader:
    """A node that reads a list: it acknowledges what wants to be acknowledged, and asks at its start."""

    node: str = key(TEXT, "the node that reads")
    list: str = key(TEXT, "the list that it reads")
    acknowledges: bool = key(FLAG, "answers telegrams with Flags bit 0", default=True)
    delay_ns: int = key(LENGTH, "from the telegram to its acknowledgement", default=2_000_000, name="delay")
    jitter_ns: int = key(LENGTH, "and up to this much later", default=0, name="jitter")
    to: str = key(choice("sender", "broadcast"), "where acknowledgements go", default="sender")
    echo_counter: bool = key(FLAG, "acknowledgements repeat the Counter; otherwise it is 0", default=False)
    boot_up: tuple[int, ...] = key(
        array(LENGTH, single=True),
        "when it asks for current values, one request for each telegram of the list",
        default=(),
    )
    boot_up_rejected: bool = key(FLAG, "the requests come back as ICMP port unreachable", default=False)


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Some telegrams of a list."""

    list: str = key(TEXT, "the list concerned")
    subindex: int | None = key(integer(0, U16_MAX), "only this SubIndex; otherwise each one by itself", default=None)
    node: str = key(TEXT, "only telegrams of this sender; otherwise of all", default="")
    telegrams: tuple[int, ...] = key(
        array(integer(1, 100_000_000), single=True), "numbers of the telegrams, from 1", default=()
    )
    every: int = key(integer(0, 100_000_000), "the n-th telegram, the 2n-th and so on", default=0)
    probability: float = key(number(0, 1), "each telegram by itself, with this probability", default=0.0)
    run: int = key(integer(1, 100_000_000), "this many in a row from each chosen one on", default=1)
    from_ns: int = key(LENGTH, "only those sent from this time on", default=0, name="from")
    until_ns: int | None = key(LENGTH, "only those sent before this time", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class Loss(Selection):
    """Telegrams that nobody sees: neither the capture nor the readers."""


@dataclass(frozen=True, kw_only=True)
class Fragmented(Selection):
    """Telegrams that arrive as two IP fragments. They are no telegrams for an observer, so they are missing."""


@dataclass(frozen=True, kw_only=True)
class Duplicate(Selection):
    """Telegrams that are seen again, byte for byte."""

    copies: int = key(integer(1, 100), "how many more there are of each", default=1)
    delay_ns: int = key(LENGTH, "when, if nothing comes in between", default=5_000, name="delay")
    behind: int = key(integer(0, 63), "this many telegrams of the stream come in between", default=0)


@dataclass(frozen=True, kw_only=True)
class Overtaken(Selection):
    """Telegrams that arrive after later ones."""

    by: int = key(integer(1, 63), "how many later telegrams of the stream arrive before", default=1)


@dataclass(frozen=True, kw_only=True)
class Late(Selection):
    """Sendings of the list that come late; the following ones are on time."""

    by_ns: int = key(LENGTH, "how late, less than the interval", name="by")


@dataclass(frozen=True, kw_only=True)
class Truncated(Selection):
    """Telegrams of which the capture keeps only the beginning."""

    payload_bytes: int = key(integer(0, 1471), "how much of the UDP payload is kept")


@dataclass(frozen=True, kw_only=True)
class WrongChecksum(Selection):
    """Telegrams with another checksum than before."""

    checksum: int | None = key(integer(0, U8_MAX), "the value; otherwise the right one, all bits turned", default=None)


@dataclass(frozen=True, kw_only=True)
class ChecksumFlag(Selection):
    """Telegrams that carry a checksum and do not say so: Flags bit 1 is clear."""

    checksum: int = key(integer(1, U8_MAX), "value of Checksum", default=0x5A)


@dataclass(frozen=True, kw_only=True)
class ReservedFlags(Selection):
    """Telegrams with undocumented bits in Flags."""

    flags: int = key(integer(0x08, 0xF8), "the bits that are set beside the usual ones", default=0x08)


@dataclass(frozen=True, kw_only=True)
class AsciiIdentity(Selection):
    """Telegrams whose identity begins with the character '0' instead of a binary zero."""


@dataclass(frozen=True, kw_only=True)
class Shape(Selection):
    """Telegrams of another definition: other Items, other data length."""

    items: int | None = key(integer(0, U16_MAX), "Items; otherwise unchanged", default=None)
    data_bytes: int | None = key(
        integer(0, MAX_DATA_BYTES), "data bytes; otherwise unchanged", default=None, name="bytes"
    )


@dataclass(frozen=True, kw_only=True)
class WrongDlc(Selection):
    """PDOs on CAN that are shorter or longer than they should be."""

    data_bytes: int = key(integer(0, MAX_PDO_BYTES), "data bytes", name="bytes")


@dataclass(frozen=True, kw_only=True)
class Malformed(Selection):
    """Extra telegrams that make no sense, sent by the list's sender right after the chosen ones."""

    kind: str = key(
        choice("short", "stub", "wrong_length", "byte_swapped_length", "unknown_service"),
        "12 to 19 bytes; 8 bytes, not even a telegram; a Length that is 4 too large; a big-endian Length; ID 77",
    )
    payload_bytes: int = key(integer(12, 19), "UDP payload of a short one", default=16)
    service: int = key(integer(0, 6), "ID of a short one or one of wrong length: 0, 5 or 6", default=0)


@dataclass(frozen=True, kw_only=True)
class MissingAcknowledgement(Selection):
    """Telegrams that a reader does not acknowledge."""

    reader: str = key(TEXT, "only this reader keeps silent; otherwise all", default="")


@dataclass(frozen=True, kw_only=True)
class NegativeAcknowledgement(Selection):
    """Telegrams that a reader acknowledges with Flags bit 2, invalid checksum."""

    reader: str = key(TEXT, "only this reader; otherwise all", default="")


@dataclass(frozen=True, kw_only=True)
class UnexpectedAcknowledgement(Selection):
    """Acknowledgements that nobody wanted, sent right after the chosen telegrams."""

    reader: str = key(TEXT, "the node that sends them")
    to: str = key(choice("sender", "broadcast"), "where they go", default="sender")


@dataclass(frozen=True, kw_only=True)
class Unreachable(Selection):
    """ICMP port unreachable in answer to the chosen telegrams, or to their acknowledgements."""

    of: str = key(choice("data", "acknowledgement"), "what is refused", default="data")
    host: str = key(TEXT, "the node that refuses; needed where the destination is no node", default="")
    quote: str = key(
        choice("full", "header"), "how much is quoted: up to 548 bytes, or the IP header and 8 bytes", default="full"
    )
    delay_ns: int = key(LENGTH, "when the refusal follows", default=300_000, name="delay")


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


ON_CAN = (Loss, Late, WrongDlc, Stop, Pause, Burst)
"""The faults of a list on CAN."""


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


@dataclass(frozen=True, kw_only=True)
class Definition:
    """A definition of a list for who reads the capture, right or wrong; --gvl writes it. What is not given is right."""

    list: str = key(TEXT, "the list")
    index: int | None = key(integer(0, U16_MAX), "its list identifier", default=None)
    port: int | None = key(integer(1, U16_MAX), "its UDP port", default=None)
    packed: bool | None = key(FLAG, "several variables in one telegram", default=None)
    total_bytes: int = key(integer(0, 64 * MAX_DATA_BYTES), "data bytes of all its variables", default=0)


@dataclass(frozen=True, kw_only=True)
class Traffic:
    """Frames that are no telegrams of a list."""

    kind: str = key(
        choice("arp", "dns", "tcp", "ping", "udp", "parameter"),
        "udp has another payload on port 1202; parameter is the Parameter Manager, whose telegrams belong to no list",
    )
    node: str = key(TEXT, "who sends it")
    to: str = key(TEXT, "to which node")
    interval_ns: int = key(LENGTH, "how often", name="interval")
    jitter_ns: int = key(LENGTH, "and up to this much later", default=0, name="jitter")
    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")


@dataclass(frozen=True, kw_only=True)
class ParameterRequests:
    """A node that asks another one for a parameter again and again, and what comes of each request."""

    node: str = key(TEXT, "who asks")
    to: str = key(TEXT, "who is asked")
    index: int = key(integer(0, U16_MAX), "Index of the parameter", default=0x2000)
    subindex: int = key(integer(0, U16_MAX), "its SubIndex", default=0)
    write: bool = key(FLAG, "a value is written, not read", default=False)
    value_bytes: int = key(integer(0, 256), "size of the value", default=2, name="bytes")
    values: tuple[int, ...] = key(
        array(integer(-(2**63), 2**63 - 1), single=True),
        "what is written, or read, one request after the other, again and again; 0 if none is given",
        default=(),
    )
    port: int = key(integer(1, U16_MAX), "UDP port", default=1202)
    first_value: int = key(integer(0, U16_MAX), "Counter of the first request", default=1)
    interval_ns: int = key(SPAN, "how often it asks", name="interval")
    jitter_ns: int = key(LENGTH, "and up to this much later", default=0, name="jitter")
    from_ns: int = key(LENGTH, "since when", default=0, name="from")
    until_ns: int | None = key(LENGTH, "until when", default=None, name="until")
    latency_ns: int = key(LENGTH, "how long a reply takes", default=3_000_000, name="latency")
    unanswered: tuple[int, ...] = key(array(integer(1, 2**31)), "requests without a reply, by number", default=())
    refused: tuple[int, ...] = key(array(integer(1, 2**31)), "requests that are refused", default=())
    error: str = key(
        choice(*(one.name for one in PARAMETER_ERRORS)),
        "the service with which they are", default="ODErrorReplyIdx",
    )  # fmt: skip
    undeliverable: tuple[int, ...] = key(
        array(integer(1, 2**31)), "requests that come back as ICMP port unreachable, without a reply", default=()
    )
    host: str = key(TEXT, "the node that sends them back, such as a router; who is asked if none is given", default="")
    late: tuple[int, ...] = key(array(integer(1, 2**31)), "requests whose reply takes late_by", default=())
    late_by_ns: int = key(LENGTH, "so long", default=700_000_000, name="late_by")


@dataclass(frozen=True, kw_only=True)
class Expect:
    """What a report about this traffic must say, no more and no less; the simulator does not look at it."""

    findings: dict[str, tuple[str, ...]] | None = key(  # noqa: RUF009
        mapping(array(TEXT)),
        'codes of findings by list, such as "udp/1202/7", or "udp/1202/7-9"; those of no list under "capture"',
        default=None,
    )
    counters: dict[str, dict[str, int]] | None = key(  # noqa: RUF009
        mapping(mapping(integer(-(2**31), 2**31))), "counters that are not 0, by list", default=None
    )
    writes: tuple[str, ...] = key(
        array(TEXT),
        "who writes which parameter, its old and new bytes, and what comes of it, in the order of the capture: "
        '"hmi -> press 0x2000:1: 2a 00 -> 2b 00, confirmed"; of an old value that nobody knows, ?',
        default=(),
    )
    page_writes: tuple[str, ...] = key(
        array(TEXT),
        'the same of pages and the variables of controllers: "hmi -> press PLC_PRG.n: 1 -> 2, confirmed"',
        default=(),
    )
    project: str = key(TEXT, "a project file that the report is made with: what it says of the plant", default="")


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A plant for some time, seen at one capture point."""

    title: str = key(TEXT, "what is happening, in a sentence", default="")
    seed: int = key(integer(0, 2**63 - 1), "another seed gives other chances", default=1)
    duration_ns: int = key(LENGTH, "how long is recorded", name="duration")
    start_ns: int = key(MOMENT, "time of the first moment", default=1_704_067_200_000_000_000, name="start")
    link: str = key(
        choice("ethernet", "sll", "sll2", "raw", "null", "loop"),
        "link layer of the capture, of what is not on CAN",
        default="ethernet",
    )
    snap_length: int = key(integer(0, 65_535), "bytes kept of each frame that is not of CAN; 0 keeps all", default=0)
    wild: bool = key(FLAG, "faults may meet; the truth about counters is then not exact", default=False)
    node: tuple[Node, ...] = key(tables(Node), "controllers and PCs; CAN does without", default=())
    list: tuple[ListPlan, ...] = key(tables(ListPlan), "network variables lists", default=())
    reader: tuple[Reader, ...] = key(tables(Reader), "who reads what", default=())
    parameter: tuple[ParameterRequests, ...] = key(
        tables(ParameterRequests), "requests of the Parameter Manager", default=()
    )
    page: tuple[Page, ...] = key(tables(Page), "pages of web visualizations", default=())
    traffic: tuple[Traffic, ...] = key(tables(Traffic), "foreign traffic", default=())
    bus: tuple[Bus, ...] = key(tables(Bus), "CAN buses", default=())
    can_list: tuple[CanList, ...] = key(tables(CanList), "network variables lists on CAN", default=())
    can_traffic: tuple[CanTraffic, ...] = key(tables(CanTraffic), "other frames on CAN", default=())
    error_frames: tuple[ErrorFrames, ...] = key(tables(ErrorFrames), "error frames of CAN", default=())
    bus_overload: tuple[BusOverload, ...] = key(tables(BusOverload), "CAN buses that are full", default=())
    bus_off: tuple[BusOff, ...] = key(tables(BusOff), "CAN controllers that leave the bus", default=())
    loss: tuple[Loss, ...] = key(tables(Loss), "lost telegrams", default=())
    fragmented: tuple[Fragmented, ...] = key(tables(Fragmented), "IP fragments", default=())
    duplicate: tuple[Duplicate, ...] = key(tables(Duplicate), "duplicates", default=())
    overtaken: tuple[Overtaken, ...] = key(tables(Overtaken), "overtaken telegrams", default=())
    late: tuple[Late, ...] = key(tables(Late), "late sendings", default=())
    truncated: tuple[Truncated, ...] = key(tables(Truncated), "telegrams cut by the capture", default=())
    wrong_checksum: tuple[WrongChecksum, ...] = key(tables(WrongChecksum), "wrong checksums", default=())
    checksum_flag: tuple[ChecksumFlag, ...] = key(tables(ChecksumFlag), "checksums without their flag", default=())
    reserved_flags: tuple[ReservedFlags, ...] = key(tables(ReservedFlags), "undocumented flags", default=())
    ascii_identity: tuple[AsciiIdentity, ...] = key(tables(AsciiIdentity), "identities in ASCII", default=())
    shape: tuple[Shape, ...] = key(tables(Shape), "changed definitions", default=())
    wrong_dlc: tuple[WrongDlc, ...] = key(tables(WrongDlc), "PDOs of another length", default=())
    malformed: tuple[Malformed, ...] = key(tables(Malformed), "malformed telegrams", default=())
    missing_acknowledgement: tuple[MissingAcknowledgement, ...] = key(
        tables(MissingAcknowledgement), "missing acknowledgements", default=()
    )
    negative_acknowledgement: tuple[NegativeAcknowledgement, ...] = key(
        tables(NegativeAcknowledgement), "negative acknowledgements", default=()
    )
    unexpected_acknowledgement: tuple[UnexpectedAcknowledgement, ...] = key(
        tables(UnexpectedAcknowledgement), "unexpected acknowledgements", default=()
    )
    unreachable: tuple[Unreachable, ...] = key(tables(Unreachable), "refused telegrams", default=())
    restart: tuple[Restart, ...] = key(tables(Restart), "restarts of nodes", default=())
    stop: tuple[Stop, ...] = key(tables(Stop), "senders that stop", default=())
    power_off: tuple[PowerOff, ...] = key(tables(PowerOff), "nodes without power", default=())
    unplugged: tuple[Unplugged, ...] = key(tables(Unplugged), "nodes without their cable", default=())
    held_back: tuple[HeldBack, ...] = key(tables(HeldBack), "lists whose reader is not found", default=())
    pause: tuple[Pause, ...] = key(tables(Pause), "senders that are held up", default=())
    burst: tuple[Burst, ...] = key(tables(Burst), "bursts", default=())
    second_sender: tuple[SecondSender, ...] = key(tables(SecondSender), "second senders of a list", default=())
    scan: tuple[Scan, ...] = key(tables(Scan), "hosts that look for lists", default=())
    clock_step: tuple[ClockStep, ...] = key(tables(ClockStep), "steps of the capture's clock", default=())
    mirrored: tuple[Mirrored, ...] = key(tables(Mirrored), "frames seen twice", default=())
    capture_loss: tuple[CaptureLoss, ...] = key(tables(CaptureLoss), "frames that the capture lacks", default=())
    definition: tuple[Definition, ...] = key(tables(Definition), "definitions of lists on UDP", default=())
    expect: Expect | None = key(table_of(Expect), "what a report must say", default=None)  # noqa: RUF009
    path: str = "scenario"

    def error(self, keys: str, what: str, next_step: str = "") -> ConfigurationError:
        """Return the error that something is wrong at a place of this scenario, such as ``loss[0]``."""
        return Place(self.path, keys).error(what, next_step)

    @cached_property
    def node_numbers(self) -> dict[str, int]:
        """The position of each node by its name."""
        return {node.name: position for position, node in enumerate(self.node)}

    @cached_property
    def list_numbers(self) -> dict[str, int]:
        """The position of each list by its name."""
        return {entry.name: position for position, entry in enumerate(self.list)}

    @cached_property
    def can_numbers(self) -> dict[str, int]:
        """The position of each list on CAN by its name."""
        return {entry.name: position for position, entry in enumerate(self.can_list)}

    @property
    def channels(self) -> tuple[str, ...]:
        """The CAN buses that any table names, in the order of their names."""
        tables = (self.bus, self.can_list, self.can_traffic, self.error_frames, self.bus_overload, self.bus_off)
        return tuple(sorted({entry.channel for table in tables for entry in table}))

    @property
    def has_network(self) -> bool:
        """Whether there is something else than CAN; nodes alone, which CAN has too, send nothing."""
        return not self.channels or bool(self.list or self.traffic or self.parameter or self.page)

    def rows(self) -> Iterator[tuple[str, int, object]]:
        """Yield every table of every array of tables, with the array's name and its position there."""
        for entry in fields(self):
            if "kind" in entry.metadata and entry.metadata["kind"].table is not None and entry.name != "expect":
                for position, row in enumerate(getattr(self, entry.name)):
                    yield entry.name, position, row

    def selections(self) -> Iterator[tuple[str, Selection]]:
        """Yield every fault that chooses telegrams, with its place in the file: ``loss[0]``."""
        for name, position, row in self.rows():
            if isinstance(row, Selection):
                yield f"{name}[{position}]", row
