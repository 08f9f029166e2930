"""The ways to receive what is sent: how each is called, and what it says it received and dropped."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tool import HERE, not_found, nvscope_path, python


@dataclass(frozen=True)
class Received:
    """What a program says of its run; ``dropped`` is None where it says nothing."""

    count: int
    dropped: int | None
    notes: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Consumer:
    """One way to receive; ``counts`` is what of the sent ones it is asked to count, ``truth`` gives it."""

    name: str
    command: Callable[[str], list[str]]
    read: Callable[[str, str], Received]
    missing: str | None = None
    counts: Callable[[dict[str, Any]], int] = lambda truth: int(truth["frames"])
    is_socket: bool = False


def _of_dumpcap(out: str, said: str) -> Received:
    # Packets received/dropped on interface 'nvbb': 1010000/0 (pcap:0/dumpcap:0/flushed:0/ps_ifdrop:0) (100.0%)
    found = re.search(r"received/dropped on interface [^:]*: (\d+)/(\d+)", said)
    return Received(int(found[1]), int(found[2])) if found else Received(0, None)


def _of_tshark(out: str, said: str) -> Received:
    dropped = re.search(r"(\d+) packets? dropped", said)
    captured = re.findall(r"^(\d+) packets? captured", said, re.MULTILINE)
    return Received(int(captured[-1]) if captured else 0, int(dropped[1]) if dropped else 0)


def _of_report(out: str, said: str) -> Received:
    document = json.loads(out)
    capture = document["capture"]
    codes = sorted({one["code"] for one in document["findings"]})
    notes = {"frames": capture["frames"], "findings": codes, "causes": len(document["causes"])}
    return Received(capture["telegrams"], capture["drops"], notes)


def _of_numbers(out: str, said: str) -> Received:
    count, dropped = map(int, out.split())
    return Received(count, dropped)


def telegrams(truth: dict[str, Any]) -> int:
    """Return how many telegrams were sent."""
    return int(truth["telegrams"])


def broadcasts(truth: dict[str, Any]) -> int:
    """Return how many of the telegrams come to a socket of a machine that is none of the nodes."""
    kinds = truth["kinds"]
    return int(truth["telegrams"] - kinds["acknowledgement"] - kinds["refusal"])


def report(
    name: str, *options: str, source: str = "{}", counts: Callable[[dict[str, Any]], int] = telegrams
) -> Consumer:
    """Return nvscope as a consumer, with some options."""
    nvscope = nvscope_path()
    return Consumer(
        name,
        lambda device: [str(nvscope), "report", "--json", source.format(device), *options],
        _of_report,
        not_found(nvscope, "nvscope"),
        counts,
        source.startswith("udp"),
    )


NVSCOPE = report("nvscope report")
NVSCOPE_UDP = report("nvscope report udp://", source="udp://0.0.0.0:1202", counts=broadcasts)
DUMPCAP = Consumer(
    "dumpcap",
    lambda device: ["dumpcap", "-q", "-i", device, "-w", "/dev/null"],
    _of_dumpcap,
    not_found(shutil.which("dumpcap"), "dumpcap"),
)
OTHERS = [
    Consumer(
        "tshark -w",
        lambda device: ["tshark", "-n", "-q", "-i", device, "-w", "/dev/null"],
        _of_tshark,
        not_found(shutil.which("tshark"), "tshark"),
    ),
    Consumer(
        "tshark, one line per frame",
        lambda device: ["tshark", "-n", "-i", device],
        _of_tshark,
        not_found(shutil.which("tshark"), "tshark"),
    ),
    Consumer(
        "Scapy sniff(store=False)",
        lambda device: python(str(HERE / "live_consumers.py"), device),
        _of_numbers,
        not_found("scapy" if importlib.util.find_spec("scapy") else None, "Scapy"),
    ),
]


def sniff_with_scapy(device: str) -> None:
    """Count what Scapy's ``sniff`` hands out until a signal comes, and ask its socket what the kernel dropped."""
    from scapy.config import conf  # noqa: PLC0415
    from scapy.layers import l2  # noqa: F401, PLC0415  # registers Ethernet as a link type
    from scapy.sendrecv import AsyncSniffer  # noqa: PLC0415

    count = 0

    def take(_: Any) -> None:
        nonlocal count
        count += 1

    tap = conf.L2listen(iface=device)
    sniffer = AsyncSniffer(opened_socket=tap, store=False, prn=take)
    sniffer.start()
    signal.sigwait([signal.SIGINT])
    dropped = int.from_bytes(tap.ins.getsockopt(263, 6, 8)[4:], sys.byteorder)
    sniffer.stop(join=False)
    sys.stdout.write(f"{count} {dropped}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    sniff_with_scapy(sys.argv[1])
