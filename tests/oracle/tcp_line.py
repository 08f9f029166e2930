"""One TCP connection, segment by segment, as frames of a capture."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from ipaddress import ip_address

from tests.oracle.builders import MILLISECOND, internet_packet, link_frame, whole
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.tcp import ACK, FIN, PROTOCOL_TCP, PSH, RST, SYN

End = tuple[str, int]
CLIENT, SERVER = ("10.0.0.1", 50_000), ("10.0.0.5", 80)


def tcp_frame(
    ts_ns: int, source: End, destination: End, *, seq: int = 0, ack: int = 0, flags: int = ACK, data: bytes = b"",
    link: int = ETHERNET, tags: Sequence[int] = (), options: bytes = b"", captured: int | None = None,
) -> Frame:  # fmt: skip
    """Return a frame with a segment, of whose data ``captured`` bytes were captured where that is given."""
    header = struct.pack(
        ">HHIIBBHHH", source[1], destination[1], seq % 2**32, ack % 2**32, (20 + len(options)) // 4 << 4, flags,
        8192, 0, 0,
    )  # fmt: skip
    packet = internet_packet(
        ip_address(source[0]), ip_address(destination[0]), PROTOCOL_TCP, header + options + data
    )  # fmt: skip
    frame = whole(ts_ns, link, link_frame(packet, link, tags=tags))
    return frame if captured is None else snapped(frame, len(data) - captured)


def snapped(frame: Frame, missing: int) -> Frame:
    """Return a frame of which the last bytes were not captured."""
    return frame._replace(data=frame.data[: len(frame.data) - missing])


class Line:
    """A connection; each frame is 1 ms behind the one before."""

    def __init__(
        self, client: End = CLIENT, server: End = SERVER, *, isn: tuple[int, int] = (1000, 5000), now: int = 0,
        link: int = ETHERNET, tags: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.ends = {True: client, False: server}
        self.begin = {True: isn[0] + 1, False: isn[1] + 1}
        self.sent = dict(self.begin)
        """The sequence number that comes next, without wrapping."""
        self.now, self.link, self.tags = now, link, tags
        self.frames: list[Frame] = []

    def segment(
        self, from_client: bool, data: bytes = b"", flags: int = ACK, *, seq: int | None = None,
        ack: int | None = None, captured: int | None = None,
    ) -> Line:  # fmt: skip
        """Add a frame as it is said, whatever went before."""
        self.frames.append(
            tcp_frame(
                self.now, self.ends[from_client], self.ends[not from_client],
                seq=self.sent[from_client] if seq is None else seq,
                ack=self.sent[not from_client] if ack is None else ack,
                flags=flags, data=data, link=self.link, tags=self.tags, captured=captured,
            )
        )  # fmt: skip
        self.now += MILLISECOND
        return self

    def open(self) -> Line:
        self.segment(True, flags=SYN, seq=self.begin[True] - 1, ack=0)
        self.segment(False, flags=SYN | ACK, seq=self.begin[False] - 1, ack=self.begin[True])
        return self.segment(True)

    def say(self, from_client: bool, data: bytes, flags: int = PSH | ACK, captured: int | None = None) -> Line:
        """Add a segment with the data that comes next."""
        self.segment(from_client, data, flags, captured=captured)
        return self.lose(from_client, len(data))

    def ask(self, data: bytes) -> Line:
        return self.say(True, data)

    def answer(self, data: bytes) -> Line:
        return self.say(False, data)

    def lose(self, from_client: bool, count: int) -> Line:
        """Pass over bytes that were sent, and not captured."""
        self.sent[from_client] += count
        return self

    def close(self, from_client: bool) -> Line:
        self.segment(from_client, flags=FIN | ACK)
        self.sent[from_client] += 1
        return self

    def reset(self, from_client: bool) -> Line:
        return self.segment(from_client, flags=RST | ACK)

    def wait(self, ns: int) -> Line:
        self.now += ns
        return self
