"""Counters: how a node counts what it sends."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

COUNTER_SCOPES = ("stream", "stream", "stream", "telegram", "send", "list", "constant")
COUNTER_WIDTHS = ("u16", "u16", "u16", "256", "65534", "u32", "swapped")


@dataclass
class Counters:
    """How one node counts: per what, how wide, and from where on."""

    scope: str
    width: str
    start: int
    values: dict[object, int] = field(default_factory=dict)

    def key(self, list_key: object, subindex: int) -> object:
        return {"stream": (list_key, subindex), "list": list_key}.get(self.scope)

    def next_send(self, list_key: object) -> None:
        """Count a send, where that is what the node counts."""
        if self.scope == "send":
            self.advance(None)
        elif self.scope == "list":
            self.advance(list_key)

    def next_telegram(self, list_key: object, subindex: int) -> int:
        key = self.key(list_key, subindex)
        if self.scope in ("stream", "telegram"):
            self.advance(key)
        return self.values.setdefault(key, self.start)

    def advance(self, key: object, by: int = 1) -> None:
        self.values[key] = self.values[key] + by if key in self.values else self.start

    def skip(self, list_key: object, subindex: int, count: int) -> None:
        key = self.key(list_key, subindex)
        if self.scope != "constant" and key in self.values:
            self.values[key] += count

    def restart(self, value: int) -> None:
        for key in self.values:
            self.values[key] = value

    def on_the_wire(self, value: int) -> tuple[int, int, int]:
        """Return Counter, and what is added to Flags and to Checksum."""
        if self.width == "256":
            return value % 256, 0, 0
        if self.width == "65534":
            return value % 65535, 0, 0
        if self.width == "u32":
            return value & 0xFFFF, value >> 16 & 0xFF, value >> 24 & 0xFF
        if self.width == "swapped":
            return (value & 0xFF) << 8 | (value >> 8 & 0xFF), 0, 0
        return value & 0xFFFF, 0, 0


def draw_counters(rng: random.Random, *, clean: bool) -> Counters:
    start = rng.choice((1, 1, 1, 0, rng.randint(240, 256), rng.randint(65500, 65535), rng.randint(2, 65535)))
    if clean:
        return Counters(rng.choice(COUNTER_SCOPES[:-1]), rng.choice(COUNTER_WIDTHS[:-2]), start)
    return Counters(rng.choice(COUNTER_SCOPES), rng.choice(COUNTER_WIDTHS), start)
