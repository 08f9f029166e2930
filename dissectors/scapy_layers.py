"""The same tables as Scapy layers: for the prompt and for crafting, never for the bulk path.

>>> from dissectors.scapy_layers import NetVar
>>> telegram = IP(dst="255.255.255.255") / UDP() / NetVar(index=7, items=1) / b"\\x2a\\x00"

Importing this module binds the layers to their UDP ports.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from scapy import fields as sf
from scapy.config import conf
from scapy.layers.inet import UDP
from scapy.packet import Packet, bind_bottom_up, bind_top_down

from dissectors.layout import Field, Layout
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, PORT

# numpy type -> the Scapy classes of a decimal, a hexadecimal and a named number
_NUMBERS: dict[str, tuple[Any, Any, Any]] = {
    "|u1": (sf.ByteField, sf.XByteField, sf.ByteEnumField),
    "<u2": (sf.LEShortField, sf.XLEShortField, sf.LEShortEnumField),
    "<u4": (sf.LEIntField, sf.XLEIntField, sf.LEIntEnumField),
    "<u8": (sf.LELongField, sf.XLELongField, sf.LELongEnumField),
}


def scapy_fields(layout: Layout, computed: Collection[str] = ()) -> list[sf.AnyField]:
    """Derive Scapy's ``fields_desc`` from a layout, in the order of the wire.

    The ``computed`` fields default to None, which is Scapy's word for "filled in when the packet is built".
    Raises TypeError for a field whose dtype is not an unsigned little-endian number.
    """
    return [_scapy_field(entry, None if entry.name in computed else entry.default) for entry in layout]


def _scapy_field(entry: Field, default: int | None) -> sf.AnyField:
    dtype = np.dtype(entry.dtype)
    if dtype.str not in _NUMBERS:
        raise TypeError(f"field {entry.name}: Scapy has no layer field for {entry.dtype}")
    decimal, hexadecimal, named = _NUMBERS[dtype.str]
    if entry.bits:
        width = dtype.itemsize * 8
        names = {bit.position: bit.name for bit in entry.bits}
        # a negative width is Scapy's notation for little-endian; one byte has no byte order
        return sf.FlagsField(
            entry.name, default, width if width == 8 else -width, [names.get(n, f"bit{n}") for n in range(width)]
        )
    if entry.values:
        field: sf.AnyField = named(entry.name, default, dict(entry.values))
    else:
        field = (hexadecimal if entry.base == "hex" else decimal)(entry.name, default)
    return field


_IDENTITIES = tuple(number.to_bytes(HEADER["identity"].size_bytes, "little") for number in (IDENTITY, IDENTITY_ASCII))


class NetVar(Packet):
    """A 3S-0 telegram: the fields of ``dissectors.netvar.HEADER``, its data as payload.

    ``length`` is computed where it is not given. Bytes that are shorter than the header or begin with another
    identity dissect as Raw. All bytes behind the header are payload, whatever ``length`` says.
    """

    name = "NetVar"
    fields_desc = scapy_fields(HEADER, computed=("length",))

    @classmethod
    def dispatch_hook(cls, _pkt: bytes | None = None, *args: Any, **kwargs: Any) -> type[Packet]:
        """Choose Raw for bytes that are no telegram; called by Scapy before it dissects."""
        if _pkt is None or (len(_pkt) >= HEADER.size_bytes and _pkt.startswith(_IDENTITIES)):
            return cls
        raw: type[Packet] = conf.raw_layer
        return raw

    def post_build(self, pkt: bytes, pay: bytes) -> bytes:
        """Fill in ``length`` where it is not given; raises OverflowError for more than 65535 bytes."""
        if self.length is None:
            start = HEADER.offset_of("length")
            size = HEADER["length"].size_bytes
            pkt = pkt[:start] + (len(pkt) + len(pay)).to_bytes(size, "little") + pkt[start + size :]
        return pkt + pay

    def mysummary(self) -> str:
        return self.sprintf("NetVar %NetVar.id% list %NetVar.index%/%NetVar.subindex% counter %NetVar.counter%")


bind_top_down(UDP, NetVar, sport=PORT, dport=PORT)
# In front of Scapy's own bindings: PC senders take any source port, also one that Scapy binds to another protocol.
UDP.payload_guess.insert(0, ({"dport": PORT}, NetVar))
bind_bottom_up(UDP, NetVar, sport=PORT)
