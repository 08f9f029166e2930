"""The fields of telegrams: ``nv.index``, ``nv.flags.ack``, ``nv.data``.

They come from the header table (``dissectors.netvar.HEADER``), a column for each of its fields and for each bit that
has a name; what is read is the protocol's part, a ``TelegramBatch``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.layout import Bit, Field
from dissectors.netvar import HEADER, KNOWN_SERVICE, LEAST_CAPTURED_BYTES, Fault, TelegramBatch
from nvscope.expression.typed_columns import BytesColumn, FieldType, Numbers, TextColumn
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import NETVAR


def _header_fields() -> Iterator[TelegramField]:
    for entry in HEADER:
        name = f"{HEADER.name}.{entry.name}"
        known = _captured_to(HEADER.offset_of(entry.name) + entry.size_bytes)
        yield TelegramField(
            name, FieldType.UNSIGNED, entry.label, entry.help, _header_column(entry), known,
            of=NETVAR, hex_digits=2 * entry.size_bytes if entry.base == "hex" else 0, constant=entry.name != "counter",
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
                of=NETVAR,
                constant=True,
            )
        if entry.name == "id":
            yield TelegramField(
                "nv.service", FieldType.TEXT, "Service", f"name of the service that {entry.label} stands for",
                _service, _service_known, of=NETVAR, constant=True, texts=tuple(filter(None, _SERVICES)),
            )  # fmt: skip


def _header_column(entry: Field) -> Callable[[TelegramBatch], Numbers]:
    return lambda telegrams: telegrams.header[entry.name]


def _bit_column(entry: Field, bit: Bit) -> Callable[[TelegramBatch], Bool]:
    mask = np.uint64(bit.mask)
    return lambda telegrams: (telegrams.header[entry.name] & mask) != 0


def _captured_to(end: int) -> Callable[[TelegramBatch], Bool | None]:
    """Return what tells in which telegrams the first ``end`` bytes of the payload exist and were captured."""
    if end <= LEAST_CAPTURED_BYTES:
        return lambda _: None
    return lambda telegrams: telegrams.datagram.captured_bytes >= end


_SERVICES = tuple(HEADER["id"].values.get(number, "") for number in range(len(KNOWN_SERVICE)))


def _service_code(telegrams: TelegramBatch) -> I64:
    code: I64 = np.minimum(telegrams.header["id"], len(KNOWN_SERVICE) - 1).astype(np.int64)
    return code


def _service(telegrams: TelegramBatch) -> TextColumn:
    return TextColumn(_service_code(telegrams), _SERVICES)


def _service_known(telegrams: TelegramBatch) -> Bool:
    known: Bool = KNOWN_SERVICE[_service_code(telegrams)]
    return known


_FAULTS = tuple("" if fault is Fault.NONE else fault.name.lower().replace("_", "-") for fault in Fault)


def _fault(telegrams: TelegramBatch) -> TextColumn:
    return TextColumn(telegrams.fault.astype(np.int64), _FAULTS)


def _has_fault(telegrams: TelegramBatch) -> Bool:
    has_fault: Bool = telegrams.fault != Fault.NONE
    return has_fault


def _data(telegrams: TelegramBatch) -> BytesColumn:
    datagrams = telegrams.datagram
    stop = datagrams.payload + datagrams.captured_bytes
    return BytesColumn(telegrams.data, np.minimum(datagrams.payload + HEADER.size_bytes, stop), stop)


NETVAR_FIELDS = (
    *_header_fields(),
    TelegramField(
        "nv.data", FieldType.BYTES, "Data", "captured bytes behind the header",
        _data, _captured_to(HEADER.size_bytes), of=NETVAR,
    ),
    TelegramField(
        "nv.fault", FieldType.TEXT, "Fault",
        "what is wrong with the telegram: " + ", ".join(filter(None, _FAULTS)), _fault, _has_fault, of=NETVAR,
        constant=True, texts=tuple(filter(None, _FAULTS)),
    ),
    TelegramField(
        "nv.truncated", FieldType.BOOL, "Truncated", "fewer bytes were captured than the payload has",
        lambda telegrams: telegrams.truncated, of=NETVAR, constant=True,
    ),
    TelegramField(
        "nv.broadcast", FieldType.BOOL, "Broadcast", "sent to everybody or to a multicast group, not to one node",
        lambda telegrams: telegrams.datagram.broadcast, of=NETVAR, constant=True,
    ),
)  # fmt: skip
