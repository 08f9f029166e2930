"""The program as a person or a script meets it: exit codes, streams, and messages that help."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from nvscope.cli.interrupts import comes_of_an_interrupt
from nvscope.cli.program import VERBS, program
from nvscope.errors import ExitCode
from nvscope.version import __version__
from tests.program import COMMAND, run

ROOT = Path(__file__).parent.parent.parent
PEERS = ROOT / "captures" / "peers" / "peers.pcap"


def nvscope(*arguments: str | Path, stdin: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    return run(*arguments, cwd=ROOT, stdin=stdin)


def test_a_good_report_goes_to_stdout_alone() -> None:
    done = nvscope("report", PEERS)
    assert done.returncode == ExitCode.GOOD
    assert "counter-foreign" in done.stdout.decode()
    assert "NV207" not in done.stdout.decode()
    assert done.stderr == b""
    everything = nvscope("report", PEERS, "--all").stdout.decode()
    assert "udp/1202/42" in everything
    assert "NV207" in everything


def test_json_has_the_schema_and_is_the_same_every_time() -> None:
    # Two orders of what is in a set; nvscope() has the same one all the time.
    first, second = (
        subprocess.run(
            [*COMMAND, "report", "--json", PEERS], capture_output=True, check=False, timeout=60,
            env={**os.environ, "PYTHONHASHSEED": seed},
        )
        for seed in ("1", "2")
    )  # fmt: skip
    assert first.stdout == second.stdout
    report = json.loads(first.stdout)
    assert report["schema"] == "nvscope.report/2"
    assert list(report) == ["schema", "tool", "capture", "totals", "causes", "lists", "findings"]
    assert report["capture"]["sources"] == [
        {"path": str(PEERS), "format": "pcap", "bytes": PEERS.stat().st_size, "frames": 864}
    ]


def test_stdin_and_r_are_sources_as_well() -> None:
    from_stdin = json.loads(nvscope("report", "--json", "-", stdin=PEERS.read_bytes()).stdout)
    from_option = json.loads(nvscope("report", "--json", "-r", PEERS).stdout)
    assert from_stdin["lists"] == from_option["lists"]
    assert from_stdin["capture"]["sources"][0]["bytes"] == PEERS.stat().st_size


def test_a_cut_file_is_reported_and_exits_with_3(tmp_path: Path) -> None:
    cut = tmp_path / "cut.pcap"
    cut.write_bytes(PEERS.read_bytes()[:-5])
    done = nvscope("report", "--json", cut)
    assert done.returncode == ExitCode.DATA_LOSS
    report = json.loads(done.stdout)
    assert report["capture"]["frames"] == 863
    assert [finding["count"] for finding in report["findings"] if finding["code"] == "NV903"] == [1]
    assert str(cut).encode() in done.stderr


def test_drops_and_unread_link_types_are_reported() -> None:
    report = json.loads(nvscope("report", "--json", ROOT / "captures" / "interfaces.pcapng").stdout)
    assert report["capture"]["drops"] == 5
    codes = {finding["code"]: finding["count"] for finding in report["findings"]}
    assert codes["NV901"] == 5


def test_unknown_link_types_are_reported(tmp_path: Path) -> None:
    strange = tmp_path / "strange.pcap"
    content = bytearray(PEERS.read_bytes())
    content[20] = 147  # a link type for private use
    strange.write_bytes(content)
    report = json.loads(nvscope("report", "--json", strange).stdout)
    assert {f["code"]: f["count"] for f in report["findings"]} == {"NV904": 864}
    assert report["capture"]["other_frames"] == 864


@pytest.mark.parametrize("content", [b"", b"no capture at all, but long enough to be one", b"\xd4\xc3"])
def test_a_file_that_is_no_capture_exits_with_4_and_says_what_was_expected(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "x.pcap"
    file.write_bytes(content)
    done = nvscope("report", file)
    assert done.returncode == ExitCode.UNREADABLE
    assert done.stdout == b""
    assert str(file).encode() in done.stderr
    assert b"pcap" in done.stderr


def test_a_missing_file_exits_with_4(tmp_path: Path) -> None:
    done = nvscope("report", tmp_path / "absent.pcap")
    assert done.returncode == ExitCode.UNREADABLE
    assert b"No such file" in done.stderr


def test_a_capture_without_telegrams_is_good_and_says_so(tmp_path: Path) -> None:
    empty = tmp_path / "empty.pcap"
    empty.write_bytes(PEERS.read_bytes()[:24])
    done = nvscope("report", empty)
    assert done.returncode == ExitCode.GOOD
    assert b"The capture holds no frames" in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ["report"],
        ["report", "--json", "--md", "x.pcap"],
        ["report", "--no-such-option"],
        ["report", "-d", "tcp.port==1,nvl", "x.pcap"],
        ["report", "-d", "udp.port==70000,nvl", "x.pcap"],
        ["report", "--ack-timeout", "soon", "x.pcap"],
        ["report", "--ack-timeout", "0s", "x.pcap"],
        ["explain", "NV999"],
        ["no-such-verb"],
        ["simulate", "x.toml"],
        ["simulate", "absent.toml", "-w", "x.pcap"],
    ],
)
def test_a_wrong_command_line_exits_with_2_and_no_traceback(arguments: list[str]) -> None:
    done = nvscope(*arguments)
    assert done.returncode == ExitCode.USAGE
    assert done.stdout == b""
    assert done.stderr
    assert b"Traceback" not in done.stderr


def test_ports_can_be_decided_by_hand() -> None:
    report = json.loads(nvscope("report", "--json", "-d", "udp.port==1202,data", PEERS).stdout)
    assert report["capture"]["telegrams"] == 0
    assert report["lists"] == []


@pytest.mark.parametrize("code", ["NV201", "301"])
def test_a_code_is_explained_without_what_findings_and_causes_are_judged_from(code: str) -> None:
    words = (
        "import sys\n"
        "from nvscope.report.explain import render\n"
        f"render({code!r})\n"
        "print({'numpy', 'nvscope.causes'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, check=True, text=True)
    assert done.stdout == "set()\n"


def test_the_version_is_told_without_what_reads_captures() -> None:
    words = (
        "import sys\n"
        "from nvscope.cli.main import main\n"
        "sys.argv[1:] = ['--version']\n"
        "try: main()\n"
        "finally: print({'numpy', 'nvscope.cli.report'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, check=True, text=True)
    assert done.stdout.splitlines() == [f"nvscope {__version__}", "set()"]


def test_explain_tells_of_a_finding_and_lists_all() -> None:
    assert b"no-acknowledgement" in nvscope("explain", "301").stdout
    assert b"NV905" in nvscope("explain").stdout


@pytest.mark.parametrize("verb", ["report --json", "packets -V -x"])
def test_output_that_nobody_reads_is_no_error(verb: str) -> None:
    command = f"set -o pipefail; {sys.executable} -m nvscope {verb} {PEERS} | head -c 10"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stderr) == (0, b"")


def test_an_interrupted_run_exits_with_130() -> None:
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "nvscope", "report", "-"]
    with subprocess.Popen(command, stdin=reading, stderr=subprocess.PIPE, cwd=ROOT) as program:
        os.write(writing, PEERS.read_bytes()[:5000])
        with pytest.raises(subprocess.TimeoutExpired):
            program.wait(timeout=2)  # it waits for the rest of its input
        program.send_signal(signal.SIGINT)
        _, told = program.communicate(timeout=20)
    os.close(reading)
    os.close(writing)
    assert (program.returncode, told) == (ExitCode.INTERRUPTED, b"")


def imported_by_a_report() -> set[str]:
    """Return what a report on a capture has imported in the end."""
    code = (
        "import sys\nfrom nvscope.cli import main\n"
        f"sys.argv = ['nvscope', 'report', '-q', {str(PEERS)!r}]\n"
        "try:\n    main.main()\nexcept SystemExit as end:\n    status = end.code\n"
        "print(status, *sys.modules, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    status, *modules = done.stderr.split()
    assert status == "0"
    assert "nvscope.analysis.inquiry" in modules
    return set(modules)


def test_start_up_imports_nothing_heavy() -> None:
    """Scapy, python-can, mcap and rich take longer to import than a small report takes."""
    assert not {"scapy", "can", "mcap", "rich", "textual", "pydantic"} & imported_by_a_report()


def test_a_report_without_definitions_imports_nothing_that_reads_them() -> None:
    reading = {f"nvscope.definition.{name}" for name in ("variables", "project_file", "packing")}
    assert not reading & imported_by_a_report()


@pytest.mark.parametrize("options", [["--help"], ["--no-such-option"]])
@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_alone_is_as_in_the_whole_program(verb: str, options: list[str]) -> None:
    alone, whole = (CliRunner().invoke(program(wanted), [verb, *options]) for wanted in (verb, None))
    assert (alone.output, alone.exit_code) == (whole.output, whole.exit_code)
    assert alone.output


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_whoever_asks_for_no_verb_is_told_of_all(arguments: list[str]) -> None:
    told = CliRunner().invoke(program(next(iter(arguments), None)), arguments).output
    verbs = told.split("Verbs:\n")[1].splitlines()
    assert [line.split()[0] for line in verbs if line[2:3].strip()] == [*VERBS]


@pytest.mark.parametrize("words", [[], ["gvl"], ["gvl", "--"], ["help"], ["help", ""], [""], ["gvl", ""]])
def test_whoever_names_no_verb_is_told_how_to_and_never_of_a_bug(words: list[str]) -> None:
    done = nvscope(*words)
    assert done.returncode == (ExitCode.GOOD if words == ["help"] else ExitCode.USAGE), done
    assert re.search(rb"--help|-h\b", done.stdout + done.stderr), done
    assert b"Traceback" not in done.stderr


def test_a_full_disk_is_told_without_a_traceback() -> None:
    command = f"{sys.executable} -m nvscope report {PEERS} > /dev/full"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False, cwd=ROOT)
    assert done.returncode == ExitCode.CAPTURE
    assert b"No space left" in done.stderr
    assert b"Traceback" not in done.stderr


def test_a_refused_scenario_leaves_what_was_there(tmp_path: Path) -> None:
    capture = tmp_path / "good.pcap"
    capture.write_bytes(b"precious")
    scenario = tmp_path / "bad.toml"
    plant = (ROOT / "tests" / "scenarios" / "loss.toml").read_text()
    scenario.write_text(plant.replace('"20s"', '"31d"').replace('"50ms"', '"1ms"'))
    done = nvscope("simulate", scenario, "-w", capture)
    assert done.returncode == ExitCode.USAGE
    assert capture.read_bytes() == b"precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.toml", "good.pcap"]


def test_a_capture_that_cannot_be_written_is_told_by_the_name_that_was_given(tmp_path: Path) -> None:
    scenario = ROOT / "tests" / "scenarios" / "loss.toml"
    command = f"ulimit -f 4; {sys.executable} -m nvscope simulate {scenario} -w {tmp_path}/plant.pcap"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False, cwd=ROOT, timeout=60)
    assert done.returncode == ExitCode.CAPTURE
    assert done.stderr.startswith(f"nvscope: {tmp_path}/plant.pcap: cannot be written: ".encode())
    assert not list(tmp_path.iterdir())


def test_a_name_may_be_as_long_as_names_are(tmp_path: Path) -> None:
    name = tmp_path / f"{'n' * 250}.pcap"
    done = nvscope("simulate", ROOT / "tests" / "scenarios" / "loss.toml", "-w", name, "--truth", tmp_path / "truth")
    assert done.returncode == ExitCode.GOOD, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {name.name, "truth"}


def test_truth_and_capture_are_two_files(tmp_path: Path) -> None:
    capture = tmp_path / "x.pcap"
    done = nvscope("simulate", ROOT / "captures" / "plant.toml", "-w", capture, "--truth", capture)
    assert done.returncode == ExitCode.USAGE
    assert not capture.exists()


@pytest.mark.skipif(not hasattr(os, "set_blocking"), reason="this system has no such pipes")
def test_output_into_a_pipe_that_does_not_wait_is_whole() -> None:
    """Who starts the program may have made its end of the pipe not to wait; then the reader is slow."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with subprocess.Popen([*COMMAND, "packets", PEERS, "-T", "json"], stdout=writing, cwd=ROOT) as process:
        os.close(writing)
        parts = []
        while part := os.read(reading, 1000):
            parts.append(part)
    os.close(reading)
    assert process.returncode == 0
    assert b"".join(parts) == nvscope("packets", PEERS, "-T", "json").stdout


# Runs the program, and writes a line where its first module, and where the one that takes longest, is looked for.
_WATCHED = """
import os, runpy, sys

class Watch:
    def find_spec(self, name, path=None, target=None):
        if name in ("nvscope.cli.start", "nvscope.cli.main"):
            os.write(1, name.encode() + b"\\n")
        if name == "nvscope.cli.main":
            before = {one for one in sys.modules if one not in known}
            os.write(1, " ".join(sorted(before)).encode() + b"\\n")

sys.meta_path.insert(0, Watch())
sys.argv[0] = "nvscope"
known = set(sys.modules)
runpy.run_module("nvscope", run_name="__main__", alter_sys=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="interrupts are no signals there")
@pytest.mark.parametrize("after_s", [0.0, 0.01, 0.03, 0.05, 0.08, 0.12, 0.2, 0.4])
def test_an_interrupt_at_the_start_is_silent(after_s: float) -> None:
    """From where the program itself begins: what Python says before that is its own."""
    with subprocess.Popen(
        [sys.executable, "-c", _WATCHED, "report", "-"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT,
    ) as process:  # fmt: skip
        assert process.stdout
        assert process.stdout.readline() == b"nvscope.cli.start\n"
        assert process.stdout.readline() == b"nvscope.cli.main\n"
        process.stdout.readline()
        time.sleep(after_s)
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=30)
    assert process.returncode in (ExitCode.INTERRUPTED, -signal.SIGINT)
    assert (out, errors) == (b"", b"")


# Whatever is cleaned up is interrupted, as an interrupt of a person may.
_CLEANED_UP = """
import signal, time, weakref
from nvscope.cli.interrupts import lose_no_interrupt

class Held: ...

lose_no_interrupt()
held = Held()
kept = weakref.ref(held, lambda _: signal.raise_signal(signal.SIGINT))
try:
    del held
    time.sleep(30)
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="interrupts are no signals there")
def test_an_interrupt_while_something_is_cleaned_up_is_not_lost() -> None:
    done = subprocess.run([sys.executable, "-c", _CLEANED_UP], capture_output=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == b"interrupted"
    assert done.stderr == b""


def test_what_python_makes_of_an_interrupt_is_one() -> None:
    class Named:
        def __set_name__(self, owner: type, name: str) -> None:
            raise KeyboardInterrupt

    with pytest.raises((RuntimeError, KeyboardInterrupt)) as raised:
        type("Owner", (), {"name": Named()})
    # Python before 3.12 makes a RuntimeError of it.
    assert raised.type is KeyboardInterrupt or comes_of_an_interrupt(raised.value)
    assert not comes_of_an_interrupt(RuntimeError())


def test_hardly_anything_is_imported_before_interrupts_are_silent() -> None:
    """The first of the tests above begins behind this: what is in front of it is to take no time."""
    done = subprocess.run(
        [sys.executable, "-c", _WATCHED, "--version"], capture_output=True, check=True, cwd=ROOT, text=True
    )
    imported = set(done.stdout.splitlines()[2].split())
    assert imported - {"nvscope.__main__", "__main__"} == {"nvscope", "nvscope.cli", "nvscope.cli.start"}
