"""Each rule is judged by itself: no other rule, and no other file, changes what it sees."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import BEGIN_NS, captured, definitions, ruled
from tests.check.test_verdicts import STEADY, sent
from tests.oracle.builders import data_frame, telegram
from tests.program_here import run_text

LOSSY = [one for one in STEADY if one != 5]
"""What is lost is lost at half a second."""


def verdicts(*words: Any) -> dict[str, str]:
    """Return the verdict of each rule."""
    done = run_text("check", "--json", *words)
    assert done.returncode in (0, 1, 3), done.stderr
    return {one["id"]: one["verdict"] for one in json.loads(done.stdout)["rules"]}


def file(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.rules.toml"
    path.write_text(text)
    return path


OWN = '[[rule]]\nid = "own"\ncheck = "gap"\n'
STARTS = '[defaults]\nwarmup = "2s"\n[[rule]]\nid = "starts"\ncheck = "gap"\n'


@pytest.mark.parametrize("own", [OWN, f'[defaults]\nwarmup = "0s"\n{OWN}'])
def test_a_warm_up_is_that_of_its_file(own: str, tmp_path: Path) -> None:
    capture = sent(tmp_path, LOSSY)
    starts = file(tmp_path, "starts", STARTS)
    own_file = file(tmp_path, "own", own)
    wanted = {"own": "fail", "starts": "pass"}
    assert verdicts(capture, "--rules", own_file, "--rules", starts) == wanted
    assert verdicts(capture, "--rules", starts, "--rules", own_file) == wanted
    including = file(tmp_path, "all", f'include = "starts.rules.toml"\n{own}')
    assert verdicts(capture, "--rules", including) == wanted


def test_a_file_that_a_rule_names_keeps_its_warm_up_for_itself(tmp_path: Path) -> None:
    capture = sent(tmp_path, LOSSY)
    file(tmp_path, "starts", STARTS)
    both = file(tmp_path, "both", f'[[rule]]\nid = "learnt"\ncheck = "baseline"\nfile = "starts.rules.toml"\n{OWN}')
    assert verdicts(capture, "--rules", both) == {"learnt": "pass", "own": "fail"}


def test_each_of_several_warm_ups_is_as_if_it_were_the_only_one(tmp_path: Path) -> None:
    """What is counted, measured and looked at is what it is alone, in any order of the files."""
    capture = sent(tmp_path, [one for one in STEADY if one not in (5, 15, 16, 41)])
    checks = (
        'check = "loss"\nmax = "1.1%"', 'check = "gap"', 'check = "silence"\nmax = "250ms"',
        'check = "jitter"\nmax = "90ms"',
        'check = "cycle"\ninterval = "100ms"', 'check = "present"\nwithin = "0s"',
        'check = "never"\nexpr = "list.lost > 1"\nwindow = "500ms"', 'check = "occurrence"\nper = "1s"\nmin = 9',
    )  # fmt: skip
    files = []
    for name, warmup in (("none", "0s"), ("short", "1s"), ("middle", "2s"), ("long", "5s")):
        rules = "".join(f'[[rule]]\nid = "{name}{number}"\n{one}\n' for number, one in enumerate(checks))
        files.append(file(tmp_path, name, f'[defaults]\nwarmup = "{warmup}"\n{rules}'))
    alone: dict[str, str] = {}
    for one in files:
        alone |= verdicts(capture, "--rules", one)
    assert {"fail", "pass"} <= set(alone.values())
    assert alone["none1"] == alone["middle1"] == "fail" != alone["long1"]
    for order in (files, files[::-1]):
        assert verdicts(capture, *(word for one in order for word in ("--rules", one))) == alone


def answered(folder: Path, took_ms: int) -> Path:
    """Write a list that is to be acknowledged each second: it is at once, but once after so long."""
    frames = []
    for number in range(10):
        at_ns = BEGIN_NS + number * 10**9
        payload = telegram(list_id=7, counter=number + 1, data=b"\1", flags=1)
        frames.append(data_frame(at_ns, "10.0.0.1", "10.0.0.2", payload))
        answer = telegram(5, 7, counter=number + 1, items=0)
        frames.append(data_frame(at_ns + (took_ms if number == 9 else 5) * 10**6, "10.0.0.2", "10.0.0.1", answer))
    frames.append(data_frame(BEGIN_NS + 15 * 10**9, "10.0.0.3", "10.0.0.255", telegram(list_id=8)))
    found = [Packet(one.data, one.original, one.ts_ns, one.link) for one in sorted(frames, key=lambda one: one.ts_ns)]
    return write(folder / "x.pcap", found)


PATIENT = 'check = "acknowledged"\nwithin = "3s"', 'check = "boot_up"\nwithin = "3s"\noptional = true'


@pytest.mark.parametrize("patient", PATIENT)
def test_patience_is_that_of_its_rule(patient: str, tmp_path: Path) -> None:
    capture = answered(tmp_path, 1_500)
    others = (
        'check = "acknowledged"', 'check = "findings"\nallow = ["NV406", "NV303", "NV501", "NV504"]',
        'check = "never"\nexpr = "list.missing_acknowledgements > 0"\nwindow = "1s"',
    )  # fmt: skip
    assert list(verdicts(capture, "--rules", ruled(tmp_path, *others)).values()) == ["fail"] * 3
    together = verdicts(capture, "--rules", ruled(tmp_path, *others, patient))
    assert list(together.values()) == [*["fail"] * 3, "pass"]
    assert list(verdicts(capture, "--rules", ruled(tmp_path, patient, *others)).values()) == ["pass", *["fail"] * 3]


@pytest.mark.parametrize(
    ("severity", "verdict", "count"), [("error", "pass", 0), ("warning", "fail", 1), ("note", "fail", 2)]
)
def test_severities_of_findings_say_which_count(severity: str, verdict: str, count: int, tmp_path: Path) -> None:
    capture = sent(tmp_path, [*STEADY[:50], 50, *STEADY[50:]])
    options = [text for path in definitions(tmp_path)[1:] for text in ("--gvl", path)]
    rules = ruled(tmp_path, f'check = "findings"\nseverity = "{severity}"\nallow = ["NV407", "NV502"]')
    done = run_text("check", capture, "--rules", rules, "--json", *options)
    (one,) = json.loads(done.stdout)["rules"]
    # How bad the rule is, is another thing.
    assert (one["severity"], one["verdict"], one["subjects"][0]["worst"]) == ("error", verdict, count)
    assert done.returncode == (verdict == "fail")


def test_the_severity_of_such_a_rule_is_that_of_its_file(tmp_path: Path) -> None:
    capture = sent(tmp_path, [*STEADY[:50], 50, *STEADY[50:]])
    rules = ruled(tmp_path, 'check = "findings"\nseverity = "note"', defaults='severity = "warning"')
    done = run_text("check", capture, "--rules", rules, "--json")
    (one,) = json.loads(done.stdout)["rules"]
    assert (one["severity"], one["verdict"], done.returncode) == ("warning", "fail", 0)


def test_what_was_sent_in_the_warm_up_is_not_asked_for_again(tmp_path: Path) -> None:
    """One state tells figures since one moment; those of others are the same."""
    capture = captured(tmp_path, [(number * 50, 7, [False, number % 9]) for number in range(100)])
    rule = 'check = "absent"\nlist = 7\n'
    names = [
        file(tmp_path, f"w{at}", f'[defaults]\nwarmup = "{at}s"\n[[rule]]\nid = "r{at}"\n{rule}') for at in (1, 2, 3)
    ]
    done = run_text("check", capture, "--json", *(word for one in names for word in ("--rules", one)))
    assert [one["subjects"][0]["worst"] for one in json.loads(done.stdout)["rules"]] == [80, 60, 40]
