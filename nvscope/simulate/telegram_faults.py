"""Telegram faults: what goes wrong with telegrams that a scenario chooses, as its tables."""

from __future__ import annotations

from dataclasses import dataclass

from dissectors.can.frame import MAX_DATA_BYTES as MAX_PDO_BYTES
from nvscope.simulate.plan import MAX_DATA_BYTES, U8_MAX, U16_MAX
from nvscope.toml_table import LENGTH, TEXT, array, choice, integer, key, number


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
