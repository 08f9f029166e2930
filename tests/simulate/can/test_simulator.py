"""Simulated CAN: what a bus lets through and when, what frames say, and what a scenario may not ask for."""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType
from nvscope.capture.open import open_source
from nvscope.definition.packing import pack
from nvscope.errors import ConfigurationError, ExitCode
from nvscope.simulate.can.bus import priority_of, transmit
from nvscope.simulate.can.definition import can_definitions
from nvscope.simulate.can.frame_table import frames_bits, make_can_frame_table
from nvscope.simulate.frame_table import make_frame_table
from nvscope.simulate.scenario_file import load_scenario, read_scenario
from nvscope.simulate.simulator import channels_of, open_capture, simulate
from tests.capture.can.logs import frames_of
from tests.program_here import run_text
from tests.simulate.can.random_scenario import random_can_scenario
from tests.simulate.collected import Collected
from tests.simulate.simulation import project_of

SCENARIOS = Path(__file__).parents[2] / "scenarios"
AXIS = '[[can_list]]\nname = "axis"\ncob_id = 0x110\nbytes = [8, 8, 4]\ninterval = "10ms"\n'
SECOND = 'duration = "1s"\n'


def slowly(due: list[int], priority: list[int], duration: list[int]) -> list[int]:
    """Each moment, the frame of the lowest priority that is due begins, if the bus is free."""
    waiting = set(range(len(due)))
    ends = [0] * len(due)
    now = 0
    while waiting:
        ready = [number for number in waiting if due[number] <= now]
        if not ready:
            now = min(due[number] for number in waiting)
            continue
        number = min(ready, key=lambda number: (priority[number], due[number], number))
        waiting.remove(number)
        now += duration[number]
        ends[number] = now
    return ends


@given(
    st.lists(
        st.tuples(st.integers(0, 200), st.integers(0, 6), st.integers(1, 30)),
        max_size=40,
    )
)
def test_the_lowest_identifier_goes_first(frames: list[tuple[int, int, int]]) -> None:
    due, priority, duration = ([frame[place] for frame in frames] for place in range(3))
    columns = (np.array(column, np.int64) for column in (due, priority, duration))
    assert transmit(*columns).tolist() == slowly(due, priority, duration)


def test_standard_frames_go_before_extended_ones_and_data_before_requests() -> None:
    """The order of ISO 11898-1: same base, then RTR before SRR and IDE."""
    frames = [(0x10F, 0, 0), (0x110, 0, 0), (0x110, 0, 1), (0x110 << 18, 1, 0), (0x110 << 18, 1, 1), (0x111, 0, 0)]
    identifier, extended, remote = (np.array(column) for column in zip(*frames, strict=True))
    ranks = priority_of(identifier.astype(np.uint32), extended.astype(bool), remote.astype(bool))
    assert (np.diff(ranks) > 0).all()


@pytest.mark.parametrize("seed", range(12))
def test_frames_are_as_near_as_their_bits_allow_and_never_nearer(seed: int) -> None:
    scenario = read_scenario(random_can_scenario(seed).replace('"-2s"', '"1ms"'))
    frames = make_can_frame_table(scenario).frames
    rates = {bus.channel: bus.bit_rate for bus in scenario.bus}
    for number, channel in enumerate(scenario.channels):
        own = frames.take((frames.channel == number) & ~frames.error & (frames.fd_flags == 0))
        nominal, _ = frames_bits(own)
        least_ns = nominal * 1_000_000_000 // rates[channel]
        assert (np.diff(own.ts_ns) >= least_ns[1:]).all()
    plan = scenario.can_list[0]
    if len(plan.data_bytes) > 1:
        nearest = np.diff(frames.ts_ns[frames.channel == scenario.channels.index(plan.channel)])
        assert nearest.min() < 400_000


def test_a_sending_is_written_back_to_back() -> None:
    truth_sink = Collected()
    scenario = read_scenario('duration = "10ms"\n[[bus]]\nchannel = "can0"\nbit_rate = "1M"\n' + AXIS)
    simulate(scenario, truth_sink)
    batch = truth_sink.batches[0]
    frames = [batch.packet(row).hex() for row in range(3)]
    assert [frame[:16] for frame in frames] == ["0000011008000000", "0000011108000000", "0000011204000000"]
    assert [frame[16:24] for frame in frames] == ["00000000"] * 3
    assert [len(frame) for frame in frames] == [32, 32, 24]
    times_us = (batch.ts_ns - scenario.start_ns) // 1000
    bits, _ = frames_bits(make_can_frame_table(scenario).frames)
    assert times_us.tolist() == np.cumsum(bits).tolist()


def test_values_are_those_of_every_other_machine() -> None:
    sink = Collected()
    simulate(load_scenario(SCENARIOS / "can-canopen.toml"), sink)
    content = b"".join(
        int(batch.ts_ns[row]).to_bytes(8, "little") + batch.packet(row)
        for batch in sink.batches
        for row in range(len(batch))
    )
    assert hashlib.sha256(content).hexdigest() == "e67442d2fb4592beb12c85ce042b32526af5180636a451b691975c0a20b78ec9"


@pytest.mark.parametrize("seed", [1, 2])
def test_batches_of_any_size_are_the_same(seed: int) -> None:
    scenario = read_scenario(random_can_scenario(seed))
    logs = []
    for size in (7, 1000, 1_000_000):
        sink = Collected()
        simulate(scenario, sink, batch_frames=size)
        logs.append(
            [
                (int(batch.ts_ns[row]), int(batch.channels[row]), batch.packet(row))
                for batch in sink.batches
                for row in range(len(batch))
            ]
        )
    assert logs[0] == logs[1] == logs[2]


def test_a_pcapng_file_holds_buses_and_the_network_in_the_order_of_time(tmp_path: Path) -> None:
    scenario = load_scenario(SCENARIOS / "can-and-ethernet.toml")
    path = tmp_path / "a.pcapng"
    with open_capture(scenario, str(path), str(path)) as sink:
        truth = simulate(scenario, sink, batch_frames=100)
    source = open_source([str(path)])
    seen = [
        (int(batch.ts_ns[row]), source.channels[int(batch.channels[row])], int(batch.link[row]))
        for batch in source
        for row in range(len(batch))
    ]
    assert Counter((channel, link) for _, channel, link in seen) == {
        ("eth0", 1): len(make_frame_table(scenario)),
        ("can0", LinkType.CAN_SOCKETCAN): truth["capture"]["can_frames"],
    }
    assert all(before[0] <= after[0] for before, after in pairwise(seen))


def test_what_is_written_is_what_is_read_back(tmp_path: Path) -> None:
    """A log and a pcapng file of the same scenario hold the same frames of the same buses."""
    scenario = load_scenario(SCENARIOS / "can-two-channels.toml")
    frames = []
    for name in ("a.log", "a.pcapng"):
        path = tmp_path / name
        with open_capture(scenario, str(path), str(path)) as sink:
            simulate(scenario, sink)
        frames.append(frames_of(open_source([str(path)])))
    assert frames[0] == frames[1]
    assert {frame.channel for frame in frames[0]} == set(channels_of(scenario)) == {"can0", "can1"}


@pytest.mark.parametrize("packed", [True, False])
def test_definitions_make_pdos_of_the_given_lengths(packed: bool, tmp_path: Path) -> None:
    sizes = [8, 5, 6, 8, 7, 3] if packed else [1, 2, 3, 4, 5, 6, 7, 8]
    text = AXIS.replace("[8, 8, 4]", f"{sizes}\npacked = {str(packed).lower()}")
    (entry,) = project_of(read_scenario(SECOND + text), tmp_path).definition.lists
    assert [layout.layout.size_bytes for layout in pack(entry)] == sizes
    assert (entry.protocol, entry.list_id, entry.interval_ns) == ("CAN", 0x110, 10_000_000)


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        (AXIS.replace("0x110", "0x7FE"), "can_list[0].cob_id", "0x800"),
        (AXIS.replace("[8, 8, 4]", "[]"), "can_list[0].bytes", "1 to 128"),
        (AXIS.replace("[8, 8, 4]", "9"), "can_list[0].bytes", "out of range"),
        (AXIS + AXIS.replace('"axis"', '"belt"').replace("0x110", "0x112"), "can_list[1].cob_id", "'axis'"),
        (
            AXIS + AXIS.replace('"axis"', '"belt"\nchannel = "can1"').replace("8, 8, 4", "8, 8"),
            "can_list[1].cob_id",
            "does not tell buses apart",
        ),
        (AXIS + "[[bus]]\nchannel = 'can1'\n", "x.toml", "no bus 'can0'"),
        (AXIS + "[[bus]]\nchannel = 'can0'\nbit_rate = '250kbit'\n", "bus[0].bit_rate", "no bit rate"),
        (AXIS + "[[loss]]\nlist = 'axis'\nsubindex = 3\n", "loss[0].subindex", "3 PDOs, 0 to 2"),
        (AXIS + "[[loss]]\nlist = 'axes'\n", "loss[0].list", "no list 'axes'"),
        (AXIS + "[[duplicate]]\nlist = 'axis'\n", "duplicate[0].list", "sent over CAN"),
        (AXIS + "[[wrong_checksum]]\nlist = 'axis'\n", "wrong_checksum[0].list", "sent over CAN"),
        (AXIS + "[[stop]]\nat = '1ms'\n", "stop[0]", "a node or a list"),
        (AXIS + "[[late]]\nlist = 'axis'\nby = '10ms'\n", "late[0].by", "an interval or more"),
        (AXIS + "[[can_traffic]]\nkind = 'sync'\n", "can_traffic[0]", "one of at and interval"),
        (AXIS + "[[can_traffic]]\nkind = 'frame'\nat = '1ms'\n", "can_traffic[0].cob_id", "needs a cob_id"),
        (AXIS + "[[can_traffic]]\nkind = 'sync'\ncob_id = 1\nat = '1ms'\n", "can_traffic[0].cob_id", "from CANopen"),
        (
            AXIS + "[[can_traffic]]\nkind = 'frame'\ncob_id = 0x111\nat = '1ms'\n",
            "can_traffic[0]",
            "identifier of the list 'axis'",
        ),
        (
            AXIS + "[[can_traffic]]\nkind = 'frame'\ncob_id = 1\nat = '1ms'\ndata = '0102030405060708 09'\n",
            "can_traffic[0].data",
            "kind fd",
        ),
        (AXIS + "[[can_traffic]]\nkind = 'sync'\nat = '1ms'\ndata = 'xy'\n", "can_traffic[0].data", "hexadecimal"),
        (AXIS + "[[error_frames]]\nkind = 'buss-off'\nat = '1ms'\n", "error_frames[0].kind", "nearest known"),
        (AXIS + "[[bus_off]]\nat = '1ms'\n[[bus_off]]\nat = '2ms'\n", "bus_off[1].at", "off the bus already"),
        (AXIS.replace('"can0"', '"a b"') + "[[bus]]\nchannel = 'a b'\n", "x.toml", "one word"),
    ],
)
def test_what_a_scenario_cannot_say(text: str, where: str, what: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read_scenario(SECOND + text, "x.toml")
    assert where in str(caught.value.where)
    assert what in str(caught.value) + caught.value.next_step


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[[bus]]\nchannel = 'can0'\nbit_rate = '50k'\n", "waits"),
        ("[[burst]]\nlist = 'axis'\nat = '100ms'\ncount = 3\ngap = '200us'\n", "run into each other"),
        (
            "[[burst]]\nlist = 'axis'\nat = '100ms'\ncount = 5\ngap = '1ms'\n"
            "[[loss]]\nlist = 'axis'\nsubindex = 1\ntelegrams = 11\n"
            "[[loss]]\nlist = 'axis'\nsubindex = 2\ntelegrams = 11\n"
            "[[loss]]\nlist = 'axis'\nsubindex = 0\ntelegrams = 12\n",
            "run into each other",
        ),
    ],
)
def test_what_no_observer_could_tell_is_refused_unless_the_scenario_is_wild(text: str, what: str) -> None:
    with pytest.raises(ConfigurationError, match=what):
        simulate(read_scenario(SECOND + AXIS + text), Collected())
    truth = simulate(read_scenario("wild = true\n" + SECOND + AXIS + text), Collected())
    assert not truth["exact"]


def test_no_definition_packs_a_small_pdo_in_front_of_another() -> None:
    with pytest.raises(ConfigurationError, match="PDO 1 has room in the one before it"):
        can_definitions(read_scenario(SECOND + AXIS.replace("8, 8, 4", "4, 4, 8")))


def nvscope(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return run_text(*arguments)


def test_the_program_writes_a_log_its_truth_and_the_definitions(tmp_path: Path) -> None:
    log, gvl = tmp_path / "plant.log", tmp_path / "gvl"
    done = nvscope("simulate", SCENARIOS / "can-plant-clean.toml", "-w", log, "--gvl", gvl)
    assert done.returncode == ExitCode.GOOD, done.stderr
    assert sorted(path.name for path in gvl.iterdir()) == ["axis.gvl", "belt.gvl", "recipe.gvl"]
    truth = json.loads(Path(f"{log}.truth.json").read_text())
    files = [argument for path in sorted(gvl.iterdir()) for argument in ("--gvl", str(path))]
    report = json.loads(nvscope("report", "--json", *files, log).stdout)
    assert report["capture"]["frames"] == truth["capture"]["frames"] == len(log.read_text().splitlines())
    assert [entry["name"] for entry in report["lists"]] == ["axis", "belt", "recipe"]


@pytest.mark.parametrize(
    ("name", "file", "what"),
    [
        ("can-and-ethernet", "x.log", "frames of CAN and others"),
        ("can-and-ethernet", "x.pcap", "frames of CAN and others"),
        ("can-two-channels", "x.pcap", "2 CAN buses"),
        ("loss", "x.log", "no frames of CAN"),
        ("can-late", "x.txt", "no capture format"),
    ],
)
def test_formats_that_cannot_hold_a_scenario(name: str, file: str, what: str, tmp_path: Path) -> None:
    done = nvscope("simulate", SCENARIOS / f"{name}.toml", "-w", tmp_path / file)
    assert done.returncode == ExitCode.USAGE
    assert what in done.stderr
    assert ".unfinished" not in done.stderr
    assert list(tmp_path.iterdir()) == []
