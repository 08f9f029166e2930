"""The door by which formats come in: whatever stands in FORMATS keeps the contracts of readers and sinks."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dissectors.batch import PacketBatch
from nvscope.capture import pcap
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.formats import CAN_LOGS, FORMATS, CaptureFormat, format_of, suffixes_that, written_as
from nvscope.capture.open import open_sink, open_source
from nvscope.capture.reader import Reader
from nvscope.capture.source import Attachment, FileSource
from nvscope.cli.program import program
from nvscope.errors import UnreadableInput, UsageError
from tests.capture.can import logs
from tests.capture.can.logs import Frame
from tests.capture.can.test_candump_sink import batch_of

WRITTEN = [known for known in FORMATS if known.sink]
FRAME = Frame(10**18, "can0", 0x123, "", 3, b"abc")


def _by_name(known: CaptureFormat) -> str:
    return known.name


def _class(name: str) -> type:
    module, _, attribute = name.partition(":")
    found = getattr(import_module(module), attribute)
    assert isinstance(found, type)
    return found


@pytest.mark.parametrize("known", FORMATS, ids=_by_name)
def test_a_row_names_a_reader_and_is_told_in_one_way(known: CaptureFormat) -> None:
    reader = _class(known.reader)
    assert issubclass(reader, Reader)
    assert not inspect.isabstract(reader)
    assert list(inspect.signature(reader).parameters) == ["content", "sizes"]
    assert [bool(known.magics), bool(known.is_line), bool(known.within)].count(True) == 1
    assert bool(known.within) == bool(known.told_by)
    for magic in known.magics:
        assert format_of(magic + bytes(32)) is known


def test_no_two_rows_have_a_name_a_suffix_or_a_magic_in_common() -> None:
    for column in ([known.name for known in FORMATS], [one for known in FORMATS for one in known.suffixes]):
        assert len(set(column)) == len(column)
    magics = [magic for known in FORMATS for magic in known.magics]
    assert not [one for one in magics for other in magics if one is not other and one.startswith(other)]
    assert set(FORMATS[0].magics) == set(pcap.MAGICS)
    assert {"candump", "candump-screen", "asc", "blf", "trc", "csv", "sqlite", "mf4"} == CAN_LOGS


@pytest.mark.parametrize("known", WRITTEN, ids=_by_name)
def test_what_a_sink_writes_is_told_as_its_format_and_read_by_its_reader(known: CaptureFormat, tmp_path: Path) -> None:
    for suffix in known.suffixes:
        path = str(tmp_path / f"x{suffix.upper()}")
        assert written_as(path) is known
        with open_sink(path, ["can0"]) as sink:
            sink.write(PacketBatch.nothing(until_ns=5))
            sink.write(batch_of([FRAME]))
            sink.flush()
            # What was flushed can be read by others, before the file is closed.
            channel = "can0" if known.names_channels else ""
            assert logs.frames_of(open_source([path])) == [FRAME._replace(channel=channel)]
        (info,) = open_source([path]).infos
        assert info.format == known.name


@pytest.mark.parametrize("known", WRITTEN, ids=_by_name)
def test_attachments_are_held_or_refused(known: CaptureFormat, tmp_path: Path) -> None:
    definition = Attachment("axis.gvl", "text/plain", lambda: b"<GVL/>")
    with open_sink(str(tmp_path / f"x{known.suffixes[0]}")) as sink:
        if known.holds_attachments:
            sink.attach(definition)
        else:
            with pytest.raises(UsageError, match=r"cannot hold 'axis\.gvl'"):
                sink.attach(definition)


def test_captures_have_no_attachments(tmp_path: Path) -> None:
    for name in ("a.pcap", "b.pcapng"):
        open_sink(str(tmp_path / name)).close()
    assert [*CaptureFile(str(tmp_path / "a.pcap")).attachments, *open_source([str(tmp_path)]).attachments] == []


def test_error_texts_come_from_the_table(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("something that is no capture, and is long enough")
    with pytest.raises(
        UnreadableInput,
        match="expected a pcap, pcapng or mcap file, a CAN log or a database of a DataLogger, plain or com",
    ):
        CaptureFile(str(tmp_path / "notes"))
    with pytest.raises(
        UnreadableInput, match="among 1 files, expected a pcap, pcapng or mcap file, a CAN log or a data"
    ):
        open_source([str(tmp_path)])
    with pytest.raises(UsageError) as caught:
        open_sink("x.docx")
    assert caught.value.next_step == "name the file .pcapng, .mcap or .pcap, or, for CAN, .log"
    assert suffixes_that(lambda one: one.names_channels) == ".pcapng, .mcap or .log"


def test_the_help_of_simulate_names_what_it_can_write() -> None:
    told = CliRunner().invoke(program(), ["simulate", "--help"]).stdout
    assert all(suffix in told for known in WRITTEN for suffix in known.suffixes)


def test_files_are_file_sources(tmp_path: Path) -> None:
    for name in ("a.pcap", "b.pcapng"):
        open_sink(str(tmp_path / name)).close()
    one, several = open_source([str(tmp_path / "a.pcap")]), open_source([str(tmp_path)])
    for source in (one, several, one.between(0, 1), several.between(0, 1).between(None, 3)):
        assert isinstance(source, FileSource)
