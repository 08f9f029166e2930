"""Variables of web visualization as a person asks for them: vars, export, packets, report; passwords stay hidden."""

from __future__ import annotations

import csv
import io
import json
import struct
from ipaddress import ip_address
from pathlib import Path

import pytest

from dissectors.headers import PROTOCOL_TCP
from nvscope.capture.open import open_sink
from tests.analysis.transactions.talk import post, reply
from tests.cli.test_vars import nvscope
from tests.oracle.builders import ETHERNET, internet_packet, link_frame, unreachable, whole
from tests.oracle.tcp_line import Line
from tests.packets import batch_of
from tests.program_here import run_text
from tests.tracker.visu.shown_and_carried import GVL, plant

ROOT = Path(__file__).parents[2]
PANEL = str(ROOT / "captures" / "visu" / "panel.pcap")
PEERS = str(ROOT / "captures" / "peers" / "peers.pcap")
SECRET = "geheim"


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return the arguments for a plant whose list is on a page, too."""
    folder = tmp_path_factory.mktemp("plant")
    sink = open_sink(str(folder / "plant.pcap"))
    sink.write(batch_of(plant(range(0, 500, 10), range(25, 500, 50))))
    sink.close()
    (folder / "plant.gvl").write_text(GVL)
    return [str(folder / "plant.pcap"), "--gvl", str(folder / "plant.gvl")]


def test_variables_of_pages_need_no_definition() -> None:
    done = nvscope("vars", PANEL)
    assert done.returncode == 0
    assert "visu/10.78.0.10, 10 variables of web visualization" in done.stdout
    assert "Never readable (???)" in done.stdout
    assert "2 values are hidden that may be a password; --show-secrets shows them." in done.stderr


def test_what_no_reply_has_a_value_for_is_not_called_unreadable(tmp_path: Path) -> None:
    line = Line().open().ask(post("|0|2|0|4|0|4|6|1|4|4|2|1|")).answer(reply("|1.5|"))
    line.ask(post("|0|1|0|4|8|2|1|")).answer(reply("|???|")).ask(post("|0|1|0|4|9|2|1|")).answer(reply("|"))
    sink = open_sink(str(tmp_path / "x.pcap"))
    sink.write(batch_of(line.frames))
    sink.close()
    for moment in ([], ["--at", "+1s"]):
        told = nvscope("vars", str(tmp_path / "x.pcap"), *moment).stdout
        assert "Never readable (???): 4,8,2,1." in told
        assert "Asked for, and in no reply (NV804): 4,4,2,1; 4,9,2,1." in told
    report = json.loads(nvscope("report", str(tmp_path / "x.pcap"), "--json").stdout)
    assert [one["unreadable"] for one in report["visu_unchanging"]] == [["4,8,2,1"]]


def test_variables_of_pages_stand_beside_those_of_lists(shown: list[str]) -> None:
    told = json.loads(nvscope("vars", *shown, "--json").stdout)
    assert {row["list"] for row in told["variables"]} == {"udp/1202/9"}
    assert {row["list"] for row in told["page_variables"]} == {"visu/10.0.0.5"}
    text = nvscope("vars", *shown).stdout
    assert text.index("udp/1202/9 plant") < text.index("visu/10.0.0.5")


def test_one_controller_is_chosen_by_its_address(shown: list[str]) -> None:
    told = json.loads(nvscope("vars", *shown, "--list", "visu/10.0.0.5", "--json").stdout)
    assert not told["variables"]
    assert told["page_variables"]
    done = nvscope("vars", *shown, "--list", "visu/10.0.0.77")
    assert (done.returncode, "no page asked 'visu/10.0.0.77'" in done.stderr) == (2, True)
    assert "visu/10.0.0.5" in done.stderr


def test_a_history_tells_changes_of_lists_and_pages_in_the_order_of_the_capture(shown: list[str]) -> None:
    lines = nvscope("vars", *shown, "--history", "nCount", "--list", "udp/1202/9").stdout.splitlines()
    assert not any("visu/" in line for line in lines)
    done = nvscope("vars", *shown, "--history", "ncount", "--utc")
    changes = [line.split() for line in done.stdout.splitlines() if "→" in line or "(first)" in line]
    frames = [int(change[1]) for change in changes]
    assert frames == sorted(frames)
    assert {change[2] for change in changes} == {"10.0.0.1", "visu/10.0.0.5"}


@pytest.mark.parametrize("columns", [80, 160])
def test_a_history_of_a_password_tells_when_it_changed(shown: list[str], columns: int) -> None:
    words = "vars", *shown, "--history", "visu/*/.CurrentPassword", "--utc"
    done = run_text(*words, environment={"COLUMNS": str(columns)})
    last = [line for line in done.stdout.splitlines() if "(hidden)" in line][-1]
    assert last.endswith("  → (hidden)" if columns == 80 else "  (hidden) → (hidden)")


def test_a_history_as_json_has_changes_of_pages_behind_those_of_lists(shown: list[str]) -> None:
    both = json.loads(nvscope("vars", *shown, "--history", "ncount", "--json").stdout)
    alone = json.loads(nvscope("vars", *shown, "--history", "visu/*/ncount", "--json").stdout)
    assert both["changes"]
    assert both["page_changes"] == alone["page_changes"]
    assert both["page_variables"] == alone["page_variables"]
    assert [row["new"] for row in both["page_changes"]] == list(range(10))


def test_a_name_that_no_page_has_is_told_with_those_near_it() -> None:
    done = nvscope("vars", PANEL, "--history", "visu/10.78.0.10/PLC_PRG.rSetpiont", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "PLC_PRG.rSetpoint" in done.stderr


def test_without_pages_it_says_that_there_is_no_definition() -> None:
    for options in ((), ("--at", "1s"), ("--history", "x")):
        done = nvscope("vars", PEERS, *options)
        assert (done.returncode, "no definition is given" in done.stderr) == (2, True)


def test_values_at_a_time_are_those_of_the_last_reply_before(shown: list[str]) -> None:
    told = json.loads(nvscope("vars", *shown, "--at", "140ms", "--json").stdout)
    (row,) = [row for row in told["page_variables"] if row["name"] == ".ncount"]
    assert row["value"] == 2
    earlier = json.loads(nvscope("vars", *shown, "--at", "0s", "--json").stdout)
    assert {row["missing"] for row in earlier["page_variables"]} == {"later"}


def test_exported_values_are_between_those_of_lists_by_frame(shown: list[str]) -> None:
    done = nvscope("export", *shown, "-w", "-", "--form", "long")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    frames = [int(row["frame.number"]) for row in rows]
    assert frames == sorted(frames)
    assert {row["list"] for row in rows} == {"udp/1202/9", "visu/10.0.0.5"}
    counts = [row["integer"] for row in rows if row["variable"] == ".ncount"]
    assert counts == [str(number) for number in range(10)]


def test_beside_wide_tables_values_of_pages_have_a_file_of_their_own(shown: list[str], tmp_path: Path) -> None:
    done = nvscope("export", *shown, "-w", str(tmp_path / "values.ndjson"))
    assert done.returncode == 0
    assert {path.name for path in tmp_path.iterdir()} == {"values.ndjson", "values.visu.ndjson"}
    rows = [json.loads(line) for line in (tmp_path / "values.visu.ndjson").read_text().splitlines()]
    assert {row["type"] for row in rows} >= {"REAL", "TIME", "BOOL", "STRING(5)"}
    assert [row["integer"] for row in rows if row["variable"] == "TRUN"][:2] == [0, 1_000_000]


def test_an_export_of_one_controller_needs_no_definition(tmp_path: Path) -> None:
    file = tmp_path / "panel.csv"
    done = nvscope("export", PANEL, "--list", "visu/10.78.0.10", "-w", str(file))
    assert done.returncode == 0
    rows = list(csv.DictReader(io.StringIO(file.read_text())))
    assert {row["place"] for row in rows if row["variable"] == "PLC_PRG.rSetpoint"} == {"4,156,4,6"}
    assert "--what values writes the values that pages asked for" in nvscope("export", PANEL, "-w", "-").stderr
    assert "no page" in nvscope("export", PEERS, "--what", "values", "-w", str(tmp_path / "none.csv")).stderr
    assert not (tmp_path / "none.csv").exists()


@pytest.mark.parametrize(
    "options",
    [
        ("vars",), ("vars", "--json"), ("vars", "--history", "visu/*/*"), ("vars", "--at", "-0s"),
        ("export", "--list", "visu/10.78.0.10", "-w", "-"), ("packets",), ("packets", "-V"), ("packets", "-x"),
        ("packets", "-V", "-x", "--all-frames"),
    ],
)  # fmt: skip
def test_passwords_are_shown_only_where_somebody_asks_for_them(options: tuple[str, ...]) -> None:
    verb, *others = options
    done = nvscope(verb, PANEL, *others)
    assert done.returncode == 0
    assert SECRET not in done.stdout
    assert "hidden" in done.stdout
    asked = nvscope(verb, PANEL, *others, "--show-secrets")
    assert SECRET in asked.stdout
    assert "passwords are shown" in asked.stderr


def test_a_report_hides_passwords_that_pages_and_lists_have(shown: list[str]) -> None:
    told, asked = (nvscope("report", *shown, "--compare", "--json", *more) for more in ((), ("--show-secrets",)))
    texts = [
        {row[end]["text"] for row in json.loads(done.stdout)["page_hops"] for end in ("from", "to")}
        for done in (told, asked)
    ]
    assert "'pw1'" not in texts[0]
    assert "(hidden)" in texts[0]
    assert "'pw1'" in texts[1]
    assert "passwords are shown" in asked.stderr


def test_a_filter_asks_for_any_of_the_variables_of_a_message() -> None:
    told = nvscope("packets", PANEL, "-Y", 'visu.variable == "PLC_PRG.xRun"', "-T", "fields", "-e", "visu.variables")
    assert set(told.stdout.split()) == {"7"}
    none = nvscope("packets", PANEL, "-Y", 'visu.variable == "PLC_PRG.nope"')
    assert (none.stdout, " frames read, the filter chooses none of them." in none.stderr) == ("", True)
    exact, other = (
        nvscope("packets", PANEL, "-Y", words).stdout
        for words in ('visu.variable == "PLC_PRG.xRun"', 'visu.variable in {"plc_prg.XRUN", "none"}')
    )
    assert exact == other != ""
    unlike = nvscope("packets", PANEL, "-Y", 'visu.variable && visu.variable != "plc_prg.xrun"').stdout
    assert not set(unlike.splitlines()) & set(exact.splitlines())


def test_bytes_of_pages_are_hidden_in_whatever_carries_them(tmp_path: Path) -> None:
    """A write over a page's port: behind a broken header, in ICMP errors that quote it, and in fragments."""
    body = b"|1|1|0|4|100|41|8|" + SECRET.encode() + b"|"
    good, broken = (struct.pack(">HHIIBBHHH", 49152, 80, 1, 1, words << 4, 24, 8192, 0, 0) + body for words in (5, 15))
    packets = [
        internet_packet(client, server, PROTOCOL_TCP, content, fragment=fragment)
        for client, server in (
            (ip_address("10.0.0.2"), ip_address("10.0.0.1")), (ip_address("fd00::2"), ip_address("fd00::1")),
        )
        for content, fragment in ((broken, None), (good, None), (body, (2, True)))
    ]  # fmt: skip
    packets[1], packets[4] = (
        unreachable(ip_address(where), packets[at]) for at, where in ((1, "10.0.0.9"), (4, "::9"))
    )
    sink = open_sink(str(tmp_path / "odd.pcap"))
    sink.write(batch_of([whole(number, ETHERNET, link_frame(one)) for number, one in enumerate(packets)]))
    sink.close()
    shown = [
        nvscope("packets", str(tmp_path / "odd.pcap"), "--all-frames", "-x", *more).stdout
        for more in ((), ("--show-secrets",))
    ]
    texts = ["".join(line.rpartition("   ")[2] for line in one.splitlines()) for one in shown]
    assert [one.count(SECRET) for one in texts] == [0, len(packets)], shown
    assert shown[0].count("bytes hidden, since passwords may be among them") == len(packets)


def test_the_tables_of_a_plant_without_lists_have_the_names_of_its_nodes(tmp_path: Path) -> None:
    (tmp_path / "names.toml").write_text('[nodes]\n"10.78.0.10" = { name = "press" }\n')
    done = nvscope("report", PANEL, "--project", str(tmp_path / "names.toml"), "--wide")
    assert "\n10.78.0.20  press  8080 " in done.stdout
    assert "  10.78.0.20  press  PLC_PRG.rSetpoint  21.5 " in done.stdout
    assert "\npress: 3 of 110 variables never changed" in done.stdout
