from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.program import COMMAND
from tests.program_here import run

CAPTURES = Path(__file__).parents[2] / "captures"
PEERS, TRUNCATED = str(CAPTURES / "peers" / "peers.pcap"), str(CAPTURES / "truncated.pcap")
PROGRAM = [*COMMAND, "packets"]


def packets(*arguments: str, stdin: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    return run("packets", *arguments, stdin=stdin)


def at_a_terminal(width: int, *arguments: str, environment: Mapping[str, str] | None = None) -> str:
    """Return what the program shows at a terminal of some width."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, width, 0, 0))
    kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
    child = subprocess.Popen(
        [*PROGRAM, *arguments],
        stdin=theirs,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
        env={**kept, "TERM": "xterm", **(environment or {})},
    )
    os.close(theirs)
    shown = b""
    while True:
        try:
            piece = os.read(ours, 65536)
        except OSError:  # Linux says so when nobody holds the other end any more
            break
        if not piece:
            break
        shown += piece
    os.close(ours)
    assert child.wait() == 0
    return shown.decode().replace("\r\n", "\n")


def test_a_line_a_telegram() -> None:
    done = packets(PEERS)
    assert (done.returncode, done.stderr) == (0, b"")
    lines = done.stdout.decode().splitlines()
    assert len(lines) == 862
    assert " ".join(lines[1].split()) == "4 0.001849 10.77.0.1 → broadcast list 1 sub 0 data 6 items 56 B #0"


def test_from_stdin_or_named_with_r() -> None:
    expected = packets(PEERS, "-T", "csv").stdout
    assert packets("-", "-T", "csv", stdin=Path(PEERS).read_bytes()).stdout == expected
    assert packets("-r", PEERS, "-T", "csv").stdout == expected


def test_a_count_ends_it_before_the_rest_is_read() -> None:
    done = packets(TRUNCATED, "-c", "5", "-T", "ndjson")
    assert (done.returncode, done.stderr) == (0, b"")
    assert [json.loads(line)["frame.number"] for line in done.stdout.splitlines()] == [3, 4, 5, 6, 7]


def test_a_count_does_not_wait_for_more_from_a_pipe() -> None:
    child = subprocess.Popen([*PROGRAM, "-", "-c", "2"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert child.stdin
    assert child.stdout
    child.stdin.write(Path(PEERS).read_bytes()[:3000])
    child.stdin.flush()
    # The writing end stays open: what is there has to be enough.
    assert len(child.stdout.read().splitlines()) == 2
    assert child.wait() == 0
    child.stdin.close()
    child.stdout.close()


def test_a_cut_capture_is_shown_to_its_end_and_told() -> None:
    for form in ("text", "json"):
        done = packets(TRUNCATED, "-T", form)
        assert done.returncode == 3
        assert b"truncated.pcap, offset 13650" in done.stderr
    assert len(json.loads(done.stdout)) == 97


@pytest.mark.parametrize(("form", "expected"), [("text", b""), ("ndjson", b""), ("json", b"[]\n")])
def test_no_telegrams_are_no_error(form: str, expected: bytes) -> None:
    done = packets(PEERS, "-d", "udp.port==1202,data", "-T", form)
    assert (done.returncode, done.stdout) == (0, expected)
    assert b"864 frames, no telegram" in done.stderr
    assert done.stderr.count(b"\n") == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["-e", "nv.countr"], b"perhaps nv.counter"),
        (["-T", "fields"], b"-e frame.number"),
        (["-T", "text", "-e", "nv.id"], b"-T fields"),
        (["-T", "csv", "-x"], b"udp.payload"),
        (["-T", "json", "-V"], b"-T json"),
        (["-T", "csv", "-E", "header=y"], b"-T fields"),
        (["-e", "nv.id", "-E", "separator="], b"separator=/t"),
        (["-c", "0"], b"expected 1 or more"),
        (["-Y", "nv.indx"], b"column 1: no field is called nv.indx\n  nv.indx\n  ^^^^^^^\n  perhaps nv.index"),
        (["-Y", "nv.index = 7\x1b[2J"], b"equal is written =="),
        (["-Y", ""], b"the expression is empty"),
        (["-Y", "frame.time_delta_displayed > 1"], b"still to be decided"),
        (["-e", "udp.port"], b"-e udp.srcport -e udp.dstport"),
        (["-t", "x"], b"'ud'"),
        (["-d", "tcp.port==1,nvl"], b"udp.port==PORT"),
    ],
)
def test_usage_errors_say_what_to_do(arguments: list[str], told: bytes) -> None:
    done = packets(PEERS, *arguments)
    assert (done.returncode, done.stdout) == (2, b"")
    assert told in done.stderr
    assert b"Traceback" not in done.stderr


def test_no_source_and_no_capture(tmp_path: Path) -> None:
    assert packets().returncode == 2
    garbage = tmp_path / "garbage.pcap"
    garbage.write_bytes(b"no capture at all")
    done = packets(str(garbage), "-T", "csv")
    assert (done.returncode, done.stdout) == (4, b"")
    assert b"garbage.pcap, offset 0" in done.stderr


def test_whoever_stops_reading_hears_no_complaint() -> None:
    for arguments in ([], ["-V", "-x"], ["-T", "json"]):
        child = subprocess.Popen([*PROGRAM, PEERS, PEERS, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert child.stdout
        assert child.stderr
        child.stdout.read(10)
        child.stdout.close()
        complaint = child.stderr.read()
        child.stderr.close()
        child.wait()
        assert complaint == b""


def test_fields_with_header_and_separator() -> None:
    done = packets(PEERS, "-e", "frame.number", "-e", "nv.index", "-E", "header=y", "-E", "separator=,", "-c", "2")
    assert done.stdout == b"frame.number,nv.index\n3,3\n4,1\n"


@pytest.mark.parametrize("form", [[], ["-T", "csv"], ["-T", "ndjson"], ["-e", "frame.number", "-e", "nv.index"]])
def test_a_filter_leaves_out_lines_and_changes_none(form: list[str]) -> None:
    everything = packets(PEERS, *form).stdout.decode().splitlines()
    done = packets(PEERS, *form, "-Y", "nv.index in {1..1000} && !(nv.index == 7)", "-t", "r")
    assert (done.returncode, done.stderr) == (0, b"")
    chosen = done.stdout.decode().splitlines()
    numbers = packets(PEERS, "-e", "frame.number", "-Y", "nv.index == 7").stdout.split()
    assert 0 < len(chosen) < len(everything)
    assert len(chosen) + len(numbers) == len(everything)
    assert set(chosen) <= set(everything)


def test_trees_and_arrays_of_what_is_chosen() -> None:
    done = packets(PEERS, "-Y", "nv.index == 7 && nv.subindex == 0", "-T", "json")
    assert {entry["nv.subindex"] for entry in json.loads(done.stdout)} == {0}
    tree = packets(PEERS, "-Y", "frame.number == 14", "-V").stdout
    assert tree == packets(PEERS, "-Y", "nv.index == 7", "-c", "12", "-V").stdout.split(b"\n\n")[0] + b"\n\n"


def test_a_count_counts_what_is_read_as_in_tshark() -> None:
    assert len(packets(PEERS, "-Y", "nv.index == 7", "-c", "20").stdout.splitlines()) == 3


@pytest.mark.parametrize(("form", "expected"), [("text", b""), ("fields", b""), ("json", b"[]\n")])
def test_a_filter_that_chooses_nothing_says_so(form: str, expected: bytes) -> None:
    done = packets(PEERS, "-Y", "nv.index == 12345", "-T", form, *(["-e", "nv.id"] if form == "fields" else []))
    assert (done.returncode, done.stdout) == (0, expected)
    assert done.stderr == b"nvscope: 862 telegrams read, the filter chooses none of them.\n"


def test_several_files_are_one_capture() -> None:
    numbers = packets(PEERS, PEERS, "-e", "frame.number").stdout.split()
    assert len(numbers) == 2 * 862
    assert int(numbers[-1]) <= 2 * 864
    assert [int(number) for number in numbers] == sorted({int(number) for number in numbers})


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("options", [[], ["-t", "ad"], ["-V"]])
def test_nothing_is_wider_than_the_terminal(width: int, options: list[str]) -> None:
    shown = at_a_terminal(width, PEERS, "-c", "60", *options)
    lines = re.sub(r"\x1b\[[0-9;]+m", "", shown).splitlines()
    assert len(lines) >= 60
    assert max(map(len, lines)) <= width


def test_colours_are_for_terminals_and_as_asked_for() -> None:
    assert "\x1b[" in at_a_terminal(80, PEERS, "-c", "3")
    assert "\x1b[" not in at_a_terminal(80, PEERS, "-c", "3", environment={"NO_COLOR": "1"})
    assert "\x1b[" not in at_a_terminal(80, PEERS, "-c", "3", "--color", "never")
    assert b"\x1b[" not in packets(PEERS, "-c", "3").stdout
    assert b"\x1b[" in packets(PEERS, "-c", "3", "--color", "always").stdout


@pytest.mark.parametrize("form", [["-V", "-x"], ["-T", "json"], []])
def test_a_short_capture_needs_no_heavy_library(form: list[str]) -> None:
    program = (
        "import sys\n"
        "from nvscope.cli.program import program\n"
        f"program()(['packets', {PEERS!r}, *{form!r}], standalone_mode=False)\n"
        "heavy = {'scapy', 'can', 'mcap', 'rich', 'textual', 'zstandard', 'lz4', 'lark', 'defusedxml'}\n"
        "print(heavy & set(sys.modules), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert done.stderr == b"set()\n"


@pytest.mark.parametrize(
    ("expression", "judged"), [("nv.index == 7", False), ('finding.code == "NV207"', False), ("cause.kind", True)]
)
def test_causes_are_judged_for_who_asks_for_them(expression: str, judged: bool) -> None:
    program = (
        "import sys\n"
        "from nvscope.cli.program import program\n"
        f"program()(['packets', {PEERS!r}, '-Y', {expression!r}], standalone_mode=False)\n"
        "print('nvscope.causes.case' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True)
    assert done.stdout.splitlines()[-1] == str(judged)


@pytest.mark.parametrize(
    ("expression", "what"),
    [
        ('finding.code == "NV207"', "finding"), ('cause.kind == "counter-foreign"', "cause"),
        ("finding.code && cause.kind", "finding or cause"),
    ],
)  # fmt: skip
def test_it_is_said_that_telegrams_show_the_first_events_alone(expression: str, what: str) -> None:
    done = packets(PEERS, "-Y", expression)
    assert done.stdout
    told = f"nvscope: a {what} is shown by the telegrams of its first ten events, not by all.\n"
    assert done.stderr.decode() == told
