"""Definitions of a scenario's lists, as CODESYS would export them: those on CAN, and what ``[[definition]]`` says.

The variables of a list on UDP are one array of numbers of ``element_bytes``, and single bytes for what is left.
"""

from __future__ import annotations

from nvscope.definition.gvl_file import gvl_file
from nvscope.duration import format_duration
from nvscope.simulate.can.definition import can_definitions
from nvscope.simulate.scenario import Definition, Scenario

_TYPES = {1: "BYTE", 2: "WORD", 4: "DWORD", 8: "LWORD"}
_BROADCAST = "255.255.255.255"


def definitions(scenario: Scenario) -> dict[str, str]:
    """Return the text of a .gvl file for each list that is defined, by the name of the list.

    ConfigurationError where no definition could make PDOs of the given lengths.
    """
    udp = {entry.list: _text(scenario, position, entry) for position, entry in enumerate(scenario.definition)}
    return can_definitions(scenario) | udp


def _text(scenario: Scenario, position: int, entry: Definition) -> str:
    plan = scenario.list[scenario.list_numbers[entry.list]]
    size = plan.element_bytes
    if size not in _TYPES:
        raise scenario.error(
            f"definition[{position}].list", f"no number has {size} bytes", "Give the list element_bytes = 1, 2, 4 or 8."
        )
    whole, rest = divmod(entry.total_bytes or sum(data_bytes for _, data_bytes in plan.shapes), size)
    lines = [f"\tvalues : ARRAY[1..{whole}] OF {_TYPES[size]};"] if whole else []
    lines += [f"\trest : ARRAY[1..{rest}] OF BYTE;"] if rest else []
    settings = {
        "ListIdentifier": plan.index if entry.index is None else entry.index,
        "Pack": plan.packed if entry.packed is None else entry.packed,
        "Checksum": bool(plan.checksum),
        "Acknowledge": plan.acknowledge,
        "CyclicTransmission": plan.mode == "cyclic",
        "TransmissionOnChange": plan.mode != "cyclic",
        "TransmissionOnEvent": False,
        "Interval": f"T#{format_duration(plan.interval_ns)}",
    }
    protocol = {"Broadcast Adr.": _BROADCAST, "Port": plan.port if entry.port is None else entry.port}
    more = [f'  <ProtocolSetting Name="{name}" Value="{value}" />' for name, value in protocol.items()]
    return gvl_file(
        "UDP", ["VAR_GLOBAL", *lines, "END_VAR"], settings, ["<ProtocolSettings>", *more, "</ProtocolSettings>"]
    )
