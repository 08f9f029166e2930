"""``nvscope sdo`` between hosts of our own: from which port it asks, and what comes back when nobody is there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.capture.live.network import Host, cable, needs_namespaces
from tests.cli.test_sdo_serve import TABLE
from tests.doctor.hosts import holding, running

pytestmark = [needs_namespaces, pytest.mark.long]

READ = "sdo", "read", "10.77.0.2", "0x2000", "1", "--type", "REAL", "--timeout", "20s"

TO_THE_PORT = """
import socket, struct
own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
own.bind(("0.0.0.0", 1202))
print("ready", flush=True)
while True:
    came, source = own.recvfrom(2000)
    answer = came[:4] + struct.pack("<I", 2) + came[8:14] + struct.pack("<H", 24) + came[16:20] + bytes(4)
    own.sendto(answer, (source[0], 1202))
"""
"""A controller that answers to its own port on the host that asked, whatever port that asked from."""


@pytest.fixture
def hosts() -> Iterator[tuple[Host, Host]]:
    with cable() as both:
        yield both


def asked(host: Host, *words: str) -> tuple[int, str, str]:
    done = host.nvscope(*words)
    out, err = done.communicate(timeout=60)
    return done.returncode, out, err


def test_a_controller_on_another_host_is_asked_from_its_port(hosts: tuple[Host, Host], tmp_path: Path) -> None:
    asking, host = hosts
    (tmp_path / "t.toml").write_text(TABLE, encoding="utf-8")
    served = host.nvscope("sdo", "serve", str(tmp_path / "t.toml"), "--bind", host.address, "--count", "1")
    assert served.stderr is not None
    assert served.stderr.readline().endswith(" at 10.77.0.2:1202; Ctrl-C ends.\n")
    code, out, err = asked(asking, *READ)
    assert (code, out[:16], err) == (0, "0x2000:1 = 12.5 ", "")
    told, _ = served.communicate(timeout=60)
    assert " 10.77.0.1:1202  read  rSetpoint (0x2000:1)  12.5" in told


def test_an_answer_to_that_port_comes_where_nobody_else_has_it(hosts: tuple[Host, Host]) -> None:
    asking, host = hosts
    with running(host.python_program(TO_THE_PORT), "ready"):
        code, out, _ = asked(asking, *READ)
        assert (code, out[:13]) == (0, "0x2000:1 = 0 ")
        with holding(asking, "1202", "alone"):
            code, out, err = asked(asking, *READ[:-1], "300ms")
    assert (code, out) == (3, "")
    assert "another program has port 1202 here: an answer to that port does not come" in " ".join(err.split())


def test_nobody_there_is_told(hosts: tuple[Host, Host]) -> None:
    asking, _ = hosts
    code, out, err = asked(asking, *READ)
    assert (code, out, "0x2000:1 is not read: port unreachable" in err) == (5, "", True)
    code, out, err = asked(asking, "sdo", "read", "10.77.0.9", "1", "2", "--timeout", "20s")
    assert (code, out, "0x0001:2 is not read: host unreachable" in err) == (5, "", True)
    code, out, err = asked(asking, "sdo", "read", "192.168.7.7", "1", "2")
    assert (code, out) == (5, "")
    assert "192.168.7.7:1202: cannot be sent: Network is unreachable" in err


def test_a_broadcast_address_is_no_partner(hosts: tuple[Host, Host]) -> None:
    asking, _ = hosts
    code, out, err = asked(asking, "sdo", "read", "10.77.0.255", "1", "2")
    assert (code, out) == (5, "")
    assert "10.77.0.255:1202: cannot be sent: " in err
