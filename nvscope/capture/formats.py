"""FORMATS: every capture format is a row here, and a file with its reader, its sink or both.

The row says how the format is told and what it can hold. Opening, error texts and what verbs need to know of formats
derive from it. Readers and sinks are named, not imported: the program starts with those only that it needs.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from nvscope.errors import UnreadableInput
from nvscope.whole_files import is_stdout

if TYPE_CHECKING:
    from nvscope.capture.source import Sink, SourceInfo

HEAD_BYTES = 32
"""So many bytes tell a binary format."""

TEXT_HEAD_BYTES = 8192
"""So many bytes tell a text format: its first lines may be comments or damaged."""


class NoCapture(UnreadableInput):
    """A file that is empty, or is of no known capture format."""


class CaptureFormat(Struct, frozen=True, kw_only=True):
    """One capture format; ``name`` is what reports call it, ``suffixes`` those of its files.

    A binary format is told by ``magics``, any of which its files begin with, a text format by ``is_line``: given one of
    the first lines, and whether all of that is there, it tells whether it is one of the format's. One that begins as
    the files of another format, ``within``, do is told by ``told_by``, ``module:function``, given the Content.

    ``reader`` (``module:class``, made of Content and ReadingSizes) is a ``nvscope.capture.reader.Reader``. ``sink``
    (made of a path and names of channels, or None) is a ``nvscope.capture.source.Sink``, '' where nothing writes the
    format. It can hold link types side by side (``mixes_links``), names of channels, attachments, drops, directions of
    packets, comments to packets, or CAN frames only. In it are rows of a database (``holds_rows``), else frames.
    """

    name: str
    suffixes: tuple[str, ...]
    reader: str
    sink: str = ""
    magics: tuple[bytes, ...] = ()
    is_line: Callable[[bytes, bool], bool] | None = None
    within: str = ""
    told_by: str = ""
    only_can: bool = False
    mixes_links: bool = False
    names_channels: bool = False
    holds_attachments: bool = False
    holds_drops: bool = False
    holds_directions: bool = False
    holds_comments: bool = False
    holds_rows: bool = False

    def reader_class(self) -> Any:
        """Return the class of its readers; what it is made of, this table does not need to know."""
        return _named(self.reader)

    def among(self, content: Any) -> CaptureFormat:
        """Return the format of a content that begins like files of this one: this one, or another one within."""
        others = (one for one in FORMATS if one.within == self.name)
        return next((one for one in others if _named(one.told_by)(content)), self)

    def open_sink(self, path: str, channels: Sequence[str] | None) -> Sink:
        """Return a sink that writes to ``path``; raises CaptureError where it cannot be written."""
        make: Callable[[str, Sequence[str] | None], Sink] = _named(self.sink)
        return make(path, channels)


def _named(name: str) -> Any:
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def _begins(pattern: bytes) -> Callable[[bytes, bool], bool]:
    begin = re.compile(pattern)
    return lambda line, whole: begin.match(line) is not None


_CANDUMP_BEGIN = re.compile(rb"[ \t]*\(-?\d{1,12}(?:\.\d{1,18})?\)(?:[ \t]|\Z)")
_SCREEN = re.compile(rb"[ \tm][0-9A-Fa-f]{3,8}[ \t]+(?:\[\d+\]|\{[9A-Fa-f]\})")


def _is_candump(line: bytes, whole: bool) -> bool:
    if not _CANDUMP_BEGIN.match(line):
        return False
    if not whole:
        return not _SCREEN.search(line)
    from nvscope.capture.can.candump_line import LineFault, parse  # noqa: PLC0415

    try:
        parse(line.removesuffix(b"\r"))
    except LineFault:
        return False
    return True


def _is_candump_screen(line: bytes, whole: bool) -> bool:
    if not _SCREEN.search(line):
        return False
    from nvscope.capture.can.candump_screen import is_screen_line  # noqa: PLC0415

    return is_screen_line(line)


FORMATS = (
    CaptureFormat(
        name="pcap",
        suffixes=(".pcap",),
        reader="nvscope.capture.pcap:PcapReader",
        sink="nvscope.capture.pcap:PcapSink",
        # Two byte orders, microseconds and nanoseconds.
        magics=(b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d"),
    ),
    CaptureFormat(
        name="pcapng",
        suffixes=(".pcapng",),
        reader="nvscope.capture.pcapng.reader:PcapngReader",
        sink="nvscope.capture.pcapng.sink:PcapngSink",
        magics=(b"\x0a\x0d\x0d\x0a",),
        mixes_links=True,
        names_channels=True,
        holds_drops=True,
        holds_directions=True,
        holds_comments=True,
    ),
    CaptureFormat(
        name="mcap",
        suffixes=(".mcap",),
        reader="nvscope.capture.mcap.reader:McapReader",
        sink="nvscope.capture.mcap.sink:McapSink",
        magics=(b"\x89MCAP0\r\n",),
        mixes_links=True,
        names_channels=True,
        holds_attachments=True,
        holds_drops=True,
        holds_directions=True,
        holds_comments=True,
    ),
    CaptureFormat(
        name="candump",
        suffixes=(".log",),
        reader="nvscope.capture.can.candump:CandumpReader",
        sink="nvscope.capture.can.candump_sink:CandumpSink",
        is_line=_is_candump,
        only_can=True,
        names_channels=True,
        holds_directions=True,
    ),
    CaptureFormat(
        name="candump-screen",
        suffixes=(".txt",),
        reader="nvscope.capture.can.candump_screen:ScreenReader",
        is_line=_is_candump_screen,
        only_can=True,
        names_channels=True,
    ),
    CaptureFormat(
        name="asc",
        suffixes=(".asc",),
        reader="nvscope.capture.can.asc:AscReader",
        is_line=_begins(rb"(?i)\s*(?:date\s+\w{2,3}\s|base\s+(?:hex|dec)\b)"),
        only_can=True,
    ),
    CaptureFormat(
        name="blf",
        suffixes=(".blf",),
        reader="nvscope.capture.can.blf:BlfReader",
        magics=(b"LOGG",),
        only_can=True,
    ),
    CaptureFormat(
        name="trc",
        suffixes=(".trc",),
        reader="nvscope.capture.can.trc:TrcReader",
        is_line=_begins(rb"\s*;\$FILEVERSION\s*=|\s*;\s+Start time:|\s*\d+\)\s+\d+(?:\.\d+)?\s+\S"),
        only_can=True,
    ),
    CaptureFormat(
        name="csv",
        suffixes=(".csv",),
        reader="nvscope.capture.can.csv_log:CsvReader",
        is_line=_begins(rb"timestamp,arbitration_id,"),
        only_can=True,
    ),
    CaptureFormat(
        name="sqlite",
        suffixes=(".db",),
        reader="nvscope.capture.can.sqlite_log:SqliteReader",
        magics=(b"SQLite format 3\0",),
        only_can=True,
    ),
    CaptureFormat(
        name="datalogger",
        suffixes=(),
        reader="nvscope.capture.datalogger.reader:LogReader",
        within="sqlite",
        told_by="nvscope.capture.datalogger.reader:is_log",
        holds_rows=True,
    ),
    CaptureFormat(
        name="mf4",
        suffixes=(".mf4",),
        reader="nvscope.capture.can.mdf:MdfReader",
        # Loggers finish a file when they close it, which many never do.
        magics=(b"MDF     ", b"UnFinMF "),
        only_can=True,
    ),
)

BEGUN = next(known for known in FORMATS if known.holds_rows)
"""The format of files that others go on with, and in which nothing is yet."""

CAN_LOGS = frozenset(known.name for known in FORMATS if known.only_can)
"""The names of formats that hold CAN frames and nothing else."""

LIVE_FORMATS = ("can", "interface", "stream", "udp")
"""What stands in the place of a format where no file is read; a stream is one until its format is known."""

DATABASES = frozenset(known.name for known in FORMATS if known.holds_rows)
"""The names of formats of which packets are rows of a database."""


def are_databases(infos: Sequence[SourceInfo]) -> bool:
    """Tell whether there is nothing in some sources but databases."""
    return bool(infos) and all(info.format in DATABASES for info in infos)


def why_no_row(infos: Sequence[SourceInfo]) -> str:
    """Return in words that databases have no row, or, where something of them could not be read, that none can be."""
    of_them = "the database" if len(infos) == 1 else "any database"
    if any(info.truncation is not None for info in infos):
        return f"no row of {of_them} can be read"
    return "the database has no row" if len(infos) == 1 else "no database has a row"


_TEXT = re.compile(rb"\xef\xbb\xbf|[\t\n\r -~]{32}")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def format_of(head: bytes) -> CaptureFormat | None:
    """Return the format of a file by its first bytes, None where they show none."""
    for known in FORMATS:
        if head.startswith(known.magics):
            return known
    texts = [(known, known.is_line) for known in FORMATS if known.is_line]
    lines = head.removeprefix(_BYTE_ORDER_MARK).split(b"\n")
    for number, line in enumerate(lines):
        for known, is_line in texts:
            if is_line(line, number + 1 < len(lines)):
                return known
    return None


def is_enough(head: bytes) -> bool:
    """Return whether more bytes would not tell more about the format than these."""
    if len(head) < HEAD_BYTES:
        return False
    # No text begins with a NUL or a control character: what is compressed, or nothing at all.
    return len(head) >= TEXT_HEAD_BYTES or format_of(head) is not None or not _TEXT.match(head)


def written_as(path: str) -> CaptureFormat | None:
    """Return the format that a file of this name is written in, None where no sink writes one.

    Of stdout, ``-.mcap`` says it, and ``-`` alone is pcapng, as of tshark.
    """
    suffix = Path(path).suffix.lower()
    if is_stdout(path):
        suffix = os.path.splitext(f"x{path.removeprefix('-')}")[1].lower() or ".pcapng"
    return next((known for known in FORMATS if known.sink and suffix in known.suffixes), None)


def suffixes_that(fits: Callable[[CaptureFormat], bool]) -> str:
    """Return the suffixes of the written formats that fit, the most capable first, such as ``.pcapng or .pcap``."""
    written = [known for known in FORMATS if known.sink and fits(known)]
    written.sort(key=lambda known: not known.mixes_links)
    return either([suffix for known in written for suffix in known.suffixes])


def either(names: Sequence[str]) -> str:
    """Return names as a choice: ``a``, ``a or b``, ``a, b or c``."""
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


_NETWORK = either([known.name for known in FORMATS if known.sink and not known.only_can])

READABLE = f"a {_NETWORK} file, a CAN log or a database of a DataLogger"
"""What a person may give as a capture."""
