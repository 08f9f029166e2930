"""What channels are called: one bus has one name in all formats of logs, and a person may give it another."""

from __future__ import annotations

import json
from pathlib import Path

import can
import pytest

from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.open import open_source
from tests.capture.can.logs import frames_of
from tests.capture.can.test_blf import container, file_head, item, message
from tests.program_here import run_text as run

DATE = "Sat Sep 30 10:06:13.191 PM 2017"
ASC = f"date {DATE}\nbase hex  timestamps absolute\n0.1 1 123 Rx d 1 11\n0.2 2 124 Rx d 1 11\n"
TRC = (
    ";$FILEVERSION=2.1\n;$STARTTIME=43008.9\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    " 1 0.5 DT 1 0123 Rx - 1 11\n 2 0.6 DT 2 0124 Rx - 1 11\n"
)


def a_log(folder: Path, suffix: str) -> Path:
    """A log with 0x123 on channel 1 and 0x124 on channel 2, as files number them."""
    path = folder / f"a{suffix}"
    if suffix == ".blf":
        body = b"".join(item(1, message(0x122 + number, channel=number)) for number in (1, 2))
        path.write_bytes(file_head() + container(body))
    elif suffix == ".mf4":
        with can.Logger(str(path)) as logger:
            for number in (1, 2):
                # Numbers are written as they are.
                logger.on_message_received(
                    can.Message(timestamp=number, arbitration_id=0x122 + number, is_extended_id=False, channel=number)
                )
    else:
        path.write_text(ASC if suffix == ".asc" else TRC)
    return path


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".mf4"])
def test_channel_1_is_can1_in_every_format(tmp_path: Path, suffix: str) -> None:
    source = CaptureFile(str(a_log(tmp_path, suffix)))
    assert [(frame.channel, frame.identifier) for frame in frames_of(source)] == [("can1", 0x123), ("can2", 0x124)]


def test_one_bus_in_two_files_is_one_channel(tmp_path: Path) -> None:
    source = open_source([str(a_log(tmp_path, suffix)) for suffix in (".asc", ".blf", ".trc")])
    frames = frames_of(source)
    assert {frame.channel for frame in frames if frame.identifier == 0x123} == {"can1"}
    assert list(source.channels) == ["can1", "can2"]


@pytest.mark.parametrize(
    ("options", "channels"),
    [
        (["can1=press"], ["press", "can2"]),
        (["can1=can2", "can2=can1"], ["can2", "can1"]),
        (["can1=can2,can2=can1"], ["can2", "can1"]),
        (["can1=one, can2=one"], ["one", "one"]),
        (["can7=x"], ["can1", "can2"]),
    ],
)
@pytest.mark.parametrize("verb", ["packets", "report"])
def test_channels_are_renamed(tmp_path: Path, options: list[str], channels: list[str], verb: str) -> None:
    path = a_log(tmp_path, ".asc")
    given = [part for option in options for part in ("--channel-map", option)]
    if verb == "packets":
        ran = run("packets", str(path), *given, "-e", "can.channel", cwd=tmp_path)
        assert ran.stdout.split() == channels
    else:
        ran = run("report", str(path), *given, "--json", cwd=tmp_path)
        assert [bus["channel"] for bus in json.loads(ran.stdout)["buses"]] == sorted(set(channels))
    nobody = "no channel is called can7. The nearest known one is 'can"
    assert (nobody in ran.stderr) == (options == ["can7=x"])


def test_a_project_renames_and_the_command_line_goes_before_it(tmp_path: Path) -> None:
    """Bit rates are those of the new name."""
    path = a_log(tmp_path, ".asc")
    (tmp_path / "nvscope.toml").write_text(
        '[channels]\ncan1 = "press"\ncan2 = "lift"\n[buses.press]\nbit_rate = 250000\n'
    )
    buses = json.loads(run("report", str(path), "--json", cwd=tmp_path).stdout)["buses"]
    assert [(bus["channel"], bus["bit_rate"] and bus["bit_rate"]["nominal"]) for bus in buses] == [
        ("lift", None),
        ("press", 250_000),
    ]
    ran = run("packets", str(path), "--channel-map", "can1=x", "-e", "can.channel", cwd=tmp_path)
    assert ran.stdout.split() == ["x", "lift"]
    ran = run("packets", str(path), "-e", "can.channel", cwd=tmp_path)
    assert ran.stdout.split() == ["press", "lift"]


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ("can1", "expected OLD=NEW"),
        ("can1=", "expected OLD=NEW"),
        ("=x", "expected OLD=NEW"),
        ("can1=a b", "expected OLD=NEW"),
        ("can1=" + "x" * 61, "expected OLD=NEW"),
        ("can1=\x1b[31m", "expected OLD=NEW"),
        ("can1=x,can1=y", "gives can1 two names: x and y"),
    ],
)
def test_what_is_no_map_is_told(tmp_path: Path, option: str, told: str) -> None:
    ran = run("report", str(a_log(tmp_path, ".asc")), "--channel-map", option, cwd=tmp_path)
    assert ran.returncode == 2
    assert told in ran.stderr


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ('[channel]\ncan1 = "x"\n', "The nearest known one is 'channels'"),
        ('[channels]\ncan1 = ""\n', "channels.can1: the name of a channel has 1 to 60 characters"),
        ("[channels]\ncan1 = 1\n", "channels.can1: "),
    ],
)
def test_what_is_wrong_in_a_project_is_told(tmp_path: Path, table: str, told: str) -> None:
    (tmp_path / "nvscope.toml").write_text(table)
    ran = run("report", str(a_log(tmp_path, ".asc")), cwd=tmp_path)
    assert ran.returncode == 2
    assert told in ran.stderr


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--bitrate", "can9@500k"), "nvscope: --bitrate can9@500k: no channel is called can9. "),
        (("--bitrate", "x*@500k"), "nvscope: --bitrate x*@500k: no channel is called x*. "),
        (("--bitrate", "can?@500k"), ""),
        (("--bitrate", "500k"), ""),
        (("--channel-map", "can9=press"), "nvscope: --channel-map can9=press: no channel is called can9. "),
    ],
)
def test_channels_that_are_not_there_are_told(tmp_path: Path, options: tuple[str, ...], told: str) -> None:
    (tmp_path / "a.log").write_text("(1.0) can0 110#01\n(1.1) can0 110#02\n")
    ran = run("report", "a.log", *options, cwd=tmp_path)
    assert ran.returncode == 0
    assert ran.stderr.startswith(told)
    assert bool(ran.stderr) == bool(told)


@pytest.mark.parametrize(
    "verb",
    [["vars"], ["vars", "--at", "T#1s"], ["vars", "--history", "*"], ["export", "-w", "values.csv"]],
    ids=lambda verb: " ".join(verb[:2]),
)
def test_a_channel_that_is_not_there_is_told_wherever_values_are(tmp_path: Path, verb: list[str]) -> None:
    captures = Path(__file__).parents[2] / "captures" / "can"
    log, definition = captures / "press.log", captures / "press.gvl"
    told = "nvscope: --channel-map can9=press: no channel is called can9. "
    ran = run(verb[0], str(log), str(definition), *verb[1:], "--channel-map", "can9=press", cwd=tmp_path)
    assert (ran.returncode, told in ran.stderr) == (0, True), ran.stderr
    here = tmp_path / "there"
    here.mkdir()
    ran = run(verb[0], str(log), str(definition), *verb[1:], "--channel-map", "can0=press", cwd=here)
    assert (ran.returncode, "no channel" in ran.stderr) == (0, False), ran.stderr
