"""Captures with definitions, drawn for ``questions``: fitting ones, mutated ones, and those of another plant."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

from tests.fuzz.asked import Plant
from tests.fuzz.definition_mutations import mutated_definition
from tests.fuzz.matching_definitions import matching
from tests.fuzz.mutations import mutated, shortened
from tests.fuzz.originals import CAPTURES, SCENARIOS, random_traffic, sample_captures, scenario_traffic

_SAMPLES = sample_captures()
_SUFFIXES = (".gvl", ".st", ".exp", ".xml", ".TcGVL", ".TcDUT")
_FOLDERS = (CAPTURES / "peers", Path(__file__).parents[1] / "definition" / "samples")


def sample_definitions() -> list[dict[str, bytes]]:
    """Return the definition files of each folder that has some, by name."""
    return [
        {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix in _SUFFIXES}
        for folder in _FOLDERS
    ]


_DEFINITIONS = sample_definitions()


def fuzz_plant(seed: int, number: int) -> tuple[str, Plant]:
    """Return the name of an original and a plant that is made of it."""
    rng = random.Random(f"plant/{seed}/{number}")
    name, raw = _original(rng)
    raw = shortened(rng, raw, rng.choice((3, 30, 300)))
    with tempfile.TemporaryDirectory(prefix="nvscope-fuzz-") as folder:
        files = rng.choice(_DEFINITIONS) if rng.random() < 0.3 else matching(raw, Path(folder), rng)
    if rng.random() < 0.4:
        raw = mutated(rng, raw, list(_SAMPLES.values()))
    others = [one for files in _DEFINITIONS for one in files.values()]
    files = dict(files)
    if files and rng.random() < 0.2:
        # The sender's file and the reader's: one list, defined twice.
        theirs = rng.choice(sorted(files))
        files[f"reader {theirs}"] = mutated_definition(rng, files[theirs], others)
    if files and rng.random() < 0.5:
        for one in rng.sample(sorted(files), rng.choice((1, 1, min(2, len(files)), len(files)))):
            files[one] = mutated_definition(rng, files[one], others)
    return name, Plant(raw, files)


def _original(rng: random.Random) -> tuple[str, bytes]:
    match rng.randrange(4):
        case 0:
            return "peers/peers.pcap", _SAMPLES["peers/peers.pcap"]
        case 1:
            return rng.choice(list(_SAMPLES.items()))
        case 2:
            number = rng.randrange(1000)
            return f"traffic-{number}", random_traffic(number)
        case _:
            path = rng.choice(SCENARIOS)
            return path.stem, scenario_traffic(path)
