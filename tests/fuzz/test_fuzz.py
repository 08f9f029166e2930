"""No bytes make the program fall over, hang, or lose a frame: a bounded run of the fuzzer, and files made to be costly.

``python -m tests.fuzz.run`` does the first part for as long as it is told to.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tracemalloc
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from nvscope.errors import UnreadableInput
from tests.fuzz.anatomy import anatomy_of
from tests.fuzz.examination import NAME, Examined, assert_printable, content_of, ends, examine
from tests.fuzz.floods import CAPTURE_FLOODS, TELEGRAM_FLOODS, huge_lengths, large_content
from tests.fuzz.logs import examine_log, fuzz_log
from tests.fuzz.mutations import AIMED, BLIND, COMPRESSIONS, mutated, shortened
from tests.fuzz.originals import random_traffic, sample_captures
from tests.fuzz.run import fuzz_input
from tests.laws import some
from tests.packets import document_of, tracked
from tests.program import COMMAND, run_text

CAPTURES = sample_captures()
FILES_OF_A_CAPTURE = 100
RECORDS = 150
MEBIBYTE = 1 << 20


# --- mutated captures -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CAPTURES)
def test_mutated_captures_are_refused_or_accounted_for(tmp_path: Path, name: str) -> None:
    reached: list[Examined] = [examine(CAPTURES[name], tmp_path, random.Random(name))]
    # A capture of pages has none.
    seen = "telegrams" if reached[0].telegrams else "frames"
    for number in some(range(FILES_OF_A_CAPTURE)):
        rng = random.Random(f"{name}/{number}")
        raw = mutated(rng, shortened(rng, CAPTURES[name], RECORDS), list(CAPTURES.values()))
        reached.append(examine(raw, tmp_path, rng))
    # A fuzzer that only makes files that are refused at once tests nothing.
    assert sum(getattr(examined, seen) > 0 for examined in reached) > len(reached) // 4
    assert any(examined.cut for examined in reached)


def test_damaged_logs_are_refused_or_accounted_for(tmp_path: Path) -> None:
    reached: dict[str, list[Examined]] = {}
    for number in some(range(FILES_OF_A_CAPTURE)):
        suffix, raw = fuzz_log(1000, number)
        reached.setdefault(suffix, []).append(examine_log(raw, tmp_path, random.Random(number)))
    # A fuzzer that only makes files that are refused at once tests nothing.
    every = [examined for found in reached.values() for examined in found]
    assert sum(examined.frames > 0 for examined in every) > len(every) // 4
    assert any(examined.cut for examined in every)


@pytest.mark.parametrize("suffix", COMPRESSIONS)
def test_mutated_compressed_captures_are_refused_or_accounted_for(tmp_path: Path, suffix: str) -> None:
    compress = COMPRESSIONS[suffix]
    others = [compress(raw) for raw in CAPTURES.values()]
    read = 0
    for number in range(30):
        rng = random.Random(f"{suffix}/{number}")
        raw = compress(shortened(rng, rng.choice(list(CAPTURES.values())), RECORDS))
        read += examine(mutated(rng, raw, others), tmp_path, rng).readable
    assert read


def test_mutated_random_traffic_is_accounted_for(tmp_path: Path) -> None:
    for number in some(range(20)):
        rng = random.Random(number)
        raw = random_traffic(number, 100)
        examine(mutated(rng, raw, [raw]), tmp_path, rng)


@pytest.mark.parametrize("name", ["telegrams.pcap", "interfaces.pcapng"])
def test_every_number_of_every_record_at_its_ends(tmp_path: Path, name: str) -> None:
    """The lengths in headers and blocks, one after the other, as 0, 1, the largest, and one off."""
    anatomy = anatomy_of(CAPTURES[name])
    assert anatomy is not None
    # One record of each kind and size of header: the others have the same numbers.
    places = {(record.kind, record.order, len(record.numbers())): at for at, record in enumerate(anatomy.records)}
    changed = [
        (place, number.written(record.data, value))
        for place in places.values()
        for record in [anatomy.records[place]]
        for number in record.numbers()
        for old in [number.read(record.data)]
        for value in (0, 1, -1, old + 1, old - 1)
    ]
    for place, data in some(changed):
        records = list(anatomy.records)
        records[place] = records[place]._replace(data=data)
        _read_as_expected(tmp_path, anatomy.with_records(records).assembled())


def _read_as_expected(folder: Path, raw: bytes) -> None:
    path = folder / NAME
    path.write_bytes(raw)
    expected = content_of(raw)
    try:
        source = CaptureFile(str(path))
        document = document_of(tracked(source))
    except UnreadableInput:
        assert not expected.readable
        return
    assert document["capture"]["frames"] == len(expected.packets) == source.info.frames
    assert document["capture"]["telegrams"] + document["capture"]["other_frames"] == source.info.frames
    assert (source.info.truncation.offset if source.info.truncation else None) == expected.cut


def test_captures_cut_at_any_byte_give_the_whole_records_before(tmp_path: Path) -> None:
    for name in ("telegrams.pcap", "interfaces.pcapng"):
        raw = CAPTURES[name]
        for size in some(range(0, len(raw), 13)):
            _read_as_expected(tmp_path, raw[:size])


def test_mutated_captures_make_one_timeline(tmp_path: Path) -> None:
    others = list(CAPTURES.values())
    for number in some(range(15)):
        rng = random.Random(f"timeline/{number}")
        raws = [mutated(rng, shortened(rng, rng.choice(others), RECORDS), others) for _ in range(3)]
        paths: list[Path] = []
        frames = 0
        for raw in raws:
            expected = content_of(raw)
            if expected.readable:
                paths.append(tmp_path / f"{number}-{len(paths)}")
                paths[-1].write_bytes(raw)
                frames += len(expected.packets)
        if paths:
            with ends():
                source = open_source([str(path) for path in paths])
                capture = document_of(tracked(source))["capture"]
            assert capture["telegrams"] + capture["other_frames"] == capture["frames"] == frames
            assert [info.frames for info in source.infos] == [
                len(content_of(path.read_bytes()).packets) for path in paths
            ]


def test_the_same_seed_makes_the_same_file() -> None:
    assert [fuzz_input(3, number) for number in range(12)] == [fuzz_input(3, number) for number in range(12)]


@pytest.mark.parametrize("change", [*AIMED, *BLIND], ids=lambda change: change.__name__)
def test_every_mutation_changes_files(change: Callable[..., Any]) -> None:
    raw = shortened(random.Random(1), CAPTURES["peers/peers.pcap"], 20)
    anatomy = anatomy_of(raw)
    assert anatomy is not None
    assert anatomy.assembled() == raw
    made = set()
    for seed in range(20):
        rng = random.Random(seed)
        made.add(change(rng, anatomy).assembled() if change in AIMED else change(rng, raw, list(CAPTURES.values())))
    assert len(made - {raw}) > 3


# --- the program ----------------------------------------------------------------------------------------------------

COMMANDS = (
    ["report", "-v"], ["report", "--json"], ["report", "--md"], ["packets"], ["packets", "-V", "-x"],
    ["packets", "-T", "ndjson"],
)  # fmt: skip


@pytest.mark.parametrize("number", range(12))
def test_the_program_ends_with_a_code_and_in_words(tmp_path: Path, number: int) -> None:
    command = COMMANDS[number % len(COMMANDS)]
    _, raw = fuzz_input(1000, number)
    path = tmp_path / NAME
    path.write_bytes(raw)
    if number % 3 > 0:
        done = run_text(*command, "-q", path)
    else:
        with path.open("rb") as file:
            done = subprocess.run(
                [*COMMAND, *command, "-q", "-"], stdin=file, capture_output=True, text=True, timeout=120, check=False
            )
    assert done.returncode in (0, 3, 4), done.stderr
    assert "Traceback" not in done.stderr
    assert_printable(done.stdout)
    assert_printable(done.stderr)
    # Whoever ends with another code than 0 says why.
    assert done.stderr or not done.returncode


# --- memory ---------------------------------------------------------------------------------------------------------


def test_lengths_that_promise_much_take_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "capture"
    files = huge_lengths()
    assert len(files) > 50
    tracked(CaptureFile(str(_written(path, CAPTURES["telegrams.pcap"]))))
    tracemalloc.start()
    try:
        for name, raw in files.items():
            _written(path, raw)
            tracemalloc.reset_peak()
            before, _ = tracemalloc.get_traced_memory()
            try:
                tracked(CaptureFile(str(path)))
            except UnreadableInput:
                assert not content_of(raw).readable
            _, peak = tracemalloc.get_traced_memory()
            assert peak - before < 20 * MEBIBYTE, name
    finally:
        tracemalloc.stop()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell what a process took")
@pytest.mark.parametrize("suffix", COMPRESSIONS)
def test_small_files_with_large_content_take_little_memory(tmp_path: Path, suffix: str) -> None:
    megabytes = 300
    raw = COMPRESSIONS[suffix](large_content(megabytes))
    assert len(raw) < 4 * MEBIBYTE
    program = (
        "import sys\n"
        "from nvscope.capture.capture_file import CaptureFile\n"
        "from tests.packets import tracked\n"
        "print(tracked(CaptureFile(sys.argv[1])).capture.frames)\n"
        "print(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])\n"
    )
    command = [sys.executable, "-c", program, str(_written(tmp_path / "capture", raw))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    frames, most_kib = map(int, done.stdout.split())
    assert frames == 4 * megabytes
    assert most_kib < 250 * 1024


def _written(path: Path, raw: bytes) -> Path:
    path.write_bytes(raw)
    return path


# --- cost -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CAPTURE_FLOODS)
def test_floods_of_records_end(tmp_path: Path, name: str) -> None:
    flood, count = CAPTURE_FLOODS[name]
    raw = flood(count)
    with ends():
        state = tracked(CaptureFile(str(_written(tmp_path / "capture", raw))))
    assert state.capture.frames == len(content_of(raw).packets)


@pytest.mark.parametrize("name", TELEGRAM_FLOODS)
def test_cost_grows_no_faster_than_the_capture(tmp_path: Path, name: str) -> None:
    """From 400 to 800 telegrams twice as much is added as from 200 to 400; where the cost is a square, four times."""
    flood = TELEGRAM_FLOODS[name]

    def judged(count: int) -> int:
        path = _written(tmp_path / "capture", flood(count))
        return steps(lambda: document_of(tracked(CaptureFile(str(path)))))

    judged(20)  # what is computed once only
    assert growth(judged) < 2.6


def test_a_cost_that_is_a_square_does_not_go_unnoticed() -> None:
    """Neither a loop over some lines nor one in a single line, both without a call."""
    assert growth(lambda count: steps(lambda: _looked_through(count, 20))) < 2.1
    assert growth(lambda count: steps(lambda: _looked_through(count, count // 8))) > 2.6
    assert growth(lambda count: steps(lambda: [1 for _ in range(count) for _ in range(count // 8)])) > 2.6


def _looked_through(count: int, others: int) -> int:
    found = 0
    for number in range(count):
        for other in range(others):
            if other == number:
                found += 1
    return found


def growth(cost: Callable[[int], int]) -> float:
    quarter, half, whole = (cost(count) for count in (200, 400, 800))
    return (whole - half) / (half - quarter)


def steps(action: Callable[[], object]) -> int:
    """Return how many lines and turns of loops, calls and returns of Python an action takes: the same each time."""
    executed = 0

    def follow(_frame: types.FrameType, _event: str, _argument: object) -> Any:
        nonlocal executed
        executed += 1
        return follow

    before = sys.gettrace()
    sys.settrace(follow)
    try:
        action()
    finally:
        sys.settrace(before)
    return executed
