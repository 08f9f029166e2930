"""Fuzzes for as long as it is told to: ``python -m tests.fuzz.run --minutes 5 --seed 1``.

Every input is drawn from the seed and its number alone. One that fails is kept as a file, beside it what happened, and
once more as small as it could be made; ``--replay FILE`` examines it again.

``--what logs`` draws CAN logs of every format.

``--what plants`` draws captures with definition files and asks every verb about them. One that fails is kept as a
folder, its files as small as they could be made; ``--replay FOLDER`` asks again.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fuzz.asked import Plant
from tests.fuzz.examination import Examined, examine
from tests.fuzz.logs import examine_log, fuzz_log
from tests.fuzz.mutations import COMPRESSIONS, mutated, shortened
from tests.fuzz.originals import SCENARIOS, random_traffic, sample_captures, scenario_traffic
from tests.fuzz.plants import fuzz_plant
from tests.fuzz.program import ProgramBug
from tests.fuzz.questions import ask
from tests.fuzz.reduction import reduced

LONGEST = 300
"""Records of an original that are taken at most: more telegrams are slower to examine and seldom show more."""

_SAMPLES = sample_captures()
_SHOW_SECONDS = 30.0
_TRIES = 60  # for each file of a plant: to ask about one again takes seconds


def fuzz_input(seed: int, number: int) -> tuple[str, bytes]:
    """Return the name of an original and the input that is made of it."""
    rng = random.Random(f"{seed}/{number}")
    name, raw = _original(rng)
    raw = shortened(rng, raw, rng.choice((3, 30, LONGEST)))
    others = [*_SAMPLES.values(), raw]
    if rng.random() < 0.1:
        suffix, compress = rng.choice(list(COMPRESSIONS.items()))
        return name + suffix, mutated(rng, compress(raw), [compress(other) for other in others])
    return name, mutated(rng, raw, others)


def _original(rng: random.Random) -> tuple[str, bytes]:
    match rng.randrange(3):
        case 0:
            return rng.choice(list(_SAMPLES.items()))
        case 1:
            number = rng.randrange(1000)
            return f"traffic-{number}", random_traffic(number)
        case _:
            path = rng.choice(SCENARIOS)
            return path.stem, scenario_traffic(path)


Fails = Callable[[Any], bool]


@dataclass(frozen=True)
class Subject:
    """What is fuzzed: how an input is drawn from seed and number, examined, kept and read again.

    ``examine`` returns what it reached, by name; ``keep`` writes an input that fails, as it is and smaller, and returns
    where the smaller one lies.
    """

    draw: Callable[[int, int], tuple[str, Any]]
    examine: Callable[[Any, Path, random.Random], Mapping[str, int]]
    keep: Callable[[Path, Any, Fails], Path]
    read: Callable[[Path], Any]


def _examine_capture(raw: bytes, folder: Path, rng: random.Random) -> Mapping[str, int]:
    return _figures(examine(raw, folder, rng))


def _examine_log(raw: bytes, folder: Path, rng: random.Random) -> Mapping[str, int]:
    return _figures(examine_log(raw, folder, rng))


def _figures(examined: Examined) -> Mapping[str, int]:
    return {
        "read": examined.readable, "cut": examined.cut, "frames": examined.frames, "telegrams": examined.telegrams,
        "findings": examined.findings,
    }  # fmt: skip


def _keep_capture(path: Path, raw: bytes, fails: Fails) -> Path:
    path.with_suffix(".capture").write_bytes(raw)
    small = path.with_suffix(".small.capture")
    small.write_bytes(reduced(raw, fails))
    return small


def _ask_plant(plant: Plant, folder: Path, rng: random.Random) -> Mapping[str, int]:
    with tempfile.TemporaryDirectory(dir=folder) as own:
        answered = ask(plant, Path(own), rng)
    return {
        "read": answered.readable, "defined": answered.defined, "telegrams": answered.telegrams,
        "decoded": answered.decoded, "values": answered.values, "drafts": answered.drafts, "runs": answered.runs,
    }  # fmt: skip


def _keep_plant(path: Path, plant: Plant, fails: Fails) -> Path:
    _write_plant(path, plant)
    for name in list(plant.definitions):
        less = {other: raw for other, raw in plant.definitions.items() if other != name}
        if fails(Plant(plant.capture, less)):
            plant = Plant(plant.capture, less)
    capture = reduced(plant.capture, lambda raw: fails(Plant(raw, plant.definitions)), _TRIES)
    definitions = dict(plant.definitions)
    for name, content in plant.definitions.items():

        def fails_with(raw: bytes, name: str = name) -> bool:
            return fails(Plant(capture, definitions | {name: raw}))

        definitions[name] = reduced(content, fails_with, _TRIES)
    small = path.with_name(f"{path.name}-small")
    _write_plant(small, Plant(capture, definitions))
    return small


def _write_plant(folder: Path, plant: Plant) -> None:
    folder.mkdir(exist_ok=True)
    (folder / _CAPTURE_NAME).write_bytes(plant.capture)
    for name, raw in plant.definitions.items():
        (folder / name).write_bytes(raw)


def _read_plant(folder: Path) -> Plant:
    files = {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}
    return Plant(files.pop(_CAPTURE_NAME), files)


_CAPTURE_NAME = "capture"
SUBJECTS = {
    "captures": Subject(fuzz_input, _examine_capture, _keep_capture, Path.read_bytes),
    "logs": Subject(fuzz_log, _examine_log, _keep_capture, Path.read_bytes),
    "plants": Subject(fuzz_plant, _ask_plant, _keep_plant, _read_plant),
}


def failure_of(subject: Subject, what: Any, folder: Path, draw: str) -> Exception | None:
    """Examine an input and return what went wrong; ``draw`` seeds the choices of the examination."""
    try:
        subject.examine(what, folder, random.Random(draw))
    except Exception as error:  # whatever it is, it is what was looked for
        return error
    return None


def signature(error: Exception) -> str:
    """Tell failures apart by the kind of error and the line that raised it."""
    if isinstance(error, ProgramBug):
        return f"{error.kind} at {error.place}"
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} at {place.filename}:{place.lineno}"


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options().parse_args(arguments)
    subject = SUBJECTS[options.what]
    with tempfile.TemporaryDirectory(prefix="nvscope-fuzz-") as name:
        folder = Path(name)
        if options.replay:
            return _replay(subject, options.replay, folder)
        keep = Path(options.keep or tempfile.mkdtemp(prefix="nvscope-failures-"))
        keep.mkdir(parents=True, exist_ok=True)
        return _fuzz(subject, options.seed, options.minutes, folder, keep)


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.run", description=__doc__)
    parser.add_argument("--what", choices=list(SUBJECTS), default="captures", help="default: %(default)s")
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", metavar="FOLDER", help="where inputs that fail are kept; default: a new folder")
    parser.add_argument("--replay", metavar="FILE", nargs="+", type=Path, help="examine files instead of fuzzing")
    return parser


def _replay(subject: Subject, paths: Sequence[Path], folder: Path) -> int:
    failed = 0
    for path in paths:
        what = subject.read(path)
        # The choices of the examination are part of what failed; without knowing them, several are tried.
        name = path.stem.partition(".")[0].removesuffix("-small")
        errors = (failure_of(subject, what, folder, f"{name}#{turn}") for turn in range(10))
        error = next((error for error in errors if error), None)
        print(f"{path}: {'good' if error is None else signature(error)}")
        if error:
            failed += 1
            traceback.print_exception(error)
    return int(failed > 0)


def _fuzz(subject: Subject, seed: int, minutes: float, folder: Path, keep: Path) -> int:
    seen: Counter[str] = Counter()
    reached: Counter[str] = Counter()
    number = 0
    begin = shown = time.monotonic()
    while (now := time.monotonic()) < begin + minutes * 60:
        if now > shown + _SHOW_SECONDS:
            shown = now
            print(_progress(number, reached, seen), flush=True)
        name, what = subject.draw(seed, number)
        draw = f"{seed}-{number}#0"
        try:
            figures = subject.examine(what, folder, random.Random(draw))
            reached.update({word: int(figure) for word, figure in figures.items()})
        except Exception as error:  # whatever it is, it is what was looked for
            kind = signature(error)
            seen[kind] += 1
            if seen[kind] == 1:
                _keep(subject, keep / f"{seed}-{number}", name, what, error, folder, draw)
        number += 1
    print(_progress(number, reached, seen))
    for kind, count in seen.most_common():
        print(f"{count} × {kind}")
    return int(bool(seen))


def _progress(number: int, reached: Counter[str], seen: Counter[str]) -> str:
    figures = ", ".join(f"{count} {what}" for what, count in reached.items())
    return f"{number} files: {figures}; {seen.total()} failures of {len(seen)} kinds"


def _keep(subject: Subject, path: Path, name: str, what: Any, error: Exception, folder: Path, draw: str) -> None:
    kind = signature(error)
    print(f"{kind}: {error}"[:500], flush=True)
    path.with_suffix(".txt").write_text(f"made of {name}\n" + "".join(traceback.format_exception(error)))

    def fails(smaller: Any) -> bool:
        found = failure_of(subject, smaller, folder, draw)
        return found is not None and signature(found) == kind

    small = subject.keep(path, what, fails)
    subjects = next(word for word, one in SUBJECTS.items() if one is subject)
    print(f"  made of {name}; replay with: python -m tests.fuzz.run --what {subjects} --replay {small}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
