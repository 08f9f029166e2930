"""What the bytes of an element mean."""

from __future__ import annotations

import struct

from nvscope.definition.variables import Elementary, ScalarKind, String, scalar_of

Value = bool | int | float | str | bytes
"""Of a BOOL, a number, a string, or of what nobody has described; times are numbers in the type's unit."""


def value_of(kind: Elementary, raw: bytes) -> Value:
    """Return the value of an element; ``raw`` are its bytes, as many as the type has. No bytes raise.

    A string ends at its first NUL; what follows are leftovers. Bytes of STRING are ISO-8859-1, of WSTRING UTF-16LE,
    where half a character becomes U+FFFD.
    """
    if isinstance(kind, String):
        text = raw.decode("utf-16-le", errors="replace") if kind.wide else raw.decode("iso-8859-1")
        return text.partition("\0")[0]
    scalar = scalar_of(kind)
    if scalar is None or scalar.kind is ScalarKind.RAW:
        return bytes(raw)
    if scalar.kind is ScalarKind.BOOL:
        return any(raw)
    if scalar.kind is ScalarKind.REAL:
        number: float = struct.unpack("<f" if scalar.size_bytes == 4 else "<d", raw)[0]
        return number
    return int.from_bytes(raw, "little", signed=scalar.kind is ScalarKind.SIGNED)
