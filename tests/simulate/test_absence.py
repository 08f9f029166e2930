"""Nodes that are away, lists that begin anew alone, and what a capture lacks: who is seen when, and what they count."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.capture.open import open_source
from nvscope.errors import UsageError
from nvscope.simulate.definition import definitions
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import read_scenario
from nvscope.simulate.simulator import open_capture, simulate
from tests.oracle.frame import Frame
from tests.simulate.simulation import Simulation

PLANT = """
duration = "10s"
wild = true
[[node]]
name = "press"
address = "10.0.0.1"
[[node]]
name = "hmi"
address = "10.0.0.2"
[[list]]
name = "axis"
index = 7
sender = "press"
bytes = 8
interval = "100ms"
acknowledge = true
[[list]]
name = "order"
index = 8
sender = "press"
bytes = 4
interval = "100ms"
[[reader]]
node = "hmi"
list = "axis"
[[traffic]]
kind = "arp"
node = "press"
to = "hmi"
interval = "300ms"
"""
IDENTITY = b"\x00\x2d\x53\x33"


def frames(faults: str) -> list[tuple[float, Frame]]:
    """Return the frames of the plant with faults, with the second in which they are seen."""
    scenario = read_scenario(PLANT + faults)
    return [((frame.ts_ns - scenario.start_ns) / 1e9, frame) for frame in Simulation(scenario).frames()]


def counters(faults: str, index: int) -> list[tuple[float, int]]:
    """Return the counters of a list, by when they are seen."""
    found = []
    for seconds, frame in frames(faults):
        start = frame.data.find(IDENTITY)
        service, of = frame.data[start + 4], frame.data[start + 8]
        if start > 0 and service == 0 and of == index:
            found.append((seconds, int.from_bytes(frame.data[start + 16 : start + 18], "little")))
    return found


def of_press(faults: str) -> list[float]:
    """Return when frames of the press are seen, whatever they are."""
    return [seconds for seconds, frame in frames(faults) if frame.data[6:12] == bytes.fromhex("020000000001")]


@pytest.mark.parametrize("fault", ["power_off", "unplugged"])
def test_nothing_comes_of_a_node_that_is_away(fault: str) -> None:
    seen = of_press(f'[[{fault}]]\nnode = "press"\nat = "3s"\nuntil = "6s"\n')
    assert not [seconds for seconds in seen if 3 <= seconds < 6]
    assert [seconds for seconds in seen if seconds >= 6]
    assert not [seconds for seconds in of_press(f'[[{fault}]]\nnode = "press"\nat = "3s"\n') if seconds >= 3]


def test_a_program_goes_on_without_cable_and_begins_anew_after_power() -> None:
    without_cable = counters('[[unplugged]]\nnode = "press"\nat = "3s"\nuntil = "6s"\n', 7)
    without_power = counters('[[power_off]]\nnode = "press"\nat = "3s"\nuntil = "6s"\n', 7)
    assert next(counter for seconds, counter in without_cable if seconds >= 6) == 61
    assert next(counter for seconds, counter in without_power if seconds >= 6) == 1


def test_a_reader_that_is_away_does_not_answer() -> None:
    away = frames('[[power_off]]\nnode = "hmi"\nat = "3s"\n')
    assert not [1 for seconds, frame in away if seconds > 3 and frame.data[6:12] == bytes.fromhex("020000000002")]


def test_one_list_begins_anew_alone() -> None:
    fault = '[[restart]]\nnode = "press"\nlist = "axis"\nat = "3s"\n'
    assert next(counter for seconds, counter in counters(fault, 7) if seconds >= 3) == 1
    assert next(counter for seconds, counter in counters(fault, 8) if seconds >= 3) == 31


def test_a_pause_of_a_node_holds_up_all_its_lists() -> None:
    fault = '[[pause]]\nnode = "press"\nat = "3s"\nby = "2s"\n'
    for index in (7, 8):
        assert not [1 for seconds, _ in counters(fault, index) if 3 < seconds < 4.9]
        assert [counter for _, counter in counters(fault, index)] == list(range(1, 81))


def test_a_capture_lacks_all_frames_of_a_moment_or_some_of_everybody() -> None:
    whole, lacking = frames(""), frames('[[capture_loss]]\nat = "3s"\nlasting = "500ms"\n')
    assert [one for one in whole if not 3 <= one[0] < 3.5] == lacking
    some = frames("[[capture_loss]]\nprobability = 0.2\n")
    assert 0.7 < len(some) / len(whole) < 0.9


def test_a_capture_tells_of_drops_where_the_format_can(tmp_path: Path) -> None:
    scenario = read_scenario(PLANT + '[[capture_loss]]\nat = "3s"\ndrops = 7\n')
    assert drops(scenario, tmp_path / "a.pcapng") == 7
    assert drops(read_scenario(PLANT), tmp_path / "b.pcapng") == 0
    with pytest.raises(UsageError, match="cannot say"):
        open_capture(scenario, str(tmp_path / "c.pcap"), "c.pcap")
    assert not (tmp_path / "c.pcap").exists()


def drops(scenario: Scenario, path: Path) -> int | None:
    """Return how many frames a capture of a scenario says that it dropped."""
    with open_capture(scenario, str(path), path.name) as sink:
        simulate(scenario, sink)
    source = open_source([str(path)])
    for _ in source:
        pass
    return source.infos[0].drops


def test_a_short_header_has_eighteen_bytes() -> None:
    """As the public npm sender writes it: captures/peers/peers.pcap, frame 18."""
    sender = '[[node]]\nname = "pc"\naddress = "10.0.0.3"\nshort_header = true\n'
    plan = '[[list]]\nname = "odd"\nindex = 9\nsender = "pc"\nbytes = 2\nitems = 1\ninterval = "1s"\nfrom = "2s"\n'
    found = [frame.data[42:] for _, frame in frames(sender + plan) if frame.data[6:12] == bytes.fromhex("020000000003")]
    assert found[0] == bytes.fromhex("002d5333 00000000 0900 00 0100 1600 0100 00 0000")
    assert {len(payload) for payload in found} == {20}


def test_a_definition_says_what_the_scenario_says_and_else_what_is_right() -> None:
    scenario = read_scenario(PLANT + '[[definition]]\nlist = "axis"\nindex = 11\nport = 1300\ntotal_bytes = 9\n')
    text = definitions(scenario)["axis"]
    for part in ("<ListIdentifier>11<", 'Value="1300"', "ARRAY[1..2] OF DWORD", "ARRAY[1..1] OF BYTE", "T#100ms"):
        assert part in text
    assert definitions(read_scenario(PLANT)) == {}


def test_a_full_bus_makes_others_wait_and_what_waits_at_the_end_is_not_recorded() -> None:
    """At 125 kbit/s, a frame takes about a millisecond; without the overload, both lists come at once."""
    plan = "[[bus]]\nchannel = 'can0'\nbit_rate = '125k'\n"
    for name, cob_id in (("a", 0x110), ("b", 0x111)):
        plan += f"[[can_list]]\nname = '{name}'\ncob_id = {cob_id}\nbytes = 8\ninterval = '10ms'\ndefined = false\n"
    scenario = read_scenario(f"duration = '3s'\nwild = true\n{plan}[[bus_overload]]\nfrom = '1s'\nshare = 0.99\n")
    found = [(frame.ts_ns - scenario.start_ns, frame.data[3]) for frame in Simulation(scenario).frames()]
    assert max(time for time, _ in found) < 3_000_000_000

    def count(low: int, begin: int) -> int:
        return sum(begin <= time < begin + 1_000_000_000 and word == low for time, word in found)

    assert (count(0x01, 0), count(0x11, 0)) == (0, 100)
    assert count(0x01, 2_000_000_000) > 900
    assert count(0x11, 2_000_000_000) < 50
