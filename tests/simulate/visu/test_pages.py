"""Pages in simulated traffic: what was put in is what the rules of the tests and a report see."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path

import pytest

from nvscope.errors import ConfigurationError
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import read_scenario
from nvscope.simulate.visu.talk import talk_of
from nvscope.simulate.visu.truth import COUNTS
from tests.laws import some
from tests.packets import batch_of
from tests.simulate.simulation import Simulation
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of

PLANT = """
duration = "8s"
[[node]]
name = "press"
address = "{network}1"
[[node]]
name = "oven"
address = "{network}2"
vlan = 7
[[node]]
name = "panel"
address = "{network}3"
"""


def random_pages(seed: int) -> str:
    """Return a scenario of some pages, each with faults of its own."""
    chance = random.Random(seed)
    lines = [f"seed = {seed}", f'link = "{chance.choice(["ethernet", "raw", "sll", "sll2"])}"']
    lines.append(PLANT.format(network=chance.choice(["10.0.0.", "10.0.0.", "fd00::"])))
    for _ in range(chance.randint(1, 4)):
        node, to = chance.sample(["press", "oven", "panel"], 2)
        write = chance.random() < 0.3
        keys = {
            "node": f'"{node}"', "to": f'"{to}"', "port": chance.choice([80, 80, 8080]),
            "write": str(write).lower(), "lists": chance.choice(["true", "false"]),
            "kept": chance.choice(["true", "false"]), "segment_bytes": chance.choice([1, 20, 30, 70, 1460]),
            "interval": f'"{chance.choice([90, 400, 1000])}ms"', "jitter": f'"{chance.choice([0, 50])}ms"',
            "latency": f'"{chance.choice([0, 3, 200])}ms"', "late_by": '"1100ms"', "patience": '"700ms"',
            "resent_after": f'"{chance.choice([0, 30, 400])}ms"',
            "values": [chance.choice(["0", "12.5", "a text", "Öl", ""]) for _ in range(chance.randrange(4))],
            "encoding": f'"{chance.choice(["UTF-8", "Cp1252", "X-NONE", "UTF-16"])}"',
        }  # fmt: skip
        if chance.random() < 0.6:
            del keys["encoding"]
        numbers = list(range(1, 30))
        chance.shuffle(numbers)
        faults = ["late", "unanswered", "refused", "overdeclared", "resent", "overtaken"]
        for name in faults if write else [*faults, "shortened"]:
            keys[name] = sorted(numbers.pop() for _ in range(chance.choice([0, 0, 1, 3])))
        lines += ["[[page]]", *(f"{name} = {value}".replace("'", '"') for name, value in keys.items())]
        lines.append("[page.variables]")
        offsets = chance.sample(range(0, 400, 10), chance.choice([1, 2, 7]))
        lines += [f'"v{place}" = "4,{place},{chance.choice(["2,1", "4,6", "9,8"])}"' for place in offsets]
    return "\n".join(lines)


def counted(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """Return rows with what a truth has of them."""
    names = ("client", "server", "port", *COUNTS, "variables")
    return [{name: row[name] for name in names} for row in rows]


@pytest.mark.parametrize("seed", some(range(60)))
def test_what_was_put_in_is_what_is_seen(seed: int) -> None:
    simulation = Simulation(read_scenario(random_pages(seed)))
    put_in = simulation.truth["visu"]
    assert put_in == counted(simulation.visu.rows)
    rows, _ = told(followed([batch_of(list(simulation.frames()))]))
    assert counted(rows) == put_in


LACKING = """
[[page]]
node = "panel"
to = "press"
interval = "1s"
segment_bytes = {size}
lacking = [2]
values = ["{value}"]
kept = {kept}
[page.variables]
a = "4,0,200,8"
"""


def lacking(size: int, value: str, kept: str = "true") -> Scenario:
    return read_scenario(PLANT.format(network="10.0.0.") + LACKING.format(size=size, value=value, kept=kept))


@pytest.mark.parametrize("kept", ["true", "false"])
@pytest.mark.parametrize("size", [1, 7, 30, 61])
def test_a_segment_that_the_capture_lacks_is_a_hole_in_a_body(size: int, kept: str) -> None:
    simulation = Simulation(lacking(size, "x" * 150, kept))
    (row,) = simulation.truth["visu"]
    assert (row["cut"], row["gap_bytes"], row["replies"]) == (1, size, row["reads"] - 1)
    assert counted(simulation.visu.rows) == [row]


def test_a_reply_that_is_too_short_lacks_nothing() -> None:
    with pytest.raises(ConfigurationError, match="the reply to request 2 has no segment that could be lacking"):
        talk_of(lacking(1460, "x"), 0)


ENCODED = """
[[page]]
node = "panel"
to = "press"
interval = "1s"
encoding = "{encoding}"
values = ["{value}"]
write = {write}
[page.variables]
a = "4,0,200,8"
"""


def encoded(encoding: str, value: str, write: str = "true") -> Scenario:
    said = ENCODED.format(encoding=encoding, value=value, write=write)
    return read_scenario(PLANT.format(network="10.0.0.") + said)


@pytest.mark.parametrize(
    ("encoding", "value", "shown"),
    [
        ("UTF-8", "5 € für Öl", "5 € für Öl"), ("Cp1251", "Мельница", "Мельница"), ("SJIS", "機械", "機械"),
        ("ISO-8859-1", "Öl", "Öl"), ("X-NONE", "Öl", "Öl"),
    ],
)  # fmt: skip
def test_texts_are_read_as_the_page_says(encoding: str, value: str, shown: str) -> None:
    simulation = Simulation(encoded(encoding, value))
    frames = list(simulation.frames())
    state = followed([batch_of(frames)])
    assert {row[7] for row in writes_of(state)} == {shown}
    assert writes_of(state) == writes_by_the_rules(by_the_rules(frames))
    assert ("NV809" in {one["code"] for one in told(state)[1]}) is (encoding == "X-NONE")
    wire = b"".join(frame.data for frame in frames)
    said = value.encode({"Cp1251": "cp1251", "SJIS": "shift_jis", "UTF-8": "utf-8"}.get(encoding, "latin-1"))
    assert said + b"|" in wire


@pytest.mark.parametrize(
    ("encoding", "value", "what"),
    [
        ("Cp1252", "Мельница", "is no character of cp1252"), ("X-NONE", "€", "is no character of ISO-8859-1"),
        ("SJIS", "ポ", "has the byte of"), ("a b", "x", "a name has"), ("a<b", "x", "a name has"),
    ],
)  # fmt: skip
def test_texts_that_cannot_be_said_are_told(encoding: str, value: str, what: str) -> None:
    with pytest.raises(ConfigurationError, match=what):
        encoded(encoding, value)


def test_pages_are_the_same_in_every_run_and_others_by_another_seed() -> None:
    frames = [list(Simulation(read_scenario(random_pages(5))).frames()) for _ in range(2)]
    assert frames[0] == frames[1]
    other = Simulation(read_scenario(random_pages(5).replace("seed = 5", "seed = 6")))
    assert list(other.frames()) != frames[0]


def test_more_segments_than_there_is_room_for_are_told() -> None:
    text = PLANT.format(network="10.0.0.").replace('"8s"', '"5h"') + LACKING.format(size=1, value="x", kept="true")
    with pytest.raises(ConfigurationError, match="more than 200000 segments"):
        talk_of(read_scenario(text.replace("lacking = [2]\n", "")), 0)


def test_tshark_puts_together_what_was_said(tmp_path: Path) -> None:
    path = Simulation(read_scenario(random_pages(2))).write(tmp_path / "x.pcap")
    words = ["tshark", "-n", "-r", str(path), "-o", "tcp.reassemble_out_of_order:TRUE", "-Y", "http.request", "-T"]
    done = subprocess.run([*words, "fields", "-e", "http.request.method"], capture_output=True, text=True, check=True)
    simulation = Simulation(read_scenario(random_pages(2)))
    posts = sum(row["reads"] + row["writes"] for row in simulation.truth["visu"])
    assert done.stdout.split().count("POST") == posts > 0
