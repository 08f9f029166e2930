"""What tshark chooses by many display filters: one run answers for all of them, as its start takes the most time."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

_TAPS = Path(__file__).with_suffix(".lua")


def choices_of_tshark(path: Path, filters: Sequence[str], *options: str) -> dict[str, list[int]]:
    """Return the numbers of the frames that each filter chooses; what tshark does not understand as one is not there.

    Fields of Lua dissectors are not there: those are registered when all Lua programs have been run.
    """
    command = ["tshark", "-n", "-Q", "-r", str(path), *options, "-X", f"lua_script:{_TAPS}"]
    command += ["-X", "lua_script1:" + "\n".join(filters)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, list[int]] = {expression: [] for expression in filters}
    for line in done.stdout.splitlines():
        place, number = line.split()
        if number == "refused":
            del found[filters[int(place) - 1]]
        else:
            found[filters[int(place) - 1]].append(int(number))
    return found
