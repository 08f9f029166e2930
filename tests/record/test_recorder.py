"""What is recorded while it is told: whole frames in a new file, whatever happens to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.capture.open import open_source
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.errors import UsageError
from nvscope.record.recorder import Recorder
from tests.packets import Batches, cut
from tests.program import run_text

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "captures" / "plant.pcapng.gz"


def packets_of(path: Path) -> list[tuple[bytes, int]]:
    return [
        (batch.packet(row), int(batch.ts_ns[row])) for batch in open_source([str(path)]) for row in range(len(batch))
    ]


def told_to(recorder: Recorder, count: int, size: int = 100) -> None:
    """Tell a recorder the first frames of the plant."""
    (whole,) = open_source([str(PLANT)])
    for _ in run(Batches(cut(whole[:count], size)), Reading(), [recorder]):  # type: ignore[arg-type]
        pass


def test_frames_are_recorded_from_the_start_to_the_stop(tmp_path: Path) -> None:
    recorder, path = Recorder(), tmp_path / "some.pcapng"
    told_to(recorder, 100)
    recorder.start(str(path))
    told_to(recorder, 250)
    state = recorder.stop()
    told_to(recorder, 50)
    assert state is not None
    assert (state.frames, state.is_on, state.failure) == (250, False, "")
    assert packets_of(path) == packets_of(PLANT)[:250]


def test_each_batch_is_in_the_file_at_once(tmp_path: Path) -> None:
    recorder, path = Recorder(), tmp_path / "some.pcapng"
    recorder.start(str(path))
    told_to(recorder, 100)
    assert len(packets_of(path)) == 100
    assert recorder.state is not None
    assert recorder.state.bytes == path.stat().st_size
    recorder.stop()


def test_what_exists_is_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "some.pcapng"
    path.write_text("mine")
    recorder = Recorder()
    for write in (lambda: recorder.start(str(path)), lambda: recorder.save(str(path), [], ())):
        with pytest.raises(UsageError, match="exists"):
            write()
    assert path.read_text() == "mine"
    assert recorder.state is None


def test_one_file_at_a_time(tmp_path: Path) -> None:
    recorder = Recorder()
    recorder.start(str(tmp_path / "one.pcapng"))
    with pytest.raises(UsageError, match="already"):
        recorder.start(str(tmp_path / "two.pcapng"))
    assert not (tmp_path / "two.pcapng").exists()
    recorder.stop()


def test_a_full_disk_ends_it_with_the_last_whole_frame(small_disk: Path) -> None:
    recorder, path = Recorder(), small_disk / "some.pcapng"
    recorder.start(str(path))
    told_to(recorder, 1212)
    state = recorder.state
    assert state is not None
    assert not state.is_on
    assert "No space left" in state.failure
    assert 100 < state.frames < 1212
    assert packets_of(path) == packets_of(PLANT)[: state.frames]
    done = run_text("report", str(path))
    assert (done.returncode, done.stderr) == (0, "")
    told_to(recorder, 100)  # off
    assert recorder.state == state


def test_what_is_saved_is_a_capture_in_the_format_of_its_name(tmp_path: Path) -> None:
    (whole,) = open_source([str(PLANT)])
    path = tmp_path / "ring.pcap"
    assert Recorder.save(str(path), cut(whole, 300), ()) == 1212
    assert packets_of(path) == packets_of(PLANT)
    with pytest.raises(UsageError, match="suffix"):
        Recorder.save(str(tmp_path / "ring.txt"), cut(whole, 300), ())
    assert not (tmp_path / "ring.txt").exists()
