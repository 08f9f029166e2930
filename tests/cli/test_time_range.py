"""--from-time and --to-time: what is left is as if the capture had been cut."""

from __future__ import annotations

import json
import shutil
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.open import open_sink, open_source
from tests.laws import some
from tests.program_here import run_text

CAPTURES = Path(__file__).parent.parent.parent / "captures"
PEERS, PLANT, PRESS = CAPTURES / "peers" / "peers.pcap", CAPTURES / "plant.pcapng.gz", CAPTURES / "can" / "press.log"
DEFINED = ["--gvl", str(CAPTURES / "peers" / "axis.gvl"), "--gvl", str(CAPTURES / "peers" / "axis_types.st")]
S_NS = 10**9


def nvscope(
    *arguments: str | Path, code: int = 0, stdin: Path | None = None, zone: str = "UTC"
) -> subprocess.CompletedProcess[str]:
    done = run_text(*arguments, stdin=stdin.read_bytes() if stdin else b"", environment={"TZ": zone})
    assert done.returncode == code, done.stderr
    return done


def document(*arguments: str | Path, **options: Any) -> dict[str, Any]:
    report = json.loads(nvscope("report", "--json", *arguments, **options).stdout)
    del report["capture"]["sources"]
    return dict(report)


def start_ns(capture: Path) -> int:
    return int(document(capture)["capture"]["start_ns"])


def text_of(ns: int, zone: str = "Z") -> str:
    return f"{datetime.fromtimestamp(ns // S_NS, UTC):%Y-%m-%dT%H:%M:%S}.{ns % S_NS:09d}{zone}"


def cut(capture: Path, begin_ns: int, end_ns: int, path: Path) -> Path:
    """Write the packets from one time to another, both included, with editcap where it can read the capture."""
    if capture.suffix == ".log":
        kept = []
        for line in capture.read_text().splitlines(keepends=True):
            seconds, _, fraction = line[1:].split(")")[0].partition(".")
            if begin_ns <= int(seconds) * S_NS + int(fraction.ljust(9, "0")) <= end_ns:
                kept.append(line)
        path.write_text("".join(kept))
        return path
    if shutil.which("editcap") is None:
        pytest.skip("needs editcap")
    bounds = [f"{ns // S_NS}.{ns % S_NS:09d}" for ns in (begin_ns, end_ns + 1)]
    subprocess.run(["editcap", "-A", bounds[0], "-B", bounds[1], str(capture), str(path)], check=True)
    return path


@pytest.mark.parametrize(
    ("capture", "begin_ms", "end_ms"),
    some([
        (capture, begin_ms, end_ms)
        for capture in (PEERS, PLANT, PRESS) for begin_ms, end_ms in ((1000, 2500), (0, 700), (1700, 10**6))
    ]),
)  # fmt: skip
def test_a_part_is_reported_and_shown_as_if_nothing_else_had_been_captured(
    capture: Path, begin_ms: int, end_ms: int, tmp_path: Path
) -> None:
    first_ns = start_ns(capture)
    begin_ns, end_ns = first_ns + begin_ms * 10**6, first_ns + end_ms * 10**6
    alone = cut(capture, begin_ns, end_ns, tmp_path / f"cut{capture.suffixes[0]}")
    times = ["--from-time", f"{begin_ms}ms", "--to-time", f"{end_ms}ms"]
    assert document(capture, *times) == document(alone)
    for arguments in (["-T", "json"], ["-t", "r"], ["-Y", "frame.number > 10", "-V", "-c", "30"]):
        assert nvscope("packets", capture, *times, *arguments).stdout == nvscope("packets", alone, *arguments).stdout
    assert document(alone)["capture"]["frames"] > 20


def test_times_are_taken_as_at_takes_them(tmp_path: Path) -> None:
    """From the start, from the end, of the day, with a zone and nine digits: the same frames each time."""
    first_ns = start_ns(PEERS)
    last_ns = int(document(PEERS)["capture"]["end_ns"])
    begin_ns, end_ns = first_ns + 2 * S_NS, last_ns - S_NS
    clock = text_of(begin_ns, "").split("T")[1]
    expected = document(PEERS, "--from-time", text_of(begin_ns), "--to-time", text_of(end_ns))
    assert expected["capture"]["frames"] not in (0, 864)
    for begin in ("2s", "+2s", "2000ms", clock, text_of(begin_ns, "+00:00"), text_of(begin_ns, "").replace("T", " ")):
        assert document(PEERS, "--from-time", begin, "--to-time", "-1s") == expected
    assert document(PEERS, "--utc", "--from-time", clock, "--to-time", "-1s", zone="Europe/Berlin") == expected
    hour = (datetime.fromisoformat(text_of(begin_ns, "")[:19]).hour + 1) % 24
    local = f"{hour:02d}{clock[2:]}"
    assert document(PEERS, "--from-time", local, "--to-time", "-1s", zone="Europe/Berlin") == expected
    shown = [
        nvscope("packets", PEERS, "-t", "u", "--from-time", time, "--to-time", "-1s", zone="Europe/Berlin").stdout
        for time in (clock, "2s")
    ]
    assert shown[0] == shown[1]


def test_both_bounds_are_included() -> None:
    (batch, *_) = open_source([str(PEERS)])
    one = text_of(int(batch.ts_ns[100]))
    shown = nvscope("packets", PEERS, "--from-time", one, "--to-time", one, "-T", "fields", "-e", "frame.number")
    assert shown.stdout == "1\n"


def test_several_captures_are_cut_as_one_timeline() -> None:
    """Times from the start and from the end are those of all captures together."""
    whole = [PEERS, PLANT]
    first_ns = min(map(start_ns, whole))
    last_ns = max(int(document(path)["capture"]["end_ns"]) for path in whole)
    found = document(*whole, "--from-time", "1s", "--to-time", "-1s")
    assert int(found["capture"]["start_ns"]) >= first_ns + S_NS
    assert int(found["capture"]["end_ns"]) <= last_ns - S_NS
    absolute = ["--from-time", text_of(first_ns + S_NS), "--to-time", text_of(last_ns - S_NS)]
    assert document(*whole, *absolute) == found


def test_values_and_judged_filters_are_those_of_the_part() -> None:
    part = ["--from-time", "3s", "--to-time", "6s"]
    found = document(PEERS, *DEFINED, *part, "-Y", "list.lost == 0")
    frames = [frame for finding in found["findings"] for frame in finding["frames"]]
    assert max(frames, default=0) <= found["capture"]["frames"]
    assert any(entry["values"] for entry in found["lists"])
    lines = nvscope("packets", PEERS, *part, "-Y", "list.lost == 0", "-T", "fields", "-e", "frame.number").stdout
    assert 0 < max(map(int, lines.split())) <= found["capture"]["frames"]


def test_stdin_is_cut_from_its_start() -> None:
    part = ["--from-time", "1s", "--to-time", "2s"]
    assert document("-", *part, stdin=PEERS) == document(PEERS, *part)
    assert nvscope("packets", "-", *part, stdin=PEERS).stdout == nvscope("packets", PEERS, *part).stdout
    told = nvscope("report", "-", "--to-time", "-1s", stdin=PEERS, code=2).stderr
    assert told.startswith("nvscope: --to-time -1s: stdin has no end that is known before it is there\n")


@pytest.mark.parametrize("verb", ["report", "packets"])
def test_what_is_no_time_is_refused(verb: str) -> None:
    frame = nvscope(verb, PEERS, "--from-time", "#1234", code=2).stderr
    assert frame == (
        "nvscope: --from-time #1234: a frame, expected a time\n"
        "  write 5s after the first frame, -2s before the end, 08:00:01.5, or 2026-01-31 08:00:01.5Z\n"
    )
    wrong = nvscope(verb, PEERS, "--to-time", "noon", code=2).stderr
    assert wrong.startswith("nvscope: --to-time 'noon': not a time of the capture\n  write 5s after")
    assert "#1234" not in wrong
    swapped = nvscope(verb, PEERS, "--from-time", "5s", "--to-time", "2s", code=2).stderr
    assert swapped.startswith("nvscope: --from-time 5s lies behind --to-time 2s\n")


def test_nothing_between_is_said() -> None:
    sentence = "nvscope: no frame lies in the time that --from-time and --to-time leave.\n"
    for verb in ("report", "packets"):
        assert nvscope(verb, PEERS, "--to-time", "2001-01-01").stderr == sentence
    assert document(PEERS, "--from-time", "1h")["capture"]["frames"] == 0


def test_a_cut_capture_is_told_whatever_part_of_it_is_wanted(tmp_path: Path) -> None:
    path = tmp_path / "cut.pcap"
    path.write_bytes(PEERS.read_bytes()[:-5])
    done = nvscope("report", path, "--to-time", "1s", code=3)
    assert "cut short" in done.stderr


def test_a_capture_without_packets_has_no_times(tmp_path: Path) -> None:
    open_sink(str(tmp_path / "a.pcap")).close()
    assert list(open_source([str(tmp_path / "a.pcap")])) == []
    for time in ("5s", "-5s", "08:00:00"):
        assert document(tmp_path / "a.pcap", "--from-time", time)["capture"]["frames"] == 0
