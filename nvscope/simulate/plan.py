"""Plan of a plant: its nodes, the lists that they send, and who reads these, as tables of a scenario."""

from __future__ import annotations

from dataclasses import dataclass

from nvscope.list_key import ListKey
from nvscope.toml_table import FLAG, LENGTH, TEXT, array, choice, integer, key

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
