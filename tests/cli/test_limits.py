"""What a system does not give, such as memory, descriptors or room on a disk, is a sentence and an exit code."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from nvscope.errors import ExitCode
from tests.laws import crossed
from tests.program import COMMAND, run

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "captures" / "peers"

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="these are limits of its shell")


def limited(
    limits: str, words: str, *, cwd: Path, unbuffered: bool = False, to: str = ""
) -> subprocess.CompletedProcess[bytes]:
    """Run the program under limits of a shell; ``to`` is where its streams go."""
    # A limit of files would cut what Python keeps of its modules.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"PYTHONUNBUFFERED": "1"} if unbuffered else {}
    command = f"{limits}; exec {shlex.join([*COMMAND, *words.split()])} {to}"
    return subprocess.run(["bash", "-c", command], cwd=cwd, env=environment, capture_output=True, check=False)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    for name in ("peers.pcap", "batch.gvl"):
        shutil.copy(PEERS / name, tmp_path)
    return tmp_path


PRINTING = [
    "report peers.pcap",
    "report peers.pcap --json",
    "packets peers.pcap",
    "packets peers.pcap -T csv",
    "packets peers.pcap -T ndjson",
    "vars peers.pcap --gvl batch.gvl --json",
    "vars peers.pcap --gvl batch.gvl --history run",
    "schema report",
    "explain --json",
    "keys --fields",
    "gvl layout batch.gvl --json",
    "report --help",
]


@pytest.mark.parametrize(("words", "unbuffered"), crossed(PRINTING, [False, True]))
def test_what_does_not_go_to_stdout_as_a_whole_is_no_success(words: str, unbuffered: bool, place: Path) -> None:
    done = limited("ulimit -f 1", words, cwd=place, unbuffered=unbuffered, to="> out")
    assert (done.returncode, (place / "out").stat().st_size) == (ExitCode.CAPTURE, 1024)
    assert done.stderr == b"nvscope: the output cannot be written: File too large\n  make room, or write elsewhere\n"


@pytest.mark.parametrize("words", PRINTING)
def test_a_stdout_that_is_closed_is_no_success(words: str, place: Path) -> None:
    done = limited("true", words, cwd=place, to=">&-")
    assert done.returncode == ExitCode.CAPTURE
    assert done.stderr == b"nvscope: the output cannot be written: stdout is closed\n  make room, or write elsewhere\n"


def test_without_a_buffer_the_same_is_printed(place: Path) -> None:
    done = limited("true", "report peers.pcap", cwd=place, unbuffered=True)
    assert (done.returncode, done.stdout) == (0, run("report", "peers.pcap", cwd=place).stdout)


def test_what_needs_no_stream_works_without_any(place: Path) -> None:
    done = limited("true", "export peers.pcap batch.gvl -w out.csv", cwd=place, to="<&- >&- 2>&-")
    assert done.returncode == 0
    run("export", "peers.pcap", "batch.gvl", "-w", "same.csv", cwd=place)
    assert (place / "out.csv").read_bytes() == (place / "same.csv").read_bytes()


def test_small_captures_are_not_open_side_by_side(place: Path) -> None:
    """All of them overlap: nothing can be passed on before all are looked at."""
    (place / "many").mkdir()
    for number in range(50):
        shutil.copy(PEERS / "peers.pcap", place / "many" / f"{number}.pcap")
    done = limited("ulimit -n 25", "report many --json", cwd=place)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout == run("report", "many", "--json", cwd=place).stdout


def test_as_many_files_as_the_system_allows_are_open(place: Path) -> None:
    """Those that are compressed stay open while they are read; the soft limit is for other programs."""
    (place / "many").mkdir()
    packed = subprocess.run(["gzip", "-c", PEERS / "peers.pcap"], capture_output=True, check=True).stdout
    for number in range(50):
        (place / "many" / f"{number}.pcap.gz").write_bytes(packed)
    done = limited("ulimit -n 25", "report many", cwd=place)
    assert (done.returncode, done.stdout) == (ExitCode.CAPTURE, b"")
    assert b".pcap.gz: too many files are open at a time\n  raise the limit (ulimit -n)" in done.stderr
    assert limited("ulimit -Sn 25", "report many", cwd=place).returncode == 0


@pytest.mark.parametrize("kilobytes", [40_000, 60_000, 115_000, 130_000])
def test_too_little_memory_to_start_is_said(kilobytes: int, place: Path) -> None:
    # Modules that must be compiled first say anything of too little memory: then all of them are.
    assert run("--version").returncode == 0
    done = limited(f"ulimit -v {kilobytes}", "report peers.pcap", cwd=place)
    if b"OpenBLAS" in done.stderr or b"Fatal Python error" in done.stderr or b"error while loading" in done.stderr:
        pytest.skip("not even what is beneath the program could start")
    assert done.returncode == ExitCode.CAPTURE
    assert b"nvscope: there is not enough memory" in done.stderr
    assert b"Traceback" not in done.stderr


@pytest.mark.parametrize("kilobytes", [800_000, 1_200_000])
@pytest.mark.parametrize("name", ["out.csv", "out.ndjson"])
def test_too_little_memory_for_what_writes_text_is_said(name: str, kilobytes: int, place: Path) -> None:
    done = limited(f"ulimit -v {kilobytes}", f"export peers.pcap batch.gvl -w {name}", cwd=place)
    assert done.returncode == ExitCode.CAPTURE
    assert done.stderr.startswith(b"nvscope: there is not enough memory")
    assert sorted(os.listdir(place)) == ["batch.gvl", "peers.pcap"]
