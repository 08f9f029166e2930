"""Fields of CAN frames as other programs read them: tshark in captures, python-can in logs."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import can
import pytest

from dissectors.batch import LinkType
from nvscope.capture.open import open_source
from tests.fuzz.program import run
from tests.report.test_can_laws import cooked
from tests.view.test_can_filter import drawn_frame

NAMES = ("can.id", "can.flags.xtd", "can.flags.rtr", "can.flags.err", "can.len", "canfd.flags.brs", "canfd.flags.esi")


def log_of(folder: Path, seed: int, frames: int = 300) -> Path:
    chance = random.Random(seed)
    path = folder / "a.log"
    path.write_text(
        "".join(f"({1_700_000_000 + number}.{number:06d}) {drawn_frame(chance)[0]}\n" for number in range(frames))
    )
    return path


def shown(path: Path, *names: str) -> list[list[str]]:
    ran = run("packets", str(path), *(word for name in names for word in ("-e", name)))
    assert ran.code == 0
    return [line.split("\t") for line in ran.out.splitlines()]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
@pytest.mark.parametrize("link", [LinkType.CAN_SOCKETCAN, LinkType.LINUX_SLL, LinkType.LINUX_SLL2])
def test_fields_are_those_of_tshark(tmp_path: Path, link: LinkType) -> None:
    (batch,) = open_source([str(log_of(tmp_path, link))])
    path = tmp_path / "a.pcap"
    path.write_bytes(cooked(batch, link))
    fields = [word for name in (*NAMES, "data.data") for word in ("-e", name)]
    done = subprocess.run(
        ["tshark", "-n", "-r", str(path), "-T", "fields", *fields], capture_output=True, text=True, check=True
    )
    theirs = [line.split("\t") for line in done.stdout.splitlines()]
    ours = shown(path, *NAMES, "can.data", "can.fd")
    assert len(ours) == len(theirs) == 300
    for (identifier, xtd, rtr, err, length, brs, esi, data, fd), their in zip(ours, theirs, strict=True):
        assert int(length) == int(their[4])
        if err == "1":
            assert their[3] == "1"  # whose identifier and data tshark shows as what they mean
            continue
        assert (identifier, xtd, data) == (their[0], their[1], their[7])
        assert (brs, esi) == (their[5], their[6]) if fd == "1" else (rtr, err) == (their[2], their[3])


def test_fields_are_those_of_python_can(tmp_path: Path) -> None:
    path = log_of(tmp_path, 3)
    theirs = [
        [
            f"{message.timestamp:.6f}", message.channel, message.arbitration_id, message.is_extended_id,
            message.is_remote_frame, message.is_error_frame, message.dlc, message.is_fd, message.data.hex(),
        ]
        for message in can.LogReader(str(path))
    ]  # fmt: skip
    names = ("frame.time_epoch", "can.channel", *NAMES[:5], "can.fd", "can.data")
    for ours, their in zip(shown(path, *names), theirs, strict=True):
        time, channel, identifier, xtd, rtr, err, length, fd, data = ours
        # Of an error frame of no class, eight zeros say nothing.
        data = data or ("00" * 8 if err == "1" and not their[2] else "")
        assert (time[:-3], channel, data) == (their[0], their[1], their[8])
        flags = [bool(int(flag)) for flag in (xtd, rtr, err, fd)]
        if flags[2]:
            continue  # of these, python-can knows those of one class only
        assert (int(identifier), *flags, int(length)) == (their[2], *their[3:6], their[7], their[6])
