"""The reference library (PyPI ``mcap``) reads what nvscope records, and nvscope what it writes."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from nvscope.capture.mcap.packets import ENCODING, SCHEMA_NAME, TOPIC
from nvscope.capture.open import open_sink
from nvscope.capture.source import Attachment
from nvscope.schemas.schema_files import schema_text
from tests.capture.mcap.recordings import Packet, batch, drawn_batches, read, steady, write
from tests.laws import examples


@given(batches=drawn_batches())
@examples(100)
def test_it_reads_every_record_and_every_checksum_is_right(
    batches: list[list[Packet]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = write(tmp_path_factory.mktemp("r") / "x.mcap", *batches, flushed=True)
    content = path.read_bytes()
    records = list(StreamReader(BytesIO(content), validate_crcs=True).records)
    seeking = SeekingReader(BytesIO(content), validate_crcs=True)
    summary = seeking.get_summary()
    assert summary is not None
    messages = [(message.log_time, message.data) for _, _, message in seeking.iter_messages(log_time_order=False)]
    in_order = NonSeekingReader(BytesIO(content), validate_crcs=True).iter_messages(log_time_order=False)
    assert messages == [(message.log_time, message.data) for _, _, message in in_order]
    statistics = summary.statistics
    assert statistics is not None
    assert (statistics.message_count, statistics.chunk_count) == (len(messages), len(summary.chunk_indexes))
    assert statistics.message_start_time == min(time for time, _ in messages)
    assert statistics.message_end_time == max(time for time, _ in messages)
    assert statistics.channel_message_counts == {1: len(messages)}
    assert sum(type(one).__name__ == "Chunk" for one in records) in (0, statistics.chunk_count)


def test_it_sees_topic_schema_attachments_and_metadata(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with open_sink(str(path), ["eth0"]) as sink:
        sink.attach(Attachment("plant.gvl", "text/plain", lambda: b"VAR_GLOBAL", 7))
        sink.write(batch(steady(3)))
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        (channel,) = summary.channels.values()
        assert (channel.topic, channel.message_encoding) == (TOPIC, ENCODING)
        schema = summary.schemas[channel.schema_id]
        assert (schema.name, schema.encoding) == (SCHEMA_NAME, "jsonschema")
        assert schema.data.decode() == schema_text("packets")
        (attachment,) = reader.iter_attachments()
        assert (attachment.name, attachment.create_time, attachment.data) == ("plant.gvl", 7, b"VAR_GLOBAL")
        told = {one.name: one.metadata for one in reader.iter_metadata()}
        assert told["nvscope"]["format"] == "1"
        assert told["nvscope.interfaces"] == {"0": "eth0"}
        header = reader.get_header()
        assert (header.profile, header.library.split()[0]) == ("", "nvscope")


REWRITTEN: dict[str, Callable[[BytesIO], Writer]] = {
    "as it does": Writer,
    "lz4": lambda file: Writer(file, compression=CompressionType.LZ4),
    "not compressed": lambda file: Writer(file, compression=CompressionType.NONE, chunk_size=100),
    "without chunks": lambda file: Writer(file, use_chunking=False),
    "without indexes": lambda file: Writer(file, index_types=IndexType.NONE, use_statistics=False),
    "without a summary": lambda file: Writer(
        file, index_types=IndexType.NONE, use_statistics=False, repeat_channels=False, repeat_schemas=False,
        use_summary_offsets=False,
    ),
    "without checksums": lambda file: Writer(file, enable_crcs=False),
}  # fmt: skip


@pytest.mark.parametrize("how", REWRITTEN)
def test_packets_are_read_however_other_tools_write_them_anew(how: str, tmp_path: Path) -> None:
    packets = steady(3000, 10_000_000)
    original = write(tmp_path / "x.mcap", packets)
    rewritten = BytesIO()
    writer = REWRITTEN[how](rewritten)
    writer.start("", "somebody")
    schema = writer.register_schema("other", "jsonschema", b"{}")
    other = writer.register_channel("/other", "json", schema)
    with original.open("rb") as file:
        reader = SeekingReader(file)
        channel = 0
        for schema_of, channel_of, message in reader.iter_messages():
            assert schema_of is not None
            if not channel:
                schema = writer.register_schema(schema_of.name, schema_of.encoding, schema_of.data)
                channel = writer.register_channel(channel_of.topic, channel_of.message_encoding, schema)
            writer.add_message(other, message.log_time, b'{"x": 1}', message.log_time)
            writer.add_message(channel, message.log_time, message.data, message.publish_time)
    writer.finish()
    path = tmp_path / "rewritten.mcap"
    path.write_bytes(rewritten.getvalue())
    found = read(path)
    assert found.packets == packets
    assert found.info.truncation is None
