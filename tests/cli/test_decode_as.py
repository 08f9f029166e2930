"""What is on a port, as -d says it: pages of WebVisu on further TCP ports, with every verb that reads captures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink
from tests.analysis.transactions.talk import post, reply
from tests.cli.test_vars import nvscope
from tests.oracle.tcp_line import Line
from tests.packets import batch_of


@pytest.fixture
def elsewhere(tmp_path: Path) -> str:
    """A capture with a page on ports 8081 and 8085 of a controller, each with a value of its own."""
    path = str(tmp_path / "x.pcap")
    sink = open_sink(path)
    for port, value in ((8081, "7"), (8085, "9")):
        line = Line(server=("10.0.0.5", port)).open().ask(post("|0|1|0|4|0|2|1|")).answer(reply(f"|{value}|"))
        sink.write(batch_of(line.frames))
    sink.close()
    return path


def test_a_page_on_another_port_is_found_where_somebody_names_that(elsewhere: str) -> None:
    assert "visu" not in json.loads(nvscope("report", "--json", elsewhere).stdout)
    report = json.loads(nvscope("report", "--json", elsewhere, "-d", "tcp.port==8085,http").stdout)
    assert [(one["server"], one["port"], one["reads"]) for one in report["visu"]] == [("10.0.0.5", 8085, 1)]


@pytest.mark.parametrize(
    "options", [["-d", "tcp.port==8081-8085,http"], ["-d", "tcp.port == 8081,http", "-d", "tcp.port==8085,http"]]
)
def test_ranges_and_several_options_add_up(elsewhere: str, options: list[str]) -> None:
    told = nvscope("packets", elsewhere, *options).stdout
    assert [line.rpartition(" ")[2] for line in told.splitlines() if "reply" in line] == ["7", "9"]


def test_ports_of_a_project_stay(elsewhere: str, tmp_path: Path) -> None:
    project = tmp_path / "nvscope.toml"
    project.write_text("[webvisu]\nports = 8081\n")
    more = ["--project", str(project)]
    for verb in ("vars", "packets"):
        alone = nvscope(verb, elsewhere, *more).stdout.split()
        assert ("7" in alone, "9" in alone) == (True, False)
        both = nvscope(verb, elsewhere, *more, "-d", "tcp.port==8085,http").stdout.split()
        assert ("7" in both, "9" in both) == (True, True)


def test_where_nothing_is_found_it_is_said_how_a_port_is_named(elsewhere: str) -> None:
    assert "`-d tcp.port==PORT,http`" in " ".join(nvscope("report", elsewhere).stdout.split())


@pytest.mark.parametrize(
    "option",
    ["tcp.port==8081,nvl", "udp.port==1202,http", "tcp.port==0,http", "tcp.port==65536,http", "tcp.port==9-8,http",
     "tcp.port==8081", "http"],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_with_what_can(elsewhere: str, option: str) -> None:
    done = nvscope("report", elsewhere, "-d", option)
    assert done.returncode == 2
    assert "tcp.port==PORT,http" in done.stderr
    example = " ".join(done.stderr.split()).partition("for example ")[2]
    assert "-d udp.port==1300,nvl" in example
    assert "-d tcp.port==8081,http" in example


@pytest.mark.parametrize("verb", ["report", "packets", "vars"])
def test_the_help_names_both(verb: str) -> None:
    told = nvscope(verb, "--help").stdout
    assert "(udp|tcp).port==PORT,WHAT" in told
    assert "tcp.port==PORT,http" in " ".join(told.split())
