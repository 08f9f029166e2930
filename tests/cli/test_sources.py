"""What is named as a source on the command line."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.program_here import run_text

CAPTURES = Path(__file__).parent.parent.parent / "captures"
CAPTURE = CAPTURES / "telegrams.pcap"


def nvscope(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run_text(*arguments, cwd=cwd)


PEERS = CAPTURES / "peers"
VERBS = {
    "report": (),
    "packets": ("-c", "50", "-T", "fields", "-e", "var.stAxis.pos"),
    "vars": ("--json",),
    "export": ("-w", "out.csv", "--list", "axis"),
}


@pytest.mark.parametrize("verb", VERBS)
def test_definitions_are_known_by_their_content_however_they_are_named(verb: str, tmp_path: Path) -> None:
    """What a shell makes of patterns, what it leaves of them, directories, and arguments without an option."""
    (tmp_path / "plc" / "types").mkdir(parents=True)
    (tmp_path / "plc" / "axis.gvl").write_bytes((PEERS / "axis.gvl").read_bytes())
    (tmp_path / "plc" / "types" / "axis_types.st").write_bytes((PEERS / "axis_types.st").read_bytes())
    (tmp_path / "plc" / "readme.md").write_text("# Types of the press\n")
    (tmp_path / "peers.pcap").write_bytes((PEERS / "peers.pcap").read_bytes())

    def said(*arguments: str) -> tuple[int, str, str, bytes]:
        out = tmp_path / "out.csv"
        out.unlink(missing_ok=True)
        done = nvscope(verb, *arguments, *VERBS[verb], "-q" if verb != "packets" else "-n", cwd=tmp_path)
        return done.returncode, done.stdout, done.stderr, out.read_bytes() if out.exists() else b""

    files = "plc/axis.gvl", "plc/types/axis_types.st"
    expected = said("peers.pcap", "--gvl", files[0], "--gvl", files[1])
    assert expected[0] == 0
    assert (expected[1] + expected[3].decode()).strip()
    assert said("peers.pcap", "--gvl", *files) == expected
    assert said("--gvl", *files, "peers.pcap") == expected
    assert said("--gvl", "peers.pcap", *files) == expected
    assert said("peers.pcap", *files) == expected
    assert said(*files, "peers.pcap") == expected
    assert said("peers.pcap", "--gvl", "plc") == expected
    assert said("peers.pcap", "plc") == expected
    assert said("peers.pcap", "--gvl", "plc/**/*") == expected
    assert said("peers.pcap", "--gvl", "plc/*.gvl", "--gvl", "plc/types/*") == expected
    assert said("*.pcap", "plc/*.gvl", "plc/types/*.st") == expected


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("types.st", "// types\nTYPE a : INT; END_TYPE"),
        ("line.TcDUT", "?"),
        ("plant.txt", "\n(* @NESTEDCOMMENTS := 'Yes' *)"),
        ("export", "<?xml version='1.0'?><project/>"),
    ],
)
def test_a_definition_alone_is_nothing_to_report_on(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    done = nvscope("report", name, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "nvscope: no capture is given, only definitions\n"
        f"  name the capture, too; `nvscope gvl layout {name}` shows what a definition says\n"
    )


def test_what_stands_for_no_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for given, said in (
        ("*.gvl", f"nvscope: no file matches '*.gvl'\n  Patterns are relative to {tmp_path.resolve()}; correct"),
        ("empty", "nvscope: empty: no definition file is in it\n"),
        ("axis.gvl", "nvscope: axis.gvl: cannot be read: No such file or directory\n"),
    ):
        done = nvscope("report", str(CAPTURE), "--gvl", given, cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr.startswith(said)


def test_a_directory_with_captures_is_a_source_and_its_definitions_are_told(tmp_path: Path) -> None:
    (tmp_path / "day").mkdir()
    for name in ("peers.pcap", "batch.gvl"):
        (tmp_path / "day" / name).write_bytes((PEERS / name).read_bytes())
    done = nvscope("report", "day", "-q", cwd=tmp_path)
    assert done.stderr == "nvscope: day holds definitions, too; --gvl day takes them.\n"
    assert "batch" not in done.stdout
    assert nvscope("report", "day", "--gvl", "day", "-q", cwd=tmp_path).stderr == ""


@pytest.mark.parametrize("root", ["testsuites", "DataLoggerConfigDocument xmlns='http://x'", "x:report"])
def test_other_xml_in_a_directory_is_taken_for_no_definition(root: str, tmp_path: Path) -> None:
    folder = tmp_path / "day"
    folder.mkdir()
    (folder / "peers.pcap").write_bytes((PEERS / "peers.pcap").read_bytes())
    (folder / "junit.xml").write_text(f"<?xml version='1.0'?>\n<!-- made -->\n<{root}/>")
    assert "definitions" not in nvscope("report", "day", "-q", cwd=tmp_path).stderr


def test_what_can_be_read_as_a_capture_is_one_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "line.st").write_bytes(CAPTURE.read_bytes())
    done = nvscope("report", "line.st", cwd=tmp_path)
    assert "line.st (pcap" in done.stdout


def test_other_files_are_no_captures_but_no_definitions_either(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("Types of the press", encoding="utf-8")
    done = nvscope("report", "notes.txt", cwd=tmp_path)
    assert done.returncode == 4
    assert "notes.txt, offset 0: the bytes 54 79 70 65, expected a pcap" in done.stderr


@pytest.mark.parametrize("verb", ["report", "packets -V -c 1"])
def test_definitions_of_types_alone_say_so(verb: str, tmp_path: Path) -> None:
    (tmp_path / "types.st").write_text("TYPE Axis : STRUCT pos : LREAL; END_STRUCT END_TYPE")
    done = nvscope(*verb.split(), str(CAPTURE), "types.st", cwd=tmp_path)
    assert done.returncode == 0
    assert "nvscope: the definition files declare types, but no list: name the exported list, too.\n" in done.stderr


def test_types_alone_may_be_those_of_parameters(tmp_path: Path) -> None:
    (tmp_path / "types.st").write_text("TYPE Axis : STRUCT pos : LREAL; END_STRUCT END_TYPE")
    (tmp_path / "nvscope.toml").write_text('definitions = "types.st"\n[parameters]\n"1:0" = { type = "Axis" }\n')
    done = nvscope("report", str(CAPTURE), cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "asked",
    [
        "vars",
        "vars --list broken",
        "vars --history nSpeed",
        "vars --at 1s --list broken",
        "vars -Y var.nSpeed>5",
        "export -w out.csv --list broken",
        "export -w out.csv -e var.nSpeed",
        "packets -Y var.nSpeed>5",
        "packets -e var.nSpeed",
        "report -Y var.nSpeed>5",
    ],
)
def test_what_was_left_out_is_told_before_something_of_it_is_missed(asked: str, tmp_path: Path) -> None:
    (tmp_path / "plc").mkdir()
    (tmp_path / "plc" / "broken.st").write_text("VAR_GLOBAL\nnSpeed : ;\nEND_VAR\n")
    if asked != "vars":
        (tmp_path / "plc" / "counters.gvl").write_bytes((PEERS / "counters.gvl").read_bytes())
    else:
        (tmp_path / "plc" / "types.st").write_text("TYPE Axis : STRUCT pos : LREAL; END_STRUCT END_TYPE")
    done = nvscope(*asked.split(), str(PEERS / "peers.pcap"), "--gvl", "plc", cwd=tmp_path)
    assert done.returncode == 2
    said = done.stderr.splitlines()
    assert said[0].startswith("nvscope: left out: plc/broken.st, line 2, column 10: found ';', expected a type")
    assert "declare types, but no list" not in done.stderr
    assert done.stderr.count("left out: ") == 1


@pytest.mark.parametrize("asked", ["vars", "export -w out.csv"])
def test_where_nothing_is_left_of_the_definitions_the_cause_is_told(asked: str, tmp_path: Path) -> None:
    (tmp_path / "plc").mkdir()
    (tmp_path / "plc" / "broken.gvl").write_text("<GVL>")
    (tmp_path / "plc" / "types.st").write_text("TYPE Axis : STRUCT pos : LREAL; END_STRUCT END_TYPE")
    done = nvscope(*asked.split(), str(PEERS / "peers.pcap"), "--gvl", "plc", cwd=tmp_path)
    assert done.returncode == 2
    assert "left out: plc/broken.gvl, line 1" in done.stderr
    assert "what could be read of the definition files declares no variables of a list" in done.stderr


def test_a_type_that_no_file_declares_is_told_before_a_member_of_it_is_missed(tmp_path: Path) -> None:
    done = nvscope(
        "vars", str(PEERS / "peers.pcap"), "--gvl", str(PEERS / "axis.gvl"), "--history", "stAxis.fPos", cwd=tmp_path
    )
    assert done.returncode == 2
    assert "types that no file declares: Axis" in done.stderr.splitlines()[0]
    assert "no variable is named 'stAxis.fPos'" in done.stderr


def test_keys_tells_what_the_definitions_lack(tmp_path: Path) -> None:
    (tmp_path / "broken.gvl").write_text("<GVL>")
    done = nvscope("keys", "--fields", "broken.gvl", str(PEERS / "axis.gvl"), cwd=tmp_path)
    assert done.returncode == 0
    assert "left out: broken.gvl, line 1" in done.stderr
    assert "types that no file declares: Axis" in done.stderr
    assert nvscope("keys", "--fields", str(PEERS / "counters.gvl"), cwd=tmp_path).stderr == ""


@pytest.mark.parametrize("verb", ["report", "packets -V -c 1", "vars", "export -w out.csv"])
def test_every_verb_tells_what_the_definitions_lack(verb: str, tmp_path: Path) -> None:
    (tmp_path / "plc").mkdir()
    for name in ("axis.gvl", "counters.gvl"):
        (tmp_path / "plc" / name).write_bytes((PEERS / name).read_bytes())
    (tmp_path / "plc" / "old.gvl").write_text("<GVL>")
    done = nvscope(*verb.split(), str(PEERS / "peers.pcap"), "--gvl", "plc", cwd=tmp_path)
    assert done.returncode == 0
    said = done.stderr.splitlines()
    assert "nvscope: left out: plc/old.gvl, line 1, column 6: this is no well-formed XML" in done.stderr
    assert sum("types that no file declares: Axis (plc/axis.gvl, line 6, column 11)" in line for line in said) == 1
    assert "nvscope: axis: nobody knows how many bytes stAxis : Axis has; from there on, bytes are bytes." in said


def test_a_directory_that_holds_the_named_capture_too_gives_its_definitions() -> None:
    named = nvscope("report", str(PEERS / "peers.pcap"), str(PEERS), "-q", cwd=PEERS)
    assert (named.returncode, named.stderr) == (0, "")
    assert named.stdout == nvscope("report", str(PEERS / "peers.pcap"), "--gvl", str(PEERS), "-q", cwd=PEERS).stdout


@pytest.mark.parametrize(
    ("names", "keys"),
    [
        (["42"], ["udp/1202/42"]),
        (["AXIS"], ["udp/1202/42"]),
        (["udp/1202/1", "1202/3"], ["udp/1202/1", "udp/1202/3"]),
    ],
)
def test_a_report_of_some_lists(names: list[str], keys: list[str], tmp_path: Path) -> None:
    files = [str(PEERS / name) for name in ("peers.pcap", "axis.gvl", "axis_types.st")]
    options = [word for name in names for word in ("--list", name)]
    whole = json.loads(nvscope("report", *files, "--json", cwd=tmp_path).stdout)
    part = json.loads(nvscope("report", *files, "--json", *options, cwd=tmp_path).stdout)
    assert part["lists"] == [entry for entry in whole["lists"] if entry["key"] in keys]
    of_capture = [finding for finding in whole["findings"] if finding["list"] is None and finding["node"] is None]
    expected = [finding for finding in whole["findings"] if finding["list"] in keys or finding in of_capture]
    assert part["findings"] == expected
    assert part["capture"] == whole["capture"]


def test_a_list_that_was_not_seen_may_be_asked_for(tmp_path: Path) -> None:
    files = [str(CAPTURE), str(PEERS / "axis.gvl"), str(PEERS / "axis_types.st")]
    part = json.loads(nvscope("report", *files, "--json", "--list", "axis", cwd=tmp_path).stdout)
    assert (part["lists"], [finding["code"] for finding in part["findings"] if finding["list"]]) == ([], ["NV407"])
    done = nvscope("report", *files, "--list", "axes", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("nvscope: no list is named 'axes'\n  there are ")


def test_a_report_of_a_list_on_can(tmp_path: Path) -> None:
    press = str(CAPTURES / "can" / "press.log")
    for name in ("0x110", "272", "can0/0x110", "can/can0/272"):
        part = json.loads(nvscope("report", press, "--json", "--list", name, cwd=tmp_path).stdout)
        assert [entry["cob_id"] for entry in part["lists"]] == ["0x110"]


def stopped(report: str) -> list[tuple[str, str]]:
    return [(one["list"], one["message"]) for one in json.loads(report)["findings"] if one["code"] == "NV504"]


def test_captures_that_lie_days_apart_are_told(tmp_path: Path) -> None:
    (tmp_path / "plant.pcapng.gz").write_bytes((CAPTURES / "plant.pcapng.gz").read_bytes())
    (tmp_path / "peers.pcap").write_bytes((PEERS / "peers.pcap").read_bytes())
    done = nvscope("report", "peers.pcap", "plant.pcapng.gz", "-q", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == (
        "nvscope: 1055 d 10 h without a capture lie between plant.pcapng.gz and peers.pcap: what was late or lost "
        "meanwhile is no fault. Report them apart: nvscope report plant.pcapng.gz, then nvscope report peers.pcap\n"
    )
    apart = [nvscope("report", name, "--json", cwd=tmp_path).stdout for name in ("plant.pcapng.gz", "peers.pcap")]
    together = nvscope("report", "peers.pcap", "plant.pcapng.gz", "--json", cwd=tmp_path).stdout
    alone = [(key, told.replace(";", " of a capture;")) for key, told in stopped(apart[0])] + stopped(apart[1])
    assert sorted(stopped(together)) == sorted(alone) != []
    assert nvscope("report", "peers.pcap", "peers.pcap", "-q", cwd=tmp_path).stderr == ""


MAGICS = [b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\x3c\x4d", b"\n\r\r\n", b"LOGG", b"MDF     ", b"\x1f\x8b", b"\x28\xb5\x2f\xfd"]


@pytest.mark.parametrize("magic", MAGICS)
def test_a_text_that_begins_with_the_bytes_of_a_capture_is_none(magic: bytes, tmp_path: Path) -> None:
    """It is a definition by what it is called, or by --gvl, and as such told to be damaged where it is."""
    text = magic + (PEERS / "axis.gvl").read_bytes().replace(b"\xef\xbb\xbf", b"")
    for name in ("axis.gvl", "axis.txt"):
        (tmp_path / name).write_bytes(text)
    first = (PEERS / "batch.gvl").read_bytes()
    (tmp_path / "batch.gvl").write_bytes(first)
    for arguments in (["axis.gvl"], ["--gvl", "axis.gvl"], ["--gvl", "axis.txt"]):
        path = arguments[-1]
        done = nvscope("report", str(CAPTURE), *arguments, "--gvl", "batch.gvl", "-q", cwd=tmp_path)
        assert done.returncode == 0
        if not text.lstrip().startswith(b"<"):
            assert f"nvscope: left out: {path}, line 1, column " in done.stderr
            alone = nvscope("report", str(CAPTURE), *arguments, cwd=tmp_path)
            assert (alone.returncode, alone.stdout) == (2, "")
            assert alone.stderr.startswith(f"nvscope: {path}, line 1, column ")
        else:
            assert "left out" not in done.stderr


def test_a_capture_that_is_named_as_a_definition_is_told(tmp_path: Path) -> None:
    for name in ("first.pcap", "axis.gvl"):
        (tmp_path / name).write_bytes((PEERS / "peers.pcap").read_bytes())
    done = nvscope("report", "first.pcap", "--gvl", "axis.gvl", cwd=tmp_path)
    assert "nvscope: axis.gvl is a capture, and read as one: --gvl names definitions.\n" in done.stderr
    assert "axis.gvl (pcap" in done.stdout
    # A shell makes this of --gvl *.
    assert nvscope("report", "--gvl", "axis.gvl", "-q", cwd=tmp_path).stderr == ""
