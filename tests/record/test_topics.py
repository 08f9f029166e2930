"""Topics of recordings: what real senders sent is what other tools read, and each message is as its schema says."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import SeekingReader

from nvscope.capture.open import open_source
from tests.capture.mcap.recordings import Packet, packets_of, read, write
from tests.oracle.builders import data_frame, telegram
from tests.program import run_text

CAPTURES = Path(__file__).parents[2] / "captures"
PEERS = CAPTURES / "peers"


class Topic(NamedTuple):
    """What the reference library tells of a topic: its schema, and its messages with their times."""

    title: str
    schema: dict[str, Any]
    messages: list[dict[str, Any]]
    times_ns: list[int]


def topics_of(path: Path) -> dict[str, Topic]:
    """Return the topics of lists, by name; those of the packets are left out."""
    found: dict[str, Topic] = {}
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        for channel in summary.channels.values():
            if channel.topic.startswith("/nv/"):
                assert channel.message_encoding == "json"
                schema = summary.schemas[channel.schema_id]
                assert schema.encoding == "jsonschema"
                found[channel.topic] = Topic(schema.name, json.loads(schema.data), [], [])
        for _, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic in found:
                found[channel.topic].messages.append(json.loads(message.data))
                found[channel.topic].times_ns.append(message.log_time)
    return found


def recorded(capture: Path, definitions: Path, tmp_path: Path, verb: str = "record") -> dict[str, Topic]:
    path = tmp_path / "x.mcap"
    done = run_text(verb, capture, "--gvl", definitions, "-w", path)
    assert done.returncode == 0, done.stderr
    topics = topics_of(path)
    for topic in topics.values():
        Draft202012Validator.check_schema(topic.schema)
        validator = Draft202012Validator(_closed(topic.schema))
        assert [error.message for one in topic.messages for error in validator.iter_errors(one)] == []
    return topics


def _closed(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema that allows nothing which it does not name; what is null in an array is of another telegram."""
    if schema.get("type") == "object":
        properties = {name: _closed(one) for name, one in schema["properties"].items()}
        return schema | {"properties": properties, "additionalProperties": False}
    if schema.get("type") == "array":
        return schema | {"items": {"anyOf": [_closed(schema["items"]), {"type": "null"}]}}
    if schema["type"] == "number":
        return schema | {"type": ["number", "null"]}
    return schema | {"oneOf": [{}]} if "oneOf" in schema else schema


def joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the variables of several telegrams together."""
    found: dict[str, Any] = {}
    for part in parts:
        for name, value in part.items():
            if name == "_nv":
                continue
            before = found.get(name)
            found[name] = value
            if isinstance(value, list) and isinstance(before, list):
                found[name] = [new if old is None else old for old, new in zip(before, value, strict=True)]
    return found


@pytest.mark.parametrize("verb", ["record", "convert"])
@pytest.mark.parametrize(("log", "name", "parts"), [
    ("sent-codesys-client.json", "/nv/udp/1202/1", 1), ("sent-codesys-client.json", "/nv/udp/1202/7", 3),
    ("sent-node-red.json", "/nv/udp/1202/42", 1),
])  # fmt: skip
def test_messages_are_what_was_sent(log: str, name: str, parts: int, verb: str, tmp_path: Path) -> None:
    topic = recorded(PEERS / "peers.pcap", PEERS, tmp_path, verb)[name]
    number = int(name.rpartition("/")[2])
    sent = [entry["v"] for entry in json.loads((PEERS / log).read_text()) if entry["list"] == number]
    messages = [
        joined(topic.messages[begin : begin + parts]) for begin in range(0, len(topic.messages), parts)
    ]  # fmt: skip
    assert len(messages) > 40
    for told, expected in zip(messages, sent, strict=False):
        assert _as_sent(told) == _as_sent({**expected, **({"t": expected["t"] * 1_000_000} if "t" in expected else {})})


def _as_sent(value: Any) -> Any:
    """Return values with numbers as REAL has them, which is what nine digits tell."""
    if isinstance(value, dict):
        return {name: _as_sent(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_as_sent(one) for one in value]
    if isinstance(value, float):
        return struct.unpack("<f", struct.pack("<f", value))[0]
    return value


def test_each_telegram_is_a_message_at_its_time_and_tells_where_it_is_from(tmp_path: Path) -> None:
    topics = recorded(PEERS / "peers.pcap", PEERS, tmp_path)
    times = [packet.ts_ns for part in open_source([str(PEERS / "peers.pcap")]) for packet in packets_of(part)]
    told = run_text("packets", PEERS / "peers.pcap", "-Y", "nv.service == 0 && nv.index in {1, 7, 42}", "-T", "json")
    shown = {int(one["frame.number"]): one for one in json.loads(told.stdout)} if told.stdout.startswith("[") else {}
    for topic in topics.values():
        for message, time_ns in zip(topic.messages, topic.times_ns, strict=True):
            origin = message["_nv"]
            assert times[origin["frame"] - 1] == time_ns
            if origin["frame"] in shown:
                assert shown[origin["frame"]]["ip.src"] == origin["sender"]


EVERYTHING = """<GVL>
  <Declarations><![CDATA[TYPE Mode : (STOP := 0, RUN := 5, TEST) UINT; END_TYPE
TYPE Inner : STRUCT a : INT; b : ARRAY[1..2, 0..1] OF SINT; END_STRUCT END_TYPE
VAR_GLOBAL
  x : BOOL; big : LINT; bits : LWORD; few : REAL; many : LREAL; dur : TIME; long : LTIME; day : TOD;
  day2 : DATE; when : DT; text : STRING(7); wide : WSTRING(3); mode : Mode; s : ARRAY[0..1] OF Inner;
  "100%" : BYTE;
END_VAR]]></Declarations>
  <NetvarSettings Protocol="UDP">
    <ListIdentifier>9</ListIdentifier>
    <Pack>True</Pack>
    <Checksum>False</Checksum>
    <Acknowledge>False</Acknowledge>
    <CyclicTransmission>True</CyclicTransmission>
    <TransmissionOnChange>False</TransmissionOnChange>
    <TransmissionOnEvent>False</TransmissionOnEvent>
    <Interval>T#50ms</Interval>
    <MinGap>T#20ms</MinGap>
  </NetvarSettings>
</GVL>
""".replace('  "100%" : BYTE;\n', "")


def _everything(few: float, many: float, mode: int) -> bytes:
    data = struct.pack(
        "<?qQfdIqIII", True, -(1 << 62), (1 << 64) - 1, few, many, 1500, 10**15, 3_600_000, 86_400, 86_401
    )
    data += b'a"\x01\xe4\0\0\0\0' + "aä\u20ac\0".encode("utf-16-le") + struct.pack("<H", mode)
    for number in range(2):
        data += struct.pack("<hbbbb", -number, *range(4 * number, 4 * number + 4))
    return telegram(list_id=9, items=23, data=data)


def test_every_type_has_its_form(tmp_path: Path) -> None:
    (tmp_path / "all.gvl").write_text(EVERYTHING)
    payloads = [_everything(0.1, 0.1, 5), _everything(float("nan"), float("inf"), 77)]
    frames = [
        Packet(frame.data, frame.original, frame.ts_ns, frame.link)
        for frame in (data_frame(10**18 + n, "10.0.0.1", "10.0.0.255", one) for n, one in enumerate(payloads))
    ]
    capture = write(tmp_path / "x.pcap", frames)
    (topic,) = recorded(capture, tmp_path / "all.gvl", tmp_path).values()
    first, second = topic.messages
    assert first == {
        "_nv": {"sender": "10.0.0.1", "subindex": 0, "frame": 1},
        "x": True, "big": str(-(1 << 62)), "bits": str((1 << 64) - 1), "few": 0.1, "many": 0.1, "dur": 1_500_000_000,
        "long": str(10**15), "day": 3_600 * 10**9, "day2": "1970-01-02T00:00:00.000000000",
        "when": "1970-01-02T00:00:01.000000000", "text": "a\"\x01ä", "wide": "aä€", "mode": 5,
        "s": [{"a": 0, "b": [0, 1, 2, 3]}, {"a": -1, "b": [4, 5, 6, 7]}],
    }  # fmt: skip
    assert (second["few"], second["many"], second["mode"]) == (None, None, 77)
    properties = topic.schema["properties"]
    assert topic.title == "all"
    assert properties["mode"]["oneOf"] == [
        {"title": "STOP", "const": 0}, {"title": "RUN", "const": 5}, {"title": "TEST", "const": 6},
    ]  # fmt: skip
    assert (properties["big"]["type"], properties["dur"]["description"]) == ("string", "TIME, nanoseconds")
    b = properties["s"]["items"]["properties"]["b"]
    assert (b["items"]["type"], b["description"]) == ("integer", "[1..2, 0..1]")


def test_arrays_of_arrays_and_what_is_in_other_telegrams(tmp_path: Path) -> None:
    text = EVERYTHING.replace("<Pack>True", "<Pack>False").replace(
        EVERYTHING[EVERYTHING.index("  x : BOOL") : EVERYTHING.index("END_VAR")],
        "  a : ARRAY[0..1] OF ARRAY[1..2] OF INT; s : ARRAY[0..1] OF Inner;\n",
    )
    (tmp_path / "two.gvl").write_text(text)
    sent = [telegram(list_id=9, subindex=5, data=b"\7"), telegram(list_id=9, subindex=2, data=b"\2\0")]
    frames = [
        Packet(frame.data, frame.original, frame.ts_ns, frame.link)
        for frame in (data_frame(10**18 + n, "10.0.0.1", "10.0.0.255", one) for n, one in enumerate(sent))
    ]
    (topic,) = recorded(write(tmp_path / "x.pcap", frames), tmp_path / "two.gvl", tmp_path).values()
    assert [{key: value for key, value in one.items() if key != "_nv"} for one in topic.messages] == [
        {"s": [{"b": [7, None, None, None]}, {}]}, {"a": [None, None, 2, None]},
    ]  # fmt: skip
    assert topic.schema["properties"]["a"]["description"] == "[0..1][1..2]"


def test_lists_on_can_have_topics_by_channel_and_identifier(tmp_path: Path) -> None:
    topics = recorded(CAPTURES / "can" / "press.log", CAPTURES / "can" / "press.gvl", tmp_path)
    (name,) = topics
    assert name == "/nv/can/can0/0x110"
    report = json.loads(run_text("report", "--json", CAPTURES / "can" / "press.log", "--gvl", CAPTURES / "can").stdout)
    sent = next(one for one in report["lists"] if one["name"] == "press")
    assert len(topics[name].messages) == sum(stream["telegrams"] for stream in sent["streams"])
    assert all(set(one) <= {"_nv", "v0", "v1", "v2", "v3", "v4"} for one in topics[name].messages)


def test_recordings_are_read_without_their_topics(tmp_path: Path) -> None:
    recorded(PEERS / "peers.pcap", PEERS, tmp_path)
    expected = [one for part in open_source([str(PEERS / "peers.pcap")]) for one in packets_of(part)]
    assert read(tmp_path / "x.mcap").packets == expected


def test_without_topics_where_nobody_wants_them(tmp_path: Path) -> None:
    done = run_text("record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", tmp_path / "x.mcap", "--packets-only")
    assert (done.returncode, topics_of(tmp_path / "x.mcap")) == (0, {})


def test_files_that_follow_each_other_have_the_messages_of_their_packets(tmp_path: Path) -> None:
    done = run_text(
        "record", PEERS / "peers.pcap", "--gvl", PEERS, "-w", tmp_path / "y.mcap", "-b", "packets:100"
    )  # fmt: skip
    assert done.returncode == 0
    files = sorted(tmp_path.iterdir())
    assert len(files) == 9
    whole = recorded(PEERS / "peers.pcap", PEERS, tmp_path)
    for name, topic in whole.items():
        parts = [topics_of(path)[name] for path in files]
        assert [one for part in parts for one in part.messages] == topic.messages
    for path in files:
        times = [packet.ts_ns for packet in read(path).packets]
        for time_ns in _times(topics_of(path)):
            assert times[0] <= time_ns <= times[-1]


def _times(topics: dict[str, Topic]) -> Iterator[int]:
    for topic in topics.values():
        yield from topic.times_ns


def test_a_list_on_two_buses_has_a_topic_of_each(tmp_path: Path) -> None:
    log = (CAPTURES / "can" / "press.log").read_text()
    both = tmp_path / "both.log"
    both.write_text("".join(f"{line}\n{line.replace(' can0 ', ' can7 ')}\n" for line in log.splitlines()))
    topics = recorded(both, CAPTURES / "can" / "press.gvl", tmp_path)
    assert sorted(topics) == ["/nv/can/can0/0x110", "/nv/can/can7/0x110"]
    assert len({len(topic.messages) for topic in topics.values()}) == 1
