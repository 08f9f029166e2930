"""Faults: what goes wrong in a plant, and how likely."""

from __future__ import annotations

import random
import struct

UNKNOWN_SERVICES = (7, 19, 29, 99, 101, 0x05000000, 0xFFFFFFFF)

FAULTS = (
    "loss",
    "burst",
    "mirror",
    "late",
    "overtaken",
    "restart",
    "no_acknowledgement",
    "negative_acknowledgement",
    "broadcast_acknowledgement",
    "own_acknowledgement",
    "surplus_acknowledgement",
    "deadline_acknowledgement",
    "boot_up_request",
    "boot_up_unanswered",
    "checksum_wrong",
    "checksum_flag_clear",
    "shape",
    "short",
    "wrong_length",
    "swapped_length",
    "unknown_service",
    "reserved_flags",
    "ascii_identity",
    "parameter",
    "parameter_malformed",
    "cut",
    "fragment",
    "vlan",
    "header_options",
    "odd_lengths",
    "unreachable",
    "stranger",
    "clock_back",
    "clock_forward",
    "equal_time",
    "deadline_frame",
    "link_says_otherwise",
    "pause",
)


class Faults:
    """How likely each fault is, drawn once: some plants are clean and some are wild."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.rates = self.draw_rates()
        self.clean = not any(self.rates.values())

    def draw_rates(self) -> dict[str, float]:
        rng = self.rng
        mood = rng.random()
        if mood < 0.1:
            return dict.fromkeys(FAULTS, 0.0)
        likely = 0.15 if mood < 0.4 else 0.5
        return {fault: rng.choice((0.003, 0.01, 0.03, 0.1, 0.3)) if rng.random() < likely else 0.0 for fault in FAULTS}

    def happens(self, fault: str) -> bool:
        rate = self.rates[fault]
        return rate > 0 and self.rng.random() < rate

    def malform(self, payload: bytes) -> tuple[bytes, bool]:
        """Return a telegram as it is sent, and whether it is malformed now."""
        rng = self.rng
        good = payload
        if self.happens("ascii_identity"):
            good = payload = b"0" + payload[1:]
        if self.happens("short"):
            payload = payload[: rng.randint(8, 19)]
        if self.happens("wrong_length"):
            payload = rng.choice((payload + b"!", payload[:14] + rng.randbytes(2) + payload[16:]))
        if self.happens("swapped_length") and len(payload) >= 20:
            payload = payload[:14] + len(payload).to_bytes(2, "big") + payload[16:]
        if self.happens("unknown_service"):
            payload = payload[:4] + struct.pack("<I", rng.choice(UNKNOWN_SERVICES)) + payload[8:]
        return payload, payload != good
