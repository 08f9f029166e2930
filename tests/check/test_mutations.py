"""A good capture keeps all rules; each fault that is put into it breaks the rules that are about it, and no other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.check.rules import read_rules
from nvscope.check.run import checked
from nvscope.check.verdict import Verdict
from nvscope.simulate.scenario_file import load_scenario
from tests.check.plants import captured, definitions
from tests.check.plants import judged as judged_as_data
from tests.check.scenario_captures import capture_of
from tests.simulate.simulation import project_of

RULES = """
[[rule]]
id = "cycle"
check = "cycle"
list = "axis"
interval = "50ms"
tolerance = "20%"

[[rule]]
id = "jitter"
check = "jitter"
list = "axis"
max = "5ms"

[[rule]]
id = "min_gap"
check = "min_gap"
list = "axis"
min = "40ms"

[[rule]]
id = "silence"
check = "silence"
list = ["axis", 9]
max = "300ms"

[[rule]]
id = "present"
check = "present"
list = ["axis", 9, "recipe"]
within = "2s"

[[rule]]
id = "absent"
check = "absent"
list = "99"

[[rule]]
id = "occurrence"
check = "occurrence"
list = 9
per = "1s"
min = 36
max = 44

[[rule]]
id = "loss"
check = "loss"

[[rule]]
id = "gap"
check = "gap"
max = 1

[[rule]]
id = "duplicates"
check = "duplicates"

[[rule]]
id = "overtaken"
check = "overtaken"

[[rule]]
id = "restarts"
check = "restarts"

[[rule]]
id = "malformed"
check = "malformed"

[[rule]]
id = "single_sender"
check = "single_sender"
list = ["axis", 9, "recipe"]
senders = ["192.168.1.10", "192.168.1.11"]

[[rule]]
id = "known_nodes"
check = "known_nodes"
nodes = ["192.168.1.10", "192.168.1.11"]

[[rule]]
id = "acknowledged"
check = "acknowledged"
list = "recipe"
within = "20ms"

[[rule]]
id = "boot_up"
check = "boot_up"
list = "recipe"
within = "100ms"

[[rule]]
id = "definition"
check = "definition"
list = ["axis", "recipe"]

[[rule]]
id = "coherence"
check = "coherence"
list = "axis"
skew = "5ms"

[[rule]]
id = "capture_quality"
check = "capture_quality"
min_duration = "15s"

[[rule]]
id = "no_loss_in_a_second"
check = "never"
expr = "list.lost > 0"
window = "1s"
list = "axis"

[[rule]]
id = "no_second_sender"
check = "never"
expr = 'cause.kind == "second-sender"'

[[rule]]
id = "nobody_silent"
check = "never"
expr = 'cause.kind == "node-silent" || cause.kind == "list-stopped"'

[[rule]]
id = "sent"
check = "eventually"
expr = "nv.index == 3 && nv.counter > 5"
within = "10s"
"""

DEFINED = '[[definition]]\nlist = "axis"\n[[definition]]\nlist = "recipe"\n'

LOSES = {"loss", "cycle", "coherence", "no_loss_in_a_second"}
"""What one lost telegram of the axis breaks, which is sent in two parts: it is late, and one of its cycles is torn."""

MUTATIONS = {
    "nothing": ("", (), set()),
    "one telegram is lost": ('[[loss]]\nlist = "axis"\nsubindex = 0\ntelegrams = [100]', (), LOSES),
    "three in a row are": ('[[loss]]\nlist = "axis"\nsubindex = 0\ntelegrams = [100]\nrun = 3', (), LOSES | {"gap"}),
    "one comes late": ('[[late]]\nlist = "axis"\ntelegrams = [100]\nby = "30ms"', (), {"cycle", "min_gap"}),
    "one in ten comes late": (
        '[[late]]\nlist = "axis"\nevery = 10\nby = "12ms"', (), {"cycle", "jitter", "min_gap"},
    ),
    "one comes twice": ('[[duplicate]]\nlist = "belt"\ntelegrams = [50]', (), {"duplicates"}),
    "one is overtaken": ('[[overtaken]]\nlist = "recipe"\ntelegrams = [20]', (), {"overtaken"}),
    "a node starts anew": (
        '[[restart]]\nnode = "conveyor"\nat = "10s"\noutage = "50ms"', (), {"restarts"},
    ),
    "it is away for long": (
        '[[restart]]\nnode = "conveyor"\nat = "10s"\noutage = "3s"', (), {"restarts", "silence", "occurrence"},
    ),
    "a second one sends": (
        '[[second_sender]]\nlist = "axis"\nnode = "bench"\nfrom = "10s"\nbytes = [256, 88]\nchecksum = 0x5A',
        (('[[list]]\nname = "axis"', '[[node]]\nname = "bench"\naddress = "192.168.1.99"\n\n[[list]]\nname = "axis"'),),
        {"single_sender", "known_nodes", "no_second_sender"},
    ),
    "another one sends": ("", (("192.168.1.11", "192.168.1.12"),), {"single_sender", "known_nodes"}),
    "a list stops": (
        '[[stop]]\nnode = "conveyor"\nat = "10s"', (), {"silence", "occurrence", "nobody_silent"},
    ),
    "the cycle is another one": (
        "", (('bytes = [256, 88]\ninterval = "50ms"', 'bytes = [256, 88]\ninterval = "60ms"'),), {"cycle"},
    ),
    "acknowledgements are missing": (
        '[[missing_acknowledgement]]\nlist = "recipe"\ntelegrams = [20]', (), {"acknowledged"},
    ),
    "they are slow": ("", (('delay = "3ms"', 'delay = "30ms"'),), {"acknowledged"}),
    "nobody answers who starts": (
        "", (("acknowledge = true", "acknowledge = true\nanswers_boot_up = false"),), {"boot_up"},
    ),
    "the parts are far apart": ("", (('checksum = 0x5A', 'checksum = 0x5A\nspacing = "8ms"'),), {"coherence"}),
    "one is malformed": ('[[malformed]]\nlist = "belt"\nkind = "wrong_length"\ntelegrams = [50]', (), {"malformed"}),
    "it is recorded for too short": ("", (('duration = "20s"', 'duration = "12s"'),), {"capture_quality"}),
}  # fmt: skip


def judged(folder: Path, changes: tuple[tuple[str, str], ...], more: str) -> dict[str, tuple[Verdict, str]]:
    """Return the verdict of each rule, and its reason."""
    (folder / "x.rules.toml").write_text(RULES)
    capture = capture_of("plant-clean", folder, *changes, seed=8, more=more)
    plain = capture_of("plant-clean", folder, seed=9, more=DEFINED).with_suffix(".toml")
    project = project_of(load_scenario(plain), folder)
    found = checked(Inquiry([str(capture)], project), read_rules([str(folder / "x.rules.toml")]))
    return {
        one.rule.id: (one.verdict, "; ".join(f"{each.list} {each.reason} {each.worst}" for each in one.subjects))
        for one in found.decided
    }  # fmt: skip


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_fault_breaks_the_rules_that_are_about_it(mutation: str, tmp_path: Path) -> None:
    more, changes, expected = MUTATIONS[mutation]
    found = judged(tmp_path, changes, more)
    wrong = {name: told for name, told in found.items() if (told[0] is Verdict.FAIL) != (name in expected)}
    assert wrong == {}
    undecided = {name: told for name, (verdict, told) in found.items() if verdict is Verdict.INCONCLUSIVE}
    assert undecided == {}


OF_VARIABLES = {
    "range": 'check = "range"\nvariable = "valve.fPos"\nmin = 0\nmax = 100',
    "enum": 'check = "enum"\nvariable = "safety.nMode"\nvalues = [1, 2, 3]',
    "monotonic": 'check = "monotonic"\nvariable = "valve.tRun"\nstrict = true',
    "rate_of_change": 'check = "rate_of_change"\nvariable = "valve.fPos"\nmax = 100.0',
    "frozen": 'check = "frozen"\nvariable = "valve.fPos"\nmax = "500ms"',
    "implies": 'check = "implies"\nif = "rose(var.safety.bStop)"\nthen = "var.valve.bClosed"\nwithin = "200ms"',
    "sequence": (
        'check = "sequence"\nsteps = ["var.safety.bStop", "var.valve.bClosed", "not var.safety.bStop"]\nwithin = "2s"'
    ),
    "always": 'check = "always"\nexpr = "var.valve.fPos <= 100"\nfor = "100ms"',
    "never": 'check = "never"\nexpr = "var.valve.bClosed and not var.safety.bStop"\nfor = "300ms"',
    "occurrence": 'check = "occurrence"\nexpr = "rose(var.safety.bStop)"\nper = "2s"\nmin = 1\nmax = 1',
    "hops": 'check = "hops"\nfrom = "safety.nMode"\nto = "valve.nCount"\nmax_delay = "100ms"',
    "held": 'check = "never"\nexpr = "held(var.safety.bStop, 1200ms)"',
}


def _plant() -> list[list[Any]]:
    """Return 10 s of two lists, each sent every 100 ms; the valve is closed 40 ms behind the stop, and opened so."""
    found: list[list[Any]] = []
    for number in range(100):
        stops, mode = number % 20 >= 10, 1 + number // 40
        found.append([number * 100, 7, [stops, mode]])
        found.append([number * 100 + 40, 8, [stops, 50.0 + number % 10, mode, b"", number]])
    return found


def _valve(number: int, place: int, value: Any) -> Callable[[list[list[Any]]], None]:
    """Let one telegram of the valve have another value."""

    def change(sendings: list[list[Any]]) -> None:
        sendings[2 * number + 1][2][place] = value

    return change


def _kept_open(sendings: list[list[Any]]) -> None:
    for one in sendings[20:40]:
        one[2][0] = one[2][0] and one[1] == 7


def _kept_closed(sendings: list[list[Any]]) -> None:
    for one in sendings[40:60]:
        one[2][0] = one[1] == 8


def _stopped_for_long(sendings: list[list[Any]]) -> None:
    for one in sendings[20:60]:
        one[2][0] = True


def _stuck(sendings: list[list[Any]]) -> None:
    for one in sendings[41:61:2]:
        one[2][1] = 52.0


def _mode_left_behind(sendings: list[list[Any]]) -> None:
    for one in sendings[81:91:2]:
        one[2][2] = 1


VALUES: dict[str, tuple[Callable[[list[list[Any]]], None], set[str]]] = {
    "nothing": (lambda sendings: None, set()),
    "a value is too large": (_valve(30, 1, 104.0), {"range", "rate_of_change"}),
    "it is too large for long": (
        lambda sendings: [_valve(number, 1, 54.5 + number)(sendings) for number in range(50, 60)] and None,
        {"range", "rate_of_change", "always"},
    ),
    "it is no number": (_valve(30, 1, float("nan")), {"range", "rate_of_change"}),
    "it does not move": (_stuck, {"frozen"}),
    "it goes back": (_valve(30, 4, 20), {"monotonic"}),
    "a mode that is none": (lambda sendings: sendings[60][2].__setitem__(1, 7), {"enum"}),
    "the valve stays open": (_kept_open, {"implies", "sequence"}),
    "the valve stays closed": (_kept_closed, {"never", "sequence"}),
    "it is stopped for long": (_stopped_for_long, {"held", "sequence", "occurrence"}),
    "one follows late": (_mode_left_behind, {"hops"}),
}


@pytest.mark.parametrize("mutation", VALUES)
def test_a_value_breaks_the_rules_that_are_about_it(mutation: str, tmp_path: Path) -> None:
    change, expected = VALUES[mutation]
    sendings = _plant()
    change(sendings)
    capture = captured(tmp_path, [(at_ms, index, values) for at_ms, index, values in sendings])
    told = "\n".join(f'[[rule]]\nid = "{name}"\n{rule}\n' for name, rule in OF_VARIABLES.items())
    (tmp_path / "x.rules.toml").write_text(told)
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    found = {one["id"]: one for one in judged_as_data(capture, tmp_path / "x.rules.toml", *options)["rules"]}
    assert {name for name, one in found.items() if one["verdict"] == "fail"} == expected
    assert {name for name, one in found.items() if one["verdict"] == "inconclusive"} == set()
