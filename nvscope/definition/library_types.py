"""Types of common libraries that projects use and no export of theirs declares, where their size is public.

Sources, all of the Beckhoff Information System: T_MaxString, TwinCAT 3 PLC programming conventions, strings;
T_AmsNetId, Tc2_System; T_FILETIME, Tc2_Utilities; DCTIMESTRUCT, Tc2_EtherCAT; HRESULT, a signed number of 32 bits,
TF8560 Plastic Technology Functions. A PVOID is an address, whose size depends on the controller.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from nvscope.definition.scalars import SCALARS, unknown_raw
from nvscope.definition.variables import Member, Scalar, String, Structure


def _of_words(name: str, scalar: Scalar, members: str) -> Structure:
    return Structure(name, tuple(Member(member, scalar) for member in members.split()))


LIBRARY_TYPES: Mapping[str, Scalar | String | Structure] = MappingProxyType(
    {
        "T_MAXSTRING": String(255),
        "T_AMSNETID": String(23),
        "HRESULT": SCALARS["DINT"],
        "PVOID": unknown_raw("PVOID", is_one=True),
        "T_FILETIME": _of_words("T_FILETIME", SCALARS["DWORD"], "dwLowDateTime dwHighDateTime"),
        "DCTIMESTRUCT": _of_words(
            "DCTIMESTRUCT", SCALARS["WORD"],
            "wYear wMonth wDayOfWeek wDay wHour wMinute wSecond wMilliseconds wMicroseconds wNanoseconds",
        ),
    }
)  # fmt: skip
"""By name in capitals, without the namespace of the library. A declaration of the project goes before."""
