"""Lists that take several telegrams: each cycle that lacks one is told, the first ones too."""

from __future__ import annotations

import random
from collections.abc import Collection
from pathlib import Path

import pytest

from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import BEGIN_NS, judged, ruled
from tests.oracle.builders import data_frame, telegram


def sent(
    folder: Path, cycles: int, missing: Collection[tuple[int, int]] = (), *, parts: int = 2, apart: int = 0,
    swap: int = -1,
) -> Path:  # fmt: skip
    """Write a list that is sent in parts every 100 ms; those that are missing are given by cycle and part.

    ``apart`` is how far the Counter of each part is from that of the one before; the last part of cycle ``swap`` comes
    behind the first one of the next.
    """
    events = []
    for cycle in range(cycles):
        for part in range(parts):
            late_us = 101_000 if cycle == swap and part == parts - 1 else part * 1_000
            if (cycle, part) not in missing:
                events.append((cycle * 100_000 + late_us, cycle + 1 + part * apart, part))
    packets = []
    for at_us, counter, part in sorted(events):
        payload = telegram(list_id=9, counter=counter, data=b"\0\0", subindex=part)
        one = data_frame(BEGIN_NS + at_us * 1000, "10.0.0.9", "10.0.0.255", payload)
        packets.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return write(folder / "x.pcap", packets)


@pytest.mark.parametrize("parts", [2, 3])
@pytest.mark.parametrize("cycles", [6, 9, 12, 13, 40])
@pytest.mark.parametrize("torn", [2, 3, 7, 10, 11, 12, 30])
def test_a_torn_cycle_is_told_wherever_it_is(cycles: int, torn: int, parts: int, tmp_path: Path) -> None:
    part = random.Random(torn).randrange(parts)
    capture = sent(tmp_path, cycles, {(torn, part)}, parts=parts)
    (one,) = judged(capture, ruled(tmp_path, 'check = "coherence"\nlist = 9'))["rules"]
    if torn >= cycles - 1:
        assert one["verdict"] == "pass"
        return
    (subject,) = one["subjects"]
    assert (one["verdict"], subject["count"]) == ("fail", 1)
    assert subject["worst"] == pytest.approx(1 / (cycles - 2))


def test_whole_cycles_are_whole(tmp_path: Path) -> None:
    for capture in (sent(tmp_path, 40), sent(tmp_path, 40, swap=5), sent(tmp_path, 40, swap=20), sent(tmp_path, 7)):
        (one,) = judged(capture, ruled(tmp_path, 'check = "coherence"\nlist = 9'))["rules"]
        assert one["verdict"] == "pass", one


def test_counters_that_belong_to_nothing_say_nothing(tmp_path: Path) -> None:
    """Each part counts for itself, from where it began: then only times say what belongs together."""
    (one,) = judged(sent(tmp_path, 40, apart=7), ruled(tmp_path, 'check = "coherence"\nlist = 9'))["rules"]
    assert one["verdict"] != "fail", one


def test_a_warm_up_is_not_looked_at(tmp_path: Path) -> None:
    capture = sent(tmp_path, 40, {(3, 1)})
    for warmup, verdict in (("200ms", "fail"), ("500ms", "pass"), ("3s", "pass")):
        rules = ruled(tmp_path, 'check = "coherence"\nlist = 9', defaults=f'warmup = "{warmup}"')
        assert judged(capture, rules)["rules"][0]["verdict"] == verdict
