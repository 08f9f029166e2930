"""``nvscope record``: what comes is in a file, whatever ends the recording, and the file is whole."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import pytest
from mcap.reader import SeekingReader

from nvscope.capture.open import open_source
from tests.capture.live.network import Host, cable, needs_namespaces, send
from tests.capture.live.test_ring import wait_for_ring
from tests.capture.mcap.recordings import packets_of, read, steady, write
from tests.program_here import run, run_text

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "captures" / "plant.pcapng.gz"
PEERS = ROOT / "captures" / "peers"
SPARE_S = 20


def checked(path: Path) -> int:
    """Have the reference library read all of a file, its checksums too; return how many messages there are."""
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        count = sum(1 for _ in reader.iter_messages(log_time_order=False))
        assert count == summary.statistics.message_count
        return count


def metadata_of(path: Path) -> dict[str, str]:
    """Return the last of what a recording says of itself."""
    with path.open("rb") as file:
        return [one.metadata for one in SeekingReader(file).iter_metadata() if one.name == "nvscope"][-1]


def test_a_capture_is_recorded_as_it_is(tmp_path: Path) -> None:
    done = run_text("record", PLANT, "-w", tmp_path / "x.mcap")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == f"nvscope: 1212 frames in {tmp_path / 'x.mcap'}.\n"
    checked(tmp_path / "x.mcap")
    expected = [one for part in open_source([str(PLANT)]) for one in packets_of(part)]
    assert read(tmp_path / "x.mcap").packets == expected


def test_the_format_is_that_of_the_ending(tmp_path: Path) -> None:
    for ending in ("pcap", "pcapng", "mcap"):
        assert run_text("record", PLANT, "-w", tmp_path / f"x.{ending}", "-q").stderr == ""
        assert read(tmp_path / f"x.{ending}").info.format == ending
    done = run_text("record", PLANT, "-w", tmp_path / "x.docx")
    assert (done.returncode, "no capture format has the suffix" in done.stderr) == (2, True)


def test_one_file_follows_the_other_and_each_stands_alone(tmp_path: Path) -> None:
    done = run_text(
        "record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", tmp_path / "x.mcap", "-b", "packets:300", "-b", "files:2"
    )
    assert done.returncode == 0, done.stderr
    files = sorted(tmp_path.iterdir())
    assert [len(read(path).packets) for path in files] == [300, 264]
    for path in files:
        checked(path)
        assert len(open_source([str(path)]).attachments) == 5
    assert "batch" in run_text("vars", tmp_path, cwd=tmp_path).stdout
    assert done.stderr.endswith(f"864 frames in 3 files, the last is {files[-1]}.\n")


def test_what_exists_stays_unless_it_is_forced(tmp_path: Path) -> None:
    path = write(tmp_path / "x.mcap", steady(3))
    before = path.read_bytes()
    done = run_text("record", PLANT, "-w", path)
    assert (done.returncode, "exists already" in done.stderr, "--force" in done.stderr) == (2, True, True)
    for options in ((), ("--force",)):
        done = run_text("record", path, "-w", path, *options)
        assert (done.returncode, "one of the inputs" in done.stderr) == (2, True)
    assert path.read_bytes() == before
    assert run_text("record", PLANT, "-w", path, "--force").returncode == 0
    assert len(read(path).packets) == 1212


def test_it_says_what_is_missing() -> None:
    assert "no file to write is named" in run_text("record", PLANT).stderr
    assert "does not say when a file is followed" in run_text("record", PLANT, "-w", "x.mcap", "-b", "files:3").stderr


@pytest.mark.parametrize("ending", ["mcap", "pcapng", "pcap"])
def test_where_the_disk_is_full_the_file_is_whole(small_disk: Path, ending: str, tmp_path: Path) -> None:
    path = small_disk / f"x.{ending}"
    many = write(tmp_path / "many.pcap", steady(60_000))
    done = run_text("record", many, "-w", path)
    assert done.returncode == 5, done.stderr
    assert "No space left on device; what was recorded is whole" in done.stderr
    found = read(path)
    assert found.packets == steady(60_000)[: len(found.packets)]
    assert found.info.truncation is None
    assert f"nvscope: {len(found.packets)} frames in {path}" in done.stderr.replace(" ", "", 0).replace("\u202f", "")
    if ending == "mcap":
        checked(path)


def test_no_room_for_a_begin_leaves_no_file(small_disk: Path) -> None:
    (small_disk / "full").write_bytes(bytes(62 << 10))
    done = run_text("record", PLANT, "-w", small_disk / "x.mcap")
    assert (done.returncode, "No space left" in done.stderr) == (5, True)
    assert [one.name for one in small_disk.iterdir()] == ["full"]


def sent(sender: Host, *words: str) -> None:
    """Wait until all is sent."""
    assert sender.start(*words).wait(SPARE_S) == 0


def _recording(reader: Host, path: Path, *words: str) -> subprocess.Popen[str]:
    done = reader.nvscope("record", "-i", reader.device, "-w", str(path), *words)
    wait_for_ring(reader)
    return done


@needs_namespaces
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_it_with_a_whole_file(number: int, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with cable() as (sender, reader):
        recorder = _recording(reader, path, "-f", "udp")
        sent(sender, *send("10.77.0.255", 500))
        time.sleep(0.2)
        recorder.send_signal(number)
        out, told = recorder.communicate(timeout=SPARE_S)
    assert (recorder.returncode, out) == (0, ""), told
    assert f"500 frames in {path}" in told
    assert len(read(path).packets) == 500
    checked(path)
    said = metadata_of(path)
    assert (said["interface"], said["capture_filter"], said["drops"]) == (reader.device, "udp", "0")
    assert said["host"]


@needs_namespaces
def test_each_packet_is_in_the_file_within_a_second(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with cable() as (sender, reader):
        recorder = _recording(reader, path)
        for count in (1, 2, 3):
            sent(sender, *send("10.77.0.255", 1))
            time.sleep(1.0)
            found = read(path)
            assert len(found.packets) == count
            assert found.info.truncation is not None
        recorder.send_signal(signal.SIGINT)
        recorder.communicate(timeout=SPARE_S)
    assert read(path).info.truncation is None


@needs_namespaces
def test_an_interface_that_goes_ends_it_with_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with cable() as (sender, reader):
        recorder = _recording(reader, path)
        sent(sender, *send("10.77.0.255", 100))
        time.sleep(0.2)
        reader.ip("link", "delete", reader.device)
        _, told = recorder.communicate(timeout=SPARE_S)
    assert recorder.returncode == 5
    assert "the interface is gone" in told
    assert len(read(path).packets) >= 100
    checked(path)


@needs_namespaces
def test_it_ends_by_itself(tmp_path: Path) -> None:
    with cable() as (sender, reader):
        recorder = _recording(reader, tmp_path / "x.mcap", "-a", "packets:70", "-f", "udp")
        sent(sender, *send("10.77.0.255", 100))
        recorder.communicate(timeout=SPARE_S)
    assert recorder.returncode == 0
    assert len(read(tmp_path / "x.mcap").packets) == 70


def test_packets_writes_what_it_would_show(tmp_path: Path) -> None:
    done = run_text("packets", PLANT, "-Y", "nv.index == 7", "-w", tmp_path / "x.pcapng")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == f"nvscope: 702 of 1212 frames in {tmp_path / 'x.pcapng'}.\n"
    shown = run_text("packets", PLANT, "-Y", "nv.index == 7", "-t", "e", "-T", "fields", "-e", "frame.time_epoch")
    written = run_text("packets", tmp_path / "x.pcapng", "-t", "e", "-T", "fields", "-e", "frame.time_epoch")
    assert shown.stdout == written.stdout
    done = run_text("packets", PLANT, "-w", tmp_path / "y.pcapng", "-V", "-c", "3")
    assert (done.returncode, "-V, -c: of what is shown" in done.stderr) == (2, True)
    done = run_text("packets", PLANT, "-w", PLANT)
    assert (done.returncode, PLANT.stat().st_size) == (2, PLANT.stat().st_size)


def test_a_file_that_cannot_be_written_is_not_removed(tmp_path: Path) -> None:
    for name in ("notes.docx", "x.mcap"):
        (tmp_path / name).write_text("mine")
    done = run_text("record", PLANT, "-w", tmp_path / "notes.docx", "--force")
    assert (done.returncode, (tmp_path / "notes.docx").read_text()) == (2, "mine")
    (tmp_path / "folder.mcap").mkdir()
    done = run_text("record", PLANT, "-w", tmp_path / "folder.mcap", "--force")
    assert (done.returncode, (tmp_path / "folder.mcap").is_dir()) == (2, True)


def test_stdout_takes_a_recording(tmp_path: Path) -> None:
    expected = [one for part in open_source([str(PLANT)]) for one in packets_of(part)]
    for verb in ("record", "convert"):
        for name, ending in (("-", "pcapng"), ("-.mcap", "mcap"), ("-.pcap", "pcap")):
            done = run(verb, PLANT, "-w", name, "-q", cwd=tmp_path)
            assert (done.returncode, done.stderr) == (0, b"")
            (tmp_path / f"x.{ending}").write_bytes(done.stdout)
            assert read(tmp_path / f"x.{ending}").packets == expected
            assert read(tmp_path / f"x.{ending}").info.format == ending
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.mcap", "x.pcap", "x.pcapng"]


def test_a_disk_that_is_full_between_two_files_is_told(small_disk: Path) -> None:
    done = run_text("record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", small_disk / "x.mcap", "-b", "packets:100")
    assert done.returncode == 5, done.stderr
    assert "No space left on device; what was recorded is whole" in done.stderr
    assert sum(len(read(path).packets) for path in small_disk.iterdir()) == int(done.stderr.split()[1])
    for path in small_disk.iterdir():
        checked(path)


def test_inputs_in_a_directory_stay_as_they_are(tmp_path: Path) -> None:
    path = write(tmp_path / "in.mcap", steady(3))
    before = path.read_bytes()
    done = run_text("record", tmp_path, "-w", path, "--force")
    assert (done.returncode, "one of the inputs" in done.stderr, path.read_bytes()) == (2, True, before)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("-w", "x.mcap", "--pre", "3s"), "--pre is of the events of --trigger"),
        (("-w", "x.mcap", "--max-rate", "3"), "--max-rate is of the events of --trigger"),
        (("-w", ".",), "is a directory"),
        (("-w", "-", "-b", "packets:3"), "-b makes files, and -w - is stdout"),
        (("-w", "x.mcap", "--trigger", "var.fTemp > 3"), "--gvl names them"),
        (("-w", "x.mcap", "--trigger", "nv.index == 7", "--pre", "-1s"), "must not be less than 0"),
    ],
)  # fmt: skip
def test_options_that_do_not_fit_are_told(options: tuple[str, ...], told: str, tmp_path: Path) -> None:
    done = run_text("record", PLANT, *options, cwd=tmp_path)
    assert (done.returncode, done.stdout, told in done.stderr) == (2, "", True), done.stderr
    assert list(tmp_path.iterdir()) == []
