"""What logs say of an error frame, as SocketCAN says it: the class in the identifier, the detail in eight data bytes.

The identifier that most logs tell beside an error frame is that of the frame it disturbed, and no class. What a log
does not tell stays 0: no class, type or place. Sources: ``linux/can/error.h``; for Vector's ``.asc`` and ``.blf`` the
comments of Technica-Engineering/vector_blf (``CanErrorFrameExt.h``) and of Wireshark's ``wiretap/blf.h``; for ``.trc``
"PEAK CAN TRC File Format" (2020), "Error Frames"; for ``.mf4`` ASAM MDF 4 "Bus Logging", ``CAN_ErrorFrame.ErrorType``.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from dissectors.can.error import CLASSES, COUNTERS, DETAIL, LOCATIONS, PROTOCOL, PROTOCOL_BITS
from nvscope.capture.can.frame import ERROR

NO_ACKNOWLEDGEMENT = CLASSES[5].mask
_BIT, _FORM, _STUFF = (PROTOCOL_BITS[position].mask for position in range(3))
_OVERLOAD, _SENDING = PROTOCOL_BITS[5].mask, PROTOCOL_BITS[7].mask
_AT_CRC, _AT_ACKNOWLEDGE_DELIMITER = 0x08, 0x1B


class ErrorFrame(NamedTuple):
    """What is known of an error: ``classes``, and of ``DETAIL`` these three; ``counters`` or None."""

    classes: int = 0
    protocol: int = 0
    location: int = 0
    counters: tuple[int, int] | None = None
    controller: int = 0

    @property
    def identifier(self) -> int:
        """The word that stands for it in a frame."""
        return ERROR | self.classes | (COUNTERS if self.counters else 0)

    @property
    def data(self) -> bytes:
        """The eight bytes of detail."""
        sent, received = self.counters or (0, 0)
        detail = {
            "controller": self.controller, "protocol": self.protocol, "location": self.location, "tx_errors": sent,
            "rx_errors": received,
        }  # fmt: skip
        return bytes(detail.get(field.name, 0) for field in DETAIL)


UNTOLD = ErrorFrame()
"""An error frame of which nothing more is known."""

OVERLOADED = ErrorFrame(PROTOCOL, _OVERLOAD)
"""A frame by which a node asks for time."""

# What Vector's CAN core calls an error; those left out are "other errors".
_CORE_ERRORS: Mapping[int, ErrorFrame] = MappingProxyType(
    {
        0: ErrorFrame(PROTOCOL, _BIT),
        1: ErrorFrame(PROTOCOL, _FORM),
        2: ErrorFrame(PROTOCOL, _STUFF),
        4: ErrorFrame(PROTOCOL, location=_AT_CRC),
        5: ErrorFrame(PROTOCOL, location=_AT_ACKNOWLEDGE_DELIMITER),
        7: ErrorFrame(NO_ACKNOWLEDGEMENT),
        8: OVERLOADED,
        9: ErrorFrame(PROTOCOL, _BIT),
    }
)
_SJA_ERRORS = (_BIT, _FORM, _STUFF, 0)
_PEAK_ERRORS = {1: _BIT, 2: _FORM, 4: _STUFF, 8: 0}
_MDF_ERRORS = (
    UNTOLD, _CORE_ERRORS[0], _CORE_ERRORS[1], _CORE_ERRORS[2], _CORE_ERRORS[4], _CORE_ERRORS[7],
)  # fmt: skip

SJA_VALID, CORE_VALID = 1, 2
"""The bits of Vector's flags that say what its ``ecc`` holds: the register of an SJA1000, or of the CAN core."""


def of_vector(flags: int, ecc: int, code: int) -> ErrorFrame:
    """Return what the fields of a ``CAN_ERROR_EXT`` or ``CAN_FD_ERROR_64`` tell.

    ``flags`` say what ``ecc`` is: the register of an SJA1000, or that of Vector's CAN core, with the error in bits 0 to
    5, and in bits 6 and 7 whether it met a receiver (0, 2) or a sender (1, 3), and whether it was a missing
    acknowledgement (0, 1). ``code`` ("flagsExt", "CodeExt") repeats error and direction from bit 6 on, but older
    programs leave it 0; it is asked where ``ecc`` is 0. Where both are, nobody filled them in.
    """
    if flags & CORE_VALID:
        register = ecc or code >> 6 & 0xFF
        return _of_core(register & 0x3F, register >> 6) if register else UNTOLD
    return of_sja1000(ecc) if flags & SJA_VALID else UNTOLD


def _of_core(error: int, way: int) -> ErrorFrame:
    found = _CORE_ERRORS[7] if way < 2 else _CORE_ERRORS.get(error, ErrorFrame(PROTOCOL))
    if found.classes == PROTOCOL and way == 3:
        return found._replace(protocol=found.protocol | _SENDING)
    return found


def of_sja1000(ecc: int) -> ErrorFrame:
    """Return what the error code capture register of an SJA1000 tells: kind, direction (0 sending), segment."""
    sending = 0 if ecc & 0x20 else _SENDING
    return ErrorFrame(PROTOCOL, _SJA_ERRORS[ecc >> 6] | sending, _known_location(ecc & 0x1F))


def of_peak(kind: int, data: bytes) -> ErrorFrame:
    """Return what an error of a .trc of version 1 tells: kind by bits, data: direction, segment and two counters.

    The counters are that of receive errors, then that of transmit errors.
    """
    if kind not in _PEAK_ERRORS or len(data) < 2:
        return UNTOLD
    sending = _SENDING if data[0] == 0 else 0
    counters = (data[3], data[2]) if len(data) >= 4 else None
    return ErrorFrame(PROTOCOL, _PEAK_ERRORS[kind] | sending, _known_location(data[1]), counters)


def of_mdf(kind: int) -> ErrorFrame:
    """Return what a number of ``CAN_ErrorFrame.ErrorType`` says."""
    return _MDF_ERRORS[kind] if 0 <= kind < len(_MDF_ERRORS) else UNTOLD


def _known_location(segment: int) -> int:
    return segment if segment in LOCATIONS else 0
