"""What reports tell of sources that are no files, by the schema of reports."""

from __future__ import annotations

import json
import socket

import pytest

from nvscope.capture.formats import LIVE_FORMATS
from nvscope.capture.live.can.bus import CanBus
from nvscope.capture.live.layer2 import Layer2
from nvscope.capture.live.ring import KernelRing
from nvscope.capture.live.udp_socket import UdpSocket
from tests.program import run_text
from tests.schemas.validation import mistakes_in


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


@pytest.mark.parametrize(("source", "wanted"), [("udp://127.0.0.1:{port}", "udp"), ("can:virtual:nvscope-test", "can")])
def test_a_report_on_a_live_source_is_valid(source: str, wanted: str) -> None:
    done = run_text("report", "-i", source.format(port=free_port()), "--for", "100ms", "--json")
    report = json.loads(done.stdout)
    assert [one["format"] for one in report["capture"]["sources"]] == [wanted]
    assert mistakes_in(report) == []


def test_every_kind_of_live_source_is_of_a_format_that_the_schema_knows() -> None:
    kinds = {CanBus.format, Layer2.format, KernelRing.format, UdpSocket.format, "stream"}
    assert kinds == {*LIVE_FORMATS}
