"""Buses of python-can as sources, by those that need no adapter."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import can
import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.live.can.word import CanWord
from nvscope.capture.source import Source
from nvscope.cli.definitions import project_of
from nvscope.errors import UsageError
from tests.capture.live.buses import SCRIPTS, frames_of, message, opened, sender
from tests.oracle.builders import telegram
from tests.program import run_text

_CAPTURES = Path(__file__).parents[3] / "captures" / "can"


@pytest.mark.parametrize(
    ("word", "interface", "channel", "name", "options"),
    [
        ("can:socketcan:can0", "socketcan", "can0", "can0", {}),
        ("can:kvaser:1", "kvaser", "1", "can1", {}),
        ("can:slcan:/dev/ttyUSB0,bitrate=250000", "slcan", "/dev/ttyUSB0", "/dev/ttyUSB0", {"bitrate": 250000}),
        ("can:udp_multicast:ff15::6d6f,port=0x10,fd=no", "udp_multicast", "ff15::6d6f", "ff15::6d6f",
         {"port": 16, "fd": False}),
        ("can:cantact:0,1,speed=1.5,name=a b", "cantact", "0,1", "0,1", {"speed": 1.5, "name": "a b"}),
    ],
)  # fmt: skip
def test_what_a_word_says(word: str, interface: str, channel: str, name: str, options: dict[str, Any]) -> None:
    where = CanWord.of(word)
    assert (where.interface, where.channel, where.name, dict(where.options)) == (interface, channel, name, options)


@pytest.mark.parametrize(
    "word", ["can:", "can:slcan", "can:slcan:", "can::can0", "can:a:b,=1", "can:a:b,c=1,d", "can:a:b,channel=c"]
)
def test_words_that_say_nothing(word: str) -> None:
    with pytest.raises(UsageError, match=re.escape(word)):
        CanWord.of(word)


def test_every_kind_of_frame_is_what_it_was() -> None:
    sent = [
        message(0x7FF, b""),
        message(0x1ABCDEF, b"\xff" * 8, extended=True),
        message(0x123, is_remote_frame=True, dlc=5, data=b""),
        message(0x20, bytes(range(64)), is_fd=True, bitrate_switch=True),
        message(0x21, bytes(12), is_fd=True, error_state_indicator=True),
        message(0x44, bytes([0, 0x30, 0, 0, 0, 0, 1, 2]), is_error_frame=True),
    ]
    source = opened("can:virtual:kinds")
    with sender("kinds") as bus:
        for one in sent:
            bus.send(one)
        heard = frames_of(source, lambda heard: sum(map(len, heard)) == len(sent))

    def told(name: str) -> list[int]:
        return [int(one) for frames in heard for one in getattr(frames, name)]

    assert not any(told("fault"))
    assert told("identifier") == [one.arbitration_id for one in sent]
    assert told("extended") == [0, 1, 0, 0, 0, 0]
    assert told("remote") == [one.is_remote_frame for one in sent]
    assert told("fd") == [one.is_fd for one in sent]
    assert told("brs") == [one.bitrate_switch for one in sent]
    assert told("esi") == [one.error_state_indicator for one in sent]
    assert told("error") == [one.is_error_frame for one in sent]
    assert told("length") == [0, 8, 5, 64, 12, 8]
    payloads = [frames.payload(place) for frames in heard for place in range(len(frames))]
    assert [payloads[n] for n in (0, 1, 3, 4, 5)] == [bytes(sent[n].data) for n in (0, 1, 3, 4, 5)]
    assert (source.channels, source.infos[0].drops, source.infos[0].failure) == (["kinds"], 0, "")


def _told(captures: Sequence[str] | Source) -> dict[str, Any]:
    inquiry = Inquiry(captures, project_of(None, [str(_CAPTURES / "press.gvl"), str(_CAPTURES / "level.gvl")]))
    return inquiry.report(inquiry.analyze(values=True), values=True)


def test_the_report_is_that_of_a_log_of_the_same_frames(tmp_path: Path) -> None:
    """python-can itself writes the log, of a bus of its own that hears the same."""
    log = tmp_path / "plant.log"
    lines = [line.split()[2] for line in (_CAPTURES / "press.log").read_text().splitlines() if " 20000" not in line]
    source = opened("can:virtual:plant")
    with sender("plant") as bus, can.Bus(interface="virtual", channel="plant") as other, can.Logger(log) as logger:
        notifier = can.Notifier(other, [logger])

        def play() -> None:
            for line in lines[:400]:
                identifier, data = line.split("#")
                bus.send(message(int(identifier, 16), bytes.fromhex(data)))
                time.sleep(0.001)
            time.sleep(0.3)
            source.stop()

        playing = threading.Thread(target=play)
        playing.start()
        live = _told(source)
        playing.join()
        notifier.stop()
    offline = _told([str(log)])
    # What it was watched for behind its last frame the log cannot know.
    assert live["capture"]["frames"] == offline["capture"]["frames"] == 400
    assert (live["capture"]["start_ns"], live["capture"]["end_ns"]) == (
        offline["capture"]["start_ns"], offline["capture"]["end_ns"]
    )  # fmt: skip
    assert len(live["lists"]) == 4
    for part in ("lists", "buses"):
        assert _timeless(live[part]) == _timeless(offline[part])


def _timeless(told: Any) -> Any:
    """Return what is told without what it was divided by: the time up to which the bus was watched."""
    if isinstance(told, dict):
        return {name: _timeless(value) for name, value in told.items() if name not in ("rate", "load_percent")}
    return [_timeless(one) for one in told] if isinstance(told, list) else told


def test_a_bus_off_is_told_as_it_is_offline() -> None:
    def script(_: can.BusABC) -> Iterator[Any]:
        for number in range(40):
            yield message(0x110 + number % 3)
            time.sleep(0.01)
        raise can.CanOperationError("Bus off status")

    SCRIPTS["a"] = script
    found = _told(opened("can:playing:a", seconds=1.5))
    assert "NV606" in {one["code"] for one in found["findings"]}
    assert "bus-off" in {one["kind"] for one in found["causes"]}
    assert found["capture"]["sources"][0]["frames"] >= 41


def test_a_silent_source_holds_nothing_back() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        port = own.getsockname()[1]
    words = ["can:virtual:quiet", "can:virtual:loud", f"udp://127.0.0.1:{port}"]
    source = opened(*words)
    with sender("loud") as bus:
        bus.send(message())
        assert [len(one) for one in frames_of(source, bool)] == [1]
    assert source.channels == ["loud"]

    source = opened(*words)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.sendto(telegram(), ("127.0.0.1", port))
        count = 0
        for batch in source:
            count += len(batch)
            if count:
                source.stop()
    assert count == 1


def test_two_buses_with_one_name_are_two() -> None:
    SCRIPTS["a"] = [message()]
    source = opened("can:playing:a", "can:virtual:a", seconds=1)
    with sender("a") as bus:
        bus.send(message(0x111))
        heard = frames_of(source)
    assert sorted(source.channels) == ["playing:a", "virtual:a"]
    assert sum(map(len, heard)) == 2


def test_a_channel_is_called_as_it_was_asked() -> None:
    source = opened("can:virtual:a", renamed={"a": "press"})
    with sender("a") as bus:
        bus.send(message())
        frames_of(source, bool)
    assert source.channels == ["press"]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["can:socketcn:can0"], 5, "perhaps can:socketcan:can0"),
        (["can:virtual"], 2, "for example can:socketcan:can0"),
        (["can:udp_multicast:10.0.0.1"], 5, "`nvscope -D` lists the channels"),
        (["can:virtual:a", "can:virtual:a"], 2, "more than once"),
        (["can:virtual:a", "-f", "udp"], 2, "-f: for interfaces, and can:virtual:a is none"),
        (["can:gs\x1b[31m:a"], 5, "python-can has no interface 'gs\\x1b[31m'"),
    ],
)
def test_what_cannot_be_opened_is_told_in_words(words: list[str], code: int, said: str) -> None:
    done = run_text("report", *words)
    assert (done.returncode, done.stdout) == (code, "")
    assert said in done.stderr


def test_the_program_hears_a_bus_of_another_process() -> None:
    word = "can:udp_multicast:239.74.163.77,port=43199"
    with subprocess.Popen(
        [sys.executable, "-m", "nvscope", "report", "--json", word, "--for", "60s"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as watching:  # fmt: skip
        # Nothing that is sent with this hop limit leaves the machine.
        with can.Bus(interface="udp_multicast", channel="239.74.163.77", port=43199, hop_limit=0) as bus:
            for _ in range(600):  # as long as a machine may take on which others work
                bus.send(message())
                time.sleep(0.05)
                if _listens(43199, watching.pid):
                    break
            for number in range(50):
                bus.send(message(0x222, bytes([number])))
                time.sleep(0.002)
            time.sleep(0.3)
        watching.send_signal(signal.SIGINT)
        out, said = watching.communicate(timeout=20)
    assert watching.returncode == 0, said
    report = json.loads(out)
    assert report["capture"]["frames"] >= 50
    assert report["capture"]["drops"] == 0
    assert [one["channel"] for one in report["buses"]] == ["239.74.163.77"]


def _listens(port: int, process: int) -> bool:
    """Return whether a process has a UDP socket on a port, as the kernel tells it."""
    told = Path("/proc/net/udp").read_text()
    inodes = {line.split()[9] for line in told.splitlines()[1:] if int(line.split()[1].split(":")[1], 16) == port}
    try:
        open_ones = [str(one.readlink()) for one in Path(f"/proc/{process}/fd").iterdir()]
    except OSError:
        return False
    return any(f"socket:[{inode}]" in open_ones for inode in inodes)
