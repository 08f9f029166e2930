"""``nvscope replay`` and ``simulate`` on CAN: python-can hears what its own log reader reads, frame by frame."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import can

from tests.program_here import run_text

ROOT = Path(__file__).parents[2]
PRESS = ROOT / "captures" / "can" / "press.log"
GROUP = "239.74.163.78"
QUIET_S = 0.4

Fact = tuple[int, bool, bool, bool, bool, bool, int, bytes]


def fact(message: can.Message) -> Fact:
    """Return what of a frame is on the bus."""
    return (
        message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.is_fd,
        message.bitrate_switch, message.error_state_indicator, message.dlc, bytes(message.data),
    )  # fmt: skip


def word(port: int) -> str:
    """Return a bus that all processes of this machine hear, and nobody else."""
    return f"can:udp_multicast:{GROUP},port={port},hop_limit=0"


@contextmanager
def heard(port: int) -> Iterator[list[Fact]]:
    """Yield the frames that come on a bus; complete behind the with."""
    got: list[Fact] = []
    ended = threading.Event()

    def listen() -> None:
        quiet_s = time.monotonic()
        while not (ended.is_set() and time.monotonic() - quiet_s > QUIET_S):
            message = bus.recv(0.05)
            if message is not None:
                got.append(fact(message))
                quiet_s = time.monotonic()

    with can.Bus(interface="udp_multicast", channel=GROUP, port=port, hop_limit=0) as bus:
        thread = threading.Thread(target=listen)
        thread.start()
        try:
            yield got
        finally:
            ended.set()
            thread.join()


def written(path: Path, messages: Sequence[can.Message], channel: str = "can0") -> Path:
    with can.CanutilsLogWriter(str(path)) as log:
        for number, message in enumerate(messages):
            message.timestamp, message.channel = 1000 + number / 200, channel
            log.on_message_received(message)
    return path


def test_every_kind_of_frame_comes_as_it_is(tmp_path: Path) -> None:
    messages = [
        can.Message(arbitration_id=0x181, data=b"\1\2\3", is_extended_id=False),
        can.Message(arbitration_id=0x18FF0201, data=b"", is_extended_id=True),
        can.Message(arbitration_id=0x605, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x185, data=bytes(range(48)), is_fd=True, bitrate_switch=True, is_extended_id=False),
        can.Message(
            arbitration_id=7, data=b"x" * 64, is_fd=True, error_state_indicator=True, is_extended_id=True
        ),
        can.Message(arbitration_id=0x80, data=b"", is_extended_id=False),
    ]  # fmt: skip
    path = written(tmp_path / "x.log", messages)
    with heard(43201) as got:
        done = run_text("replay", path, "--to", word(43201))
    assert done.returncode == 0, done.stderr
    assert f"6 frames sent to {word(43201)}; late by" in done.stderr
    assert got == [fact(one) for one in messages]


def test_a_plant_comes_frame_by_frame_and_without_its_error_frames() -> None:
    # python-can's reader takes what is told of errors for frames of 29 bits.
    errors = [int(line.split()[2].split("#")[0], 16) & 0x20000000 for line in PRESS.read_text().splitlines()]
    read = zip(can.CanutilsLogReader(str(PRESS)), errors, strict=True)
    expected = [fact(one) for one, is_error in read if not is_error]
    with heard(43202) as got:
        done = run_text("replay", PRESS, "--to", word(43202), "--rate", "50")
    assert done.returncode == 0, done.stderr
    assert got == expected
    assert len(got) > 1000
    assert "1 error frame left out: nobody sends such" in done.stderr


def test_two_channels_on_one_bus_and_what_was_mapped_in_vain_are_told(tmp_path: Path) -> None:
    log = tmp_path / "x.log"
    log.write_text("(1000.000000) can0 101#01\n(1000.010000) can1 102#02\n")
    done = run_text("replay", log, "--to", "can:virtual:a", "--map", "can7=can:virtual:b")
    assert done.returncode == 0, done.stderr
    assert "frames of can0, can1 went to one bus, can:virtual:a; --map CHANNEL=can:… parts them." in done.stderr
    assert "--map can7=…: no frame was on a channel of this name." in done.stderr


def test_what_remote_frames_ask_for_comes_too(tmp_path: Path) -> None:
    log = tmp_path / "x.log"
    log.write_text("(1000.000000) can0 605#R4\n")
    with heard(43207) as got:
        assert run_text("replay", log, "--to", word(43207)).returncode == 0
    assert got == [(0x605, False, True, False, False, False, 4, b"")]


def test_channels_go_where_they_are_mapped_to(tmp_path: Path) -> None:
    log = tmp_path / "x.log"
    log.write_text("(1000.000000) can0 101#01\n(1000.010000) can1 102#02\n(1000.020000) can0 103#03\n")
    with heard(43203) as first, heard(43204) as second:
        done = run_text("replay", log, "--to", word(43203), "--map", f"can1={word(43204)}")
    assert done.returncode == 0, done.stderr
    assert [one[0] for one in first] == [0x101, 0x103]
    assert [one[0] for one in second] == [0x102]


def test_what_was_not_captured_whole_is_not_sent(tmp_path: Path) -> None:
    path = written(tmp_path / "x.log", [can.Message(arbitration_id=1, data=b"12345678", is_extended_id=False)] * 2)
    assert run_text("convert", path, "-w", tmp_path / "x.pcap").returncode == 0
    data = bytearray((tmp_path / "x.pcap").read_bytes())
    # The second one was captured without its last four bytes.
    data[24 + 32 + 8 : 24 + 32 + 12] = (12).to_bytes(4, "little")
    (tmp_path / "cut.pcap").write_bytes(data[:-4])
    with heard(43205) as got:
        done = run_text("replay", tmp_path / "cut.pcap", "--to", word(43205))
    assert (done.returncode, len(got)) == (3, 1), done.stderr
    assert "1 frame not captured whole, and not sent" in done.stderr


def test_a_simulated_bus_sends_what_it_would_write(tmp_path: Path) -> None:
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        'title = "bus"\nduration = "1s"\nseed = 1\n[[bus]]\nchannel = "can0"\nbit_rate = 250000\n'
        '[[can_list]]\nname = "a"\ncob_id = 0x181\nbytes = [8]\ninterval = "20ms"\n'
    )
    made = run_text("simulate", scenario, "-w", tmp_path / "x.log")
    assert made.returncode == 0, made.stderr
    with heard(43206) as got:
        done = run_text("simulate", scenario, "--to", word(43206))
    assert done.returncode == 0, done.stderr
    assert got == [fact(one) for one in can.CanutilsLogReader(str(tmp_path / "x.log"))]
    assert len(got) > 20


def test_a_bus_that_is_not_there_is_told() -> None:
    done = run_text("replay", PRESS, "--to", "can:nothing:x", "--allow-network")
    assert (done.returncode, "python-can has no interface 'nothing'" in done.stderr) == (5, True), done.stderr
