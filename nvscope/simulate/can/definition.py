"""Definitions of a scenario's lists on CAN, as files that CODESYS would export: a report needs them to know its lists.

A list is packed by the rule of UDP with 8 bytes a frame: an element goes where there is room for it. So the variables
are chosen such that the PDOs become as long as the scenario says.
"""

from __future__ import annotations

from nvscope.definition.gvl_file import gvl_file
from nvscope.definition.packing import PDO_DATA_BYTES
from nvscope.duration import format_duration
from nvscope.simulate.can.tables import CanList
from nvscope.simulate.scenario import Scenario

_TYPES = {1: "BYTE", 2: "WORD", 4: "DWORD", 8: "LWORD"}


def can_definitions(scenario: Scenario) -> dict[str, str]:
    """Return the text of a .gvl file for each list on CAN that is defined, by the name of the list.

    Where a list is sent over two buses, the first one tells of both. ConfigurationError where no definition could make
    PDOs of the given lengths.
    """
    found: dict[str, str] = {}
    known: set[int] = set()
    for position, entry in enumerate(scenario.can_list):
        if entry.has_definition and entry.cob_id not in known:
            known.add(entry.cob_id)
            found[entry.name] = _text(entry, _types(scenario, position, entry))
    return found


def _types(scenario: Scenario, position: int, entry: CanList) -> list[str]:
    """Return the types of the variables of a list."""
    types: list[str] = []
    room = 0
    for number, size in enumerate(entry.data_bytes):
        if not size or (entry.packed and 0 < size <= room):
            before = PDO_DATA_BYTES - room
            why = f"has room in the one before it, which has {before} bytes" if size else "has no bytes"
            raise scenario.error(
                f"can_list[{position}].bytes",
                f"PDO {number} {why}: no definition packs a list like this",
                "Set packed = false, or defined = false.",
            )
        whole = not entry.packed or room
        types += [_type(size)] if whole else [_type(part) for part in _parts(size)]
        room = PDO_DATA_BYTES - size
    return types


def _parts(size: int) -> list[int]:
    """Return the sizes of the scalars that a PDO is cut into, of at most four bytes."""
    return [4] * (size // 4) + [2] * (size % 4 // 2) + [1] * (size % 2)


def _type(size: int) -> str:
    return _TYPES.get(size) or f"STRING({size - 1})"


def _text(entry: CanList, types: list[str]) -> str:
    cyclic = entry.mode == "cyclic"
    settings = {
        "ListIdentifier": entry.cob_id,
        "Pack": entry.packed,
        "Checksum": False,
        "Acknowledge": False,
        "CyclicTransmission": cyclic,
        "TransmissionOnChange": not cyclic,
        "TransmissionOnEvent": False,
        "Interval": f"T#{format_duration(entry.interval_ns)}",
    }
    lines = ["VAR_GLOBAL", *(f"\tv{number} : {kind};" for number, kind in enumerate(types)), "END_VAR"]
    return gvl_file("CAN", lines, settings)
