"""Damaged CAN logs and captures, with definitions: every verb ends with a code of its own, in words."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from dissectors.batch import LinkType
from nvscope.capture.open import open_source
from nvscope.capture.pcap import PcapSink
from nvscope.errors import ExitCode
from tests.can_plant import drawn_plant
from tests.fuzz.mutations import mutated
from tests.fuzz.program import Ran, run
from tests.laws import some

DRAWN = int(os.environ.get("NVSCOPE_FUZZ", "12"))
READ = (ExitCode.GOOD, ExitCode.DATA_LOSS)
QUESTIONS = (
    ("report",),
    ("report", "--json"),
    ("report", "-Y", "can.len > 2"),
    ("packets",),
    ("packets", "-V"),
    ("packets", "-x", "-Y", "!can.flags.err"),
    ("packets", "-T", "csv"),
    ("packets", "-T", "ndjson", "-e", "can.data", "-e", "list.key"),
    ("vars",),
    ("vars", "--json", "--at", "-1s"),
    ("vars", "--history", "*"),
    ("export", "-w", "{folder}/wide.parquet"),
    ("export", "--form", "long", "-w", "{folder}/long.csv"),
    ("export", "--what", "telegrams", "-w", "{folder}/telegrams.parquet"),
)


def damaged_log(chance: random.Random, raw: bytes) -> bytes:
    """Return a log with bytes changed, lines cut, swapped, repeated and joined, and numbers out of any range."""
    lines = raw.split(b"\n")
    for _ in range(chance.randint(1, 6)):
        place = chance.randrange(len(lines))
        line = bytearray(lines[place])
        kind = chance.randrange(9)
        if kind == 0 and line:
            line[chance.randrange(len(line))] = chance.choice(b"#_R()  .0Fx\0\r\xff\t")
        elif kind == 1:
            line = line[: chance.randrange(len(line) + 1)]
        elif kind == 2:
            line *= 2
        elif kind == 3:
            lines[place], lines[-1] = lines[-1], lines[place]
            continue
        elif kind == 4:
            line = line.replace(b"(17", chance.choice([b"(9" * 6, b"(-17", b"(0", b"(99999999999999999999"]))
        elif kind == 5:
            line = line.replace(b" can", chance.choice([b" ", b" \xc3\xa4", b" " + b"c" * 300, b" \x1b[31m", b"  can"]))
        elif kind == 6:
            line = line.replace(b"#", chance.choice([b"##", b"#R", b"", b"###", b"##F" + b"00" * 64]))
        elif kind == 7:
            line = bytearray(chance.randbytes(chance.randrange(60)))
        else:
            del lines[place]
            lines = lines or [b""]
            continue
        lines[place] = bytes(line)
    return b"\n".join(lines)


def asked(capture: Path, options: list[str], folder: Path) -> Iterator[Ran]:
    for question in QUESTIONS:
        words = [word.format(folder=folder) for word in question]
        yield run(words[0], str(capture), *(options if "telegrams" not in words else []), *words[1:])


def check(capture: Path, options: list[str], folder: Path) -> None:
    """All questions of one capture are answered, or refused alike; what is shown has no control characters."""
    codes = set()
    for ran in asked(capture, options, folder):
        codes.add(ran.code)
        assert ran.code in (*READ, ExitCode.UNREADABLE), ran
        assert all(char.isprintable() or char in "\n\t" for char in ran.out), ran.words
        assert all(char.isprintable() or char == "\n" for char in ran.err), ran.err
        if ran.code != ExitCode.GOOD:
            assert ran.err
    assert len(codes) == 1, codes


@pytest.mark.parametrize("seed", some(range(DRAWN)))
def test_damaged_logs_are_answered(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    log, options = drawn_plant(seed, frames=30).write(tmp_path)
    capture = tmp_path / "damaged.log"
    capture.write_bytes(damaged_log(chance, Path(log).read_bytes()))
    check(capture, options, tmp_path)


@pytest.mark.parametrize("seed", some(range(DRAWN)))
def test_damaged_captures_are_answered(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    log, options = drawn_plant(seed, frames=30).write(tmp_path)
    with PcapSink(str(tmp_path / "whole.pcap"), LinkType.CAN_SOCKETCAN) as sink:
        for batch in open_source([log]):
            sink.write(batch)
    capture = tmp_path / "damaged.pcap"
    capture.write_bytes(mutated(chance, (tmp_path / "whole.pcap").read_bytes(), [Path(log).read_bytes()]))
    check(capture, options, tmp_path)
