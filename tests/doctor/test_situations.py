"""Situations of the network that ``nvscope doctor`` claims to recognise, made for real; and a healthy one."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from ipaddress import ip_address
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.capture.live.network import Host, needs_namespaces
from tests.doctor.hosts import (
    NOBODY,
    SEND_FRAMES,
    SUBNET,
    asked,
    definition,
    needs_nobody,
    of_state,
    renumbered,
    routed,
    running,
    seen,
    sending,
    settled,
    wait_for_carrier,
)
from tests.oracle.builders import internet_packet, link_frame, telegram, udp
from tests.oracle.frame import PROTOCOL_UDP

pytestmark = needs_namespaces


def test_nothing_is_wrong_where_telegrams_come(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender):
        found = asked(reader)
    assert of_state(found, "problem") == []
    # Whether the clock of the machine follows a server is not ours to choose.
    assert set(of_state(found, "note")) <= {"clock"}
    assert found["verdict"].startswith("Telegrams come: ")
    assert "of 1 list on UDP 1202 from 10.77.0.1" in found["verdict"]
    assert found["telegrams"] > 0


def test_a_network_in_which_nobody_sends(pair: tuple[Host, Host]) -> None:
    _, reader = pair
    found = asked(reader)
    assert of_state(found, "problem") == ["telegrams"]
    assert "not one frame" in seen(found, "telegrams")


def test_a_network_in_which_others_send_something_else(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender, port=9999, payload=b"something else"):
        found = asked(reader)
    assert of_state(found, "problem") == ["telegrams"]
    assert "frames of others" in seen(found, "telegrams")


def test_an_interface_is_down() -> None:
    with settled() as (_, reader):
        reader.ip("link", "set", reader.device, "down")
        found = asked(reader)
    assert found["verdict"].endswith(f": {reader.device} is down")
    assert of_state(found, "problem")[0] == "interfaces"


def test_an_interface_has_no_cable() -> None:
    with settled() as (sender, reader):
        sender.ip("link", "set", sender.device, "down")
        wait_for_carrier(reader, carrier=False)
        found = asked(reader)
    assert found["verdict"].endswith(f": {reader.device} has no carrier")


def test_a_netmask_does_not_fit_what_is_sent(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with renumbered(reader, "10.77.0.2/16"), sending(sender):
        found = asked(reader)
    assert of_state(found, "problem") == ["addresses"]
    assert f"the netmask of {reader.device} (/16) does not fit {SUBNET}" in found["verdict"]
    assert "10.77.255.255" in seen(found, "addresses")


def test_a_netmask_that_leaves_the_sender_out_is_no_router(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with renumbered(reader, "10.77.0.6/30"), sending(sender):
        found = asked(reader)
    assert of_state(found, "problem") == ["addresses"]
    assert set(of_state(found, "note")) <= {"clock"}


def test_a_sender_on_the_wire_with_an_address_of_another_network(pair: tuple[Host, Host]) -> None:
    """Its broadcasts come, so there is no router in between."""
    sender, reader = pair
    packet = internet_packet(
        ip_address(sender.address), ip_address("255.255.255.255"), PROTOCOL_UDP, udp(telegram(list_id=7))
    )
    frame = link_frame(packet, broadcast=True).hex()
    process = sender.start(sys.executable, "-c", SEND_FRAMES, sender.device, frame)
    with renumbered(reader, "10.99.0.2/24"), running(process, "sent"):
        found = asked(reader)
    assert "10.77.0.1 broadcasts on the wire of" in seen(found, "addresses")
    assert "routers" not in [*of_state(found, "problem"), *of_state(found, "note")]


def test_this_machine_has_the_address_of_a_controller(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    packet = internet_packet(ip_address("10.77.0.2"), ip_address(SUBNET), PROTOCOL_UDP, udp(telegram(list_id=7)))
    frame = link_frame(packet, broadcast=True).hex()
    process = sender.start(sys.executable, "-c", SEND_FRAMES, sender.device, frame)
    with running(process, "sent"):
        found = asked(reader)
    assert of_state(found, "problem") == ["addresses"]
    assert "10.77.0.2 is an address of this machine, and of another device" in seen(found, "addresses")
    assert "of 1 list on UDP 1202 from 10.77.0.2" in seen(found, "telegrams")


def test_answers_of_this_machine_are_answers(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    asking, answer = telegram(list_id=7, flags=1), telegram(list_id=7, service=5)
    with sending(sender, payload=asking), sending(reader, sender.address, payload=answer):
        found = asked(reader)
    assert "conversations" not in of_state(found, "note")


@needs_nobody
def test_a_definition_names_a_broadcast_address_of_another_netmask(pair: tuple[Host, Host]) -> None:
    """Also without a telegram, and for who may not capture."""
    _, reader = pair
    with TemporaryDirectory() as folder, renumbered(reader, "10.77.0.2/16"):
        found = asked(reader, definition(Path(folder), SUBNET), user=NOBODY)
    assert "addresses" in of_state(found, "problem")
    assert "axis (udp/1202/7) is sent to 10.77.0.255" in seen(found, "addresses")


def test_a_node_of_the_project_is_in_another_network(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    project = tmp_path / "nvscope.toml"
    project.write_text('[nodes]\n"192.168.1.10" = { name = "press" }\n')
    _, reader = pair
    found = asked(reader, "--project", str(project))
    assert of_state(found, "problem") == ["addresses", "telegrams"]
    assert "press (192.168.1.10)" in seen(found, "addresses")


def test_telegrams_come_on_another_port(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender, port=1300):
        found = asked(reader)
        told = asked(reader, definition(tmp_path, "255.255.255.255", 1300))
    assert of_state(found, "problem") == ["other-ports", "telegrams"]
    assert found["verdict"].endswith(": telegrams come on UDP 1300")
    assert of_state(told, "problem") == []


@pytest.mark.parametrize(
    ("identity", "word"), [(b"0-S3", "letter 0"), (b"3S-0", "33 53 2d 30"), (b"\0-S4", "00 2d 53 34")]
)
def test_telegrams_have_another_identity(identity: bytes, word: str, pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender, payload=telegram(identity=identity)):
        found = asked(reader)
    assert of_state(found, "problem") == ["identity", "telegrams"]
    assert word in found["verdict"]


def test_another_protocol_has_the_port(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender, payload=b"\x16\xfe\xfd another one"):
        found = asked(reader)
    assert of_state(found, "problem") == ["identity", "telegrams"]


def _tagged(vlan: int) -> str:
    source, target = ip_address("10.77.0.1"), ip_address(SUBNET)
    packet = internet_packet(source, target, PROTOCOL_UDP, udp(telegram(list_id=7)))
    frame = link_frame(packet, broadcast=True, tags=[0x8100])
    return (frame[:14] + vlan.to_bytes(2, "big") + frame[16:]).hex()


@pytest.mark.parametrize("vlan", [42, 0], ids=["vlan", "priority"])
def test_telegrams_have_vlan_tags(vlan: int) -> None:
    """Number 0 is a priority alone: programs get the frame."""
    with settled() as (sender, reader), running(
        sender.start(sys.executable, "-c", SEND_FRAMES, sender.device, _tagged(vlan)), "sent"
    ):  # fmt: skip
        found = asked(reader)
        assert of_state(found, "problem") == (["vlan"] if vlan else [])
        if vlan:
            assert "; but they have the VLAN tag 42" in found["verdict"]
            try:
                reader.ip("link", "add", "link", reader.device, "name", "plant", "type", "vlan", "id", "42")
            except subprocess.CalledProcessError:
                return  # a kernel without VLANs
            reader.ip("addr", "add", "10.77.0.2/24", "dev", "plant")
            reader.ip("link", "set", "plant", "up")
            assert of_state(asked(reader), "problem") == []


def test_a_sender_is_behind_a_router(tmp_path: Path) -> None:
    project = tmp_path / "nvscope.toml"
    project.write_text('[nodes]\n"10.78.0.1" = { name = "press" }\n')
    with routed() as (sender, _, reader):
        with sending(sender, "10.77.0.2"):
            found = asked(reader)
        with sending(sender, "10.78.0.255"):
            broadcast = asked(reader, "--project", str(project))
    assert of_state(found, "problem") == []
    assert "10.78.0.1 is in another network: 1 router on the way" in seen(found, "routers")
    # What it broadcasts, the router keeps: nobody can see more of it here than that it is far.
    assert of_state(broadcast, "problem") == ["addresses", "telegrams"]


def test_a_reader_refuses_what_it_is_sent(pair: tuple[Host, Host]) -> None:
    """The host that is sent to says by ICMP that no program has the port; its firewall is asked nothing."""
    sender, reader = pair
    with sending(reader, "10.77.0.1"):
        # Of messages that tell so, Linux sends one a second.
        found = asked(sender, "udp://0.0.0.0:1300", "--all", sender.device, heard_for="1500ms")
    assert of_state(found, "problem")[0] == "other-ports"
    assert "unreachable" in of_state(found, "problem")
    assert "no program has the port there" in seen(found, "unreachable")


def test_a_list_is_sent_to_another_station_alone(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    _, reader = pair
    found = asked(reader, definition(tmp_path, "10.77.0.9"))
    assert of_state(found, "problem") == ["conversations", "telegrams"]
    assert "mirror port" in next(one["next"] for one in found["results"] if one["check"] == "conversations")


def test_a_sender_asks_for_an_address_that_nobody_has(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    me, wanted = (ip_address(text).packed.hex() for text in (sender.address, "10.77.0.9"))
    request = f"ffffffffffff020000000001080600010800060400010200000000{'01'}{me}000000000000{wanted}"
    with running(sender.start(sys.executable, "-c", SEND_FRAMES, sender.device, request), "sent"), sending(sender):
        found = asked(reader)
    assert "arp" in of_state(found, "note")
    assert "nobody answers" in seen(found, "arp")


def test_the_lists_that_come_are_others(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender):
        found = asked(reader, definition(tmp_path, "255.255.255.255", name="other", number=8))
    assert of_state(found, "problem") == ["lists"]


def test_ctrl_c_ends_the_listening_and_it_is_told_what_came(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender):
        process = reader.nvscope("doctor", "--for", "1h", "--json")
        for _ in range(500):
            told = subprocess.run(
                ["ip", "netns", "exec", reader.namespace, "cat", "/proc/net/packet"], capture_output=True, text=True,
                check=True,
            )  # fmt: skip
            if len(told.stdout.splitlines()) > 2:
                break
            time.sleep(0.02)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, said = process.communicate(timeout=10)
    assert process.returncode == 0, said
    assert json.loads(out)["telegrams"] > 0


def test_an_interface_that_is_not_there(pair: tuple[Host, Host]) -> None:
    _, reader = pair
    process = reader.nvscope("doctor", "-i", "eht0")
    _, said = process.communicate(timeout=10)
    assert process.returncode == 5
    assert "no interface has this name" in said
