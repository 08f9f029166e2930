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
    swap: int = -1, far: int = -1,
) -> Path:  # fmt: skip
    """Write a list that is sent in parts every 100 ms; those that are missing are given by cycle and part.

    ``apart`` is how far the Counter of each part is from that of the one before; the last part of cycle ``swap`` comes
    behind the first one of the next, that of cycle ``far`` 30 ms behind its first one.
    """
    events = []
    for cycle in range(cycles):
        for part in range(parts):
            late_us = 101_000 if cycle == swap and part == parts - 1 else part * 1_000
            late_us += 29_000 if cycle == far and part == parts - 1 else 0
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


def on_can(folder: Path, cycles: int, missing: Collection[tuple[int, int]] = (), far: int = -1) -> Path:
    """Write a list on CAN of three frames every 100 ms; the frames of cycle ``far`` are 20 ms apart, else 1 ms."""
    lines = []
    for cycle in range(cycles):
        for part, data in enumerate(("1122334455667788", "1122334455667788", "11223344")):
            at_us = cycle * 100_000 + part * (20_000 if cycle == far else 1_000)
            if (cycle, part) not in missing:
                lines.append(f"({1_790_000_000 + at_us / 1e6:.6f}) can0 {0x110 + part:03X}#{data}\n")
    path = folder / "x.log"
    path.write_text("".join(lines))
    return path


CAN_LIST = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL
	nA : LWORD;
	nB : LWORD;
	nC : DWORD;
END_VAR]]></Declarations>
  <NetvarSettings Protocol="CAN">
    <ListIdentifier>272</ListIdentifier>
    <Pack>True</Pack>
    <CyclicTransmission>True</CyclicTransmission>
    <Interval>T#100ms</Interval>
  </NetvarSettings>
</GVL>
"""


@pytest.mark.parametrize(
    ("missing", "far", "rule", "verdict", "worst", "frame"),
    [
        ((), -1, "", "pass", 0.0, None),
        ({(7, 1)}, -1, "", "fail", 1 / 39, 22),
        ({(0, 2), (20, 0)}, -1, "", "fail", 2 / 39, 1),
        ({(7, 1)}, -1, 'max = "5%"', "pass", 1 / 39, 22),
        ((), 30, 'skew = "5ms"', "fail", 0.04, 91),
        ((), 30, 'skew = "50ms"', "pass", 0.0, None),
    ],
)
def test_cycles_on_can(
    missing: Collection[tuple[int, int]], far: int, rule: str, verdict: str, worst: float, frame: int | None,
    tmp_path: Path,
) -> None:  # fmt: skip
    gvl = tmp_path / "axis.gvl"
    gvl.write_text(CAN_LIST)
    rules = ruled(tmp_path, f'check = "coherence"\nlist = "axis"\n{rule}')
    (one,) = judged(on_can(tmp_path, 40, missing, far), rules, "--gvl", gvl)["rules"]
    (subject,) = one["subjects"]
    assert (one["verdict"], subject["worst"]) == (verdict, pytest.approx(worst)), one
    assert subject["frames"][:1] == ([] if frame is None else [frame])


def test_without_a_definition_nobody_knows_which_frames_belong_together(tmp_path: Path) -> None:
    (one,) = judged(on_can(tmp_path, 40), ruled(tmp_path, 'check = "coherence"\nlist = "can/can0/272"'))["rules"]
    assert one["verdict"] == "inconclusive"
    assert one["subjects"][0]["reason"] == "only a definition says which frames belong together"


def test_the_cycle_whose_parts_are_farthest_apart_has_its_frame_and_time(tmp_path: Path) -> None:
    capture = sent(tmp_path, 40, far=20)
    (one,) = judged(capture, ruled(tmp_path, 'check = "coherence"\nlist = 9\nskew = "5ms"'))["rules"]
    (subject,) = one["subjects"]
    assert (one["verdict"], subject["frames"]) == ("fail", [41])
    assert subject["first_ns"] == str(BEGIN_NS + 2_000 * 10**6)
