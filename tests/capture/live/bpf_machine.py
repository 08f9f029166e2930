"""What a classic BPF program answers about a packet: the kernel's machine, by its description (bpf(4)), in Python."""

from __future__ import annotations

from collections.abc import Sequence

_SIZES = {0x00: 4, 0x08: 2, 0x10: 1}


def answer(program: Sequence[tuple[int, int, int, int]], packet: bytes) -> int:
    """Return how many bytes of a packet are let in, 0 for none."""
    accumulator = index = place = 0
    while True:
        code, if_true, if_false, number = program[place]
        place += 1
        kind, mode = code & 0x07, code & 0xE0
        if kind in (0x00, 0x01) and mode in (0x20, 0x40, 0xA0):
            at = number + (index if mode == 0x40 else 0)
            size = 1 if mode == 0xA0 else _SIZES[code & 0x18]
            if at + size > len(packet):
                return 0
            value = int.from_bytes(packet[at : at + size], "big")
            if mode == 0xA0:
                index = 4 * (value & 0x0F)
            else:
                accumulator = value
        elif code == 0x01:
            index = number
        elif code == 0x05:
            place += number
        elif kind == 0x05:
            holds = {
                0x10: accumulator == number,
                0x30: accumulator >= number,
                0x40: bool(accumulator & number),
            }[code & 0xF0]
            place += if_true if holds else if_false
        elif code == 0x06:
            return number
        else:
            raise AssertionError(f"no instruction has the code {code:#x}")
