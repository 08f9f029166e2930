"""Opens capture files for reading by their content, and for writing by their name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dissectors.batch import LinkType
from nvscope.capture.can.candump_sink import CandumpSink
from nvscope.capture.capture_file import STDIN, CaptureFile, NoCapture
from nvscope.capture.pcap import PcapSink
from nvscope.capture.pcapng import PcapngSink
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.timeline import Timeline
from nvscope.errors import UnreadableInput, UsageError


def open_source(paths: Sequence[str], *, batch_packets: int = 131_072) -> CaptureFile | Timeline:
    """Return the packets of capture files as one timeline.

    "-" is stdin, a directory all capture files in it. Raises UnreadableInput, also later when a file changes or goes.
    """
    if not paths:
        raise UsageError("no capture file is given")
    if list(paths).count(STDIN) > 1:
        raise UsageError("stdin is given more than once")
    sizes = ReadingSizes(batch_packets=batch_packets)
    files: list[CaptureFile] = []
    for path in paths:
        if path != STDIN and Path(path).is_dir():
            files += _open_directory(path, sizes)
        else:
            files.append(CaptureFile(path, sizes=sizes))
    return files[0] if len(files) == 1 else Timeline(files, batch_packets=batch_packets)


def _open_directory(directory: str, sizes: ReadingSizes) -> list[CaptureFile]:
    try:
        names = sorted(entry.name for entry in Path(directory).iterdir() if entry.is_file())
    except OSError as error:
        raise UnreadableInput(
            error.strerror or str(error), where=directory, next_step="check the path and the permissions"
        ) from error
    files: list[CaptureFile] = []
    for name in names:
        try:
            files.append(CaptureFile(str(Path(directory) / name), sizes=sizes))
        except NoCapture:
            # Notes, definitions and the like lie beside captures.
            continue
    if not files:
        raise UnreadableInput(
            f"no capture file among {len(names)} files, expected pcap or pcapng",
            where=directory,
            next_step="give the directory that holds the captures; subdirectories are not searched",
        )
    return files


def open_sink(path: str, link: int, channels: Sequence[str] | None = None) -> PcapSink | PcapngSink | CandumpSink:
    """Return a sink for a .pcap or .pcapng file or a candump .log; ``link`` is the link type of what will be written.

    ``channels`` are the names of the channels by number, where packets have any: a .pcap file holds none.
    Raises UsageError for another suffix and for a log of something else than CAN, CaptureError where the file cannot be
    written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".pcap":
        return PcapSink(path, link)
    if suffix == ".pcapng":
        return PcapngSink(path, channels)
    if suffix == ".log":
        if link != LinkType.CAN_SOCKETCAN:
            raise UsageError(
                "a candump log holds frames of CAN only", where=path, next_step="name the file .pcapng or .pcap"
            )
        return CandumpSink(path, channels or ())
    raise UsageError(
        f"no capture format has the suffix {suffix!r}",
        where=path,
        next_step="name the file .pcapng or .pcap, or, for CAN, .log",
    )
