"""What a system may do to a program: each of it is a sentence and an exit code, never a traceback."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.program import COMMAND, run_text

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "captures" / "peers"
LONG = "n" * 5_000

EDGES: dict[str, tuple[list[str], int, str]] = {
    "empty source": (["report", ""], 2, "the name of a source is empty"),
    "empty definition": (["report", "x.pcap", "--gvl", ""], 2, "the name of a definition file is empty"),
    "long source": (["report", LONG], 2, "no verb"),
    "long path": (["report", f"./{LONG}"], 4, "File name too long"),
    "long definition": (["report", "x.pcap", "--gvl", LONG], 2, "File name too long"),
    "long output": (["export", "x.pcap", "-w", f"{LONG}.csv"], 5, "File name too long"),
    "long project": (["report", "x.pcap", "--project", LONG], 2, "File name too long"),
    "long scenario": (["simulate", LONG, "-w", "y.pcap"], 2, "File name too long"),
    "link loop": (["report", "loop"], 4, "Too many levels of symbolic links"),
    "loop of a definition": (["report", "x.pcap", "--gvl", "loop"], 2, "Too many levels of symbolic links"),
    "loop of an output": (["export", "x.pcap", "-w", "loop.csv"], 5, "Symlink loop"),
    "loop of a scenario": (["simulate", "loop", "-w", "y.pcap"], 2, "Too many levels of symbolic links"),
    "directory as output": (["export", "x.pcap", "-w", "folder.csv"], 5, "is a directory"),
    "file as directory": (["export", "x.pcap", "-w", "x.pcap/y.csv"], 5, "Not a directory"),
    "no directory": (["simulate", "loss.toml", "-w", "gone/y.pcap"], 5, "No such file or directory"),
    "name of bytes": (["report", os.fsdecode(b"bad\xff.pcap")], 4, "bad\\udcff.pcap"),
    "folder without captures": (["report", "folder.csv"], 4, "no capture file among 0 files"),
}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    shutil.copy(PEERS / "peers.pcap", tmp_path / "x.pcap")
    shutil.copy(ROOT / "tests" / "scenarios" / "loss.toml", tmp_path / "loss.toml")
    for name in ("loop", "loop.csv"):
        (tmp_path / name).symlink_to(name)
    (tmp_path / "folder.csv").mkdir()
    return tmp_path


@pytest.mark.parametrize("edge", EDGES)
def test_each_edge_has_its_sentence_and_exit_code(edge: str, place: Path) -> None:
    words, code, said = EDGES[edge]
    if edge == "long source":
        words, code, said = ["report", LONG], 4, "File name too long"
    done = run_text(*words, cwd=place)
    assert done.returncode == code, done.stderr[:500]
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= 3


def shell(command: str, place: Path) -> subprocess.CompletedProcess[str]:
    program = " ".join(COMMAND)
    return subprocess.run(
        ["bash", "-c", command.replace("nvscope", program, 1)], capture_output=True, text=True, check=False, cwd=place,
        timeout=60,
    )  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell")
@pytest.mark.parametrize(
    ("command", "code", "said"),
    [
        ("nvscope report - <&-", 4, "stdin is closed"),
        ("nvscope report x.pcap >&-", 5, "stdout is closed"),
        ("nvscope report missing.pcap 2>/dev/full", 4, ""),
        ("nvscope export x.pcap -w y.csv --gvl " + str(PEERS / "batch.gvl") + " 2>/dev/full", 0, ""),
        ("nvscope report x.pcap 2>&-", 0, ""),
        ("mkdir here; cd here; rmdir ../here; nvscope report ../x.pcap", 0, ""),
        ("mkdir here; cd here; rmdir ../here; nvscope report x.pcap", 4, "No such file"),
        ("mkdir here; cd here; rmdir ../here; nvscope report ../x.pcap --gvl '*.gvl'", 2, "working directory is gone"),
        ("mkdir here; cd here; rmdir ../here; nvscope export ../x.pcap -w y.csv", 5, "cannot be written"),
        ("ulimit -n 9; nvscope report x.pcap x.pcap x.pcap", 0, ""),
        ("ulimit -v 1000000; nvscope report x.pcap", 0, ""),
    ],
)
def test_what_a_shell_may_do_has_its_exit_code(command: str, code: int, said: str, place: Path) -> None:
    done = shell(command, place)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_told(place: Path) -> None:
    (place / "x.pcap").chmod(0)
    done = run_text("report", "x.pcap", cwd=place)
    assert done.returncode == 4
    assert "Permission denied" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="files that are mapped cannot be cut there")
@pytest.mark.parametrize("verb", ["packets -T fields -e frame.number", "export -w out.csv"])
def test_a_large_capture_that_is_cut_while_it_is_read_ends_with_a_sentence(verb: str, place: Path) -> None:
    content = (place / "x.pcap").read_bytes()
    large = place / "large.pcap"
    large.write_bytes(content[:24] + content[24:] * 300)
    words = verb.split()
    command = [*COMMAND, words[0], "large.pcap", *words[1:], "-Y", "frame.number < 9000000"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=place, bufsize=0
    ) as process:  # fmt: skip
        assert process.stdout
        if words[0] == "packets":
            process.stdout.read(1)
        else:
            while not [name for name in os.listdir(place) if "unfinished" in name]:
                assert process.poll() is None
        os.truncate(large, 5_000)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 3, errors
    assert errors.decode().startswith("nvscope: large.pcap")
    assert "was cut" in errors.decode() or "ends" in errors.decode() or "cut" in errors.decode()
    assert not [name for name in os.listdir(place) if "unfinished" in name]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no such pipes")
def test_a_pipe_under_the_name_of_a_project_file_is_not_waited_for(place: Path) -> None:
    os.mkfifo(place / "nvscope.toml")
    done = run_text("report", "x.pcap", cwd=place)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("nvscope: nvscope.toml: cannot be read: it is a pipe\n")


@pytest.mark.parametrize(
    "key", ["a" + ".b" * 5_000 + " = 1", "x = { " + '"a".' * 5_000 + "b = 1 }", "[" + "a." * 5_000 + "b]"]
)
def test_a_key_of_thousands_of_parts_is_refused(key: str, place: Path) -> None:
    (place / "nvscope.toml").write_text(f"{key}\n")
    done = run_text("report", "x.pcap", cwd=place)
    assert (done.returncode, done.stdout) == (2, "")
    assert "a key has more than 200 parts" in done.stderr
    (place / "deep.toml").write_text(f"{key}\n")
    (place / "nvscope.toml").unlink()
    assert "a key has more than 200 parts" in run_text("simulate", "deep.toml", "-w", "y.pcap", cwd=place).stderr


@pytest.mark.parametrize(
    "words",
    [
        ["report", "x.pcap", "-d", "udp.port==١٢٠٢,nvl"], ["report", "x.pcap", "--bitrate", "٢50k"],
        ["report", "x.pcap", "--from-time", "٣s"], ["report", "x.pcap", "--ack-timeout", "٣s"],
        ["report", "x.pcap", "-Y", "nv.index == ٣"], ["report", "x.pcap", "--list", "٤٢"],
    ],
    ids=lambda words: words[2],
)  # fmt: skip
def test_numbers_have_the_digits_that_the_wire_knows(words: list[str], place: Path) -> None:
    """Digits of other scripts are letters to everything else that reads them."""
    done = run_text(*words, cwd=place)
    assert (done.returncode, done.stdout) == (2, "")
