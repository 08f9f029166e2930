"""A plant of a seed, with its faults, as a capture that can be asked."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.buses import Buses, BusSettings
from nvscope.definition.project_file import read_project
from tests.causes.drawn import capture_faults, list_faults, loss_faults, node_faults, reader_faults
from tests.causes.drawn.bus import ON_CAN, Bus, drawn_bus, write_log
from tests.causes.drawn.measure import told
from tests.causes.drawn.packets import write_pcap, write_pcapng
from tests.causes.drawn.places import Inject
from tests.causes.drawn.plant import Plant, drawn_plant
from tests.causes.drawn.traffic import UnclearError, play
from tests.causes.drawn.truth import Fault
from tests.records import replace

ON_ETHERNET: Sequence[Inject] = (
    node_faults.node_restart, node_faults.node_silent, node_faults.program_stopped,
    list_faults.list_restarted, list_faults.list_stopped, list_faults.second_sender, list_faults.byte_swapped,
    list_faults.wide_counter, list_faults.sender_late, list_faults.sender_bursts, list_faults.download,
    list_faults.two_paths,
    loss_faults.loss_of_list, loss_faults.outage_of_list, loss_faults.link_flaps, loss_faults.link_thins,
    loss_faults.link_cut,
    reader_faults.reader_silent, reader_faults.reader_rejects, reader_faults.reader_without_program,
    reader_faults.single_answers_lost, reader_faults.acknowledgement_impossible, reader_faults.boot_up_unanswered,
    capture_faults.mirror_overloaded, capture_faults.mirror_thins, capture_faults.drops_told,
    capture_faults.mirrored_twice, capture_faults.clock_back, capture_faults.clock_forward,
)  # fmt: skip


def drawn(seed: int, folder: Path) -> tuple[Sequence[Fault], Inquiry, str]:
    """Return what was put into the plant of a seed, what can be asked of its capture, and a word about it."""
    for attempt in range(100):
        plant = drawn_plant(random.Random(seed * 1000 + attempt))
        try:
            return _written(plant, folder)
        except UnclearError:
            continue
    raise AssertionError(f"no clear plant of seed {seed}")


def drawn_on_can(seed: int, folder: Path) -> tuple[Sequence[Fault], Inquiry, str]:
    """Return the same of a plant with one or two buses."""
    chance = random.Random(seed)
    seconds = chance.choice([30, 40, 60])
    buses = [drawn_bus(chance, f"can{number}", seconds) for number in range(chance.choice([1, 1, 2]))]
    wanted = chance.choices(range(6), [3, 5, 5, 3, 2, 2])[0]
    faults: list[Fault] = []
    for _ in range(40):
        if len(faults) >= wanted:
            break
        fault = chance.choice(ON_CAN)(chance.choice(buses))
        if fault is not None and any(_same(fault, other) for other in faults):
            return drawn_on_can(seed + 1_000_003, folder)
        if fault is not None:
            faults.append(fault)
    try:
        path, files = write_log(buses, folder)
    except UnclearError:
        return drawn_on_can(seed + 1_000_003, folder)
    return faults, inquiry_of(buses, path, files), f"can: {[told(fault) for fault in faults]}"


def inquiry_of(buses: Sequence[Bus], path: Path, files: Sequence[str]) -> Inquiry:
    """Return what can be asked of a log of buses whose definitions and bit rates are known."""
    rates = Buses(tuple((bus.channel, BusSettings(bus.bit_rate)) for bus in buses))
    return Inquiry([str(path)], replace(read_project(None, definitions=files), buses=rates))


def _written(plant: Plant, folder: Path) -> tuple[Sequence[Fault], Inquiry, str]:
    chance = plant.chance
    wanted = chance.choices(range(6), [3, 5, 5, 3, 2, 2])[0]
    for _ in range(60):
        if len(plant.faults) >= wanted:
            break
        fault = chance.choice(ON_ETHERNET)(plant)
        if fault is not None and any(_same(fault, other) for other in plant.faults):
            raise UnclearError
        if fault is not None:
            plant.faults.append(fault)
    frames = play(plant)
    if plant.drops is None:
        path = folder / "plant.pcap"
        write_pcap(frames, path)
    else:
        path = folder / "plant.pcapng"
        write_pcapng(frames, path, plant.drops)
    return (
        plant.faults,
        Inquiry([str(path)]),
        f"{len(frames)} frames",
    )


ONE_EACH = (
    "node-restart",
    "node-silent",
    "program-stopped",
    "list-restarted",
    "clock",
    "second-sender",
    "reader-silent",
)
"""Each of these events is one, also where there are several of a kind; of others, all at one place are one."""


def _same(one: Fault, other: Fault) -> bool:
    same = (
        one.channel == other.channel
        and one.kind == other.kind
        and one.nodes == other.nodes
        and one.lists == other.lists
    )
    return same and one.kind not in ONE_EACH
