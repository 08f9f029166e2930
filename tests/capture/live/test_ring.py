"""The kernel's ring, asked about real traffic between hosts of our own; tcpdump and counting are the oracles."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from ipaddress import ip_address
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from tests.capture.live.network import Host, cable, needs_namespaces, send
from tests.oracle.builders import internet_packet, link_frame, telegram, udp
from tests.oracle.frame import PROTOCOL_UDP

pytestmark = needs_namespaces

_BROADCAST = "10.77.0.255"


def wait_for_ring(host: Host, rings: int = 1) -> None:
    """Wait until so many packet sockets of the host take in packets."""
    for _ in range(500):
        told = subprocess.run(
            ["ip", "netns", "exec", host.namespace, "cat", "/proc/net/packet"], capture_output=True, text=True,
            check=True,
        )  # fmt: skip
        # sk RefCnt Type Proto Iface R Rmem User Inode
        if sum(line.split()[5] == "1" for line in told.stdout.splitlines()[1:]) >= rings:
            time.sleep(0.05)
            return
        time.sleep(0.02)
    raise AssertionError("nobody opened a packet socket")


_HEAD_BYTES, _RECORD_BYTES = 24, 16 + 14 + 20 + 8 + 24
"""What a telegram that is sent takes in a capture."""


def wait_for_size(path: Path, size: int) -> None:
    """Wait until somebody has written so much to a file: who ends tcpdump earlier loses what it has not written."""
    for _ in range(500):
        if path.exists() and path.stat().st_size >= size:
            return
        time.sleep(0.02)


_SEND_RAW = """
import socket, sys
out = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
out.bind((sys.argv[1], 0))
out.send(bytes.fromhex(sys.argv[2]))
"""


def _tagged(kind: int, number: int) -> bytes:
    """Return a broadcast frame with a VLAN tag (42) of a kind, and a telegram of a list."""
    source, target = ip_address("10.77.0.1"), ip_address(_BROADCAST)
    packet = internet_packet(source, target, PROTOCOL_UDP, udp(telegram(list_id=number)))
    return link_frame(packet, broadcast=True, tags=[kind])


def _report(done: subprocess.Popen[str], code: int = 0) -> Any:
    out, said = done.communicate(timeout=30)
    assert done.returncode == code, said
    return json.loads(out)


def test_everything_that_was_sent_is_in_the_report() -> None:
    with cable() as (press, engineer):
        watching = engineer.nvscope("report", "--json", engineer.device, "--for", "3s")
        wait_for_ring(engineer)
        sending = press.start(*send(_BROADCAST, 600, 3))
        report = _report(watching)
        sending.wait(10)
    assert [(one["key"], one["streams"][0]["telegrams"]) for one in report["lists"]] == [
        (f"udp/1202/{number}", 200) for number in (1, 2, 3)
    ]
    assert report["capture"]["drops"] == 0
    assert report["capture"]["drops_by"] == {}
    assert int(report["capture"]["until_ns"]) > int(report["capture"]["end_ns"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_all_that_came_until_then(number: int) -> None:
    with cable() as (press, engineer):
        watching = engineer.nvscope("report", "--json", engineer.device)
        wait_for_ring(engineer)
        press.start(*send(_BROADCAST, 500, 5, 100_000)).wait(20)
        watching.send_signal(number)
        report = _report(watching)
    assert report["capture"]["telegrams"] == 500


@pytest.mark.skipif(which("tcpdump") is None, reason="needs tcpdump")
def test_the_report_is_that_of_a_capture_of_the_same_packets(tmp_path: Path) -> None:
    kept = tmp_path / "kept.pcap"
    # Slots of its buffer are as long as what it keeps of a frame: of short ones there are many.
    words = ["tcpdump", "-i", "{}", "-s", "256", "-B", "16384", "--immediate-mode", "--time-stamp-precision=nano"]
    words += ["-U", "-w", str(kept)]
    with cable() as (press, engineer):
        recording = engineer.start(*(word.format(engineer.device) for word in words), "udp or arp or icmp")
        wait_for_ring(engineer)
        watching = engineer.nvscope("report", "--json", engineer.device, "-a", "packets:900")
        wait_for_ring(engineer, 2)
        press.start(*send(_BROADCAST, 900, 3, 300_000)).wait(20)
        live = _report(watching)
        wait_for_size(kept, _HEAD_BYTES + 900 * _RECORD_BYTES)
        recording.terminate()
        recording.communicate(timeout=10)
    offline = json.loads(
        subprocess.run(
            [sys.executable, "-m", "nvscope", "report", "--json", str(kept)], capture_output=True, text=True, check=True
        ).stdout
    )
    assert live["capture"]["telegrams"] == offline["capture"]["telegrams"] == 900
    for before, after in zip(live["lists"], offline["lists"], strict=True):
        assert before["counters"] == after["counters"]
        assert before["streams"][0]["telegrams"] == after["streams"][0]["telegrams"]
        assert before["streams"][0]["interval_ns"] == after["streams"][0]["interval_ns"]


def test_only_what_the_filter_lets_in_is_there() -> None:
    with cable() as (press, engineer):
        watching = engineer.nvscope("packets", engineer.device, "-f", "udp port 9", "--all-frames", "--for", "2s")
        wait_for_ring(engineer)
        press.start(*send(_BROADCAST, 50)).wait(10)
        out, said = watching.communicate(timeout=20)
    assert (watching.returncode, out) == (0, "")
    assert "0 frames" in said


def test_tags_that_the_kernel_took_out_are_put_back() -> None:
    with cable() as (press, engineer):
        watching = engineer.nvscope(
            "packets",
            engineer.device,
            "-T",
            "fields",
            "-e",
            "vlan.id",
            "-e",
            "ieee8021ad.id",
            "-e",
            "nv.index",
            "--for",
            "2s",
        )
        wait_for_ring(engineer)
        for kind, number in ((0x8100, 1), (0x88A8, 2)):
            press.python(_SEND_RAW, press.device, _tagged(kind, number).hex())
        press.start(*send(_BROADCAST, 1, 3)).wait(10)
        out, said = watching.communicate(timeout=20)
    assert out.splitlines() == ["42\t\t1", "\t42\t2", "\t\t1"], said


def test_each_packet_of_a_loopback_comes_once() -> None:
    with cable() as (press, _):
        watching = press.nvscope("report", "--json", "lo", "--for", "2s")
        wait_for_ring(press)
        press.start(*send("127.0.0.1", 20)).wait(10)
        report = _report(watching)
    assert report["capture"]["telegrams"] == 20


@pytest.mark.parametrize(("change", "said"), [("down", "the interface is down"), ("gone", "the interface is gone")])
def test_an_interface_that_goes_away_ends_it_with_what_came(change: str, said: str) -> None:
    with cable() as (press, engineer):
        watching = engineer.nvscope("report", "--json", engineer.device)
        wait_for_ring(engineer)
        press.start(*send(_BROADCAST, 30)).wait(10)
        time.sleep(0.5)
        if change == "down":
            engineer.ip("link", "set", engineer.device, "down")
        else:
            engineer.ip("link", "del", engineer.device)
        out, told = watching.communicate(timeout=20)
    assert watching.returncode == 5
    assert said in told
    assert json.loads(out)["capture"]["telegrams"] == 30


def test_an_interface_that_is_down_is_no_source() -> None:
    with cable() as (_, engineer):
        engineer.ip("link", "set", engineer.device, "down")
        watching = engineer.nvscope("report", engineer.device)
        out, told = watching.communicate(timeout=20)
    assert (watching.returncode, out) == (5, "")
    assert told.splitlines()[0] == f"nvscope: {engineer.device}: the interface is down"


def test_nothing_at_all_ends_too() -> None:
    with cable() as (_, engineer):
        report = _report(engineer.nvscope("report", "--json", engineer.device, "--for", "500ms"))
    assert report["capture"]["frames"] == 0
    assert report["capture"]["start_ns"] is None


def test_several_interfaces_are_one_timeline() -> None:
    with cable() as (press, engineer):
        watching = press.nvscope("report", "--json", "-i", press.device, "-i", "lo", "--for", "3s")
        wait_for_ring(press, 2)
        press.start(*send("127.0.0.1", 20)).wait(10)
        press.start(*send(engineer.address, 30)).wait(10)
        report = _report(watching)
    assert report["capture"]["telegrams"] == 50
    assert {one["path"]: one["frames"] >= 20 for one in report["capture"]["sources"]} == dict.fromkeys(
        [press.device, "lo"], True
    )


@pytest.mark.long
def test_what_does_not_fit_is_counted_as_the_kernel_does() -> None:
    """A reader that is stopped leaves the kernel's buffer to fill up."""
    with cable() as (press, engineer):
        watching = engineer.nvscope("report", "--json", engineer.device, "-B", "4", "-a", "duration:9")
        wait_for_ring(engineer)
        time.sleep(0.3)
        watching.send_signal(signal.SIGSTOP)
        press.start(*send(_BROADCAST, 60_000, 2, 0)).wait(30)
        watching.send_signal(signal.SIGCONT)
        report = _report(watching, 3)
    capture = report["capture"]
    assert capture["drops"] > 0
    assert capture["drops_by"] == {"kernel": capture["drops"]}
    assert capture["frames"] + capture["drops"] == 60_000 + capture["other_frames"]
    assert [one["code"] for one in report["findings"]][:1] == ["NV901"] or "NV901" in {
        one["code"] for one in report["findings"]
    }
