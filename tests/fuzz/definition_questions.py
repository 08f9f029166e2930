"""Questions about definition files: their layout, their flaws, what differs, and what is wrong with them."""

from __future__ import annotations

from nvscope.errors import ExitCode
from tests.fuzz.asked import Asked


def ask_definitions(asked: Asked) -> None:
    if not asked.files:
        return
    layout = asked.run("gvl", "layout", *asked.files, "--json")
    lint = asked.run("gvl", "lint", *asked.files, *(["--json"] if asked.rng.random() < 0.5 else []))
    assert layout.code in (ExitCode.GOOD, ExitCode.USAGE), layout
    assert lint.code in (ExitCode.GOOD, ExitCode.ASSERTION_FAILED, ExitCode.USAGE), lint
    if ExitCode.USAGE in (layout.code, lint.code):
        assert layout.code == lint.code
        assert layout.err == lint.err
        assert layout.err
        return
    asked.answered.defined = True
    layout.document()
    asked.run("gvl", "layout", *asked.files)
    first, second = asked.files[0], asked.rng.choice(asked.files)
    types = [word for file in asked.files for word in ("--types", file) if file != first]
    same = asked.run("gvl", "diff", first, first, *types)
    if same.code != ExitCode.USAGE:
        # What nobody knows the size of cannot be told to be the same.
        assert same.code == ExitCode.GOOD or "unknown" in same.out or "nobody" in same.out, same
    asked.run("gvl", "diff", first, second, *types, *(["--json"] if asked.rng.random() < 0.5 else []))


def ask_refused(asked: Asked) -> None:
    """What is wrong with definitions is said by every verb alike."""
    words = [word for file in asked.files for word in ("--gvl", file)]
    verbs = (["vars"], ["report"], ["packets", "-V"])
    refusals = {asked.run(*verb, "-q", str(asked.capture), *words).err for verb in verbs}
    assert len(refusals) == 1, refusals
