"""Plain segments: TCP over IPv4 and Ethernet without options, read out of headers that were gathered already.

Most segments of most captures are such. All others, and all that contradict themselves, are for ``dissectors.link``.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch, Records
from dissectors.headers import ETHERNET, IPV4, IPV4_HIGH, IPV4_LOW, PROTOCOL_TCP, TCP
from dissectors.plain import LEAD_BYTES
from dissectors.transport import NO_SEGMENTS, SegmentBatch

_AT = ETHERNET.size_bytes + IPV4.size_bytes
_WITH_TCP_BYTES = _AT + TCP.size_bytes
_OFFSET_SHIFT = 4
_TCP_WORD_BYTES = 4


def take_segments(packets: PacketBatch, rows: I64, head: Records, claimed: Bool) -> tuple[SegmentBatch, Bool]:
    """Return the plain segments of claimed ports among some packets (rising), and which of these packets they are.

    ``head`` are the headers of the packets (``dissectors.plain.heads_of``), ``claimed`` which of them are of such ports
    (``dissectors.plain.are_claimed``). What is left out here may be a segment all the same.
    """
    own: Bool = (head["ip"]["protocol"] == PROTOCOL_TCP) & claimed
    own &= packets.captured[rows] >= _WITH_TCP_BYTES
    if not own.any():
        return NO_SEGMENTS, own
    tcp = _tcp_of(head)
    header_bytes = (tcp["offset"] >> _OFFSET_SHIFT).astype(np.int64) * _TCP_WORD_BYTES
    total_bytes = head["ip"]["total_length"].astype(np.int64)
    own &= (header_bytes >= TCP.size_bytes) & (IPV4.size_bytes + header_bytes <= total_bytes)
    if not own.all():
        rows, head, header_bytes, total_bytes = rows[own], head[own], header_bytes[own], total_bytes[own]
        tcp = _tcp_of(head)
    ip = head["ip"]
    begin = packets.offset[rows]
    header, stop = begin + _AT, begin + ETHERNET.size_bytes + total_bytes
    payload = header + header_bytes
    end = np.minimum(begin + packets.captured[rows], stop)
    high = np.broadcast_to(IPV4_HIGH, (len(rows),))
    found = SegmentBatch(
        rows, high, ip["source"].astype(np.uint64) | IPV4_LOW, high, ip["destination"].astype(np.uint64) | IPV4_LOW,
        payload, stop - payload, np.maximum(end - payload, 0),
        tcp["source_port"].astype(np.uint16), tcp["destination_port"].astype(np.uint16), header,
        tcp["sequence"].astype(np.uint32), tcp["acknowledgement"].astype(np.uint32), tcp["flags"].astype(np.uint8),
    )  # fmt: skip
    return found, own


def _tcp_of(head: Records) -> Records:
    """Return the TCP headers that stand where telegrams have those of UDP and their own."""
    row = np.dtype({"names": ["tcp"], "formats": [TCP.dtype], "offsets": [LEAD_BYTES + _AT], "itemsize": head.itemsize})
    return head.view(row)["tcp"]
