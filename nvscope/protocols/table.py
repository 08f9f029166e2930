"""All protocols that are looked for, and what they have together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace

from nvscope.protocols.can import CAN
from nvscope.protocols.datalogger import DATALOGGER
from nvscope.protocols.netvar import NETVAR
from nvscope.protocols.other_frames import OTHER_FRAMES
from nvscope.protocols.protocol import Protocol
from nvscope.protocols.visu import VISU, visu_of

if TYPE_CHECKING:
    from dissectors.dissector import Dissector
    from nvscope.definition.project import Project
    from nvscope.findings.judge import Judge
    from nvscope.tracker.accumulator import ProtocolAccumulator
    from nvscope.tracker.state import TrackerState
    from nvscope.view.fields.field import TelegramField

PROTOCOLS: Sequence[Protocol] = (NETVAR, CAN, VISU, DATALOGGER, OTHER_FRAMES)
"""In the order in which fields are listed; of frames that several could read, the first one's."""


def of_project(protocols: Sequence[Protocol], project: Project) -> Sequence[Protocol]:
    """Return protocols with what a project says of them."""
    webvisu = project.webvisu
    if webvisu is None:
        return protocols
    told = visu_of(webvisu)
    return [replace(one, dissector=told.dissector) if one.name == VISU.name else one for one in protocols]


def dissectors_of(protocols: Iterable[Protocol]) -> tuple[Dissector, ...]:
    """Return what reads the protocols that have ports of their own."""
    return tuple(protocol.dissector() for protocol in protocols if protocol.dissector)


def accumulators_of(protocols: Iterable[Protocol]) -> Mapping[str, ProtocolAccumulator]:
    """Return what counts protocols that the state does not count by itself, new, by name."""
    return {protocol.name: protocol.observe() for protocol in protocols if protocol.observe}


def judges_of(protocols: Iterable[Protocol], state: TrackerState) -> Sequence[Judge]:
    """Return the judges of what a state has counted of protocols."""
    return [one.judge for one in protocols if one.judge and (one.observe is None or one.name in state.others)]


def fields_of(protocols: Iterable[Protocol]) -> Sequence[TelegramField]:
    """Return the fields of all frames, and of the protocols; one with ports of its own can be asked for by name."""
    from nvscope.view.fields.field import presence  # noqa: PLC0415
    from nvscope.view.fields.frame import CARRIER_FIELDS  # noqa: PLC0415

    fields = list(CARRIER_FIELDS)
    for protocol in protocols:
        if protocol.dissector:
            fields.append(presence(protocol.name, protocol.title))
        fields += protocol.fields()
    return fields
