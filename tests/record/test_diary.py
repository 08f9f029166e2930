"""What a recording tells of a plant: figures as ``watch --json`` prints them, causes and findings when they begin."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import NonSeekingReader, SeekingReader

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import scenes_by_second
from nvscope.definition.project import Project
from nvscope.record.diary import Diary
from tests.program import run_text

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "captures" / "plant.pcapng.gz"
PEERS = ROOT / "captures" / "peers"
PRESS = ROOT / "captures" / "can" / "press.log"


def told_in(path: Path, topic: str) -> tuple[str, dict[str, Any], list[tuple[int, dict[str, Any]]]]:
    """Return the name of a topic's schema, the schema, and the messages with their times."""
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        (channel,) = (one for one in summary.channels.values() if one.topic == topic)
        schema = summary.schemas[channel.schema_id]
        found = [
            (message.log_time, json.loads(message.data))
            for _, _, message in reader.iter_messages(topics=[topic], log_time_order=False)
        ]
        return schema.name, json.loads(schema.data), found


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("r") / "x.mcap"
    done = run_text("record", PLANT, "-w", path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="module")
def watched() -> list[dict[str, Any]]:
    return [json.loads(line) for line in run_text("watch", PLANT, "--json").stdout.splitlines()]


def test_figures_are_those_that_watch_prints(recording: Path, watched: list[dict[str, Any]]) -> None:
    name, schema, found = told_in(recording, "/nvscope/figures")
    assert name == "nvscope.figures"
    properties = schema["properties"]["lists"]["items"]["properties"]
    assert [time_ns for time_ns, _ in found] == [int(line["at_ns"]) for line in watched]
    for (_, told), line in zip(found, watched, strict=True):
        assert set(told) == set(schema["properties"])
        assert (told["frames"], told["telegrams"], told["drops"]) == (line["frames"], line["telegrams"], line["drops"])
        assert [
            {key: entry[key] for key in ("key", "status", "telegrams", "lost", "per_s")} for entry in told["lists"]
        ] == line["lists"]
        assert all(set(entry) == set(properties) for entry in told["lists"])


def test_of_a_capture_causes_are_logged_at_the_times_at_which_they_began_and_were_over(recording: Path) -> None:
    """All of them is known when it is recorded: so none is told late, or as what it turns out not to be."""
    name, schema, found = told_in(recording, "/nvscope/log")
    assert name == "foxglove.Log"
    Draft202012Validator.check_schema(schema)
    causes = json.loads(run_text("report", "--json", PLANT).stdout)["causes"]
    begun = [(int(one["since_ns"]), one["kind"]) for one in causes]
    over = [(int(one["until_ns"]), f"{one['title']}: over") for one in causes if one["until_ns"]]
    told = [(time_ns, one) for time_ns, one in found if not one["name"].startswith("NV")]
    assert sorted((time_ns, one["name"]) for time_ns, one in told if one["level"] > 2) == sorted(begun)
    assert sorted((time_ns, one["message"]) for time_ns, one in told if one["level"] == 2) == sorted(over)
    for time_ns, one in told:
        assert one["timestamp"]["sec"] * 10**9 + one["timestamp"]["nsec"] == time_ns


def test_all_is_in_the_order_of_time(recording: Path, tmp_path: Path) -> None:
    """Packets, variables, figures and log: tools that look through a recording complain of others."""
    both = [PRESS, PRESS.with_name("press.gvl"), PLANT]
    for name, words in (("p", [PEERS / "peers.pcap", "--gvl", PEERS]), ("can", [PRESS]), ("both", both)):
        assert run_text("record", *words, "-w", tmp_path / f"{name}.mcap").returncode == 0
    for path in (recording, *tmp_path.glob("*.mcap")):
        with path.open("rb") as file:
            times = [
                message.log_time for _, _, message in NonSeekingReader(file).iter_messages(log_time_order=False)
            ]  # fmt: skip
        assert len(times) > 20
        assert times == sorted(times), path


def test_of_a_plant_that_is_watched_causes_are_logged_when_they_are_seen(watched: list[dict[str, Any]]) -> None:
    diary, said = Diary(), []
    for scene in scenes_by_second(Inquiry([str(PLANT)], Project())):
        for topic, text, time_ns in diary.entries(scene):
            told = json.loads(text)
            if topic == "/nvscope/log" and not told["name"].startswith("NV"):
                said.append((time_ns, told))
    begun = [(int(line["at_ns"]), one["kind"], one["title"]) for line in watched for one in line["causes_new"]]
    found = [(time_ns, told["name"], told["message"]) for time_ns, told in said if told["level"] > 2]
    assert len(found) == len(begun)
    for (time_ns, kind, message), (at_ns, expected, title) in zip(found, begun, strict=True):
        assert (time_ns, kind) == (at_ns, expected)
        assert message.startswith(title)
        assert ". Next: " in message
    (over,) = (told for _, told in said if told["message"].endswith("13.0 s: over"))
    assert (over["level"], over["name"], over["file"]) == (2, "reader-silent", "udp/1202/3")


def test_findings_are_logged_once_with_their_list_and_first_frame(recording: Path) -> None:
    _, schema, found = told_in(recording, "/nvscope/log")
    findings = [told for _, told in found if told["name"].startswith("NV")]
    assert len({(one["name"], one["file"], one["line"], one["message"]) for one in findings}) == len(findings)
    (gap,) = (one for one in findings if one["name"] == "NV201")
    assert (gap["file"], gap["line"], gap["level"]) == ("udp/1202/7", 278, 4)
    assert schema["properties"]["level"]["oneOf"][4] == {"title": "ERROR", "const": 4}
    for told in findings:
        assert set(told) == set(schema["properties"])
        assert 0 <= told["timestamp"]["nsec"] < 1_000_000_000


def test_of_buses_too(tmp_path: Path) -> None:
    assert run_text("record", PRESS, "--gvl", PRESS.with_name("press.gvl"), "-w", tmp_path / "x.mcap").returncode == 0
    _, _, found = told_in(tmp_path / "x.mcap", "/nvscope/figures")
    last = {entry["key"]: entry for entry in found[-1][1]["lists"]}
    assert last["can/can0/272"]["name"] == "press"
    assert last["can/can0/272"]["lost"] is None


def test_each_file_of_a_series_has_the_topics(tmp_path: Path) -> None:
    assert run_text("record", PLANT, "-w", tmp_path / "x.mcap", "-b", "duration:10").returncode == 0
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    times = [time_ns for path in files for time_ns, _ in told_in(path, "/nvscope/figures")[2]]
    assert times == sorted(times)
    assert len(times) == 30
