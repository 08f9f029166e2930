"""What ``nvscope doctor`` tells of capture files, which are made frame by frame."""

from __future__ import annotations

import json
from collections.abc import Sequence
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.open import open_sink
from nvscope.doctor.checks import CHECKS, Where
from tests.oracle.builders import (
    ACKNOWLEDGEMENT,
    ETHERNET,
    MILLISECOND,
    START,
    internet_packet,
    link_frame,
    telegram,
    udp,
    unreachable,
    whole,
)
from tests.oracle.frame import PROTOCOL_ICMP, PROTOCOL_UDP
from tests.packets import batch_of
from tests.program import run, run_text

_SENDER, _READER, _ALL = "192.168.1.10", "192.168.1.11", "192.168.1.255"


def packet(payload: bytes, *, source: str = _SENDER, target: str = _ALL, port: int = 1202, hops: int = 64) -> bytes:
    """Return an IP packet with a datagram."""
    made = internet_packet(ip_address(source), ip_address(target), PROTOCOL_UDP, udp(payload, port=port))
    return made[:8] + bytes([hops]) + made[9:]


def frame(made: bytes, *, broadcast: bool = True, tags: Sequence[int] = ()) -> bytes:
    return link_frame(made, broadcast=broadcast, tags=tags)


def asked(folder: Path, frames: Sequence[bytes], *words: str) -> dict[str, Any]:
    """Return what the doctor says of a capture of some frames, each seen five times."""
    path = folder / "made.pcap"
    told = [whole(START + number * MILLISECOND, ETHERNET, data) for number, data in enumerate([*frames] * 5)]
    with open_sink(str(path)) as sink:
        sink.write(batch_of(told))
    done = run("doctor", str(path), "--json", *words, cwd=folder)
    found: dict[str, Any] = json.loads(done.stdout)
    assert (done.returncode == 1) == (found["state"] == "problem"), done.stderr
    assert {one["check"] for one in found["results"]} == {one.name for one in CHECKS if one.where is Where.TRAFFIC}
    return found


def of_state(found: dict[str, Any], *states: str) -> list[str]:
    return [one["check"] for one in found["results"] if one["state"] in states]


def seen(found: dict[str, Any], check: str) -> str:
    return " ".join(one["seen"] for one in found["results"] if one["check"] == check)


def test_a_healthy_capture_has_nothing_to_say(tmp_path: Path) -> None:
    data = frame(packet(telegram(list_id=7, flags=1)))
    answer = frame(packet(telegram(ACKNOWLEDGEMENT, 7), source=_READER, target=_SENDER), broadcast=False)
    found = asked(tmp_path, [data, answer])
    assert of_state(found, "problem", "note", "unknown") == []
    assert found["telegrams"] == 10
    assert (found["live"], found["listened_ns"]) == (False, None)


@pytest.mark.parametrize("path", ["captures/peers/peers.pcap", "captures/plant.pcapng.gz"])
def test_captures_of_healthy_networks_have_nothing_to_say(path: str) -> None:
    done = run("doctor", str(Path(__file__).parents[2] / path), "--json")
    assert done.returncode == 0
    assert of_state(json.loads(done.stdout), "problem", "note") == []


def test_what_a_file_cannot_tell_is_named(tmp_path: Path) -> None:
    found = asked(tmp_path, [frame(packet(telegram(list_id=7)))])
    machine = [check.name for check in CHECKS if check.where is Where.MACHINE]
    assert found["not_told"] == machine
    text = run_text("doctor", "made.pcap", cwd=tmp_path).stdout
    assert "A file cannot tell: interfaces, addresses, ports, firewall, multicast, permissions, clock." in " ".join(
        text.split()
    )


@pytest.mark.parametrize(
    ("made", "state", "check", "words"),
    [
        (frame(packet(telegram(list_id=7), port=1300)), "problem", "other-ports", "on UDP 1300 from 192.168.1.10"),
        (frame(packet(telegram(identity=b"0-S3"))), "problem", "identity", "begin with the letter 0"),
        (frame(packet(telegram(identity=b"3S-0"))), "problem", "identity", "33 53 2d 30"),
        (frame(packet(telegram(identity=b"3S-0"), port=4711)), "problem", "identity", "to UDP 4711"),
        (frame(packet(b"GET / HTTP/1.1")), "problem", "identity", "47 45 54 20"),
        (frame(packet(telegram(list_id=7), hops=63)), "note", "routers", "1 router on the way"),
        (frame(packet(telegram(list_id=7), hops=126)), "note", "routers", "2 routers on the way"),
        (frame(packet(telegram(list_id=7)), tags=[0x8100]), "note", "vlan", "have the VLAN tag 42"),
        (frame(packet(telegram(list_id=7, flags=1))), "note", "conversations", "not one answer was seen"),
    ],
)
def test_what_can_be_seen_there(tmp_path: Path, made: bytes, state: str, check: str, words: str) -> None:
    found = asked(tmp_path, [made])
    assert check in of_state(found, state)
    assert words in seen(found, check)
    assert set(of_state(found, "problem", "note")) <= {check, "telegrams"}


@pytest.mark.parametrize(("code", "words"), [(3, "no program has the port"), (13, "a firewall forbids it")])
def test_telegrams_that_come_back(tmp_path: Path, code: int, words: str) -> None:
    sent = packet(telegram(list_id=7), target=_READER)
    message = unreachable(ip_address(_READER), sent, code)
    found = asked(tmp_path, [frame(sent, broadcast=False), frame(message, broadcast=False)])
    assert of_state(found, "problem") == ["unreachable"]
    assert f"to {_READER}, UDP 1202, came back: {words}" in seen(found, "unreachable")


def test_many_senders_of_one_hardware_address_are_behind_a_router(tmp_path: Path) -> None:
    made = [frame(packet(telegram(list_id=number), source=f"10.1.{number}.2")) for number in (1, 2, 3)]
    assert of_state(asked(tmp_path, made), "note") == ["routers"] * 3
    assert of_state(asked(tmp_path, made[:2]), "note") == []


def test_frames_of_which_none_is_a_telegram(tmp_path: Path) -> None:
    found = asked(tmp_path, [frame(packet(b"something else", port=53))])
    assert of_state(found, "problem") == ["telegrams"]
    assert "among 5 frames of others" in seen(found, "telegrams")


def test_the_ports_and_nodes_of_the_project_are_gone_by(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(f'ports = [1300]\n[nodes]\n"{_SENDER}" = {{ name = "press" }}\n')
    found = asked(tmp_path, [frame(packet(telegram(list_id=7), port=1300))])
    assert of_state(found, "problem", "note") == []
    assert "press (192.168.1.10)" in found["verdict"]


def test_several_files_are_told_apart(tmp_path: Path) -> None:
    for name, made in (("a", packet(telegram(list_id=7))), ("b", packet(telegram(list_id=8)))):
        with open_sink(str(tmp_path / f"{name}.pcap")) as sink:
            sink.write(batch_of([whole(START, ETHERNET, frame(made))] * (1 + (name == "b"))))
    done = run("doctor", "a.pcap", "b.pcap", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)
    assert {place["name"]: place["frames"] for place in found["places"]} == {"a.pcap": 1, "b.pcap": 2}
    assert found["telegrams"] == 3


def test_a_name_that_would_move_the_cursor_does_not(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(f'[nodes]\n"{_SENDER}" = {{ name = "pre\\u001b[2Jss" }}\n')
    asked(tmp_path, [frame(packet(telegram(list_id=7)))])
    assert "\x1b" not in run_text("doctor", "made.pcap", "--all", cwd=tmp_path).stdout


def test_a_file_that_is_cut_ends_with_the_code_of_that(tmp_path: Path) -> None:
    asked(tmp_path, [frame(packet(telegram(list_id=7)))])
    path = tmp_path / "made.pcap"
    path.write_bytes(path.read_bytes()[:-3])
    assert run("doctor", "made.pcap", cwd=tmp_path).returncode == 3


def test_files_and_interfaces_are_not_mixed(tmp_path: Path) -> None:
    asked(tmp_path, [frame(packet(telegram(list_id=7)))])
    done = run_text("doctor", "made.pcap", "udp://0.0.0.0:1202", cwd=tmp_path)
    assert done.returncode == 2
    assert "cannot be looked at together" in done.stderr
    assert run("doctor", "can:socketcan:can0").returncode == 2
    assert run("doctor", "none.pcap", cwd=tmp_path).returncode == 4


@pytest.mark.parametrize("columns", ["40", "80", "200"])
def test_lines_are_as_wide_as_the_terminal(tmp_path: Path, columns: str) -> None:
    asked(tmp_path, [frame(packet(telegram(identity=b"3S-0"))), frame(packet(telegram(list_id=7), port=1300, hops=63))])
    told = run_text("doctor", "made.pcap", cwd=tmp_path, environment={"COLUMNS": columns}).stdout
    assert max(map(len, told.splitlines())) <= min(int(columns), 100)
    words = " ".join(told.split())
    assert words.startswith("✗ No telegram on UDP 1202: telegrams come on UDP 1300. ✗ other ports ")
    assert "Next Write `ports = [1202, 1300]` into nvscope.toml" in words


def test_icmp_alone_is_no_telegram(tmp_path: Path) -> None:
    ping = internet_packet(ip_address(_SENDER), ip_address(_READER), PROTOCOL_ICMP, b"\x08\0\0\0\0\1\0\1")
    found = asked(tmp_path, [frame(ping, broadcast=False)])
    assert of_state(found, "problem") == ["telegrams"]
