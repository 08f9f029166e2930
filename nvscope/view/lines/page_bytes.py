"""Which frames, of those that nothing is found in, may hold bytes of what pages say: a password may be among them."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.headers import PROTOCOL_TCP, TCP
from dissectors.icmp import quoted_in
from dissectors.other_frames import FrameKind, OtherBatch

_PORTS_BYTES = 4


def may_hold_pages(frames: OtherBatch, data: U8, ports: frozenset[int]) -> Bool:
    """Tell which frames have bytes of TCP over one of some ports, or such that nobody knows of which ports they are.

    These are segments, also those whose header contradicts itself; segments that an ICMP error quotes; and fragments.
    What goes through tunnels that are not looked into is told as what it is elsewhere: as bytes.
    """
    found = np.zeros(len(frames), np.bool_)
    if not ports:
        return found
    wanted = np.array(sorted(ports), np.int64)
    tcp = np.flatnonzero((frames.kind == FrameKind.TCP) & (frames.end - frames.at >= _PORTS_BYTES))
    for end in ("source_port", "destination_port"):
        found[tcp] |= _is_one_of(_port(data, frames.at[tcp] + TCP.offset_of(end)), wanted)
    fragments = np.flatnonzero((frames.kind == FrameKind.FRAGMENT) & (frames.at < frames.end))
    of_version_6 = frames.version[fragments] == 6
    protocol = np.where(of_version_6, data[frames.at[fragments]], frames.protocol[fragments])
    found[fragments[protocol == PROTOCOL_TCP]] = True
    for kind in (FrameKind.ICMP, FrameKind.ICMPV6):
        for place in np.flatnonzero(frames.kind == kind).tolist():
            message = data[frames.at[place] : frames.end[place]].tobytes()
            quoted = quoted_in(message, is_ipv4=kind is FrameKind.ICMP)
            if quoted is not None and quoted.protocol == PROTOCOL_TCP:
                found[place] = quoted.ports is None or not ports.isdisjoint(quoted.ports)
    return found


def _port(data: U8, at: I64) -> I64:
    number: I64 = data[at].astype(np.int64) << 8 | data[at + 1]
    return number


def _is_one_of(numbers: I64, wanted: I64) -> Bool:
    found: Bool = (numbers[:, None] == wanted).any(axis=1)
    return found
