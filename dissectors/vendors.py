"""Who made a device, by the first bytes of its hardware address: the table of the IEEE that comes with Scapy."""

from __future__ import annotations

_BLOCKS = (36, 28)
"""The smaller blocks that the IEEE assigns, in bits; all others are of 24."""

_MOST_CHARACTERS = 40


def vendor_of(hardware: int) -> str:
    """Return the vendor of a hardware address, "" where nobody knows: of a local one, or of one that is no device's."""
    if hardware >> 40 & 0b11:
        return ""
    text = hardware.to_bytes(6, "big").hex(":").upper()
    table = _table()
    for bits in _BLOCKS:
        block = (hardware >> 48 - bits << 48 - bits).to_bytes(6, "big")[: -(-bits // 8)].hex(":").upper()
        if found := _line(table, f"\n{block}/{bits}"):
            return found
    return _line(table, f"\n{text[:8]}")


def _table() -> str:
    """Return the table, with a line a block: its beginning, a short name, and the name; "" where Scapy has none."""
    try:
        from scapy.libs.manuf import DATA  # noqa: PLC0415
    except ImportError:
        return ""
    return DATA if isinstance(DATA, str) else ""


def _line(table: str, begin: str) -> str:
    at = table.find(begin)
    columns = table[at + 1 : max(table.find("\n", at + 1), at)].split("\t") if at >= 0 else []
    if len(columns) < 2 or columns[0].strip() != begin[1:]:
        return ""
    name = " ".join(columns[-1].split()).rstrip(" ,.")
    return name if name.isprintable() and len(name) <= _MOST_CHARACTERS else " ".join(columns[1].split())
