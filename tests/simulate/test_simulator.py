"""The frames of scenarios: judged by tshark, counted by hand, and the same in every run."""

from __future__ import annotations

import hashlib
import random
import struct
import subprocess
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.open import open_sink
from nvscope.simulate.frame_table import make_frame_table
from nvscope.simulate.frames import LINKS
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import load_scenario, read_scenario
from nvscope.simulate.simulator import packets, simulate
from tests.simulate.collected import Collected, run
from tests.simulate.random_scenario import random_scenario
from tests.tshark_choices import choices_of_tshark

SCENARIOS = Path(__file__).parent.parent / "scenarios"
LINK_BYTES = {"ethernet": 14, "raw": 0, "null": 4, "loop": 4, "sll": 16, "sll2": 20}
PRESS = (
    'duration = "3s"\n[[node]]\nname = "press"\naddress = "10.0.0.1"\n'
    '[[list]]\nname = "axis"\nindex = 1\nsender = "press"\ninterval = "10ms"\n'
)
WRONG = (
    "ip.checksum.status == 0 || udp.checksum.status == 0 || tcp.checksum.status == 0 || icmp.checksum.status == 0 || "
    "icmpv6.checksum.status == 0 || _ws.expert.severity == error"
)


def written(scenario: Scenario, path: Path) -> Path:
    sink = open_sink(str(path))
    simulate(scenario, sink)
    sink.close()
    return path


CHECKS = [f"-o{name}.check_checksum:TRUE" for name in ("ip", "udp", "tcp")]
RIGHT = "udp.checksum.status == 1"


def tshark(capture: Path, *arguments: str) -> list[str]:
    command = ["tshark", "-n", "-r", str(capture), *CHECKS, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.mark.parametrize("suffix", ["pcap", "pcapng"])
@pytest.mark.parametrize(
    "name", ["plant-clean", "foreign-traffic", "unreachable", "malformed", "ipv6", "vlan", "link-sll2", "page-faults"]
)
def test_tshark_finds_every_checksum_right(name: str, suffix: str, tmp_path: Path) -> None:
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    capture = written(scenario, tmp_path / f"x.{suffix}")
    found = choices_of_tshark(capture, [WRONG, RIGHT], *CHECKS)
    assert found[WRONG] == []
    assert len(found[RIGHT]) > 100


@pytest.mark.parametrize("seed", range(6))
def test_tshark_finds_every_checksum_of_random_scenarios_right(seed: int, tmp_path: Path) -> None:
    text = random_scenario(seed).replace("snap_length = 100", "snap_length = 0")
    capture = written(read_scenario(text), tmp_path / "x.pcap")
    assert tshark(capture, "-Y", WRONG) == []


def test_tshark_puts_fragments_together_again(tmp_path: Path) -> None:
    capture = written(load_scenario(SCENARIOS / "fragments.toml"), tmp_path / "x.pcap")
    fields = ["-T", "fields", "-e", "udp.length", "-e", "udp.checksum.status"]
    assert tshark(capture, "-Y", "ip.reassembled.length", *fields) == ["1228\t1", "1228\t1"]


def test_header_fields_stand_where_they_belong() -> None:
    reader = '[[reader]]\nnode = "hmi"\nlist = "axis"\necho_counter = true\nboot_up = "5ms"'
    scenario = read_scenario(
        'duration = "25ms"\n[[node]]\nname = "press"\naddress = "10.0.0.1"\nfirst_value = 255\n'
        '[[node]]\nname = "hmi"\naddress = "10.0.0.2"\n'
        '[[list]]\nname = "axis"\nindex = 258\nsender = "press"\nbytes = [2]\nitems = [2]\ninterval = "10ms"\n'
        f"acknowledge = true\nchecksum = 0x5A\nanswers_boot_up = false\n{reader}"
    )
    truth, frames = run(scenario)
    payloads = [frame.data[42:].hex() for frame in frames]
    assert payloads == [
        "002d533300000000020100000200" + "1600ff00035a" + "0000",
        "002d533305000000020100000100" + "1400ff000000",
        "002d533306000000020100000100" + "140000000000",
        "002d533300000000020100000200" + "16000001035a" + "0100",
        "002d533305000000020100000100" + "140000010000",
        "002d533300000000020100000200" + "16000101035a" + "0200",
        "002d533305000000020100000100" + "140001010000",
    ]
    assert [frame.ts_ns % 1_000_000_000 for frame in frames] == [
        0, 2_000_000, 5_000_000, 10_000_000, 12_000_000, 20_000_000, 22_000_000,
    ]  # fmt: skip
    assert truth["capture"]["telegrams"] == 7


@pytest.mark.parametrize(
    ("counter", "expected"),
    [
        ("", [1, 1, 1, 2, 2, 2, 3, 3, 3]),
        ('counter = "telegram"', [1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ('counter = "send"', [1, 1, 2, 3, 3, 4, 5, 5, 6]),
        ('counter = "constant"\nfirst_value = 9', [9] * 9),
        ("first_value = 0\nlast_value = 1", [0, 0, 0, 1, 1, 1, 0, 0, 0]),
        ("first_value = 127\nbyte_swapped = true", [127, 127, 127, 0x8000, 0x8000, 0x8000, 0x8100, 0x8100, 0x8100]),
        ("first_value = 65535\ncarry_into_flags = true", [65535, 65535, 65535, *[65536] * 3, *[65537] * 3]),
    ],
)
def test_nodes_count_in_their_own_ways(counter: str, expected: list[int]) -> None:
    scenario = read_scenario(
        f'duration = "30ms"\n[[node]]\nname = "press"\naddress = "10.0.0.1"\n{counter}\n'
        '[[list]]\nname = "axis"\nindex = 1\nsender = "press"\nbytes = [4, 4]\ninterval = "10ms"\n'
        '[[list]]\nname = "belt"\nindex = 2\nsender = "press"\nbytes = [4]\ninterval = "10ms"\n'
    )
    _, frames = run(scenario)
    width = "<I" if "carry" in counter else "<H"
    assert [struct.unpack_from(width, frame.data, 42 + 16)[0] for frame in frames] == expected


def test_a_node_that_counts_by_list_counts_each_of_its_telegrams() -> None:
    scenario = read_scenario(
        'duration = "20ms"\n[[node]]\nname = "press"\naddress = "10.0.0.1"\ncounter = "list"\n'
        '[[list]]\nname = "axis"\nindex = 1\nsender = "press"\nbytes = [4, 4]\ninterval = "10ms"\n'
    )
    _, frames = run(scenario)
    assert [struct.unpack_from("<H", frame.data, 42 + 16)[0] for frame in frames] == [1, 2, 3, 4]


def test_frames_are_in_the_order_of_time_and_batches_of_any_size_are_the_same() -> None:
    scenario = read_scenario(random_scenario(5))
    table = make_frame_table(scenario)
    link = int(LINKS[scenario.link])

    def frames(batch_frames: int) -> list[tuple[int, bytes]]:
        return [
            (int(batch.ts_ns[row]), batch.packet(row))
            for batch in packets(table, link, batch_frames)
            for row in range(len(batch))
        ]

    whole = frames(1_000_000)
    assert whole == frames(7) == frames(1_000)
    assert [ts_ns for ts_ns, _ in whole] == sorted(ts_ns for ts_ns, _ in whole)


def test_progress_tells_frames_written() -> None:
    told: list[tuple[int, int]] = []
    scenario = read_scenario(PRESS + "bytes = 16\n")
    truth = simulate(scenario, Collected(), batch_frames=100, progress=lambda *steps: told.append(steps))
    assert told == [(100, 300), (200, 300), (300, 300)]
    assert truth["capture"]["frames"] == 300


@pytest.mark.parametrize("seed", [3, 8])
def test_the_same_seed_gives_the_same_bytes_and_another_one_others(seed: int) -> None:
    text = random_scenario(seed)
    other = text.replace(f"seed = {seed}\n", f"seed = {seed + 1}\n")
    assert run(read_scenario(text)) == run(read_scenario(text))
    assert run(read_scenario(text)) != run(read_scenario(other))


def test_bytes_are_those_of_every_other_machine() -> None:
    digests = {}
    for name in ("plant-clean", "wild"):
        _, frames = run(load_scenario(SCENARIOS / f"{name}.toml"))
        content = b"".join(struct.pack("<qI", frame.ts_ns, len(frame.data)) + frame.data for frame in frames)
        digests[name] = hashlib.sha256(content).hexdigest()
    assert digests == {
        "plant-clean": "975a0b187bf219f9f190b5ef7ff8cad6777adf16e17cfcbd2ad5f51a76e094fd",
        "wild": "2aa612eb64ea1248e098574b07b21bcd26008bdd5923ceabb78d59f82bb46cd0",
    }


def test_frames_counted_by_hand_are_those_of_the_truth() -> None:
    """Telegrams by list, sender, service and SubIndex, read with nothing but struct."""
    for seed in range(40, 52):
        scenario = read_scenario(random_scenario(seed).replace("snap_length = 100", "snap_length = 0"))
        if any(":" in node.address for node in scenario.node) or scenario.truncated:
            continue
        truth, frames = run(scenario)
        counted: Counter[tuple[Any, ...]] = Counter()
        for frame in frames:
            start = LINK_BYTES[scenario.link]
            while start in {14, 16, 18, 20} and frame.data[start : start + 1] not in {b"E", b"F"}:
                start += 4
            head = frame.data[start:]
            size = (head[0] & 15) * 4
            if head[0] >> 4 != 4 or head[9] != 17 or struct.unpack_from(">H", head, 6)[0] & 0x3FFF:
                continue
            port, payload = struct.unpack_from(">H", head, size + 2)[0], head[size + 8 :]
            if payload[1:4] != b"\x2d\x53\x33" or len(payload) < 12:
                continue
            service, index, subindex = struct.unpack_from("<IHH", payload, 4)
            source = ".".join(str(byte) for byte in head[12:16])
            length = struct.unpack_from("<H", payload, 14)[0] if len(payload) >= 20 else None
            well_formed = length == len(payload) and service in {0, 5, 6}
            counted["telegrams",] += 1
            if service not in {1, 77}:
                counted[port, index, "service", service] += 1
            if service == 0 and well_formed:
                counted[port, index, source, subindex] += 1
            if service not in {1} and not well_formed:
                counted[port, index, "malformed"] += 1
        expected: Counter[tuple[Any, ...]] = Counter({("telegrams",): truth["capture"]["telegrams"]})
        for entry in truth["lists"]:
            key = entry["port"], entry["id"]
            expected[*key, "malformed"] += entry["counters"]["malformed"]
            expected[*key, "service", 0] += entry["diag"]["nSendCount"]
            for stream in entry["streams"]:
                expected[*key, stream["node"], stream["subindex"]] += stream["telegrams"]
        assert {key: counted[key] for key in expected} == dict(expected)
        assert truth["capture"]["frames"] == len(frames)


@pytest.mark.parametrize("size", [1, 2, 9])
@pytest.mark.parametrize("values", ["ramp", "noise", "constant"])
def test_values_differ_from_telegram_to_telegram_unless_they_are_constant(values: str, size: int) -> None:
    _, frames = run(read_scenario(PRESS + f'bytes = {size}\nvalues = "{values}"\n'))
    equal = {one.data[-size:] == other.data[-size:] for one, other in pairwise(frames)}
    assert equal == {values == "constant"}


def test_random_scenarios_are_readable_and_of_many_kinds() -> None:
    kinds: Counter[str] = Counter()
    for seed in random.Random(0).sample(range(10_000), 60):
        scenario = read_scenario(random_scenario(seed))
        kinds.update({name for name, _, _ in scenario.rows()})
    assert len(kinds) > 22
