"""The fields of telegrams and CAN frames: name, type, label, help, and how to read one as a column.

One table for everything that names fields. Names are Wireshark's where it has the field; ``nv.*`` comes from the header
table (``dissectors.netvar.HEADER``), a column for each of its fields and for each bit that has a name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.headers import IPV4_HIGH, IPV4_LOW, UDP
from dissectors.layout import Bit, Field
from dissectors.netvar import HEADER, KNOWN_SERVICE, LEAST_CAPTURED_BYTES, Fault
from nvscope.errors import UsageError
from nvscope.expression.columns import (
    AddressColumn,
    BytesColumn,
    FieldType,
    Named,
    Numbers,
    TextColumn,
)
from nvscope.expression.names import nearest
from nvscope.view.escape import visible
from nvscope.view.fields.can import CAN_FIELDS
from nvscope.view.fields.field import TelegramField, on_udp
from nvscope.view.rows.frames import TelegramRows


def _header_fields() -> Iterator[TelegramField]:
    for entry in HEADER:
        name = f"{HEADER.name}.{entry.name}"
        known = _captured_to(HEADER.offset_of(entry.name) + entry.size_bytes)
        yield TelegramField(
            name, FieldType.UNSIGNED, entry.label, entry.help, _header_column(entry), known,
            hex_digits=2 * entry.size_bytes if entry.base == "hex" else 0, constant=entry.name != "counter",
            values={text: number for number, text in entry.values.items()},
        )  # fmt: skip
        for bit in entry.bits:
            help_text = f"bit {bit.position} of {entry.label}"
            yield TelegramField(
                f"{name}.{bit.name}",
                FieldType.BOOL,
                bit.label,
                help_text,
                _bit_column(entry, bit),
                known,
                constant=True,
            )
        if entry.name == "id":
            yield TelegramField(
                "nv.service", FieldType.TEXT, "Service", f"name of the service that {entry.label} stands for",
                _service, _service_known, constant=True,
            )  # fmt: skip


def _header_column(entry: Field) -> Callable[[TelegramRows], Numbers]:
    return lambda rows: rows.telegrams.header[entry.name]


def _bit_column(entry: Field, bit: Bit) -> Callable[[TelegramRows], Bool]:
    mask = np.uint64(bit.mask)
    return lambda rows: (rows.telegrams.header[entry.name] & mask) != 0


def _captured_to(end: int) -> Callable[[TelegramRows], Bool | None]:
    """Return what tells in which telegrams the first ``end`` bytes of the payload exist and were captured."""
    if end <= LEAST_CAPTURED_BYTES:
        return lambda _: None
    return lambda rows: rows.telegrams.datagram.captured_bytes >= end


_SERVICES = tuple(HEADER["id"].values.get(number, "") for number in range(len(KNOWN_SERVICE)))


def _service_code(rows: TelegramRows) -> I64:
    code: I64 = np.minimum(rows.telegrams.header["id"], len(KNOWN_SERVICE) - 1).astype(np.int64)
    return code


def _service(rows: TelegramRows) -> TextColumn:
    return TextColumn(_service_code(rows), _SERVICES)


def _service_known(rows: TelegramRows) -> Bool:
    known: Bool = KNOWN_SERVICE[_service_code(rows)]
    return known


_FAULTS = tuple("" if fault is Fault.NONE else fault.name.lower().replace("_", "-") for fault in Fault)


def _fault(rows: TelegramRows) -> TextColumn:
    return TextColumn(rows.telegrams.fault.astype(np.int64), _FAULTS)


def _has_fault(rows: TelegramRows) -> Bool:
    has_fault: Bool = rows.telegrams.fault != Fault.NONE
    return has_fault


def _payload(rows: TelegramRows) -> BytesColumn:
    return _bytes_after(rows, 0)


def _data(rows: TelegramRows) -> BytesColumn:
    return _bytes_after(rows, HEADER.size_bytes)


def _bytes_after(rows: TelegramRows, begin: int) -> BytesColumn:
    datagram = rows.telegrams.datagram
    stop = datagram.payload + datagram.captured_bytes
    return BytesColumn(rows.telegrams.data, np.minimum(datagram.payload + begin, stop), stop)


def _ip_version(rows: TelegramRows) -> Numbers:
    datagram = rows.telegrams.datagram
    is_ipv4 = (datagram.source_hi == IPV4_HIGH) & ((datagram.source_lo & IPV4_LOW) == IPV4_LOW)
    return np.where(is_ipv4, np.uint8(4), np.uint8(6))


def _source(rows: TelegramRows) -> AddressColumn:
    return AddressColumn(rows.telegrams.datagram.source_hi, rows.telegrams.datagram.source_lo)


def _destination(rows: TelegramRows) -> AddressColumn:
    return AddressColumn(rows.telegrams.datagram.destination_hi, rows.telegrams.datagram.destination_lo)


_UNSIGNED, _TIME, _DURATION, _ADDRESS = FieldType.UNSIGNED, FieldType.TIME, FieldType.DURATION, FieldType.ADDRESS

_UDP_TABLE: tuple[TelegramField, ...] = (
    TelegramField("ip.version", _UNSIGNED, "IP version", "4 or 6", _ip_version, constant=True),
    TelegramField("ip.src", _ADDRESS, "Source address", "IPv4 or IPv6 address of the sender", _source, constant=True),
    TelegramField(
        "ip.dst", _ADDRESS, "Destination address", "IPv4 or IPv6 address of the receiver", _destination, constant=True
    ),
    TelegramField(
        "udp.srcport", _UNSIGNED, UDP["source_port"].label, UDP["source_port"].help,
        lambda rows: rows.telegrams.datagram.source_port,
    ),
    TelegramField(
        "udp.dstport", _UNSIGNED, UDP["destination_port"].label, UDP["destination_port"].help,
        lambda rows: rows.telegrams.datagram.destination_port, constant=True,
    ),
    TelegramField(
        "udp.length", _UNSIGNED, "UDP length", UDP["length"].help,
        lambda rows: rows.telegrams.datagram.payload_bytes + UDP.size_bytes, constant=True,
    ),
    TelegramField("udp.payload", FieldType.BYTES, "UDP payload", "captured bytes of header and data", _payload),
    *_header_fields(),
    TelegramField(
        "nv.data", FieldType.BYTES, "Data", "captured bytes behind the header",
        _data, _captured_to(HEADER.size_bytes),
    ),
    TelegramField(
        "nv.fault", FieldType.TEXT, "Fault",
        "what is wrong with the telegram: " + ", ".join(filter(None, _FAULTS)), _fault, _has_fault, constant=True,
    ),
    TelegramField(
        "nv.truncated", FieldType.BOOL, "Truncated", "fewer bytes were captured than the payload has",
        lambda rows: rows.telegrams.truncated, constant=True,
    ),
    TelegramField(
        "nv.broadcast", FieldType.BOOL, "Broadcast", "sent to everybody or to a multicast group, not to one node",
        lambda rows: rows.telegrams.datagram.broadcast, constant=True,
    ),
)  # fmt: skip

_TABLE = (
    TelegramField(
        "frame.number", _UNSIGNED, "Frame number", "place among all frames of the capture, from 1",
        lambda rows: rows.frame_number,
    ),
    TelegramField(
        "frame.time", _TIME, "Time", "when the frame was captured, ISO 8601 in UTC",
        lambda rows: rows.telegrams.ts_ns, calendar=True,
    ),
    TelegramField(
        "frame.time_epoch", _TIME, "Epoch time", "seconds since 1970-01-01 UTC; in JSON nanoseconds as a string",
        lambda rows: rows.telegrams.ts_ns,
    ),
    TelegramField(
        "frame.time_relative", _DURATION, "Time since the first frame", "seconds; in JSON nanoseconds",
        lambda rows: rows.since_start_ns,
    ),
    TelegramField(
        "frame.time_delta", _DURATION, "Time since the previous frame", "seconds; in JSON nanoseconds",
        lambda rows: rows.since_frame_ns,
    ),
    TelegramField(
        "frame.time_delta_displayed", _DURATION, "Time since the previous telegram shown",
        "seconds; in JSON nanoseconds", lambda rows: rows.since_shown_ns,
    ),
    TelegramField(
        "frame.len", _UNSIGNED, "Frame length", "bytes on the wire",
        lambda rows: rows.packets.original[rows.telegrams.datagram.row],
    ),
    TelegramField(
        "frame.cap_len", _UNSIGNED, "Captured length", "bytes of the frame that were captured",
        lambda rows: rows.packets.captured[rows.telegrams.datagram.row],
    ),
    *map(on_udp, _UDP_TABLE),
    *CAN_FIELDS,
)  # fmt: skip

FIELDS = MappingProxyType({field.name: field for field in _TABLE})
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
    *(field for field in _TABLE if field.name.startswith(f"{HEADER.name}.")),
)
"""What is written of other captures where nobody says which fields are wanted."""

EITHER_OF = MappingProxyType({"ip.addr": ("ip.src", "ip.dst"), "udp.port": ("udp.srcport", "udp.dstport")})
"""Names that expressions know beside the fields: each stands for the fields of both sides."""

PROTOCOLS = MappingProxyType(
    {
        "frame": "frame.number", "ip": "ip.version == 4", "ipv6": "ip.version == 6", "udp": "ip.version",
        "nv": "ip.version", "can": "can.id", "canfd": "can.fd", "canopen": "canopen.function",
    }
)  # fmt: skip
"""Names of protocols, each with the expression that chooses the telegrams that have it; as in Wireshark, ``ip`` is
version 4 alone."""


def expression_names(fields: Mapping[str, TelegramField]) -> dict[str, Named]:
    """Return what an expression may name, given the fields there are."""
    return {
        **{
            name: Named(field.type, values=field.values, refused=visible(field.refused), instead=visible(field.instead))
            for name, field in fields.items()
        },
        **{name: Named(fields[parts[0]].type, parts) for name, parts in EITHER_OF.items()},
        **{name: Named(FieldType.BOOL, test=test) for name, test in PROTOCOLS.items()},
        "frame.time_delta_displayed": Named(_DURATION, refused="what is displayed is still to be decided"),
    }


def output_field(name: str, fields: Mapping[str, TelegramField] = FIELDS) -> TelegramField:
    """Return the field of a name, in any case, that -e may name; UsageError, with the nearest names, where none is."""
    wanted = "".join(name.split())
    field = fields.get(wanted) or {known.lower(): one for known, one in fields.items()}.get(wanted.lower())
    if field is None:
        if parts := EITHER_OF.get(wanted.lower()):
            raise UsageError(f"{name.strip()} is for -Y only", next_step=f"write -e {' -e '.join(parts)}")
        raise UsageError(f"no field is called {visible(name)!s}", next_step=nearest(name, fields))
    if field.refused:
        raise UsageError(f"{field.name}: {visible(field.refused)!s}", next_step=visible(field.instead))
    if field.judged:
        raise UsageError(
            f"{field.name} is for -Y only: it is known when the whole capture was read",
            next_step="`nvscope report --json` tells it",
        )
    return field
