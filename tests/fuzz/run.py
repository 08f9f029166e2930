"""Fuzzes for as long as it is told to: ``python -m tests.fuzz.run --minutes 5 --seed 1``.

Every input is drawn from the seed and its number alone. One that fails is kept as a file, beside it what happened, and
once more as small as it could be made; ``--replay FILE`` examines it again.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.fuzz.examination import Examined, examine
from tests.fuzz.mutations import COMPRESSIONS, mutated, shortened
from tests.fuzz.originals import SCENARIOS, random_traffic, sample_captures, scenario_traffic
from tests.fuzz.reduction import reduced

LONGEST = 300
"""Records of an original that are taken at most: more telegrams are slower to examine and seldom show more."""

_SAMPLES = sample_captures()
_SHOW_SECONDS = 30.0


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


def failure_of(raw: bytes, folder: Path, draw: str) -> Exception | None:
    """Examine a file and return what went wrong; ``draw`` seeds the choices of the examination."""
    try:
        examine(raw, folder, random.Random(draw))
    except Exception as error:  # whatever it is, it is what was looked for
        return error
    return None


def signature(error: Exception) -> str:
    """Tell failures apart by the kind of error and the line that raised it."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} at {place.filename}:{place.lineno}"


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options().parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="nvscope-fuzz-") as name:
        folder = Path(name)
        if options.replay:
            return _replay(options.replay, folder)
        keep = Path(options.keep or tempfile.mkdtemp(prefix="nvscope-failures-"))
        keep.mkdir(parents=True, exist_ok=True)
        return _fuzz(options.seed, options.minutes, folder, keep)


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.run", description=__doc__)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", metavar="FOLDER", help="where inputs that fail are kept; default: a new folder")
    parser.add_argument("--replay", metavar="FILE", nargs="+", type=Path, help="examine files instead of fuzzing")
    return parser


def _replay(paths: Sequence[Path], folder: Path) -> int:
    failed = 0
    for path in paths:
        # The choices of the examination are part of what failed; without knowing them, several are tried.
        errors = (failure_of(path.read_bytes(), folder, f"{path.stem.partition('.')[0]}#{turn}") for turn in range(10))
        error = next((error for error in errors if error), None)
        print(f"{path}: {'good' if error is None else signature(error)}")
        if error:
            failed += 1
            traceback.print_exception(error)
    return int(failed > 0)


def _fuzz(seed: int, minutes: float, folder: Path, keep: Path) -> int:
    seen: Counter[str] = Counter()
    reached: Counter[str] = Counter()
    number = 0
    begin = shown = time.monotonic()
    while (now := time.monotonic()) < begin + minutes * 60:
        if now > shown + _SHOW_SECONDS:
            shown = now
            print(_progress(number, reached, seen), flush=True)
        name, raw = fuzz_input(seed, number)
        draw = f"{seed}-{number}#0"
        try:
            _count(reached, examine(raw, folder, random.Random(draw)))
        except Exception as error:  # whatever it is, it is what was looked for
            kind = signature(error)
            seen[kind] += 1
            if seen[kind] == 1:
                _keep(keep / f"{seed}-{number}", name, raw, error, folder, draw)
        number += 1
    print(_progress(number, reached, seen))
    for kind, count in seen.most_common():
        print(f"{count} × {kind}")
    return int(bool(seen))


def _count(reached: Counter[str], examined: Examined) -> None:
    reached["read"] += examined.readable
    reached["cut"] += examined.cut
    reached["frames"] += examined.frames
    reached["telegrams"] += examined.telegrams
    reached["findings"] += examined.findings


def _progress(number: int, reached: Counter[str], seen: Counter[str]) -> str:
    figures = ", ".join(f"{count} {what}" for what, count in reached.items())
    return f"{number} files: {figures}; {seen.total()} failures of {len(seen)} kinds"


def _keep(path: Path, name: str, raw: bytes, error: Exception, folder: Path, draw: str) -> None:
    kind = signature(error)
    path.with_suffix(".capture").write_bytes(raw)
    path.with_suffix(".txt").write_text(f"made of {name}\n" + "".join(traceback.format_exception(error)))

    def fails(smaller: bytes) -> bool:
        found = failure_of(smaller, folder, draw)
        return found is not None and signature(found) == kind

    small = path.with_suffix(".small.capture")
    small.write_bytes(reduced(raw, fails))
    print(f"{kind}: {error}"[:500])
    print(f"  made of {name}; replay with: python -m tests.fuzz.run --replay {small}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
