"""The fields of all frames, and those of the protocols with them: name, type, label, help, and how to read a column.

One table for everything that names fields. Names are Wireshark's where it has the field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from dissectors.batch import Bool
from dissectors.headers import IPV4_HIGH, IPV4_LOW
from dissectors.headers import TCP as TCP_LAYOUT
from dissectors.headers import UDP as LAYOUT
from dissectors.transport import IpEnds
from nvscope.errors import UsageError
from nvscope.expression.names import nearest
from nvscope.expression.typed_columns import (
    AddressColumn,
    BytesColumn,
    FieldType,
    Named,
    Numbers,
)
from nvscope.expression.words import TableWords, Words, words_of
from nvscope.view.fields.can import CAN_FIELDS
from nvscope.view.fields.ethernet import ETHERNET_FIELDS
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.netvar import NETVAR_FIELDS
from nvscope.view.fields.other_frames import DEFAULT_OTHER, OTHER_FIELDS
from nvscope.view.fields.vlan import VLAN_FIELDS
from nvscope.view.rows.frames import IP, TCP, UDP, FrameRows


def _payload(rows: FrameRows) -> BytesColumn:
    start, stop = np.zeros(len(rows), np.int64), np.zeros(len(rows), np.int64)
    if found := rows.parts.get(UDP):
        at, datagrams = found.positions(len(rows)), found.part
        start[at] = datagrams.payload
        stop[at] = datagrams.payload + datagrams.captured_bytes
    return BytesColumn(rows.packets.data, start, stop)


def _ip_version(ends: IpEnds) -> Numbers:
    is_ipv4 = (ends.source_hi == IPV4_HIGH) & ((ends.source_lo & IPV4_LOW) == IPV4_LOW)
    return np.where(is_ipv4, np.uint8(4), np.uint8(6))


def _is_ipv6(ends: IpEnds) -> Bool:
    told: Bool = _ip_version(ends) == 6
    return told


def _source(ends: IpEnds) -> AddressColumn:
    return AddressColumn(ends.source_hi, ends.source_lo)


def _destination(ends: IpEnds) -> AddressColumn:
    return AddressColumn(ends.destination_hi, ends.destination_lo)


_UNSIGNED, _TIME, _DURATION, _ADDRESS = FieldType.UNSIGNED, FieldType.TIME, FieldType.DURATION, FieldType.ADDRESS

_IP_FIELDS = (
    TelegramField("ip.version", _UNSIGNED, "IP version", "4 or 6", _ip_version, of=IP, constant=True),
    TelegramField(
        "ip.src", _ADDRESS, "Source address", "IPv4 or IPv6 address of the sender", _source, of=IP, constant=True
    ),
    TelegramField(
        "ip.dst", _ADDRESS, "Destination address", "IPv4 or IPv6 address of the receiver", _destination, of=IP,
        constant=True,
    ),
    TelegramField(
        "ipv6.src", _ADDRESS, "IPv6 source address", "address of the sender, of IPv6 alone", _source, _is_ipv6, of=IP,
        constant=True,
    ),
    TelegramField(
        "ipv6.dst", _ADDRESS, "IPv6 destination address", "address of the receiver, of IPv6 alone", _destination,
        _is_ipv6, of=IP, constant=True,
    ),
)  # fmt: skip

_UDP_FIELDS = (
    TelegramField(
        "udp.srcport", _UNSIGNED, LAYOUT["source_port"].label, LAYOUT["source_port"].help,
        lambda datagrams: datagrams.source_port, of=UDP,
    ),
    TelegramField(
        "udp.dstport", _UNSIGNED, LAYOUT["destination_port"].label, LAYOUT["destination_port"].help,
        lambda datagrams: datagrams.destination_port, of=UDP, constant=True,
    ),
    TelegramField(
        "udp.length", _UNSIGNED, "UDP length", LAYOUT["length"].help,
        lambda datagrams: datagrams.payload_bytes + LAYOUT.size_bytes, of=UDP, constant=True,
    ),
    TelegramField(
        "udp.payload", FieldType.BYTES, "UDP payload", "captured bytes of header and data", _payload,
        lambda rows: rows.have(UDP),
    ),
)  # fmt: skip


def _tcp_port(name: str, column: str) -> TelegramField:
    return TelegramField(
        f"tcp.{name}", _UNSIGNED, f"{TCP_LAYOUT[column].label} of TCP", TCP_LAYOUT[column].help,
        lambda segments: getattr(segments, column), of=TCP, of_others=True,
    )  # fmt: skip


CARRIER_FIELDS = (
    TelegramField(
        "frame.number", _UNSIGNED, "Frame number", "place among all frames of the capture, from 1",
        lambda rows: rows.frame_number,
    ),
    TelegramField(
        "frame.time", _TIME, "Time", "when the frame was captured, ISO 8601 in UTC",
        lambda rows: rows.ts_ns, calendar=True,
    ),
    TelegramField(
        "frame.time_epoch", _TIME, "Epoch time", "seconds since 1970-01-01 UTC; in CSV and JSON ns, as ..._ns",
        lambda rows: rows.ts_ns,
    ),
    TelegramField(
        "frame.time_relative", _DURATION, "Time since the first frame", "seconds; in CSV and JSON ns, as ..._ns",
        lambda rows: rows.since_start_ns,
    ),
    TelegramField(
        "frame.time_delta", _DURATION, "Time since the previous frame", "seconds; in CSV and JSON ns, as ..._ns",
        lambda rows: rows.since_frame_ns,
    ),
    TelegramField(
        "frame.time_delta_displayed", _DURATION, "Time since the previous telegram shown",
        "seconds; in CSV and JSON ns, as ..._ns", lambda rows: rows.since_shown_ns,
    ),
    TelegramField(
        "frame.len", _UNSIGNED, "Frame length", "bytes on the wire",
        lambda rows: rows.packets.original[rows.row],
    ),
    TelegramField(
        "frame.cap_len", _UNSIGNED, "Captured length", "bytes of the frame that were captured",
        lambda rows: rows.packets.captured[rows.row],
    ),
    *ETHERNET_FIELDS,
    *VLAN_FIELDS,
    *_IP_FIELDS,
    *_UDP_FIELDS,
    _tcp_port("srcport", "source_port"),
    _tcp_port("dstport", "destination_port"),
)  # fmt: skip
"""The fields of all frames, and of what carries protocols."""

FIELDS = MappingProxyType(
    {field.name: field for field in (*CARRIER_FIELDS, *NETVAR_FIELDS, *CAN_FIELDS, *OTHER_FIELDS)}
)
"""All fields by name, in the order in which they are listed."""

DEFAULT_CAN_FIELDS = (FIELDS["frame.number"], FIELDS["frame.time"], *CAN_FIELDS)
"""What is written of CAN logs where nobody says which fields are wanted."""

DEFAULT_FIELDS = (
    FIELDS["frame.number"],
    FIELDS["frame.time"],
    FIELDS["ip.src"],
    FIELDS["udp.srcport"],
    FIELDS["ip.dst"],
    FIELDS["udp.dstport"],
    *NETVAR_FIELDS,
)
"""What is written of other captures where nobody says which fields are wanted."""

DEFAULT_ALL_FIELDS = (
    FIELDS["frame.number"],
    FIELDS["frame.time"],
    FIELDS["frame.len"],
    FIELDS["eth.src"],
    FIELDS["eth.dst"],
    FIELDS["eth.type"],
    *DEFAULT_FIELDS[2:],
    FIELDS["tcp.srcport"],
    FIELDS["tcp.dstport"],
    *DEFAULT_OTHER,
)
"""What is written of other captures where all frames are wanted, and nobody says which fields are."""

EITHER_OF = MappingProxyType(
    {
        "eth.addr": ("eth.src", "eth.dst"), "ip.addr": ("ip.src", "ip.dst"), "ipv6.addr": ("ipv6.src", "ipv6.dst"),
        "udp.port": ("udp.srcport", "udp.dstport"), "tcp.port": ("tcp.srcport", "tcp.dstport"),
    }
)  # fmt: skip
"""Names that expressions know beside the fields: each stands for the fields of both sides."""

PROTOCOL_TESTS = MappingProxyType(
    {
        "frame": "frame.number", "eth": "eth.dst", "vlan": "vlan.id", "ieee8021ad": "ieee8021ad.id",
        "ip": "ip.version == 4", "ipv6": "ip.version == 6", "udp": "udp.dstport", "tcp": "tcp.dstport", "nv": "nv.id",
        "can": "can.channel", "canfd": "can.fd", "canopen": "canopen.function",
    }
)  # fmt: skip
"""Names of protocols, each with the expression that chooses the telegrams that have it; as in Wireshark, ``ip`` is
version 4 alone."""


_FURTHER = "\0"


class _Names(Words[Named]):
    """What an expression may name: the fields there are, and what stands for several of them or for a test."""

    def __init__(self, fields: Words[TelegramField]) -> None:
        self._fields = fields
        self._further = TableWords(
            {
                **{name: Named(fields[parts[0]].type, parts) for name, parts in EITHER_OF.items()},
                **{name: Named(FieldType.BOOL, test=test) for name, test in PROTOCOL_TESTS.items()},
                "frame.time_delta_displayed": Named(_DURATION, refused="what is displayed is still to be decided"),
            }
        )

    def spelled(self, text: str) -> str | None:
        found = self._further.spelled(text)
        return self._fields.spelled(text) if found is None else found

    def __getitem__(self, name: str) -> Named:
        if name in self._further:
            return self._further[name]
        field = self._fields[name]
        return Named(
            field.type,
            _every(field) if field.further else (),
            values=field.values,
            texts=field.texts,
            refused=field.refused,
            instead=field.instead,
            lasts=bool(field.sent_in),
            counts=field.counts,
            any_case=field.any_case,
        )

    def __iter__(self) -> Iterator[str]:
        yield from self._further
        yield from (name for name in self._fields if name not in self._further)


def _every(field: TelegramField) -> tuple[str, ...]:
    """Return what expressions read of a field that a frame may have several times: what nobody can write, but one."""
    return (field.name, *(f"{field.name}{_FURTHER}{place}" for place in range(len(field.further))))


def field_read(name: str, fields: Mapping[str, TelegramField]) -> TelegramField:
    """Return the field that an expression reads under a name, be it a further one of those a frame has."""
    name, further, place = name.partition(_FURTHER)
    return fields[name].further[int(place)] if further else fields[name]


def expression_names(fields: Mapping[str, TelegramField]) -> Words[Named]:
    """Return what an expression may name, given the fields there are."""
    return _Names(words_of(fields))


def output_field(
    name: str, fields: Mapping[str, TelegramField] = FIELDS, *, all_frames: bool = False
) -> TelegramField:  # fmt: skip
    """Return the field of a name, in any case, that -e may name; UsageError, with the nearest names, where none is.

    ``all_frames``: it may be one that only frames have in which no protocol is found that is looked for.
    """
    wanted = "".join(name.split())
    if not wanted:
        raise UsageError("the name of a field is empty", next_step="`nvscope keys --fields` lists all fields")
    spelled = words_of(fields).spelled(wanted)
    if spelled is None:
        if parts := EITHER_OF.get(wanted.lower()):
            raise UsageError(f"{name.strip()} is for -Y only", next_step=f"write -e {' -e '.join(parts)}")
        raise UsageError(f"no field is called {name}", next_step=nearest(name, fields))
    field = fields[spelled]
    if field.refused:
        raise UsageError(f"{field.name}: {field.refused}", next_step=field.instead)
    if field.of_others and not all_frames:
        raise of_others([field.name])
    if field.judged:
        raise UsageError(
            f"{field.name} is for -Y only: it is known when the whole capture was read",
            next_step="`nvscope report --json` tells it",
        )
    return field


def of_others(names: Sequence[str]) -> UsageError:
    """Return that fields of frames that are no telegrams were asked for where only telegrams are looked at."""
    return UsageError(
        f"{', '.join(names)}: no telegram has it",
        next_step="`nvscope packets` shows frames of all kinds, and filters them",
    )
