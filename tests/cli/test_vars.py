"""``nvscope vars`` and ``nvscope gvl``, as a person types them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from tests.definition.lists import telegram
from tests.fuzz.originals import pcap_of
from tests.program_here import run_text
from tests.tracker.variables.test_values import START_NS

CAPTURES = Path(__file__).parents[2] / "captures"
PEERS = CAPTURES / "peers"
AXIS = [str(PEERS / "axis.gvl"), str(PEERS / "axis_types.st")]


def nvscope(*arguments: str, columns: int = 100) -> subprocess.CompletedProcess[str]:
    return run_text(*arguments, environment={"COLUMNS": str(columns)})


def test_the_variables_of_a_list_by_name() -> None:
    done = nvscope("vars", str(PEERS / "peers.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1], "--utc")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[:4] == [
        "udp/1202/42 axis from 10.77.0.3, 199 telegrams",
        "  Variable    Value          Type        Changed       Changes            Min            Max",
        "  bStart      FALSE          BOOL        10:05:31.065      198          FALSE           TRUE",
        "  nSpeed      -3165          INT         10:05:31.065      198         -29686          29690",
    ]


def test_the_variables_as_data() -> None:
    done = nvscope("vars", str(PEERS / "peers.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1], "--json")
    document = json.loads(done.stdout)
    assert document["schema"] == "nvscope.vars/1"
    text = next(row for row in document["variables"] if row["name"] == "sText")
    assert text == {
        "list": "udp/1202/42", "list_name": "axis", "name": "sText", "type": "STRING(30)", "sender": "10.77.0.3",
        "packing": "documented", "subindex": 0, "unit": None, "value": "order 199", "text": "'order 199'",
        "last_ns": "1795255531065858815",
        "changed_ns": "1795255531065858815", "telegrams": 199, "changes": 198,
        "min": None, "max": None, "min_text": None, "max_text": None,
    }  # fmt: skip


def test_a_definition_of_another_plant_is_told() -> None:
    done = nvscope("vars", str(CAPTURES / "telegrams.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1])
    assert done.returncode == 0
    assert done.stdout.startswith("No telegram of a defined list was found")


def test_what_is_missing_is_said() -> None:
    without = nvscope("vars", str(PEERS / "peers.pcap"))
    assert (without.returncode, without.stdout) == (2, "")
    assert "--gvl" in without.stderr
    untyped = nvscope("vars", str(PEERS / "peers.pcap"), "--gvl", AXIS[0])
    assert untyped.returncode == 0
    assert "no file declares: Axis" in untyped.stderr
    assert "axis.gvl, line 6, column 11" in untyped.stderr
    *shown, below = (line.split() for line in untyped.stdout.splitlines()[2:])
    assert [words[0] for words in shown] == ["bStart", "nSpeed", "fTemp", "stAxis"]
    assert below[0] == "Hidden:"


def test_a_byte_map() -> None:
    done = nvscope("gvl", "layout", *AXIS)
    assert done.returncode == 0
    assert done.stdout.splitlines()[:8] == [
        "axis: list 42 on UDP port 1202, packed, every 50.0 ms, 68 B in 1 telegram.",
        "",
        "  SubIndex 0: Items 11, Length 88",
        "  Offset  Bytes  Variable    Type",
        "       0      1  bStart      BOOL",
        "       1      2  nSpeed      INT",
        "       3      4  fTemp       REAL",
        "       7      8  stAxis.pos  LREAL",
    ]
    (entry,) = json.loads(nvscope("gvl", "layout", "--json", *AXIS).stdout)["lists"]
    assert [(telegram["items"], telegram["length"]) for telegram in entry["telegrams"]] == [(11, 88)]


def test_variables_in_the_tree_of_a_telegram() -> None:
    options = ["--gvl", AXIS[0], "--gvl", AXIS[1]]
    done = nvscope("packets", str(PEERS / "peers.pcap"), "-V", "-Y", "nv.index == 42", "-c", "6", *options)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    begin = lines.index("Variables  axis")
    assert lines[begin + 1 : begin + 5] == [
        "  003e  00                 bStart                  FALSE  BOOL",
        "  003f  bd 4a              nSpeed                  19133  INT",
        "  0041  e1 76 7b 42        fTemp                   62.86609  REAL",
        "  0045  7d 1f 27 6c be …   stAxis.pos              156.491994931  LREAL",
    ]
    assert "Data" not in done.stdout


def test_a_telegram_of_another_shape_keeps_its_bytes(tmp_path: Path) -> None:
    other = tmp_path / "other.gvl"
    other.write_text((PEERS / "axis.gvl").read_text().replace("nSpeed : INT", "nSpeed : DINT"))
    options = ["--gvl", str(other), "--gvl", AXIS[1]]
    tree = nvscope("packets", str(PEERS / "peers.pcap"), "-V", "-Y", "nv.index == 42", "-c", "6", *options).stdout
    assert "Variables  other: not of the shape that its definition has (NV405)\nData  68 bytes\n" in tree
    report = json.loads(nvscope("report", str(PEERS / "peers.pcap"), "--json", *options).stdout)
    assert {entry["id"]: entry["name"] for entry in report["lists"]}[42] == "other"
    (mismatch,) = [finding for finding in report["findings"] if finding["code"] == "NV405"]
    assert (mismatch["list"], mismatch["count"]) == ("udp/1202/42", 199)
    assert "eState at byte 68 is the first that cannot be there, 2 bytes short." in mismatch["message"]


def test_variables_need_trees() -> None:
    done = nvscope("packets", str(PEERS / "peers.pcap"), "--gvl", AXIS[0], "--gvl", AXIS[1])
    assert (done.returncode, done.stdout) == (2, "")
    assert "-V" in done.stderr


PEERS_DEFINED = [
    option for name in ("axis.gvl", "axis_types.st", "batch.gvl", "recipe.gvl", "counters.gvl")
    for option in ("--gvl", str(PEERS / name))
]  # fmt: skip
CAPTURE = str(PEERS / "peers.pcap")


def test_every_change_of_a_variable() -> None:
    done = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--history", "NSPEED", "--utc")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[:4] == [
        "Time            Frame  Sender           Value",
        "2026-11-21 (UTC)",
        "10:05:21.150        6  10.77.0.3        19133 (first)",
        "10:05:21.186        8  10.77.0.3        19133 → -3419",
    ]
    assert len([line for line in lines if "→" in line]) == 198
    assert lines[-3] == "nSpeed    udp/1202/42  10.77.0.3        199      198   47.9 ms  52.4 ms"


def test_the_history_of_a_structure_as_data() -> None:
    done = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--history", "axis:staxis", "--json", "--all")
    document = json.loads(done.stdout)
    assert document["schema"] == "nvscope.history/1"
    assert {row["name"] for row in document["changes"]} == {"stAxis.pos", "stAxis.vel"}
    assert len(document["changes"]) == 2 * 199
    assert [(row["name"], row["changes"]) for row in document["variables"]] == [
        ("stAxis.pos", 198),
        ("stAxis.vel", 198),
    ]


def test_a_name_that_nothing_has() -> None:
    done = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--history", "nSped")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "nvscope: no variable is named 'nSped'\n  near it: nSpeed, speed\n"
    other = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--history", "nSpeed", "--list", "recipe")
    assert other.returncode == 2
    no_list = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--history", "nowhere:nSpeed")
    assert "axis (udp/1202/42)" in no_list.stderr


def test_values_as_they_were() -> None:
    done = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--at", "#100", "--utc")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "2026-11-21 10:05:22.228 (UTC), 1.1 s after the first frame, up to frame 100"
    assert "  speed     15362      INT         11.2 ms" in lines
    at = {
        time: json.loads(nvscope("vars", CAPTURE, *PEERS_DEFINED, "--utc", "--json", "--at", time).stdout)
        for time in ("+1s", "2026-11-21 10:05:22.107Z", "-8.959s", "10:05:22.107", "0s")
    }
    assert {document["last_frame"] for time, document in at.items() if time != "0s"} == {88}
    unseen = [row for row in at["0s"]["variables"] if row["text"] is None]
    assert {row["list"] for row in unseen} >= {"udp/1202/42", "udp/1202/7"}


def test_a_time_that_is_none() -> None:
    for text, told in (
        ("soon", "not a time"), ("#9999", "864 frames"), ("#0", "not a time"), ("25:00", "not a time"),
        ("2026-02-30", "not a time"), ("5000d", "not a time"),
    ):  # fmt: skip
        done = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--at", text)
        assert (done.returncode, done.stdout) == (2, ""), text
        assert told in done.stderr
    stdin = nvscope("vars", "-", *PEERS_DEFINED, "--at", "-2s")
    assert (stdin.returncode, "stdin" in stdin.stderr) == (2, True)


def test_layouts_without_a_definition(tmp_path: Path) -> None:
    draft = tmp_path / "draft.gvl"
    done = nvscope("vars", CAPTURE, "--infer", "--list", "42", "-w", str(draft))
    assert done.returncode == 0
    assert done.stdout.splitlines()[:7] == [
        "udp/1202/42 from 10.77.0.3: 1 telegram a cycle, every 50.1 ms, 5 sure, 6 likely.",
        "",
        "  SubIndex 0: Items 11, Length 88, 199 telegrams",
        "  Offset  Bytes  Type        Grade   Evidence                                    Or",
        "       0      1  BOOL        sure    FALSE and TRUE only",
        "       1      2  INT         likely  -29686 to 29690; the sign is a guess        UINT",
        "       3      4  REAL        sure    REAL 0.0131845 to 98.1761",
    ]
    assert str(draft) in done.stderr
    shown = nvscope("vars", CAPTURE, "--gvl", str(draft))
    assert shown.stdout.startswith("udp/1202/42 draft from 10.77.0.3, 199 telegrams")
    known = [element["bytes"] for element in _elements(*AXIS)]
    assert [element["bytes"] for element in _elements(str(draft))] == known


def _elements(*files: str) -> list[dict[str, int]]:
    (entry,) = json.loads(nvscope("gvl", "layout", "--json", *files).stdout)["lists"]
    found: list[dict[str, int]] = entry["telegrams"][0]["elements"]
    return found


def test_each_list_has_a_draft_of_its_own(tmp_path: Path) -> None:
    done = nvscope("vars", CAPTURE, "--infer", "--json", "-w", str(tmp_path / "draft.gvl"))
    document = json.loads(done.stdout)
    assert document["schema"] == "nvscope.infer/1"
    assert [(entry["list"], entry["reproducible"]) for entry in document["lists"]] == [
        ("udp/1202/1", True), ("udp/1202/3", True), ("udp/1202/7", True), ("udp/1202/42", True),
    ]  # fmt: skip
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "draft-1.gvl", "draft-3.gvl", "draft-42.gvl", "draft-7.gvl",
    ]  # fmt: skip
    drafts = [option for path in tmp_path.iterdir() for option in ("--gvl", str(path))]
    report = json.loads(nvscope("report", CAPTURE, "--json", *drafts).stdout)
    assert not [finding for finding in report["findings"] if finding["code"] == "NV405"]


def test_options_that_do_not_go_together() -> None:
    for options in (
        ["--history", "a", "--at", "1s"], ["--all"], ["--list", "8"], ["-w", "x.gvl"], ["--infer", "--at", "1s"],
    ):  # fmt: skip
        done = nvscope("vars", CAPTURE, *PEERS_DEFINED, *options)
        assert (done.returncode, done.stdout) == (2, ""), options
    both = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--infer")
    assert (both.returncode, "--gvl" in both.stderr) == (2, True)
    unknown = nvscope("vars", CAPTURE, "--infer", "--list", "77")
    assert (unknown.returncode, "udp/1202/42" in unknown.stderr) == (2, True)


def test_the_report_as_data_has_the_values_of_defined_lists() -> None:
    plain = json.loads(nvscope("report", CAPTURE, "--json").stdout)
    assert all("values" not in entry for entry in plain["lists"])
    report = json.loads(nvscope("report", CAPTURE, "--json", *PEERS_DEFINED).stdout)
    variables = json.loads(nvscope("vars", CAPTURE, "--json", *PEERS_DEFINED).stdout)["variables"]
    told = [
        {"list": entry["key"], "list_name": entry["name"], **row}
        for entry in report["lists"]
        for row in entry["values"]
    ]
    assert told == variables


def test_a_filter_is_said_and_what_it_hides_is_not_said_to_be_missing() -> None:
    shown = "shown: what nv.index == 42 chooses (199 of 862 telegrams)"
    plain = nvscope("vars", CAPTURE, *PEERS_DEFINED, "-Y", "nv.index == 42")
    assert plain.stdout.startswith(f"{shown}\n\nudp/1202/42 axis from 10.77.0.3, 199 telegrams\n")
    at = nvscope("vars", CAPTURE, *PEERS_DEFINED, "-Y", "nv.index == 42", "--at", "5s")
    assert at.stdout.splitlines()[1] == shown
    assert "udp/1202/1 batch: sent, but the filter chooses none of its telegrams" in at.stdout
    assert "nobody sends it" not in at.stdout
    history = nvscope("vars", CAPTURE, *PEERS_DEFINED, "-Y", "nv.index == 42", "--history", "nSpeed")
    assert shown in history.stdout.splitlines()
    for options in ([], ["--history", "nSpeed"]):
        nothing = nvscope("vars", CAPTURE, *PEERS_DEFINED, "-Y", "nv.index == 43", *options)
        assert nothing.stdout == (
            "shown: what nv.index == 43 chooses (0 of 862 telegrams)\nNo value: the filter chooses no telegram.\n"
        )
        document = json.loads(
            nvscope("vars", CAPTURE, *PEERS_DEFINED, "-Y", "nv.index == 43", "--json", *options).stdout
        )
        assert document["filter"] == {"expression": "nv.index == 43", "telegrams": 0, "all_telegrams": 862}
    other = nvscope("vars", CAPTURE, *AXIS_ONLY, "-Y", "nv.index == 7")
    assert "no telegram that the filter chooses is one of a defined list" in other.stdout
    assert "compare the identifiers" not in other.stdout


AXIS_ONLY = ["--gvl", AXIS[0], "--gvl", AXIS[1]]


def test_one_list_alone() -> None:
    plain = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--list", "AXIS")
    assert [line for line in plain.stdout.splitlines() if line.startswith("udp/")] == [
        "udp/1202/42 axis from 10.77.0.3, 199 telegrams"
    ]
    at = json.loads(nvscope("vars", CAPTURE, *PEERS_DEFINED, "--list", "1", "--at", "5s", "--json").stdout)
    assert {row["list"] for row in at["variables"]} == {"udp/1202/1"}
    axis = nvscope("vars", str(CAPTURES / "telegrams.pcap"), *AXIS_ONLY, "--list", "axis")
    assert axis.stdout.startswith("No telegram of this list was found: compare its identifier and port")
    none = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--list", "axes")
    assert (none.returncode, none.stdout, "no list is named 'axes'" in none.stderr) == (2, "", True)


def test_a_list_over_several_telegrams_counts_all_of_them() -> None:
    done = nvscope("vars", CAPTURE, *PEERS_DEFINED, "--list", "recipe")
    assert done.stdout.startswith("udp/1202/7 recipe from 10.77.0.1, 156 telegrams in 3 SubIndexes\n")


def gvl_file(path: Path, declarations: str, list_id: int) -> list[str]:
    """Write a definition file; return the option that names it."""
    settings = f"<ListIdentifier>{list_id}</ListIdentifier><Pack>True</Pack>"
    path.write_text(
        f"<GVL><Declarations><![CDATA[VAR_GLOBAL\n{declarations}\nEND_VAR]]></Declarations>"
        f'<NetvarSettings Protocol="UDP">{settings}</NetvarSettings></GVL>'
    )
    return ["--gvl", str(path)]


def capture_file(path: Path, sent: list[tuple[int, bytes, int]]) -> str:
    """Write data telegrams of SubIndex 0, 100 ms apart, each of a list with some items; return the path."""
    frames = [
        telegram(data, items, subindex=0, counter=number, ts_ns=START_NS + number * 10**8, list_id=list_id)
        for number, (list_id, data, items) in enumerate(sent)
    ]
    path.write_bytes(pcap_of(frames))
    return str(path)


def test_the_history_of_several_lists_says_which(tmp_path: Path) -> None:
    capture = capture_file(tmp_path / "both.pcap", [(number % 2 + 5, bytes([number, 0]), 1) for number in range(4)])
    files = [*gvl_file(tmp_path / "north.gvl", "n : INT;", 5), *gvl_file(tmp_path / "south.gvl", "n : INT;", 6)]
    done = nvscope("vars", capture, *files, "--history", "n", "--utc", columns=80)
    assert done.stdout.splitlines()[:5] == [
        "Time            Frame  List   Sender           Value",
        "2023-11-14 (UTC)",
        "22:13:20.000        1  north  10.0.0.1         0 (first)",
        "22:13:20.100        2  south  10.0.0.1         1 (first)",
        "22:13:20.200        3  north  10.0.0.1         0 → 2",
    ]
    for wanted in ("south:n", "6:n", "udp/1202/6:N"):
        alone = nvscope("vars", capture, *files, "--history", wanted, "--json")
        assert {row["list_name"] for row in json.loads(alone.stdout)["changes"]} == {"south"}


def test_a_program_that_is_changed_in_the_middle(tmp_path: Path) -> None:
    sent = [(5, bytes([number, 0, 1, 0]), 2) for number in range(3)]
    sent += [(5, bytes([number, 0, 2, 0, 0, 0]), 2) for number in range(3, 8)]
    capture = capture_file(tmp_path / "download.pcap", sent)
    files = gvl_file(tmp_path / "old.gvl", "a : INT; b : INT;", 5)
    files += gvl_file(tmp_path / "new.gvl", "a : INT; b : DINT;", 5)
    done = nvscope("vars", capture, *files, "--utc")
    assert (done.returncode, done.stderr) == (0, "")
    assert [line for line in done.stdout.splitlines() if line.startswith(("udp", "  a"))] == [
        "udp/1202/5 new from 10.0.0.1, 5 telegrams",
        "  a         7      INT   22:13:20.700        4    3    7",
        "udp/1202/5 old from 10.0.0.1, 3 telegrams until 22:13:20.200; later ones have another shape (above)",
        "  a         2      INT   22:13:20.200        2    0    2",
    ]
    for name in ("old", "new", "5"):
        assert nvscope("vars", capture, *files, "--utc", "--list", name).stdout == done.stdout
    history = json.loads(nvscope("vars", capture, *files, "--history", "new:b", "--json").stdout)["changes"]
    assert [(row["frame"], row["list_name"], row["new"]) for row in history] == [(1, "old", 1), (4, "new", 2)]


def test_a_list_of_which_not_all_is_known(tmp_path: Path) -> None:
    capture = capture_file(tmp_path / "pointer.pcap", [(5, bytes([number] * 6), 3) for number in range(3)])
    files = gvl_file(tmp_path / "part.gvl", "u : INT; p : POINTER TO INT; q : INT;", 5)
    history = nvscope("vars", capture, *files, "--history", "part:*", "--json")
    assert [(row["frame"], row["name"], row["new"]) for row in json.loads(history.stdout)["changes"]] == [
        (1, "u", 0), (1, "p …", "00000000"), (2, "u", 257), (2, "p …", "01010101"),
        (3, "u", 514), (3, "p …", "02020202"),
    ]  # fmt: skip
    assert "nobody knows where q is, behind p : POINTER" in history.stderr
    at = nvscope("vars", capture, *files, "--at", "#2")
    assert "  p …       01 01 01 01  bytes from p : POINTER on  0 ns" in at.stdout.splitlines()
    behind = nvscope("vars", capture, *files, "--history", "q")
    assert (behind.returncode, behind.stdout) == (2, "")
    assert behind.stderr == (
        "nvscope: nobody knows where q is, behind p : POINTER, whose size is not known\n"
        "  p stands for all bytes from there on\n"
    )


def test_values_are_shown_whole_before_anything_else(tmp_path: Path) -> None:
    capture = capture_file(tmp_path / "narrow.pcap", [(5, bytes([number, 0]) + bytes(10), 2) for number in range(3)])
    files = gvl_file(tmp_path / "narrow.gvl", "nAPositionWithALongName : INT; aSerial : uAny;", 5)
    types = tmp_path / "any.st"
    types.write_text("TYPE uAny : UNION a : LREAL; s : STRING(9); END_UNION END_TYPE")
    for options in ([], ["--at", "1s"]):
        done = nvscope("vars", capture, *files, "--gvl", str(types), *options, columns=60)
        row = next(line for line in done.stdout.splitlines() if line.startswith("  aSerial"))
        assert " ".join(["00"] * 10) in row
