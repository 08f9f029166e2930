"""``nvscope convert``: the same frames in another format, what that cannot hold, files that are whole or not there."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink, open_source
from nvscope.capture.source import Attachment
from tests.capture.mcap.recordings import Packet, batch, packets_of, read, steady, write
from tests.program_here import run, run_text

ROOT = Path(__file__).parents[2]
CAPTURES = ROOT / "captures"
PLANT = CAPTURES / "plant.pcapng.gz"
PEERS = CAPTURES / "peers"
PRESS = CAPTURES / "can" / "press.log"


def frames_of(path: Path) -> list[Packet]:
    """Return the frames of a capture, with the names of their channels in place of numbers."""
    source = open_source([str(path)])
    found = [one for part in source for one in packets_of(part)]
    names = dict(enumerate(source.channels))
    return [one._replace(channel=names.get(one.channel, "")) for one in found]  # type: ignore[arg-type]


def converted(source: Path, target: Path, *options: str) -> str:
    """Convert, and return what is told on stderr."""
    done = run_text("convert", source, "-w", target, *options)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    return done.stderr


@pytest.mark.parametrize("capture", [PLANT, PEERS / "peers.pcap", PRESS, CAPTURES / "interfaces.pcapng"])
def test_frames_are_the_same_behind_every_format_that_can_hold_them(capture: Path, tmp_path: Path) -> None:
    frames = frames_of(capture)
    ways = [tmp_path / "a.mcap", tmp_path / "b.pcapng", tmp_path / "c.mcap"]
    for source, target in pairwise([capture, *ways]):
        converted(source, target)
        assert frames_of(target) == frames


@pytest.mark.parametrize("capture", [PLANT, PEERS / "peers.pcap", CAPTURES / "telegrams.pcap"])
def test_a_pcap_comes_back_from_mcap_byte_for_byte(capture: Path, tmp_path: Path) -> None:
    converted(capture, tmp_path / "a.pcap")
    converted(tmp_path / "a.pcap", tmp_path / "b.mcap")
    converted(tmp_path / "b.mcap", tmp_path / "c.pcap")
    assert (tmp_path / "a.pcap").read_bytes() == (tmp_path / "c.pcap").read_bytes()


def test_a_candump_log_comes_back_from_mcap_byte_for_byte(tmp_path: Path) -> None:
    converted(PRESS, tmp_path / "b.mcap")
    converted(tmp_path / "b.mcap", tmp_path / "c.log")
    assert (tmp_path / "c.log").read_bytes() == PRESS.read_bytes()


@pytest.mark.parametrize("capture", [PLANT, PEERS / "peers.pcap", PRESS, CAPTURES / "telegrams.pcap"])
@pytest.mark.parametrize("verb", [("report", "--json"), ("report", "-v"), ("packets", "-V"), ("packets", "-T", "json")])
def test_what_is_told_of_both_is_the_same(capture: Path, verb: tuple[str, ...], tmp_path: Path) -> None:
    converted(capture, tmp_path / "x.mcap")
    told = [
        run_text(*verb, path, environment={"COLUMNS": "120"}).stdout.splitlines()
        for path in (capture, tmp_path / "x.mcap")
    ]
    others = ('"path"', '"format"', '"bytes"', f"  {capture}", f"  {tmp_path}")
    expected, found = ([line for line in lines if not line.strip().startswith(others) and not
                        line.startswith(others)] for lines in told)  # fmt: skip
    assert found == expected
    assert len(found) >= len(told[1]) - 4


def test_the_chosen_frames_are_written(tmp_path: Path) -> None:
    told = converted(PLANT, tmp_path / "x.mcap", "-Y", "nv.index == 7")
    assert told == f"nvscope: 702 of 1212 frames in {tmp_path / 'x.mcap'}.\n"
    report = json.loads(run_text("report", "--json", tmp_path / "x.mcap").stdout)
    assert [one["key"] for one in report["lists"]] == ["udp/1202/7"]


def test_a_span_of_time_is_written(tmp_path: Path) -> None:
    converted(PLANT, tmp_path / "x.mcap", "--from-time", "5s", "--to-time", "6s")
    first = frames_of(PLANT)[0].ts_ns
    expected = [one for one in frames_of(PLANT) if 5 * 10**9 <= one.ts_ns - first <= 6 * 10**9]
    assert frames_of(tmp_path / "x.mcap") == expected


def test_what_a_format_cannot_hold_is_told(tmp_path: Path) -> None:
    assert "mcap has no place for comments (2)" in converted(CAPTURES / "interfaces.pcapng", tmp_path / "x.mcap")
    assert "; comments (1)" in converted(tmp_path / "x.mcap", tmp_path / "x.pcap", "-Y", "eth")
    converted(PRESS, tmp_path / "y.mcap", "--gvl", str(CAPTURES / "can" / "press.gvl"))
    told = converted(tmp_path / "y.mcap", tmp_path / "y.pcap")
    assert "pcap has no place for the names of the interfaces (" in told
    assert "attachments (press.gvl)" in told


def test_that_nobody_captured_between_two_files_is_told(tmp_path: Path) -> None:
    """In one file it looks as if everybody had been silent."""
    day_ns = 86_400 * 10**9
    monday = write(tmp_path / "a.pcap", steady(10))
    tuesday = write(tmp_path / "b.pcap", [one._replace(ts_ns=one.ts_ns + day_ns) for one in steady(10)])
    done = run_text("convert", monday, tuesday, "-w", tmp_path / "c.mcap")
    assert (done.returncode, "2 recordings, with up to 1 d 00 h between them" in done.stderr) == (0, True)
    assert "recordings" not in converted(monday, tmp_path / "d.mcap")


def test_frames_that_a_format_cannot_hold_leave_nothing_behind(tmp_path: Path) -> None:
    done = run_text("convert", PLANT, PRESS, "-w", tmp_path / "x.pcap")
    assert done.returncode == 2
    assert "another link type" in done.stderr
    done = run_text("convert", PLANT, "-w", tmp_path / "x.log")
    assert done.returncode == 2
    assert str(tmp_path / "x.log") in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_inputs_stay_as_they_are(tmp_path: Path) -> None:
    path = write(tmp_path / "x.mcap", steady(3))
    before = path.read_bytes()
    for options in ((), ("--force",)):
        done = run_text("convert", path, "-w", path, *options)
        assert (done.returncode, path.read_bytes()) == (2, before)
        assert "the output is one of the inputs" in done.stderr


def test_it_says_what_is_missing() -> None:
    assert "no file to write is named" in run_text("convert", PLANT).stderr
    done = run_text("convert", PLANT, "-w", "x.docx")
    assert (done.returncode, "no capture format has the suffix '.docx'" in done.stderr) == (2, True)


def test_a_cut_capture_is_converted_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = write(tmp_path / "x.mcap", *([one] for one in steady(10)), flushed=True)
    whole.write_bytes(whole.read_bytes()[:-900])
    done = run_text("convert", whole, "-w", tmp_path / "y.pcap")
    assert done.returncode == 3
    assert "cut short" in done.stderr
    assert frames_of(tmp_path / "y.pcap") == frames_of(whole)


def test_definitions_come_with_a_recording(tmp_path: Path) -> None:
    converted(PEERS / "peers.pcap", tmp_path / "x.mcap", "--gvl", str(PEERS))
    given = run("vars", PEERS / "peers.pcap", "--gvl", PEERS)
    assert run("vars", tmp_path / "x.mcap", cwd=tmp_path).stdout == given.stdout
    converted(tmp_path / "x.mcap", tmp_path / "y.mcap")
    assert run("vars", tmp_path / "y.mcap", cwd=tmp_path).stdout == given.stdout
    assert [one.name for one in open_source([str(tmp_path / "y.mcap")]).attachments] == [
        "axis.gvl", "axis_types.st", "batch.gvl", "counters.gvl", "recipe.gvl",
    ]  # fmt: skip


def test_a_project_comes_with_a_recording_and_others_take_its_place(tmp_path: Path) -> None:
    plant, elsewhere = tmp_path / "plant", tmp_path / "elsewhere"
    for folder in (plant, elsewhere):
        folder.mkdir()
    (plant / "plc").mkdir()
    (plant / "plc" / "axis.gvl").write_bytes((PEERS / "axis.gvl").read_bytes())
    (plant / "plc" / "types.st").write_bytes((PEERS / "axis_types.st").read_bytes())
    (plant / "nvscope.toml").write_text('definitions = ["plc/*"]\n[nodes]\n"10.77.0.1" = { name = "press" }\n')
    done = run_text("convert", PEERS / "peers.pcap", "-w", elsewhere / "x.mcap", cwd=plant)
    assert done.returncode == 0, done.stderr
    told = run_text("report", elsewhere / "x.mcap", cwd=elsewhere).stdout
    assert "press" in told
    assert "axis" in told
    (elsewhere / "nvscope.toml").write_text('[nodes]\n"10.77.0.1" = { name = "saw" }\n')
    told = run_text("report", elsewhere / "x.mcap", cwd=elsewhere).stdout
    assert ("press" in told, "saw" in told, "axis" in told) == (False, True, True)
    batch = run_text("vars", elsewhere / "x.mcap", "--gvl", PEERS / "batch.gvl", cwd=elsewhere).stdout
    assert ("batch" in batch, "axis" in batch) == (True, False)


def test_a_mistake_in_an_attached_definition_is_told_by_its_place(tmp_path: Path) -> None:
    path, packets = tmp_path / "x.mcap", frames_of(PEERS / "peers.pcap")
    with open_sink(str(path)) as sink:
        sink.attach(Attachment("plc/a.gvl", "text/plain", (PEERS / "batch.gvl").read_bytes))
        sink.attach(Attachment("plc/b.gvl", "text/plain", lambda: b"VAR_GLOBAL\n x : \nEND_VAR\n"))
        sink.write(batch([one._replace(channel=0) for one in packets]))
    done = run_text("vars", path, cwd=tmp_path)
    assert f"left out: {path}/plc/b.gvl, line 3" in done.stderr
    assert "batch" in done.stdout


def test_a_mistake_in_a_definition_that_is_not_attached_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.gvl").write_bytes((PEERS / "batch.gvl").read_bytes())
    (tmp_path / "b.gvl").write_text("VAR_GLOBAL\n x : \nEND_VAR\n")
    told = converted(PEERS / "peers.pcap", tmp_path / "x.mcap", "--gvl", str(tmp_path))
    assert "b.gvl, line 3" in told
    assert [one.name for one in open_source([str(tmp_path / "x.mcap")]).attachments] == ["a.gvl"]


def comments_of(path: Path) -> list[tuple[int | None, str]]:
    source = open_source([str(path)])
    for _ in source:
        pass
    return list(source.infos[0].comments)


def test_comments_go_with_their_frames(tmp_path: Path) -> None:
    remark = "first telegram after the restart of the press"
    source = CAPTURES / "interfaces.pcapng"
    own = [entry for entry in comments_of(source) if entry[0] is not None]
    assert own == [(2, remark)]
    for origin, target in pairwise([source, tmp_path / "a.mcap", tmp_path / "b.pcapng", tmp_path / "c.mcap"]):
        converted(origin, target)
        assert comments_of(target) == own
        assert frames_of(target) == frames_of(source)


def test_chosen_frames_that_show_a_finding_say_so(tmp_path: Path) -> None:
    told = converted(PLANT, tmp_path / "x.pcapng", "-Y", "nv.index == 7")
    assert told.startswith("nvscope: 702 of")
    found = json.loads(run_text("report", "--json", PLANT).stdout)["findings"]
    gap = next(one for one in found if one["code"] == "NV201")
    said = [number for number, text in comments_of(tmp_path / "x.pcapng") if text.startswith("NV201")]
    chosen, whole = frames_of(tmp_path / "x.pcapng"), frames_of(PLANT)
    assert [chosen[(number or 0) - 1] for number in said] == [whole[frame - 1] for frame in gap["frames"]]
    converted(tmp_path / "x.pcapng", tmp_path / "y.mcap")
    converted(tmp_path / "y.mcap", tmp_path / "z.pcapng")
    assert (tmp_path / "z.pcapng").read_bytes() == (tmp_path / "x.pcapng").read_bytes()


def test_what_others_attach_need_be_no_definition(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with open_sink(str(path)) as sink:
        sink.attach(Attachment("notes.gvl", "text/plain", lambda: b"hello"))
        sink.write(batch([one._replace(channel=0) for one in frames_of(PEERS / "peers.pcap")]))
    done = run_text("report", path, cwd=tmp_path)
    assert (done.returncode, "what is attached is left out" in done.stderr) == (0, True), done.stderr
    assert "batch" in run_text("vars", path, "--gvl", PEERS / "batch.gvl", cwd=tmp_path).stdout


def test_the_name_says_the_format_also_where_it_is_a_link(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").symlink_to(tmp_path / "real")
    converted(PLANT, tmp_path / "x.mcap")
    assert read(tmp_path / "real").info.format == "mcap"
