"""A capture with definitions on disk, the words that lead to it, and how far the questions came."""

from __future__ import annotations

import json
import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from nvscope.errors import ExitCode
from tests.fuzz.examination import NAME, assert_printable
from tests.fuzz.program import Ran, run

READ = {ExitCode.GOOD, ExitCode.DATA_LOSS}
REFUSED = {ExitCode.USAGE, ExitCode.UNREADABLE}

_CODES = frozenset(int(code) for code in ExitCode)


@dataclass(frozen=True)
class Plant:
    """A capture and the definition files that are given with it, by their names."""

    capture: bytes
    definitions: Mapping[str, bytes] = field(default_factory=dict)


@dataclass
class Answered:
    """How far the questions came: what a fuzzer must reach often to be worth its time."""

    readable: bool = False
    defined: bool = False
    telegrams: int = 0
    decoded: int = 0
    values: int = 0
    drafts: int = 0
    runs: int = 0


class Asked:
    """A plant on disk, and the words that lead to it."""

    def __init__(self, plant: Plant, folder: Path, rng: random.Random) -> None:
        self.folder, self.rng = folder, rng
        self.capture = folder / NAME
        self.capture.write_bytes(plant.capture)
        self.files: list[str] = []
        for name, raw in plant.definitions.items():
            (folder / name).write_bytes(raw)
            self.files.append(str(folder / name))
        # An empty project of its own: none above the working directory is asked.
        self.project = folder / "nvscope.toml"
        self.project.write_text(f"definitions = {json.dumps([Path(one).name for one in self.files])}\n")
        self.answered = Answered()

    def definitions(self) -> list[str]:
        if self.rng.random() < 0.3:
            return ["--project", str(self.project)]
        return [word for file in self.files for word in ("--gvl", file)]

    def run(self, *words: str, printable: bool = True) -> Ran:
        self.answered.runs += 1
        ran = run(*words, width=self.rng.choice((20, 80, 140)))
        assert ran.code in _CODES, ran
        if printable:
            assert_printable(ran.out)
        assert_printable(ran.err)
        if ran.code and words[0] not in ("gvl", "doctor"):
            assert ran.err, f"ends with {ran.code} and says nothing: {words}"
        return ran

    def on_capture(self, verb: str, *words: str, defined: bool = True, printable: bool = True) -> Ran:
        named = self.definitions() if defined else []
        return self.run(verb, "-q", str(self.capture), *named, *words, printable=printable)
