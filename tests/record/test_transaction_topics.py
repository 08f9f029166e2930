"""Topics of transactions: who asked what of whom is what other tools read, and no packet is lost or changed by it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from mcap.reader import SeekingReader

from dissectors.batch import I64, PacketBatch
from nvscope.capture.mcap.sink import McapSink
from nvscope.definition.model import Definition
from nvscope.engine.run import run
from nvscope.record import transaction_topics
from nvscope.record.recorded_topics import RecordedTopics
from nvscope.record.recorder import Beside, Recorder
from nvscope.record.transaction_topics import TransactionTopics
from tests.analysis.transactions.talk import ESCAPES, PANEL, PRESS, SERVICE, both, sdo_talk, visu_talk
from tests.capture.mcap.recordings import Packet, packets_of, read, write
from tests.laws import examples
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import parameter_traffic
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import Batches, batch_of, cut
from tests.program import run_text
from tests.tracker.visu.followed import followed, reading
from tests.tracker.visu.followed import told as told_of
from tests.tracker.visu.test_leaving import closed_ns, other, wrote
from tests.tracker.visu.test_rules import later

SDO, VISU = f"/sdo/{PRESS}/1202", f"/visu/{PRESS}/80"
PROJECT = """[parameters]
"10.0.0.5/0x2000:1" = { name = "Ramp", type = "INT" }
"""


class Notes:
    """A sink that keeps what it is told, and when: topics, messages, and packets by their number."""

    def __init__(self) -> None:
        self.topics: dict[str, dict[str, Any]] = {}
        self.messages_of: list[tuple[str, dict[str, Any], int, int]] = []
        self.packets = 0

    def topic(self, topic: str, title: str, schema: bytes) -> None:
        assert topic not in self.topics
        self.topics[topic] = json.loads(schema)

    def messages(self, topics: Sequence[str], texts: Sequence[bytes], numbers: I64, ts_ns: I64) -> None:
        told = zip(topics, map(json.loads, texts), numbers.tolist(), ts_ns.tolist(), strict=True)
        self.messages_of += told

    def write(self, batch: PacketBatch) -> None:
        self.packets += len(batch)


def noted(batches: Sequence[PacketBatch]) -> Notes:
    """Return what a sink is told of batches."""
    notes = Notes()
    topics = RecordedTopics.of(Definition(()), None)
    topics.declare(notes)  # type: ignore[arg-type]
    for told in run(Batches(batches), reading(), [_ByStream()]):
        topics.observe(told)
        if len(told):
            frames = np.arange(told.first_frame, told.first_frame + len(told))
            topics.write_with(notes, told.packets, frames)  # type: ignore[arg-type]
    return notes


class _ByStream:
    by_stream = True

    def observe(self, told: Any) -> None:
        pass


def written(path: Path, frames: Sequence[Frame]) -> Path:
    return write(path, [Packet(one.data, one.original, one.ts_ns, one.link) for one in frames])


def messages_in(path: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    """Return what the reference library reads: times and messages by topic, each as its schema says."""
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in SeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False):
            if channel.topic.startswith(("/sdo/", "/visu/")):
                assert schema is not None
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                told = json.loads(message.data)
                validator = Draft202012Validator(json.loads(schema.data) | {"additionalProperties": False})
                assert [error.message for error in validator.iter_errors(told)] == []
                found.setdefault(channel.topic, []).append((message.log_time, told))
    return found


@pytest.mark.parametrize("verb", ["record", "convert"])
def test_the_reference_library_reads_who_asked_what_of_whom(verb: str, tmp_path: Path) -> None:
    frames = both()
    capture = written(tmp_path / "x.pcap", frames)
    (tmp_path / "x.toml").write_text(PROJECT)
    done = run_text(verb, capture, "--project", tmp_path / "x.toml", "-w", tmp_path / "x.mcap")
    assert done.returncode == 0, done.stderr
    found = messages_in(tmp_path / "x.mcap")
    assert set(found) == {SDO, VISU}
    for topic in found.values():
        for time_ns, told in topic:
            if told["outcome"] != "unanswered":
                assert frames[told["_nv"]["frame"] - 1].ts_ns == time_ns
    asked = [one for _, one in found[SDO]]
    assert [(one["operation"], one["outcome"], one["values"], one.get("old")) for one in asked] == [
        ("read", "answered", {"Ramp": 5}, None), ("write", "open", {"Ramp": 6}, {"Ramp": 5}),
        ("write", "confirmed", {"Ramp": 6}, {"Ramp": 5}), ("write", "open", {"Ramp": 7}, {"Ramp": 6}),
        ("write", "refused", {"Ramp": 7}, {"Ramp": 6}), ("read", "unanswered", {"0x2001:1": None}, None),
        ("read", "unexpected", {"Ramp": 6}, None),
    ]  # fmt: skip
    assert {(one["client"], one["server"], one["port"]) for one in asked} == {(SERVICE, PRESS, 1202)}
    assert [one.get("detail") for one in asked if one["outcome"] == "refused"] == ["ODErrorReplyAccess"]
    pages = [one for _, one in found[VISU]]
    assert pages[0] == {
        "_nv": {"frame": pages[0]["_nv"]["frame"], "request_frame": pages[0]["_nv"]["request_frame"]},
        "client": PANEL, "server": PRESS, "port": 80, "operation": "read", "outcome": "answered",
        "latency_ns": 1_000_000,
        "values": {"PRG.rSpeed": 21.5, ".CurrentPassword": "(hidden)", "PRG.sText": "on"},
    }  # fmt: skip
    assert "secret" not in json.dumps(pages)


def test_a_recording_with_them_replays_its_packets_and_nothing_else(tmp_path: Path) -> None:
    capture = written(tmp_path / "x.pcap", both())
    for name, options in (("x.mcap", ()), ("bare.mcap", ("--packets-only",))):
        assert run_text("record", capture, "-w", tmp_path / name, "-q", *options).returncode == 0
        assert read(tmp_path / name).packets == read(capture).packets
    assert messages_in(tmp_path / "bare.mcap") == {}


def recording(path: Path, batches: Sequence[PacketBatch]) -> Path:
    """Record batches, each of which is in the file before the next one comes."""
    topics = RecordedTopics.of(Definition(()), None)
    with McapSink(str(path)) as sink:
        topics.declare(sink)
        for told in run(Batches(batches), reading(), [_ByStream()]):
            topics.observe(told)
            topics.write_with(sink, told.packets, np.arange(told.first_frame, told.first_frame + len(told)))
            sink.flush()
    return path


def test_a_recording_that_was_cut_anywhere_replays_what_is_whole(tmp_path: Path) -> None:
    frames = both()
    path = recording(tmp_path / "x.mcap", cut(batch_of(frames), 5))
    packets, whole = read(path).packets, path.read_bytes()
    assert packets == packets_of(batch_of(frames))
    assert len(messages_in(path)) == 2
    most = 0
    for stop in range(len(whole) // 3, len(whole), 97):
        (tmp_path / "cut.mcap").write_bytes(whole[:stop])
        found = read(tmp_path / "cut.mcap").packets
        assert found == packets[: len(found)]
        assert len(found) >= most
        most = len(found)
    assert most == len(packets)


def test_files_that_follow_each_other_have_the_topics_of_their_packets(tmp_path: Path) -> None:
    capture = written(tmp_path / "x.pcap", both())
    assert run_text("record", capture, "-w", tmp_path / "whole.mcap", "-q").returncode == 0
    whole = messages_in(tmp_path / "whole.mcap")
    (tmp_path / "parts").mkdir()
    done = run_text("record", capture, "-w", tmp_path / "parts" / "y.mcap", "-b", "packets:6", "-q")
    assert done.returncode == 0
    files = sorted((tmp_path / "parts").iterdir())
    assert len(files) > 3
    parts = [messages_in(path) for path in files]
    assert {name: [one for part in parts for one in part.get(name, [])] for name in whole} == whole


@examples(40)
@given(seed=st.integers(0, 20_000), size=st.integers(1, 60), of_pages=st.booleans())
def test_however_a_capture_is_cut_the_topics_are_the_same(seed: int, size: int, of_pages: bool) -> None:
    frames = later(visu_traffic(seed)) if of_pages else parameter_traffic(seed)
    if frames:
        whole, parts = noted([batch_of(frames)]), noted(cut(batch_of(frames), size))
        assert (parts.topics, parts.messages_of, parts.packets) == (whole.topics, whole.messages_of, len(frames))


def test_what_nobody_answered_is_told_with_the_packet_that_shows_it_or_the_next_one() -> None:
    frames = sdo_talk()
    ends = [batch_of(frames[:7]), PacketBatch.nothing(frames[6].ts_ns + 10**9), batch_of(frames[7:])]
    told, whole = (
        [(one["outcome"], frame, time_ns) for _, one, frame, time_ns in noted(batches).messages_of]
        for batches in (ends, [batch_of(frames)])
    )
    assert told[-2:] == [("unanswered", 7, frames[6].ts_ns + 500_000_000), ("unexpected", 8, frames[7].ts_ns)]
    assert told == whole


@pytest.mark.parametrize("pages_go_on", [False, True])
def test_a_client_that_gave_up_is_told_when_the_report_says_so(tmp_path: Path, pages_go_on: bool) -> None:
    """Only network variables go on, and, it may be, web traffic long behind that: it is told once, and as soon."""
    line = wrote()
    over_ns = closed_ns(line) + 10 * SECOND
    frames = [*line.frames, *(other(line.now + second * SECOND) for second in range(14))]
    if pages_go_on:
        frames += Line(("10.0.0.2", 50_000), now=line.now + 20 * SECOND).open().frames
    done = run_text("record", written(tmp_path / "x.pcap", frames), "-w", tmp_path / "x.mcap")
    assert done.returncode == 0, done.stderr
    (topic,) = messages_in(tmp_path / "x.mcap").values()
    assert [(time_ns, one["outcome"]) for time_ns, one in topic] == [
        (line.frames[3].ts_ns, "open"), (over_ns, "unanswered"),
    ]  # fmt: skip
    assert topic[1][1]["values"] == {"4,0,4,6": 9.5}
    _, findings = told_of(followed([batch_of(frames)]))
    assert {one["last_ns"] for one in findings if one["code"] == "NV805"} == {over_ns}
    for size in (1, 2, 5):
        assert noted(cut(batch_of(frames), size)).messages_of == noted([batch_of(frames)]).messages_of


def test_where_a_clock_alone_tells_it_goes_with_the_next_packet() -> None:
    line = wrote()
    end_ns = closed_ns(line) + 10 * SECOND
    live = [batch_of(line.frames), PacketBatch.nothing(end_ns), batch_of([other(end_ns + SECOND)])]
    told_live, whole = noted(live).messages_of, noted([batch_of([*line.frames, other(end_ns + SECOND)])]).messages_of
    assert told_live == whole
    assert [(one["outcome"], frame, time_ns) for _, one, frame, time_ns in whole][-1] == ("unanswered", 4, end_ns)


def test_of_frames_that_are_chosen_their_transactions_are_there_alone(tmp_path: Path) -> None:
    capture = written(tmp_path / "x.pcap", both())
    done = run_text("convert", capture, "-Y", "visu.latency > 5ms", "-w", tmp_path / "x.mcap")
    assert done.returncode == 0, done.stderr
    ((name, told),) = messages_in(tmp_path / "x.mcap").items()
    assert name == VISU
    assert [one["latency_ns"] for _, one in told] == [7_000_000, 2_001_000_000]
    assert len(read(tmp_path / "x.mcap").packets) == 2


def test_each_file_of_a_flight_recorder_knows_what_is_in_it_alone(tmp_path: Path) -> None:
    later = [one._replace(ts_ns=one.ts_ns + 10**11) for one in visu_talk()]
    other = [one._replace(ts_ns=one.ts_ns + 2 * 10**11) for one in both(panel="10.0.0.9")]
    capture = written(tmp_path / "x.pcap", [*sdo_talk(), *later, *other])
    done = run_text(
        "record", capture, "--trigger", "sdo.write || visu.kind == \"write\"", "--pre", "5s", "--post", "5s",
        "-w", f"{tmp_path}/e.mcap",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    files = sorted(path for path in tmp_path.glob("e-*.mcap"))
    found = [messages_in(path) for path in files]
    assert [set(one) for one in found] == [{SDO}, {VISU}, {SDO, VISU}]
    (first,), (second,) = found[0].values(), found[1].values()
    assert [told for _, told in first] == [one for _, one in _numbered(sdo_talk())]
    assert [told for _, told in second] == [one for _, one in _numbered(later)]
    whole = _numbered(other)
    assert {name: [told for _, told in one] for name, one in found[2].items()} == {
        name: [told for topic, told in whole if topic == name] for name in (SDO, VISU)
    }


def _numbered(frames: Sequence[Frame]) -> list[tuple[str, dict[str, Any]]]:
    """Return topics and messages of frames that are counted from the first of them."""
    return [(topic, told) for topic, told, _, _ in noted([batch_of(frames)]).messages_of]


def test_what_was_said_while_nothing_was_recorded_is_not_known(tmp_path: Path) -> None:
    frames = visu_talk()
    recorder = Recorder(Beside(topics=RecordedTopics.of(Definition(()), None)), is_live=False)
    recorder.start(str(tmp_path / "a.mcap"))
    for place, _ in enumerate(run(Batches(cut(batch_of(frames), 1)), reading(), [recorder])):
        if place == 6:  # the first read is answered
            recorder.stop()
        if place == 8:  # a write, and what came of it, that nobody has recorded
            recorder.start(str(tmp_path / "b.mcap"))
    recorder.stop()
    ((_, first),) = messages_in(tmp_path / "b.mcap").items()
    assert [told.get("old") for _, told in first][:2] == [None, None]
    assert first[0][1]["values"] == {"PRG.rSpeed": 99}


def test_beyond_so_many_servers_one_topic_has_all_further_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transaction_topics, "MOST_SERVERS", 1)
    frames = [*sdo_talk(), *parameter_traffic(3), *visu_talk()]
    notes = noted([batch_of(frames)])
    assert set(notes.topics) == {SDO, "/sdo/others", VISU}
    others = {(one["server"], one["port"]) for name, one, _, _ in notes.messages_of if name == "/sdo/others"}
    assert len(others) > 1


def test_texts_from_the_network_are_plain_ascii_in_the_file() -> None:
    notes: list[bytes] = []

    class Raw(Notes):
        def messages(self, topics: Sequence[str], texts: Sequence[bytes], numbers: I64, ts_ns: I64) -> None:
            notes.extend(texts)

    topics, sink = TransactionTopics(), Raw()
    for told in run(Batches([batch_of(visu_talk(text=ESCAPES))]), reading(), [_ByStream()]):
        topics.observe(told)
        topics.write(sink, 1, 1_000)  # type: ignore[arg-type]
    assert len(notes) == 9
    assert all(0x20 <= byte < 0x7F for text in notes for byte in text)
    assert json.loads(notes[0])["values"]["PRG.sText"].startswith("\x1b[31m")
