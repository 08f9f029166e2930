"""A capture in several files is one capture: any cut by time, in any order of the files, gives the same report."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from dissectors.batch import PacketBatch
from nvscope.capture.open import open_source
from nvscope.capture.pcap import PcapSink
from nvscope.capture.pcapng.sink import PcapngSink
from tests.laws import some
from tests.oracle.traffic import generate
from tests.packets import batch_of, document_of, tracked


def sorted_by_time(seed: int) -> PacketBatch:
    frames = sorted(generate(seed, frames=300, link=1), key=lambda frame: frame.ts_ns)
    return batch_of(frames)


def write(path: Path, batch: PacketBatch) -> None:
    with PcapngSink(str(path)) if path.suffix == ".pcapng" else PcapSink(str(path)) as sink:
        sink.write(batch)


@pytest.mark.parametrize("seed", some(range(12)))
def test_files_in_any_order_are_one_timeline(seed: int, tmp_path: Path) -> None:
    choice = random.Random(seed)
    whole = sorted_by_time(seed)
    # Frames of one time stay together: between files of the same time there is no order.
    cuts = [row for row in range(1, len(whole)) if whole.ts_ns[row] != whole.ts_ns[row - 1]]
    cuts = sorted(choice.sample(cuts, 4))
    names = [f"{choice.randrange(10**6):06}.{choice.choice(['pcap', 'pcapng'])}" for _ in range(5)]
    for name, start, stop in zip(names, [0, *cuts], [*cuts, len(whole)], strict=True):
        write(tmp_path / name, whole[start:stop])
    choice.shuffle(names)
    source = open_source([str(tmp_path / name) for name in names], batch_packets=choice.choice([1, 17, 4096]))
    assert document_of(tracked(source)) == document_of(tracked([whole]))


@pytest.mark.parametrize("seed", some(range(12)))
def test_interleaved_files_are_one_timeline(seed: int, tmp_path: Path) -> None:
    choice = random.Random(seed)
    whole = sorted_by_time(seed)
    owner = [choice.randrange(3)]
    for row in range(1, len(whole)):
        same_time = whole.ts_ns[row] == whole.ts_ns[row - 1]
        owner.append(owner[-1] if same_time else choice.randrange(3))
    for number in range(3):
        with PcapSink(str(tmp_path / f"{number}.pcap")) as sink:
            for row in range(len(whole)):
                if owner[row] == number:
                    sink.write(whole[row : row + 1])
    source = open_source([str(tmp_path / f"{number}.pcap") for number in (2, 0, 1)], batch_packets=13)
    assert document_of(tracked(source)) == document_of(tracked([whole]))
