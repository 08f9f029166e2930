"""``nvscope replay``: what a plain listener gets is what was recorded, byte by byte, and nothing goes anywhere else."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dissectors.netvar import dissect
from nvscope.capture.open import open_source
from tests.capture.mcap.recordings import Packet, write
from tests.oracle.builders import data_frame, telegram
from tests.program import COMMAND, run_text

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "captures" / "plant.pcapng.gz"
QUIET_S = 0.4


class Listener:
    """A socket that keeps what comes: payload, sender's address, and when it came."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.1)
        self.port = int(self._socket.getsockname()[1])
        self.got: list[tuple[bytes, str, int]] = []
        self._ended = False
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self._ended:
            try:
                data, (address, _) = self._socket.recvfrom(65_535)
            except TimeoutError:
                continue
            self.got.append((data, address, time.monotonic_ns()))

    def end(self) -> None:
        time.sleep(QUIET_S)
        self._ended = True
        self._thread.join()
        self._socket.close()

    @property
    def payloads(self) -> list[bytes]:
        return [data for data, _, _ in self.got]


@contextmanager
def listener() -> Iterator[Listener]:
    one = Listener()
    try:
        yield one
    finally:
        one.end()


def payloads_of(path: Path) -> list[bytes]:
    """Return the UDP payloads of the telegrams of a capture."""
    found = []
    for batch in open_source([str(path)]):
        telegrams = dissect(batch).telegrams
        spans = zip(telegrams.datagram.payload.tolist(), telegrams.datagram.payload_bytes.tolist(), strict=True)
        found += [telegrams.data[begin : begin + size].tobytes() for begin, size in spans]
    return found


def replayed(path: Path, *options: str) -> tuple[Listener, str]:
    with listener() as heard:
        done = run_text("replay", path, "--to", f"udp://127.0.0.1:{heard.port}", *options)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    return heard, done.stderr


def frames(*times_ns: int, source: str = "192.168.1.10", port: int = 1202) -> list[Packet]:
    found = []
    for number, time_ns in enumerate(times_ns):
        payload = telegram(list_id=7, counter=number, data=number.to_bytes(4, "little"))
        one = data_frame(10**18 + time_ns, source, "192.168.1.255", payload, port=port)
        found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return found


def test_every_telegram_comes_in_its_order_byte_by_byte() -> None:
    heard, told = replayed(PLANT, "--rate", "100")
    assert heard.payloads == payloads_of(PLANT)
    assert told.startswith("nvscope: 1206 telegrams sent to 127.0.0.1:")
    told, others = told.splitlines()
    assert re.search(r"late by \S+ \S+ \(p50\), \S+ \S+ \(p99\), \S+ \S+ \(worst\)\.$", told)
    assert others == "nvscope: 6 other frames left out: telegrams alone are sent to a network."


def test_malformed_ones_are_sent_as_they_are(tmp_path: Path) -> None:
    payloads = [telegram(length=999), telegram(data=b"")[:12], telegram(service=77)]
    made = [data_frame(10**18 + n, "10.0.0.1", "10.0.0.255", one) for n, one in enumerate(payloads)]
    path = write(tmp_path / "x.pcap", [Packet(one.data, one.original, one.ts_ns, one.link) for one in made])
    assert replayed(path)[0].payloads == payloads


@pytest.mark.skipif(sys.platform != "linux", reason="all of 127.0.0.0/8 is this machine")
def test_senders_are_told_apart_on_this_machine(tmp_path: Path) -> None:
    both = frames(0, 1) + frames(2, source="10.7.8.9")
    heard, _ = replayed(write(tmp_path / "x.pcap", both))
    assert [address for _, address, _ in heard.got] == ["127.168.1.10", "127.168.1.10", "127.7.8.9"]


def test_ends_are_kept_to_and_pauses_may_be_skipped(tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcap", frames(0, 5 * 10**9, 65 * 10**9, 3600 * 10**9))
    heard, _ = replayed(path, "--start-offset", "1s", "--until", "66s", "--skip-gaps", "--rate", "10")
    assert heard.payloads == payloads_of(path)[1:3]
    assert heard.got[1][2] - heard.got[0][2] < 5 * 10**9


def test_it_keeps_to_the_times_of_the_capture(tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcap", frames(*range(0, 10**9, 10**8)))
    heard, _ = replayed(path, "--rate", "2")
    steps = [after[2] - before[2] for before, after in zip(heard.got, heard.got[1:], strict=False)]
    # Not one of them comes early, as far as what goes before was not late.
    assert sum(steps) >= 9 * 5 * 10**7 * 0.9


def test_ports_are_mapped(tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcap", frames(0) + frames(1, port=1300))
    with listener() as one, listener() as other:
        done = run_text(
            "replay", path, "--to", "udp://127.0.0.1", "--port", f"1202={one.port}", "--port", f"1300={other.port}"
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [*one.payloads, *other.payloads] == payloads_of(path)


def test_what_was_not_captured_whole_is_not_sent(tmp_path: Path) -> None:
    whole, cut = frames(0, 1)
    path = write(tmp_path / "x.pcap", [whole, cut._replace(data=cut.data[:-2])])
    with listener() as heard:
        done = run_text("replay", path, "--to", f"udp://localhost:{heard.port}")
    assert done.returncode == 3
    assert "1 telegram not captured whole, and not sent" in done.stderr
    assert len(heard.payloads) == 1


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--to", "udp://192.0.2.1:1202"), "192.0.2.1 is not this machine"),
        (("--to", "udp://"), "is not this machine"),
        (("--to", "udp://127.0.0.1", "--map", "192.168.1.255=192.0.2.7"), "192.0.2.7 is not this machine"),
        (("--to", "udp://[2001:db8::1]"), "2001:db8::1 is not this machine"),
        (("--to", "udp://plant.example"), "expected an IP address"),
        (("--to", "udp://127.0.0.1:99999"), "expected udp://ADDRESS:PORT"),
        (("--to", "tcp://127.0.0.1"), "expected udp://ADDRESS:PORT"),
        (("--to", "udp://127.0.0.1", "--map", "1.2.3.4"), "expected OLD=NEW"),
        (("--to", "udp://127.0.0.1", "--port", "x"), "expected NEW, or OLD=NEW"),
        (("--to", "udp://127.0.0.1", "--rate", "0"), "--rate 0"),
        (("--map", "10.0.0.1=127.0.0.1"), "it is not said where to send"),
        ((), "there is no terminal to show it on"),
        (("--rate", "1000"), "--rate 1000: expected 0.1 to 100"),
        (("--to", "udp://127.0.0.1", "-Y", "nv.index == 7"), "-Y, --theme and --gvl are of the screen"),
        (("--to", "udp://127.0.0.1", "--start-offset", "9s", "--until", "2s"), "--start-offset 9s lies behind --until"),
        (("--to", "can:socketcan:can0"), "may have other nodes on it"),
        (("--to", "can:udp_multicast:239.74.163.2"), "may have other nodes on it"),
        (("--to", "can:virtual:a", "--map", "can1=can:slcan:/dev/ttyACM0"), "may have other nodes on it"),
        (("--to", "can:virtual:a", "--map", "10.0.0.1=127.0.0.1"), "expected CHANNEL=can:INTERFACE:CHANNEL"),
        (("--to", "can:virtual:a", "--port", "1202"), "--port is of telegrams"),
        (("--to", "can:virtual"), "expected can:INTERFACE:CHANNEL"),
    ],
)
def test_what_it_does_not_do_is_told_before_anything_is_sent(options: tuple[str, ...], told: str) -> None:
    done = run_text("replay", PLANT, *options)
    assert (done.returncode, told in done.stderr) == (2, True), done.stderr
    assert "telegrams sent" not in done.stderr


def test_it_goes_on_until_it_is_ended(tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcap", frames(0, 10**7))
    with listener() as heard:
        words = [*COMMAND, "replay", str(path), "--to", f"udp://127.0.0.1:{heard.port}", "--loop"]
        sending = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
        until_s = time.monotonic() + 20
        while len(heard.got) < 50 and time.monotonic() < until_s:
            time.sleep(0.02)
        sending.send_signal(signal.SIGINT)
        _, told = sending.communicate(timeout=20)
    assert sending.returncode == 0, told
    assert heard.payloads == (payloads_of(path) * len(heard.got))[: len(heard.got)]
    assert len(heard.got) >= 50


def test_a_simulated_plant_sends_what_it_would_write(tmp_path: Path) -> None:
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        'title = "two"\nduration = "1s"\nseed = 1\n[[node]]\nname = "a"\naddress = "10.0.0.1"\n[[list]]\nname = "l"\n'
        'index = 3\nsender = "a"\nbytes = [8]\ninterval = "50ms"\n'
    )
    assert run_text("simulate", scenario, "-w", tmp_path / "x.pcap").returncode == 0
    with listener() as heard:
        done = run_text("simulate", scenario, "--to", f"udp://127.0.0.1:{heard.port}")
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert heard.payloads == payloads_of(tmp_path / "x.pcap")
    assert "20 telegrams sent to" in done.stderr
    done = run_text("simulate", scenario, "--to", "udp://192.0.2.1")
    assert (done.returncode, "is not this machine" in done.stderr) == (2, True)
    done = run_text("simulate", scenario, "--to", "udp://127.0.0.1", "-w", tmp_path / "y.pcap")
    assert (done.returncode, "writes nothing" in done.stderr, (tmp_path / "y.pcap").exists()) == (2, True, False)


def test_what_was_mapped_in_vain_is_told(tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcap", frames(0))
    with listener() as heard:
        done = run_text(
            "replay", path, "--to", "udp://127.0.0.1", "--port", f"1202={heard.port}", "--port", "77=78",
            "--map", "1.2.3.4=127.0.0.1", "--map", "192.168.1.255=127.0.0.1",
        )  # fmt: skip
    assert done.stderr.splitlines()[1:] == [
        "nvscope: --map 1.2.3.4=…: no telegram went there.", "nvscope: --port 77=…: no telegram went there.",
    ]  # fmt: skip
    assert len(heard.payloads) == 1


def test_where_there_is_nothing_to_send_it_says_so() -> None:
    done = run_text("replay", ROOT / "captures" / "can" / "press.log", "--to", "udp://127.0.0.1:9")
    assert (done.returncode, "nothing was sent: no telegram over UDP" in done.stderr) == (0, True)
    done = run_text("replay", PLANT, "--to", "can:virtual:a")
    assert (done.returncode, "nothing was sent: no frame of CAN" in done.stderr) == (0, True)
