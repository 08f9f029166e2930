"""Every situation that ``nvscope doctor`` claims to recognise, made between hosts of our own; and a healthy one."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from ipaddress import ip_address
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from nvscope.doctor.checks import CHECKS
from tests.capture.live.network import Host, cable, needs_namespaces, send
from tests.oracle.builders import internet_packet, link_frame, telegram, udp
from tests.oracle.frame import PROTOCOL_UDP

pytestmark = needs_namespaces

_SUBNET = "10.77.0.255"
_SEND = """
import socket, sys, time
target, port, payload = sys.argv[1], int(sys.argv[2]), bytes.fromhex(sys.argv[3])
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 4)
for number in range(10_000):
    try:
        out.sendto(payload, (target, port))
    except OSError:
        pass
    if not number:
        print("sent", flush=True)
    time.sleep(0.005)
"""
_SEND_FRAMES = """
import socket, sys, time
out = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
out.bind((sys.argv[1], 0))
for number in range(10_000):
    out.send(bytes.fromhex(sys.argv[2]))
    if not number:
        print("sent", flush=True)
    time.sleep(0.005)
"""
_HOLD = """
import socket, sys, time
held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
if sys.argv[2] == "shared":
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
held.bind(("0.0.0.0", int(sys.argv[1])))
if len(sys.argv) > 3:
    group = socket.inet_aton(sys.argv[3]) + socket.inet_aton(sys.argv[4])
    held.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
print("held", flush=True)
time.sleep(60)
"""
NOBODY = ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all", "--inh-caps=-all")


def _nobody_can_run_it() -> bool:
    """Return whether a user without any rights may read the interpreter and the program."""
    words = [*NOBODY, sys.executable, "-c", "import nvscope, numpy"]
    return which("setpriv") is not None and not subprocess.run(words, capture_output=True, check=False).returncode


needs_nobody = pytest.mark.skipif(
    not _nobody_can_run_it(), reason="needs setpriv, and an interpreter that all may read"
)  # fmt: skip


@contextmanager
def running(process: subprocess.Popen[str], begun: str) -> Iterator[subprocess.Popen[str]]:
    """Have a program run meanwhile, from when it says that it has begun."""
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == f"{begun}\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def sending(host: Host, target: str = _SUBNET, *, port: int = 1202, payload: bytes = b"") -> Any:
    """Let a host send telegrams of list 7 for some seconds."""
    words = (sys.executable, "-c", _SEND, target, str(port), (payload or telegram(list_id=7)).hex())
    return running(host.start(*words), "sent")


@contextmanager
def holding(host: Host, *words: str) -> Iterator[None]:
    """Let a program of a host have a UDP port, and be a member of a group."""
    with running(host.start(sys.executable, "-c", _HOLD, *words), "held"):
        yield


def asked(host: Host, *words: str, user: tuple[str, ...] = (), heard_for: str = "300ms") -> dict[str, Any]:
    """Return what the doctor says on a host; its exit code tells whether something is wrong."""
    command = (*user, sys.executable, "-m", "nvscope", "doctor", "--for", heard_for, "--json", *words)
    done = host.start(*command)
    out, said = done.communicate(timeout=30)
    assert done.returncode in (0, 1), said
    found: dict[str, Any] = json.loads(out)
    assert (done.returncode == 1) == bool(of_state(found, "problem")) == (found["state"] == "problem")
    assert {one["check"] for one in found["results"]} == {check.name for check in CHECKS}
    assert all(one["next"] for one in found["results"] if one["state"] in ("problem", "note"))
    return found


def of_state(found: dict[str, Any], state: str) -> list[str]:
    """Return the checks that have a state."""
    return [one["check"] for one in found["results"] if one["state"] == state]


def seen(found: dict[str, Any], check: str) -> str:
    return " ".join(one["seen"] for one in found["results"] if one["check"] == check)


@contextmanager
def settled(*, carrier: bool = True) -> Iterator[tuple[Host, Host]]:
    """Yield two hosts with a cable between them, of which the kernel knows by now whether it works."""
    with cable() as (first, second):
        wait_for_carrier(second, carrier=carrier)
        yield first, second


def wait_for_carrier(host: Host, *, carrier: bool) -> None:
    for _ in range(300):
        told = subprocess.run(
            ["ip", "-n", host.namespace, "-j", "link", "show", "dev", host.device], capture_output=True, check=True
        )
        if (json.loads(told.stdout)[0]["operstate"] == "UP") == carrier:
            return
        time.sleep(0.02)
    raise AssertionError("the kernel does not learn of the carrier")


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[Host, Host]]:
    """Two hosts that tests leave as they are."""
    with settled() as hosts:
        yield hosts


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


def test_nothing_is_sent(pair: tuple[Host, Host]) -> None:
    _, reader = pair
    before = _sent(reader)
    asked(reader, f"udp://0.0.0.0:1202,{'239.1.2.3'}")
    assert _sent(reader) == before


def _sent(host: Host) -> int:
    path = f"/sys/class/net/{host.device}/statistics/tx_packets"
    done = subprocess.run(
        ["ip", "netns", "exec", host.namespace, "cat", path], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


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


@contextmanager
def renumbered(host: Host, address: str) -> Iterator[None]:
    """Give a host another address meanwhile."""
    for one in (address, None):
        host.ip("addr", "flush", "dev", host.device)
        host.ip("addr", "add", one or f"{host.address}/24", "broadcast", "+", "dev", host.device)
        if one:
            yield


def test_a_netmask_does_not_fit_what_is_sent(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with renumbered(reader, "10.77.0.2/16"), sending(sender):
        found = asked(reader)
    assert of_state(found, "problem") == ["addresses"]
    assert f"the netmask of {reader.device} (/16) does not fit {_SUBNET}" in found["verdict"]
    assert "10.77.255.255" in seen(found, "addresses")


@needs_nobody
def test_a_definition_names_a_broadcast_address_of_another_netmask(pair: tuple[Host, Host]) -> None:
    """Also without a telegram, and for who may not capture."""
    _, reader = pair
    with TemporaryDirectory() as folder, renumbered(reader, "10.77.0.2/16"):
        found = asked(reader, _definition(Path(folder), _SUBNET), user=NOBODY)
    assert "addresses" in of_state(found, "problem")
    assert "axis (udp/1202/7) is sent to 10.77.0.255" in seen(found, "addresses")


def _definition(folder: Path, target: str, port: int = 1202, name: str = "axis", number: int = 7) -> str:
    path = folder / f"{name}.gvl"
    path.write_text(
        f"<GVL><Declarations><![CDATA[VAR_GLOBAL\n n : INT;\nEND_VAR]]></Declarations>"
        f'<NetvarSettings Protocol="UDP"><ListIdentifier>{number}</ListIdentifier><Pack>True</Pack>'
        f'<ProtocolSettings><ProtocolSetting Name="Broadcast Adr." Value="{target}" />'
        f'<ProtocolSetting Name="Port" Value="{port}" /></ProtocolSettings></NetvarSettings></GVL>'
    )
    path.chmod(0o644)
    folder.chmod(0o755)
    return str(path)


def test_a_node_of_the_project_is_in_another_network(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    project = tmp_path / "nvscope.toml"
    project.write_text('[nodes]\n"192.168.1.10" = { name = "press" }\n')
    _, reader = pair
    found = asked(reader, "--project", str(project))
    assert of_state(found, "problem") == ["addresses", "telegrams"]
    assert "press (192.168.1.10)" in seen(found, "addresses")


@pytest.mark.parametrize("how", ["alone", "shared"])
def test_a_port_is_bound_by_another_program(how: str, pair: tuple[Host, Host]) -> None:
    _, reader = pair
    with holding(reader, "1202", how):
        found = asked(reader)
        # A capture shares with all; a plain socket does not.
        assert "ports" in of_state(found, "note")
        plain = asked(reader, "udp://0.0.0.0:1202")
        assert ("ports" in of_state(plain, "problem")) == (how == "alone")
        assert "python" in seen(found, "ports")
        assert "(PID " in seen(found, "ports")


@needs_nobody
def test_a_port_is_bound_by_the_program_of_another_user(pair: tuple[Host, Host]) -> None:
    _, reader = pair
    with holding(reader, "1202", "alone"):
        found = asked(reader, user=NOBODY)
    assert of_state(found, "problem") == ["ports", "permissions", "telegrams"]
    # Of others' programs, only whose they are can be seen.
    assert "a process of user root" in seen(found, "ports")


_COUNT = """
import socket, struct
held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
held.bind(("", 1202))
held.settimeout(10)
print("held", flush=True)
seen = []
while not seen or seen[-1] < 299:
    seen.append(struct.unpack("<I", held.recv(100)[20:])[0])
print(len(seen), flush=True)
"""


def test_who_has_the_port_loses_nothing_while_it_is_asked(pair: tuple[Host, Host]) -> None:
    """What is sent to one station comes to one program only, even where the port is shared."""
    sender, reader = pair
    with running(reader.start(sys.executable, "-c", _COUNT), "held") as holder:
        sent = sender.start(*send(reader.address, 300, 1, 5_000_000))
        asked(reader)
        assert holder.stdout is not None
        assert holder.stdout.readline() == "300\n"
        sent.communicate(timeout=10)


@needs_nobody
def test_a_user_who_may_not_capture(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    silent = asked(reader, user=NOBODY)
    with sending(sender):
        heard = asked(reader, user=NOBODY)
    assert of_state(silent, "problem") == ["permissions", "telegrams"]
    assert {"other-ports", "vlan", "conversations", "firewall"} <= set(of_state(silent, "unknown"))
    assert of_state(heard, "problem") == []
    assert heard["telegrams"] > 0


def test_telegrams_come_on_another_port(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender, port=1300):
        found = asked(reader)
        told = asked(reader, _definition(tmp_path, "255.255.255.255", 1300))
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
    source, target = ip_address("10.77.0.1"), ip_address(_SUBNET)
    packet = internet_packet(source, target, PROTOCOL_UDP, udp(telegram(list_id=7)))
    frame = link_frame(packet, broadcast=True, tags=[0x8100])
    return (frame[:14] + vlan.to_bytes(2, "big") + frame[16:]).hex()


@pytest.mark.parametrize("vlan", [42, 0], ids=["vlan", "priority"])
def test_telegrams_have_vlan_tags(vlan: int) -> None:
    """Number 0 is a priority alone: programs get the frame."""
    with settled() as (sender, reader), running(
        sender.start(sys.executable, "-c", _SEND_FRAMES, sender.device, _tagged(vlan)), "sent"
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


@contextmanager
def routed() -> Iterator[tuple[Host, Host, Host]]:
    """Yield a sender, a router and a reader; the sender is in another network than the reader."""
    with settled() as (router, reader), cable() as (sender, between):
        sender.ip("addr", "flush", "dev", sender.device)
        sender.ip("addr", "add", "10.78.0.1/24", "dev", sender.device)
        between.ip("link", "set", between.device, "netns", router.namespace)
        router.ip("addr", "add", "10.78.0.2/24", "dev", between.device)
        router.ip("link", "set", between.device, "up")
        sender.ip("route", "add", "default", "via", "10.78.0.2")
        forward = ("ip", "netns", "exec", router.namespace, "sysctl", "-qw", "net.ipv4.ip_forward=1")
        subprocess.run(forward, check=True, timeout=10)
        yield sender, router, reader


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
    found = asked(reader, _definition(tmp_path, "10.77.0.9"))
    assert of_state(found, "problem") == ["conversations", "telegrams"]
    assert "mirror port" in next(one["next"] for one in found["results"] if one["check"] == "conversations")


def test_a_sender_asks_for_an_address_that_nobody_has(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    me, wanted = (ip_address(text).packed.hex() for text in (sender.address, "10.77.0.9"))
    request = f"ffffffffffff020000000001080600010800060400010200000000{'01'}{me}000000000000{wanted}"
    with running(sender.start(sys.executable, "-c", _SEND_FRAMES, sender.device, request), "sent"), sending(sender):
        found = asked(reader)
    assert "arp" in of_state(found, "note")
    assert "nobody answers" in seen(found, "arp")


def test_a_multicast_group_is_not_joined(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    group = "239.10.10.11"
    path = _definition(tmp_path, group)
    sender, reader = pair
    silent = asked(reader, path)
    sender.ip("route", "replace", "224.0.0.0/4", "dev", sender.device)
    with sending(sender, group):
        heard = asked(reader, path)
        with holding(reader, "1300", "shared", group, reader.address):
            joined = asked(reader, path)
    assert of_state(silent, "problem") == ["multicast", "telegrams"]
    assert "multicast" in of_state(heard, "note")
    assert "multicast" in of_state(joined, "ok")


@pytest.mark.skipif(which("nft") is None, reason="needs nft (nftables)")
def test_the_firewall_drops_what_comes(pair: tuple[Host, Host]) -> None:
    rules = (
        "table inet filter { chain input { type filter hook input priority 0; policy drop; "
        'iifname "lo" accept; ct state established,related accept; tcp dport 22 accept; PLACE;\n}\n}\n'
    )
    sender, reader = pair
    words = ("ip", "netns", "exec", reader.namespace, "nft")
    with sending(sender), ExitStack() as behind:
        behind.callback(subprocess.run, [*words, "flush", "ruleset"], check=True, timeout=10)
        for place in ("udp dport { 1000-1300, 2000 } accept", "counter"):
            subprocess.run([*words, "flush", "ruleset"], check=True, timeout=10)
            subprocess.run([*words, "-f", "-"], input=rules.replace("PLACE", place), text=True, check=True, timeout=10)
            found = asked(reader)
            assert of_state(found, "problem") == []  # a capture sees it all the same
            assert ("firewall" in of_state(found, "ok")) == place.startswith("udp")
        plain = asked(reader, "udp://0.0.0.0:1202")
    assert of_state(plain, "problem") == ["firewall"]
    assert plain["verdict"].endswith("; but the firewall drops UDP 1202")
    assert "no program got one" in seen(plain, "firewall")


def test_what_comes_does_not_reach_programs_for_another_reason() -> None:
    """The reverse-path filter: answers to the sender would go out by another interface."""
    strict = ("net.ipv4.conf.all.rp_filter=1", "net.ipv4.conf.default.rp_filter=1")
    with routed() as (sender, _, reader):
        subprocess.run(["ip", "netns", "exec", reader.namespace, "sysctl", "-qw", *strict], check=True, timeout=10)
        with sending(sender, "10.77.0.2"):
            found = asked(reader)
    assert "firewall" in of_state(found, "note")
    assert "no program got one" in seen(found, "firewall")


def test_the_lists_that_come_are_others(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    with sending(sender):
        found = asked(reader, _definition(tmp_path, "255.255.255.255", name="other", number=8))
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
