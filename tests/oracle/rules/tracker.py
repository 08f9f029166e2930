"""Tracker: what each frame is, and which rules it concerns."""

from __future__ import annotations

from tests.oracle.frame import Datagram, Frame, Unreachable, peel
from tests.oracle.rules.clock import Clock
from tests.oracle.rules.consistency import fits_checksum, observe_sender, observe_shape
from tests.oracle.rules.errors import SEND_ERRORS
from tests.oracle.rules.headers import Headers
from tests.oracle.rules.keys import ListKey, Moment, StreamKey
from tests.oracle.rules.lists import Delivery, List
from tests.oracle.rules.loss import Loss
from tests.oracle.rules.notes import Notes
from tests.oracle.rules.telegram import (
    ACKNOWLEDGEMENT,
    ASCII_IDENTITY,
    BOOT_UP_REQUEST,
    DATA,
    IDENTITIES,
    RESERVED_FLAGS,
    Telegram,
    telegram,
)
from tests.oracle.rules.waits import Waits

QUOTE_BYTES = 10


class Tracker:
    """All that follows from the frames seen so far."""

    def __init__(self, timeout_ns: int) -> None:
        self.frames = 0
        self.telegrams = 0
        self.times: list[int] = []
        self.clock = Clock()
        self.notes = Notes()
        self.waits = Waits(self.notes, timeout_ns)
        self.loss = Loss()
        self.headers = Headers()

    def observe(self, frame: Frame) -> None:
        self.frames += 1
        moment = Moment(frame.ts_ns, self.frames)
        if self.clock.show(frame.ts_ns):
            self.notes.find("NV902", None, None, None, moment)
        self.times.append(frame.ts_ns)
        self.waits.expire(moment)
        content = peel(frame)
        if isinstance(content, Unreachable):
            self.observe_unreachable(moment, content.quoted)
        elif content is not None:
            found = telegram(self.frames, frame.ts_ns, content)
            if found is not None:
                self.telegrams += 1
                self.observe_telegram(found)

    def observe_unreachable(self, moment: Moment, quoted: Datagram) -> None:
        quote = quoted.payload
        if quote[:4] not in IDENTITIES or len(quote) < QUOTE_BYTES:
            return
        name = SEND_ERRORS.get(int.from_bytes(quote[4:8], "little"))
        if name is None:
            return
        key = ListKey("udp", quoted.port, int.from_bytes(quote[8:10], "little"))
        self.notes.list_of(key)
        self.notes.error(key, name, quoted.source, moment.time, moment.frame)
        subindex = int.from_bytes(quote[10:12], "little") if len(quote) >= 12 else None
        self.notes.find("NV305", key, quoted.source, subindex, moment)

    def observe_telegram(self, seen: Telegram) -> None:
        self.headers.observe(seen)
        key = seen.list_key
        subindex = None if key is None else seen.subindex
        if seen.payload[:4] == ASCII_IDENTITY:
            self.notes.find("NV106", key, seen.source, subindex, seen.moment)
        if seen.truncated:
            self.notes.find("NV107", key, seen.source, subindex, seen.moment)
        if not seen.header_cut and seen.fault:
            self.notes.find(seen.fault, key, seen.source, subindex, seen.moment)
        if key is None:
            return
        entry = self.notes.list_of(key)
        if seen.truncated:
            entry.truncated += 1
        if seen.header_cut:
            return
        well_formed = seen.fault is None
        written = False
        if not well_formed:
            entry.malformed += 1
        if well_formed and seen.flags & RESERVED_FLAGS:
            self.notes.find("NV104", key, seen.source, seen.subindex, seen.moment)
        if seen.service == DATA:
            observe_sender(self.notes, key, entry, seen)
            if well_formed:
                written = self.observe_data(key, entry, seen)
        elif seen.service == ACKNOWLEDGEMENT and well_formed:
            self.waits.observe_acknowledgement(key, entry, seen)
        elif seen.service == BOOT_UP_REQUEST and well_formed:
            self.waits.observe_boot_up_request(key, entry, seen)
        entry.deliveries.append(Delivery(seen, written))

    def observe_data(self, key: ListKey, entry: List, seen: Telegram) -> bool:
        """Take in a well-formed data telegram; tell whether a reader would write its values."""
        at = StreamKey(seen.source, key, seen.subindex)
        before = self.loss.last_of(at)
        repeated = before is not None and before.payload == seen.payload
        self.waits.observe_data(at, entry, seen, repeated=repeated)
        written = fits_checksum(self.notes, key, entry, seen)
        observe_shape(self.notes, key, entry, seen, before)
        self.loss.observe_data(at, seen, repeated=repeated)
        return written
