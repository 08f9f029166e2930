"""Rules on captures: each check kept, broken and not to be decided; exit codes; the same input, the same output."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.open import open_sink, open_source
from nvscope.capture.source import Circumstances
from nvscope.check.catalogue import CATALOGUE
from nvscope.check.stream_intervals import IntervalWatcher
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.state import TrackerState
from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import BEGIN_NS, captured, definitions, judged, ruled
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.packets import Batches, batch_of
from tests.program_here import run_text

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "captures" / "plant.pcapng.gz"
RULES = ROOT / "captures" / "plant.rules.toml"
SCENARIOS = ROOT / "tests" / "scenarios"


def verdicts(capture: Path, tmp_path: Path, *rules: str, defaults: str = "") -> list[str]:
    return [one["verdict"] for one in judged(capture, ruled(tmp_path, *rules, defaults=defaults))["rules"]]


def sent(tmp_path: Path, counters: list[int], *, nodes: tuple[str, ...] = ("10.0.0.1",)) -> Path:
    """Return a capture of a list that each node sends with these counters, ten a second."""
    found = []
    for number, counter in enumerate(counters):
        for node in nodes:
            payload = telegram(list_id=7, counter=counter, data=b"\1\2")
            one = data_frame(BEGIN_NS + number * 10**8, node, "10.0.0.255", payload)
            found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return write(tmp_path / "x.pcap", found)


STEADY = list(range(1, 101))


@pytest.mark.parametrize(
    ("counters", "rule", "verdict", "worst"),
    [
        (STEADY, 'check = "loss"', "pass", 0.0),
        ([one for one in STEADY if one != 50], 'check = "loss"', "fail", 0.01),
        ([one for one in STEADY if one != 50], 'check = "loss"\nmax = "1%"', "pass", 0.01),
        ([one for one in STEADY if not 50 <= one <= 52], 'check = "gap"\nmax = 2', "fail", 3),
        ([one for one in STEADY if not 50 <= one <= 52], 'check = "gap"\nmax = 3', "pass", 3),
        ([*STEADY[:50], 50, *STEADY[50:]], 'check = "duplicates"', "fail", 1),
        ([*STEADY[:50], 52, 51, *STEADY[52:]], 'check = "overtaken"', "fail", 1),
        ([*STEADY[:50], *STEADY[:50]], 'check = "restarts"', "fail", 1),
        ([*STEADY[:50], *STEADY[:50]], 'check = "restarts"\nmax = 1', "pass", 1),
        (STEADY, 'check = "malformed"', "pass", 0),
        (STEADY, 'check = "absent"\nlist = 7', "fail", 100),
        (STEADY, 'check = "absent"\nlist = 8', "pass", None),
        (STEADY, 'check = "absent"\nlist = "axis"', "inconclusive", None),
        (STEADY, 'check = "present"\nlist = 7', "pass", 0),
        (STEADY, 'check = "present"\nlist = 8', "inconclusive", None),
        (STEADY, 'check = "single_sender"', "pass", 1),
        (STEADY, 'check = "single_sender"\nsenders = "10.0.0.2"', "fail", 1),
        (STEADY, 'check = "known_nodes"\nnodes = ["10.0.0.1"]', "pass", 0),
        (STEADY, 'check = "known_nodes"\nnodes = ["10.0.0.2"]', "fail", 1),
        (STEADY, 'check = "known_nodes"', "inconclusive", None),
        (STEADY, 'check = "capture_quality"\nmin_duration = "5s"', "pass", 0),
        (STEADY, 'check = "capture_quality"\nmin_duration = "1min"', "fail", 9.9),
        (STEADY, 'check = "causes"', "pass", 0),
        (STEADY, 'check = "loss"\nlist = "8"', "inconclusive", None),
        (STEADY, 'check = "loss"\nlist = "8"\noptional = true', "pass", None),
    ],
)
def test_a_check(counters: list[int], rule: str, verdict: str, worst: float | None, tmp_path: Path) -> None:
    found = judged(sent(tmp_path, counters), ruled(tmp_path, rule))
    (one,) = found["rules"]
    assert (one["verdict"], one["subjects"][0]["worst"]) == (verdict, worst)
    assert found["verdict"] == verdict


def at(tmp_path: Path, times_ms: list[int], *, index: int = 7) -> Path:
    """Return a capture of a list that is sent at these times."""
    found = []
    for number, time_ms in enumerate(times_ms):
        payload = telegram(list_id=index, counter=number + 1, data=b"\1\2")
        one = data_frame(BEGIN_NS + time_ms * 10**6, "10.0.0.1", "10.0.0.255", payload)
        found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return write(tmp_path / "x.pcap", found)


EVERY_100 = [100 * number for number in range(101)]
ONE_LATE = [one + 130 * (one >= 5000) for one in EVERY_100]
ONE_EARLY = [one - 70 * (one == 5000) for one in EVERY_100]
STOPPED = [one for one in EVERY_100 if one <= 6000]


@pytest.mark.parametrize(
    ("times_ms", "rule", "verdict", "worst", "limit", "frames"),
    [
        (EVERY_100, 'check = "cycle"\ninterval = "100ms"', "pass", 0.1, 0.12, []),
        (ONE_LATE, 'check = "cycle"\ninterval = "100ms"', "fail", 0.23, 0.12, [51]),
        (ONE_LATE, 'check = "cycle"\ninterval = "100ms"\nexceptions = "1%"', "pass", 0.23, 0.12, [51]),
        (ONE_LATE, 'check = "cycle"\ninterval = "100ms"\ntolerance = "130%"', "pass", 0.23, 0.23, []),
        (ONE_EARLY, 'check = "cycle"\ninterval = "100ms"\ntolerance = "50%"', "fail", 0.03, 0.05, [51, 52]),
        (EVERY_100[:5], 'check = "cycle"\ninterval = "100ms"', "inconclusive", 0.1, 0.12, []),
        (EVERY_100, 'check = "min_gap"\nmin = "100ms"', "pass", 0.1, 0.1, []),
        (ONE_EARLY, 'check = "min_gap"\nmin = "50ms"', "fail", 0.03, 0.05, [51]),
        (EVERY_100, 'check = "jitter"\nmax = "1ms"', "pass", 0.0, 0.001, []),
        (EVERY_100, 'check = "silence"\nlist = 7\nmax = "150ms"', "pass", 0.1, 0.15, []),
        (ONE_LATE, 'check = "silence"\nlist = 7\nmax = "150ms"', "fail", 0.23, 0.15, [51]),
    ],
)  # fmt: skip
def test_a_check_of_time(
    times_ms: list[int], rule: str, verdict: str, worst: float, limit: float, frames: list[int], tmp_path: Path
) -> None:
    (one,) = judged(at(tmp_path, times_ms), ruled(tmp_path, rule))["rules"]
    (subject,) = one["subjects"]
    assert (one["verdict"], subject["frames"]) == (verdict, frames)
    assert (subject["worst"], subject["limit"]) == pytest.approx((worst, limit))


def test_a_cycle_without_an_interval_cannot_be_judged(tmp_path: Path) -> None:
    (one,) = judged(at(tmp_path, EVERY_100), ruled(tmp_path, 'check = "cycle"'))["rules"]
    assert (one["verdict"], "give its definition" in one["subjects"][0]["reason"]) == ("inconclusive", True)


def test_a_silence_lasts_until_the_end_of_the_capture(tmp_path: Path) -> None:
    """Another list goes on: only so it is known that the one has stopped."""
    both = captured(tmp_path, [*((at_ms, 7, []) for at_ms in STOPPED), *((at_ms, 8, []) for at_ms in EVERY_100)])
    rules = ruled(tmp_path, 'check = "silence"\nlist = 7\nmax = "1s"', 'check = "silence"\nlist = 8\nmax = "1s"')
    done = run_text("check", both, "--rules", rules, "--json")
    stopped, goes_on = json.loads(done.stdout)["rules"]
    assert (stopped["verdict"], goes_on["verdict"]) == ("fail", "pass")
    (subject,) = stopped["subjects"]
    assert (subject["worst"], subject["first_ns"]) == (4.0, str(BEGIN_NS + 6 * 10**9))


@examples(40)
@given(
    st.lists(st.integers(1, 400), min_size=6, max_size=60),
    st.integers(50, 300),
    st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    st.lists(st.sampled_from([1, 2, 5, 17]), min_size=1, max_size=5),
)
def test_intervals_are_counted_one_by_one(
    steps_ms: list[int], wanted_ms: int, tolerance: float, sizes: list[int]
) -> None:  # fmt: skip
    times = [sum(steps_ms[:number]) for number in range(len(steps_ms) + 1)]
    frames = []
    for number, time_ms in enumerate(times):
        payload = telegram(list_id=7, counter=number + 1, data=b"\1\2")
        frames.append(data_frame(BEGIN_NS + time_ms * 10**6, "10.0.0.1", "10.0.0.255", payload))
    whole, batches, begin = batch_of(frames), [], 0
    while begin < len(whole):
        size = sizes[len(batches) % len(sizes)]
        batches.append(whole[begin : begin + size])
        begin += size
    watcher = IntervalWatcher(lambda _: wanted_ms * 10**6, tolerance)
    watcher.state = TrackerState()
    for _ in run(Batches(batches, []), Reading(), [watcher.state, watcher]):
        pass
    (found,) = watcher.streams
    outside = [number for number, step in enumerate(steps_ms) if abs(step - wanted_ms) > wanted_ms * tolerance]
    assert (found.count, found.outside) == (len(steps_ms), len(outside))
    assert abs(found.worst_ns - wanted_ms * 10**6) == max(abs(one - wanted_ms) for one in steps_ms) * 10**6
    assert found.frames == [number + 2 for number in outside[:10]]


def test_what_was_before_the_warm_up_does_not_count(tmp_path: Path) -> None:
    counters = [one for one in STEADY if one not in (5, 50)]
    capture = sent(tmp_path, counters)
    for warmup, count, frames in (("0s", 2, [5, 49]), ("2s", 1, [49])):
        found = judged(capture, ruled(tmp_path, 'check = "loss"', defaults=f'warmup = "{warmup}"'))
        (subject,) = found["rules"][0]["subjects"]
        assert (subject["count"], subject["frames"]) == (count, frames)


def test_what_the_capture_itself_lost_breaks_no_rule(tmp_path: Path) -> None:
    capture = sent(tmp_path, [one for one in STEADY if one != 50])
    with open_sink(str(tmp_path / "dropped.mcap")) as sink:
        sink.describe(Circumstances(drops=0))
        for part in open_source([str(capture)]):
            sink.write(part)
        sink.describe(Circumstances(drops=1))
    found = judged(tmp_path / "dropped.mcap", ruled(tmp_path, 'check = "loss"', 'check = "restarts"'))
    loss, restarts = found["rules"]
    assert (loss["verdict"], restarts["verdict"]) == ("inconclusive", "pass")
    assert loss["subjects"][0]["reason"] == "the capture itself lost 1 frame: it may have been these"
    (quality,) = judged(tmp_path / "dropped.mcap", ruled(tmp_path, 'check = "capture_quality"'))["rules"]
    assert quality["verdict"] == "fail"


def test_two_senders_of_a_list(tmp_path: Path) -> None:
    capture = sent(tmp_path, STEADY, nodes=("10.0.0.1", "10.0.0.2"))
    (one,) = judged(capture, ruled(tmp_path, 'check = "single_sender"'))["rules"]
    assert (one["verdict"], one["subjects"][0]["reason"]) == ("fail", "10.0.0.1, 10.0.0.2 send it")


def test_the_plant_is_judged_as_its_example_says() -> None:
    found = judged(PLANT, RULES)
    assert {one["id"]: one["verdict"] for one in found["rules"]} == {
        "axis-complete": "fail", "axis-in-a-row": "pass", "axis-sender": "fail", "no-restart": "fail",
        "all-there": "pass", "no-old-list": "pass", "readable": "pass", "recorded-well": "pass",
        "axis-cycle": "fail", "nobody-silent": "fail",
    }  # fmt: skip
    loss = found["rules"][0]["subjects"][0]
    assert (loss["list"], loss["frames"], loss["count"]) == ("udp/1202/7", [278, 544], 2)
    assert found["rules"][0]["line"] == 5


def test_exit_codes(tmp_path: Path) -> None:
    lossy = sent(tmp_path, [one for one in STEADY if one != 50])
    nothing = write(tmp_path / "nothing.pcap", [])
    good, bad, open_ = 'check = "restarts"', 'check = "loss"', 'check = "loss"\nlist = "99"'
    mild = 'check = "loss"\nseverity = "warning"'
    for capture, rules, fail_on, code in (
        (lossy, [good], "error", 0),
        (lossy, [good, bad], "error", 1),
        (lossy, [good, open_], "error", 3),
        (lossy, [bad, open_], "error", 1),
        (lossy, [mild], "error", 0),
        (lossy, [mild], "warning", 1),
        (lossy, [open_], "inconclusive", 1),
        (lossy, [bad, open_], "never", 0),
        (nothing, [good, bad], "error", 3),
    ):
        done = run_text("check", capture, "--rules", ruled(tmp_path, *rules), "--fail-on", fail_on)
        assert done.returncode == code, (rules, fail_on, done.stdout, done.stderr)


def test_mistakes_in_rules_end_it_before_anything_is_judged(tmp_path: Path) -> None:
    rules = tmp_path / "x.rules.toml"
    rules.write_text('[[rule]]\nid = "a"\ncheck = "los"\n[[rule]]\ncheck = "gap"\n')
    done = run_text("check", PLANT, "--rules", rules)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{rules}, line 3, column 1: rule[0].check" in done.stderr
    assert f"{rules}, line 4, column 3: rule[1]: the key 'id' is missing" in done.stderr


def test_rules_are_found_beside_the_project(tmp_path: Path) -> None:
    ruled(tmp_path, 'check = "restarts"')
    done = run_text("check", PLANT, cwd=tmp_path)
    assert (done.returncode, "r0" in done.stdout) == (1, True), done.stderr
    (tmp_path / "x.rules.toml").unlink()
    done = run_text("check", PLANT, cwd=tmp_path)
    assert (done.returncode, "no rules are named" in done.stderr) == (2, True)


def test_the_same_input_gives_the_same_output() -> None:
    first, second = (run_text("check", PLANT, "--rules", RULES).stdout for _ in range(2))
    assert first == second
    told = " ".join(first.split())
    assert told.startswith("✗ 4 of 10 rules failed, 1 warning · plant.rules.toml · ")
    assert " · 29.9 s " in told
    assert told.endswith("the tightest is axis-in-a-row: worst 1 telegram, limit 1 telegram, margin 0 %")
    assert "first at 7.0 s, frame 278" in told
    # What belongs to a rule stands below its first line.
    assert all(line.startswith((" ", "✗", "!", "●")) for line in first.splitlines() if line)


_LIMITS = {"cycle": 'interval = "100ms"', "jitter": 'max = "5ms"', "min_gap": 'min = "10ms"', "silence": 'max = "1s"'}


@pytest.mark.parametrize("name", [name for name, one in CATALOGUE.items() if one.subject in ("list", "stream")])
def test_no_rule_is_kept_of_a_list_that_never_came(name: str, tmp_path: Path) -> None:
    capture = captured(tmp_path, [(number * 100, 7, [number % 20 > 10, 3]) for number in range(60)])
    rule = f'check = "{name}"\nlist = ["safety", "valve"]\n{_LIMITS.get(name, "")}'
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    (one,) = judged(capture, ruled(tmp_path, rule), *options)["rules"]
    (valve,) = [subject for subject in one["subjects"] if subject["list"] == "udp/1202/8"]
    if name != "absent":
        assert valve["verdict"] == ("fail" if name in ("present", "silence") else "inconclusive")
        assert valve["reason"] == "it never came"


_NEEDS = {
    **_LIMITS, "occurrence": 'per = "1s"\nmin = 1', "range": 'variable = "valve.fPos"\nmax = 1',
    "enum": 'variable = "valve.nCount"\nvalues = [1]', "monotonic": 'variable = "valve.nCount"',
    "rate_of_change": 'variable = "valve.fPos"\nmax = 1', "frozen": 'variable = "valve.fPos"\nmax = "1s"',
    "implies": 'if = "var.safety.bStop"\nthen = "var.valve.bClosed"', "bus_load": 'max = "50%"',
    "sequence": 'steps = ["var.safety.bStop", "var.valve.bClosed"]\nwithin = "1s"', "always": 'expr = "nv.index == 7"',
    "never": 'expr = "cause.kind == \\"second-sender\\""', "eventually": 'expr = "nv.index == 7"',
    "hops": 'from = "safety.nMode"\nto = "valve.nCount"\nmax_delay = "1s"', "baseline": 'file = "x.rules.toml"',
    "known_nodes": 'nodes = "10.0.0.7"', "transaction": 'max_errors = "0%"', "writes": 'only_by = "10.0.0.7"',
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name != "baseline"])
@pytest.mark.parametrize(("defaults", "seconds"), [("", 0), ('warmup = "1h"', 6)])
def test_no_rule_is_kept_where_nothing_was_recorded(name: str, defaults: str, seconds: int, tmp_path: Path) -> None:
    """Neither in an empty capture, nor where it ends before the warm-up is over."""
    capture = captured(tmp_path, [(number * 100, 7, [number % 20 > 10, 3]) for number in range(10 * seconds)])
    rules = ruled(tmp_path, f'check = "{name}"\n{_NEEDS.get(name, "")}', defaults=defaults)
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    (one,) = judged(capture, rules, *options)["rules"]
    # What a report tells of nothing is that defined lists never came.
    assert one["verdict"] == "inconclusive" or (not seconds and name in ("causes", "findings"))
    assert one["verdict"] != "pass"
    (tmp_path / "x.rules.toml").write_text(rules.read_text() + "optional = true\n")
    (again,) = judged(capture, rules, *options)["rules"]
    assert seconds == 0 or again["verdict"] == "inconclusive"
