"""Compressed captures that hold more than data, and damaged ones: what stands in front of the damage is read."""

from __future__ import annotations

import gzip
import random
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard

from nvscope.capture.open import open_source
from tests.capture import build
from tests.capture.reference import Packet
from tests.capture.test_open import COMPRESSIONS, PACKETS, RAW, write


@pytest.mark.parametrize("name", ["zst", "lz4"])
@pytest.mark.parametrize("size", [0, 3, 5_000])
def test_frames_without_data_are_skipped(name: str, size: int, tmp_path: Path) -> None:
    skippable = b"\x52\x2a\x4d\x18" + size.to_bytes(4, "little") + bytes(size)
    data = COMPRESSIONS[name](RAW)
    source = open_source([write(tmp_path / "a", data + skippable + data[:0])])
    assert build.packets_of(source) == PACKETS
    assert source.infos[0].truncation is None
    # In front of lz4 they are told from those of zstd by what follows, where that is near.
    if size < 4_000 or name == "zst":
        source = open_source([write(tmp_path / "a", skippable + skippable + data + skippable)])
        assert build.packets_of(source) == PACKETS
        assert source.infos[0].truncation is None


WITH_CHECKSUM: dict[str, Callable[[bytes], bytes]] = {
    "gz": lambda data: gzip.compress(data, 9),
    "zst": lambda data: zstandard.ZstdCompressor(level=19, write_checksum=True).compress(data),
    "lz4": lambda data: lz4.frame.compress(data, content_checksum=True),
}


@pytest.mark.parametrize("name", WITH_CHECKSUM)
@pytest.mark.parametrize("times", [1, 40_000], ids=["small", "large"])
def test_a_wrong_checksum_at_the_end_loses_no_frame(name: str, times: int, tmp_path: Path) -> None:
    """What is wrong with a checksum is told; the frames in front of it were read all the same."""
    raw = RAW + RAW[24:] * (times // len(PACKETS))
    damaged = bytearray(WITH_CHECKSUM[name](raw))
    damaged[-5 if name == "gz" else -1] ^= 1
    source = open_source([write(tmp_path / "a", bytes(damaged))])
    assert sum(map(len, source)) == len(PACKETS) * (1 + times // len(PACKETS))
    assert source.infos[0].truncation is not None
    assert "data are damaged" in source.infos[0].truncation.message


@pytest.mark.parametrize("name", WITH_CHECKSUM)
def test_what_stands_in_front_of_damage_is_read(name: str, tmp_path: Path) -> None:
    """Of two members of which the second is damaged in its middle, the first is there, and a part of the second."""
    chance = random.Random(7)
    packets = [Packet(build.BASE_S * 10**9 + n, 300, 1, chance.randbytes(300)) for n in range(2_000)]
    raw = build.pcap(packets)
    whole = WITH_CHECKSUM[name](raw)
    damaged = bytearray(whole)
    place = len(damaged) * 9 // 10
    damaged[place : place + 40] = bytes(40)
    source = open_source([write(tmp_path / "a", bytes(damaged))])
    found = build.packets_of(source)
    assert found[:1_000] == packets[:1_000]
    assert source.infos[0].truncation is not None
