"""Plants whose frames are looked at, or changed, before causes are told of them."""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import ip_address
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from nvscope.definition.project import Project
from nvscope.simulate.scenario_file import read_scenario
from tests.causes.told import causes_of
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.simulate.simulation import Simulation


def frames_of(scenario: str) -> list[Frame]:
    """Return the frames of a scenario, in their order."""
    return list(Simulation(read_scenario(scenario)).frames())


def readdressed(frames: Sequence[Frame], address: str, other: str) -> list[Frame]:
    """Return frames in which an IPv4 address is another one, wherever it stands."""
    old, new = ip_address(address).packed, ip_address(other).packed
    return [frame._replace(data=frame.data.replace(old, new)) for frame in frames]


def from_hardware(frame: Frame, hardware: str) -> Frame:
    """Return a frame on Ethernet as another hardware address sends it, and one hop later."""
    data = bytearray(frame.data)
    data[6:12] = bytes.fromhex(hardware.replace(":", ""))
    if data[12:14] == b"\x08\x00":
        data[22] -= 1
    return frame._replace(data=bytes(data))


def causes_in(frames: Sequence[Frame], directory: Path, project: Project | None = None) -> list[Cause]:
    """Return what explains the findings on some frames, which are written to a directory in the order of time."""
    path = directory / "frames.pcap"
    write_pcap(sorted(frames, key=lambda one: one.ts_ns), path)
    return causes_of(Inquiry([str(path)], project or Project()))[1]
