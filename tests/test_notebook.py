"""The Python API: what a notebook sees is what the program says."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import nvscope
from nvscope.analysis.inquiry import Inquiry
from nvscope.errors import ConfigurationError, UnreadableInput, UsageError
from nvscope.tracker.figures import Of, figures_of
from nvscope.view.documents.figures import lookup
from tests.oracle.builders import START, data_frame, telegram
from tests.oracle.pcap import write_pcap
from tests.program import run_text

CAPTURES = Path(__file__).parents[1] / "captures"
PEERS, PLANT = CAPTURES / "peers" / "peers.pcap", CAPTURES / "plant.pcapng.gz"
PRESS = CAPTURES / "can" / "press.log"
AXIS = [CAPTURES / "peers" / name for name in ("axis.gvl", "axis_types.st")]


def test_lists_streams_and_findings_are_those_of_the_report() -> None:
    plant = nvscope.open(PLANT)
    inquiry = Inquiry([str(PLANT)])
    report = inquiry.report(inquiry.analyze(causes=True))
    assert plant.report == report
    assert plant.lists["key"].to_list() == [entry["key"] for entry in report["lists"]]
    assert plant.lists["lost"].to_list() == [entry["counters"]["lost"] for entry in report["lists"]]
    assert plant.lists["readers"].to_list() == [entry["readers"] for entry in report["lists"]]
    streams = [(entry["key"], stream) for entry in report["lists"] for stream in entry["streams"]]
    assert plant.streams["list"].to_list() == [key for key, _ in streams]
    median = plant.streams["interval_p50"].cast(pl.Int64).to_list()
    assert median == [stream["interval_ns"]["p50"] for _, stream in streams]
    assert plant.findings["code"].to_list() == [finding["code"] for finding in report["findings"]]
    assert plant.findings["frames"].to_list() == [finding["frames"] for finding in report["findings"]]
    first = plant.findings["first"].cast(pl.Int64).to_list()
    assert first == [int(finding["first_ns"]) for finding in report["findings"]]


@pytest.mark.parametrize("capture", [PLANT, PRESS])
def test_frames_have_all_figures_of_the_report_by_name(capture: Path) -> None:
    found = nvscope.open(capture)
    lists, buses = found.report["lists"], found.report.get("buses", [])
    held = {
        Of.LIST: (found.lists, lists),
        Of.NODE: (found.nodes, [node for entry in lists for node in entry["nodes"]]),
        Of.STREAM: (found.streams, [stream for entry in lists for stream in entry["streams"]]),
        Of.BUS: (found.buses, buses),
    }
    for of, (frame, rows) in held.items():
        for figure in figures_of(of):
            if of in figure.keys:
                column = frame[figure.name]
                column = column.cast(pl.Int64) if column.dtype.is_temporal() else column
                cells = list(map(lookup(figure, of), rows))
                assert column.to_list() == ([cell and int(cell) for cell in cells] if figure.unit == "time" else cells)
    assert found.nodes["list"].to_list() == [entry["key"] for entry in lists for _ in entry["nodes"]]
    assert found.nodes["address"].to_list() == [node["address"] for entry in lists for node in entry["nodes"]]
    assert found.buses["channel"].to_list() == [bus["channel"] for bus in buses]


def test_values_are_those_that_were_sent() -> None:
    values = nvscope.open(PEERS, definitions=AXIS).values("axis")
    sent = [entry["v"] for entry in json.loads((CAPTURES / "peers" / "sent-node-red.json").read_text())]
    assert values["stAxis.pos"].to_list() == [entry["stAxis"]["pos"] for entry in sent]
    assert values["sText"].to_list() == [entry["sText"] for entry in sent]
    assert values["bStart"].to_list() == [entry["bStart"] for entry in sent]
    assert values["frame.time"].dtype == pl.Datetime("ns", "UTC")


def test_a_filter_chooses_causes_with_what_they_explain() -> None:
    plant = nvscope.open(PLANT)
    second = plant.where('cause.kind == "second-sender"')
    assert second.causes.equals(plant.causes.filter(pl.col("kind") == "second-sender"))
    assert set(second.findings["code"]) == set(second.causes["codes"].item())
    assert second.telegrams("frame.number")["frame.number"].to_list() == second.causes["frames"].item().to_list()
    assert second.lists["key"].to_list() == second.causes["lists"].item().to_list()


def test_a_filter_chooses_telegrams_values_and_lists() -> None:
    peers = nvscope.open(PEERS, definitions=AXIS)
    fast = peers.where("var.stAxis.pos > 500")
    assert fast.values()["stAxis.pos"].min() > 500  # type: ignore[operator]
    assert fast.values().height == peers.values().filter(pl.col("stAxis.pos") > 500).height
    assert fast.lists["key"].to_list() == ["udp/1202/42"]
    numbers = fast.telegrams("frame.number", "var.sText")
    assert numbers["frame.number"].to_list() == fast.values()["frame.number"].to_list()
    assert numbers["var.sText"].to_list() == fast.values()["sText"].to_list()
    assert "var.stAxis.pos > 500" in repr(fast)


def test_several_lists_are_long_or_one_by_one() -> None:
    files = [CAPTURES / "peers" / name for name in ("axis.gvl", "axis_types.st", "recipe.gvl")]
    peers = nvscope.open([PEERS], definitions=files)
    with pytest.raises(UsageError, match="several lists") as error:
        peers.values()
    assert "recipe (udp/1202/7)" in error.value.next_step
    long = peers.values(form="long")
    assert set(long["list_name"].cast(pl.String)) == {"axis", "recipe"}
    pos = long.filter(pl.col("variable").cast(pl.String) == "stAxis.pos")
    assert pos["real"].to_list() == peers.values("udp/1202/42")["stAxis.pos"].to_list()
    assert peers.values(7).equals(peers.values("7"))
    assert peers.values("7").height == peers.lists.filter(pl.col("id") == 7)["nSendCount"][0]


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no list is defined"):
        nvscope.open(PEERS).values()
    for ask in (lambda: nvscope.open(PEERS).at("5s"), lambda: nvscope.open(PEERS).history("stAxis.pos")):
        with pytest.raises(UsageError, match="no list is defined"):
            ask()
    with pytest.raises(UsageError, match="declare types, but no list"):
        nvscope.open(PEERS, definitions=AXIS[1:]).at("5s")
    with pytest.raises(UsageError, match="no list is named 'axes'"):
        nvscope.open(PEERS, definitions=AXIS).values("axes")
    with pytest.raises(UsageError, match=r"no field is called nv\.cuonter"):
        nvscope.open(PEERS).telegrams("nv.cuonter")
    with pytest.raises(ConfigurationError):
        nvscope.open(PEERS, definitions=tmp_path / "missing.gvl")
    with pytest.raises(UsageError, match="captures are not 5"):
        nvscope.open(5)  # type: ignore[arg-type]
    with pytest.raises(UnreadableInput, match=r"missing\.pcap"):
        nvscope.open(tmp_path / "missing.pcap")
    with pytest.raises(UsageError, match="no field is called nv\\.cuonter"):
        nvscope.open(PEERS, where="nv.cuonter == 1")
    with pytest.raises(UsageError, match="column 12"):
        nvscope.open(PEERS).where("nv.index == ")
    with pytest.raises(UsageError, match="form is not 'broad'"):
        nvscope.open(PEERS, definitions=AXIS).values(form="broad")  # type: ignore[arg-type]
    with pytest.raises(AttributeError, match="no attribute 'opne'"):
        nvscope.opne  # noqa: B018


def test_what_values_do_not_show_is_a_warning(tmp_path: Path) -> None:
    changed = tmp_path / "axis.gvl"
    changed.write_text(AXIS[0].read_text().replace("nSpeed : INT;", "nSpeed : DINT;"))
    for form in ("wide", "long"):
        with pytest.warns(UserWarning, match=r"axis: 199 telegrams left out, not of the shape .* \(NV405\)"):
            assert nvscope.open(PEERS, definitions=[changed, AXIS[1]]).values("axis", form=form).is_empty()


def test_of_a_list_with_a_pointer_there_is_what_is_known(tmp_path: Path) -> None:
    changed = tmp_path / "axis.gvl"
    changed.write_text(AXIS[0].read_text().replace("fTemp : REAL;", "fTemp : POINTER TO REAL;"))
    found = nvscope.open(PEERS, definitions=[changed, AXIS[1]]).values("axis")
    whole = nvscope.open(PEERS, definitions=AXIS).values()
    assert found.columns[4:] == ["bStart", "nSpeed", "fTemp …"]
    assert found["nSpeed"].to_list() == whole["nSpeed"].to_list()
    assert {len(rest) for rest in found["fTemp …"]} == {
        nvscope.open(PEERS).telegrams("nv.length", "nv.index").filter(pl.col("nv.index") == 42)["nv.length"][0] - 20 - 3
    }


def test_nothing_to_show_has_columns_all_the_same() -> None:
    nothing = nvscope.open(PEERS, definitions=AXIS, where="nv.index == 4711")
    assert nothing.lists.is_empty()
    assert "lost" in nothing.lists.columns
    assert nothing.findings.filter(pl.col("severity") == "error").is_empty()
    assert nothing.values().is_empty()
    assert "stAxis.pos" in nothing.values().columns


def test_a_project_file_is_used_where_it_is_wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "nvscope.toml").write_text('[lists.42]\nname = "press axis"\n')
    monkeypatch.chdir(tmp_path)
    names = [dict(zip(found["id"], found["name"], strict=True))[42] for found in (
        nvscope.open(PEERS).lists,
        nvscope.open(PEERS, project=True).lists,
        nvscope.open(PEERS, project=tmp_path / "nvscope.toml").lists,
    )]  # fmt: skip
    assert names == [None, "press axis", "press axis"]


def documents_of(*arguments: str) -> dict[str, Any]:
    """Return what ``nvscope vars --json`` says of the peers."""
    definitions = [option for path in AXIS for option in ("--gvl", str(path))]
    done = run_text("vars", str(PEERS), "--json", *arguments, *([] if "--infer" in arguments else definitions))
    assert done.returncode == 0, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


def test_a_history_is_that_of_the_program() -> None:
    plant = nvscope.open(PEERS, definitions=AXIS)
    for every in (False, True):
        told = documents_of("--history", "stAxis.*", *(["--all"] if every else []))["changes"]
        shown = plant.history("stAxis.*", every=every)
        assert shown["frame"].to_list() == [row["frame"] for row in told]
        assert shown["time"].cast(pl.Int64).to_list() == [int(row["time_ns"]) for row in told]
        assert shown["name"].to_list() == [row["name"] for row in told]
        assert shown["new"].to_list() == [row["new_text"] for row in told]
        assert shown["old"].to_list() == [row["old_text"] for row in told]
        assert shown["changed"].to_list() == [row["changed"] for row in told]
    numbers = plant.history("stAxis.pos")["value"].drop_nulls()
    assert numbers.len() == plant.history("stAxis.pos").height
    assert plant.where("frame.number < 100").history("stAxis.pos")["frame"].max() < 100  # type: ignore[operator]
    with pytest.raises(UsageError, match=r"nothing\.of\.this"):
        plant.history("nothing.of.this")


def test_names_that_no_file_declares_are_a_warning() -> None:
    with pytest.warns(UserWarning, match=r"types that no file declares: Axis \(.*axis\.gvl, line 6, column 11\)"):
        peers = nvscope.open(PEERS, definitions=AXIS[0])
    assert {"bStart", "nSpeed", "fTemp"} <= set(peers.values().columns)


def test_a_value_that_a_float_cannot_hold_is_told_as_text_alone(tmp_path: Path) -> None:
    exact, beyond = 1 << 53, (1 << 53) + 1
    frames = [
        data_frame(START + counter * 1_000, "10.0.0.1", "10.0.0.255", telegram(list_id=7, counter=counter, data=data))
        for counter, data in enumerate(number.to_bytes(8, "little") for number in (5, exact, beyond))
    ]
    write_pcap(frames, tmp_path / "large.pcap")
    settings = "<ListIdentifier>7</ListIdentifier><Pack>True</Pack>"
    (tmp_path / "large.gvl").write_text(
        "<GVL><Declarations><![CDATA[VAR_GLOBAL\n  nLarge : LINT;\nEND_VAR]]></Declarations>"
        f'<NetvarSettings Protocol="UDP">{settings}</NetvarSettings></GVL>'
    )
    large = nvscope.open(tmp_path / "large.pcap", definitions=tmp_path / "large.gvl")
    history = large.history("nLarge", every=True)
    assert history["value"].to_list() == [5.0, float(exact), None]
    assert history["new"].to_list() == ["5", str(exact), str(beyond)]
    assert large.at("#3").select("value", "text").row(0) == (None, str(beyond))


@pytest.mark.parametrize("time", ["0s", "3s", "-1s", "#200"])
def test_values_at_a_time_are_those_of_the_program(time: str) -> None:
    told = documents_of("--at", time)["variables"]
    shown = nvscope.open(PEERS, definitions=AXIS).at(time)
    for column in ("list", "sender", "subindex", "name", "type", "text", "frame", "missing"):
        assert shown[column].to_list() == [row[column] for row in told], column
    assert shown["age"].cast(pl.Int64).to_list() == [row["age_ns"] for row in told]


def test_proposals_are_those_of_the_program() -> None:
    told = [
        (entry["list"], telegram["subindex"], field["offset"], field["type"], field["grade"])
        for entry in documents_of("--infer")["lists"]
        for telegram in entry["telegrams"]
        for layout in telegram["layouts"][:1]
        for field in layout["fields"]
    ]
    assert nvscope.open(PEERS).infer().select("list", "subindex", "offset", "type", "grade").rows() == told


def test_a_capture_that_was_cut_is_a_warning_whatever_is_asked(tmp_path: Path) -> None:
    cut = tmp_path / "cut.pcap"
    cut.write_bytes(PEERS.read_bytes()[:-10])
    asked = (
        lambda plant: plant.lists,
        lambda plant: plant.values("axis"),
        lambda plant: plant.telegrams(),
        lambda plant: plant.history("stAxis.pos"),
        lambda plant: plant.at("1s"),
        lambda plant: plant.infer(),
        lambda plant: plant.truncations,
    )
    for ask in asked:
        with pytest.warns(UserWarning, match=r"cut\.pcap, offset \d+: "):
            ask(nvscope.open(cut, AXIS))
    plant = nvscope.open(cut, AXIS)
    with pytest.warns(UserWarning, match=r"cut\.pcap"):
        rows = plant.truncations.rows()
    assert [(path, offset > 0) for path, offset, _ in rows] == [(str(cut), True)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plant.telegrams()  # told once is enough
    assert nvscope.open(PEERS).truncations.is_empty()
