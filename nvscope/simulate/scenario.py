"""Scenario: a plant, its traffic and what goes wrong in it, as a file that can be read without running it.

A scenario is TOML. ``[[node]]``, ``[[list]]`` and ``[[reader]]`` describe who sends what to whom over UDP, ``[[bus]]``
and ``[[can_list]]`` what is sent over CAN; every other array of tables is a kind of fault or of foreign traffic. The
dataclasses below, and those of ``plan``, ``telegram_faults`` and ``incidents``, are the table of all keys: reading,
messages and ``scenario_file.document`` come from them.

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

from dissectors.netvar import PARAMETER_ERRORS
from nvscope.errors import ConfigurationError
from nvscope.simulate.can.tables import Bus, BusOff, BusOverload, CanList, CanTraffic, ErrorFrames
from nvscope.simulate.incidents import (
    Burst,
    CaptureLoss,
    ClockStep,
    HeldBack,
    Mirrored,
    Pause,
    PowerOff,
    Restart,
    Scan,
    SecondSender,
    Stop,
    Unplugged,
)
from nvscope.simulate.plan import MAX_DATA_BYTES, U16_MAX, ListPlan, Node, Reader
from nvscope.simulate.telegram_faults import (
    AsciiIdentity,
    ChecksumFlag,
    Duplicate,
    Fragmented,
    Late,
    Loss,
    Malformed,
    MissingAcknowledgement,
    NegativeAcknowledgement,
    Overtaken,
    ReservedFlags,
    Selection,
    Shape,
    Truncated,
    UnexpectedAcknowledgement,
    Unreachable,
    WrongChecksum,
    WrongDlc,
)
from nvscope.simulate.visu.tables import Page
from nvscope.toml_table import (
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
    table_of,
    tables,
)

ON_CAN = (Loss, Late, WrongDlc, Stop, Pause, Burst)
"""The faults of a list on CAN."""


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
