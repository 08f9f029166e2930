"""Reading of scenarios: strict, with messages that name file and key."""

from __future__ import annotations

from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path

import pytest

from nvscope.errors import ConfigurationError
from nvscope.simulate.plan import ListPlan
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_file import document, load_scenario, read_scenario
from nvscope.simulate.simulator import simulate
from nvscope.simulate.telegram_faults import Duplicate
from nvscope.simulate.visu.tables import Page
from tests.simulate.collected import Collected

PLANT = """
duration = "10s"
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
bytes = [16, 8]
interval = "50ms"
"""

ASKING = "[[parameter]]\nnode='hmi'\nto='press'\ninterval='1s'\n"
PAGE_KEYS = "variables = { a = '4,0,2,1' }\ninterval = '1s'\nnode = 'hmi'\nto = 'press'"
PAGE = f"[[page]]\n{PAGE_KEYS}"
FAST = "[[list]]\nname='fast'\nindex=8\nsender='press'\nbytes=4\ninterval='45us'\n"


def test_everything_has_its_default() -> None:
    scenario = read_scenario(PLANT)
    assert scenario.duration_ns == 10_000_000_000
    assert scenario.list[0].shapes == ((4, 16), (2, 8))
    assert scenario.list[0].port == 1202
    assert scenario.node[0].first_value == 1
    assert scenario.start_ns == int(datetime(2024, 1, 1, tzinfo=UTC).timestamp()) * 1_000_000_000


def test_start_keeps_microseconds() -> None:
    scenario = read_scenario("start = 2024-05-06T08:00:00.000001+02:00\n" + PLANT)
    assert scenario.start_ns == 1_714_975_200_000_001_000


def test_total_bytes_are_cut_between_elements() -> None:
    text = PLANT.replace("bytes = [16, 8]", "total_bytes = 600\nelement_bytes = 10")
    assert read_scenario(text).list[0].shapes == ((25, 250), (25, 250), (10, 100))
    text = PLANT.replace("bytes = [16, 8]", "total_bytes = 6\nelement_bytes = 2\npacked = false")
    assert read_scenario(text).list[0].shapes == ((1, 2), (1, 2), (1, 2))


@pytest.mark.parametrize(
    ("added", "where", "what"),
    [
        (
            "[[second_sender]]\nlist='axis'\nnode='hmi'\ncounts_along=true\n",
            "second_sender[0].counts_along",
            "not exact",
        ),
        ("[[scan]]\nnode='pc'\nindex=1\ncount=9\ninterval='1s'\n", "scan[0].node", "there is no node 'pc'"),
        ("[[scan]]\nnode='hmi'\nindex=65000\ncount=999\ninterval='1s'\n", "scan[0].count", "identifiers end at 65535"),
        ("colour = 1", "plant.toml: list[0].colour", "unknown key 'colour'"),
        ("jiter = '1ms'", "list[0].jiter", "nearest known one is 'jitter'"),
        ("jitter = 1", "list[0].jitter", "a duration is expected"),
        ("jitter = '1x'", "list[0].jitter", "is no duration"),
        ("jitter = '-1ms'", "list[0].jitter", "cannot be negative"),
        ("jitter = '26ms'", "list[0].jitter", "more than half the interval"),
        ("spacing = '26ms'", "list[0].spacing", "more than half the interval"),
        ("port = 65536", "list[0].port", "out of range: 1 to 65535"),
        ("port = true", "list[0].port", "a whole number is expected"),
        ("port = 1.5", "list[0].port", "a whole number is expected"),
        ("packed = 1", "list[0].packed", "true or false is expected"),
        ("checksum = [1, 2, 300]", "list[0].checksum[2]", "out of range"),
        ("checksum = [1, 2, 3]", "list[0].checksum", "one for each telegram"),
        ("items = [1]", "list[0].items", "bytes has 2 telegrams"),
        ("mode = 'cyclc'", "list[0].mode", "nearest known one is 'cyclic'"),
        ("destination = 'hmj'", "list[0].destination", "neither an address nor a node"),
        ("destination = 'fd00::1'", "list[0]", "the same version of IP"),
        ("total_bytes = 8", "list[0]", "one of bytes and total_bytes"),
        ("[[loss]]\nlist = 'axes'", "loss[0].list", "nearest known one is 'axis'"),
        ("[[loss]]\nlist = 'axis'\nsubindex = 2", "loss[0].subindex", "0 to 1"),
        ("[[loss]]\nlist = 'axis'\nnode = 'hmi'", "loss[0].node", "does not send this list"),
        ("[[loss]]\nlist = 'axis'\nevery = 2\nprobability = 0.5", "loss[0]", "exclude each other"),
        ("[[loss]]\nlist = 'axis'\ntelegrams = 2\nfrom = '1s'", "loss[0]", "need no times"),
        ("[[loss]]\nlist = 'axis'\nprobability = 2", "loss[0].probability", "out of range"),
        ("[[loss]]\nlist = 'axis'\nby = 2", "loss[0].by", "unknown key"),
        ("[[loss]]\nsubindex = 0", "loss[0]", "the key 'list' is missing"),
        ("[loss]\nlist = 'axis'", "loss", "an array is expected"),
        ("[[late]]\nlist = 'axis'\nby = '50ms'", "late[0].by", "late by an interval"),
        ("[[shape]]\nlist = 'axis'", "shape[0]", "needs items or bytes"),
        ("[[wrong_checksum]]\nlist = 'axis'", "wrong_checksum[0]", "no checksum that could be wrong"),
        ("[[malformed]]\nlist = 'axis'\nkind = 'short'\nservice = 2", "malformed[0].service", "belong to no list"),
        ("[[reader]]\nnode = 'hmj'\nlist = 'axis'", "reader[0].node", "there is no node 'hmj'"),
        ("[[second_sender]]\nlist = 'axis'\nnode = 'press'", "second_sender[0].node", "sends this list already"),
        ("[[burst]]\nlist = 'axis'\nat = '1s'\ncount = 2\ngap = '100us'", "burst[0].gap", "take longer"),
        ("[[node]]\nname = 'x'\naddress = '10.0.0.1'", "node[2].address", "another node already"),
        ("[[node]]\nname = 'press'\naddress = '10.0.0.3'", "node[2].name", "taken"),
        ("[[node]]\nname = 'x'\naddress = '10.0.0.256'", "node[2].address", "no IP address"),
        ("[[node]]\nname = 'x'\naddress = '225.0.0.1'", "node[2].address", "that of one host"),
        ("[[node]]\nname = 'x'\naddress = '10.0.0.3'\nmac = '1:2'", "node[2].mac", "no hardware address"),
        ("[[traffic]]\nkind = 'arp'\nnode = 'hmi'\nto = 'x'\ninterval = '1s'", "traffic[0].to", "there is no node"),
        ("[[pause]]\nat = '1s'\nby = '1s'", "pause[0]", "needs a node or a list"),
        ("[[unplugged]]\nnode = 'hmi'\nat = '2s'\nuntil = '1s'", "unplugged[0].until", "not before"),
        ("[[power_off]]\nnode = 'hmj'\nat = '2s'", "power_off[0].node", "there is no node 'hmj'"),
        ("[[capture_loss]]\nat = '1s'", "capture_loss[0]", "wild = true"),
        ("[[capture_loss]]\nat = '1s'\nprobability = 0.5", "capture_loss[0]", "one of at and probability"),
        ("[[definition]]\nlist = 'axes'", "definition[0].list", "nearest known one is 'axis'"),
        (PAGE.replace("'hmi'", "'hmj'"), "page[0].node", "there is no node 'hmj'"),
        (PAGE.replace("'press'", "'pres'"), "page[0].to", "nearest known one is 'press'"),
        (PAGE.replace("'hmi'", "'press'"), "page[0].to", "a page asks another node"),
        (PAGE.replace("4,0,2,1", "4,0,2"), "page[0].variables.a", "an address is expected"),
        (PAGE.replace("a = '4,0,2,1'", ""), "page[0].variables", "1 to 1000 variables"),
        (PAGE.replace("a =", "'' ="), "page[0].variables", "a name of 1 to 200"),
        ("[[page]]\npath = 'x y'\n" + PAGE_KEYS, "page[0].path", "begins with a slash"),
        ("[[page]]\nvalues = ['a|b']\n" + PAGE_KEYS, "page[0].values[0]", "no | and no line ends"),
        ("[[page]]\nvalues = ['€']\n" + PAGE_KEYS, "page[0].values[0]", "ISO-8859-1"),
        ("[[page]]\nwrite = true\nshortened = [1]\n" + PAGE_KEYS, "page[0].shortened", "have no values"),
        ("[[page]]\nlate = [1, 2]\nunanswered = [2]\n" + PAGE_KEYS, "page[0].late", "request 2 has no reply"),
        ("[[page]]\novertaken = [1]\nresent_after = '6s'\n" + PAGE_KEYS, "page[0].resent_after", "is missing"),
        (PAGE + "\n[[mirrored]]\nfrom = '0s'", "page[0]", "wild = true"),
        (PAGE + "\n[[unplugged]]\nnode = 'hmi'\nat = '2s'", "page[0]", "a node that is away"),
        (
            "[[page]]\novertaken = [1]\n" + PAGE_KEYS + "\n[[clock_step]]\nat = '1s'\nby = '5s'",
            "page[0]",
            "step of the clock",
        ),
        (
            "[[traffic]]\nkind = 'arp'\nnode = 'hmi'\nto = 'press'\ninterval = '0s'",
            "traffic[0].interval",
            "more than 0",
        ),
    ],
)
def test_a_mistake_is_named_with_its_place(added: str, where: str, what: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read_scenario(PLANT + added, "plant.toml")
    assert where in caught.value.where
    assert caught.value.where.startswith("plant.toml")
    assert what in f"{caught.value.what} {caught.value.next_step}"


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('duration = "10s"', "", "the key 'duration' is missing"),
        ('duration = "10s"', 'duration = "0s"', "more than 0"),
        ('duration = "10s"', 'duration = "32d"', "at most 31 days"),
        ('duration = "10s"', 'duration = "10s"\nstart = 2024-01-01T00:00:00', "with an offset"),
        ('duration = "10s"', 'duration = "10s"\nstart = 2200-01-01T00:00:00Z', "between 1970 and 2038"),
        ('duration = "10s"', 'duration = "10s', "no TOML"),
        ("[16, 8]", "[1453]", "out of range"),
        ("[16, 8]", "[]", "one of bytes and total_bytes"),
        ('"50ms"', '"0s"', "more than 0"),
        ('"press"\nbytes', "[]\nbytes", "no sender"),
        ("[[list]]", f"[[node]]\nname='far'\naddress='fe80::1'\n{ASKING}host='far'\n[[list]]", "same version of IP"),
        ("[[list]]", f"{ASKING}host='hm'\n[[list]]", "there is no node 'hm'"),
    ],
)
def test_a_scenario_that_makes_no_sense_is_refused(old: str, new: str, what: str) -> None:
    with pytest.raises(ConfigurationError, match=what):
        read_scenario(PLANT.replace(old, new))


@pytest.mark.parametrize(
    ("added", "what"),
    [
        ("[[loss]]\nlist = 'axis'\ntelegrams = 201", "telegram 201 of axis of press, SubIndex 0 does not exist"),
        ("[[loss]]\nlist='axis'\ntelegrams=9\n[[overtaken]]\nlist='axis'\ntelegrams=10", "telegram 10 of axis"),
        ("[[loss]]\nlist='axis'\ntelegrams=9\n[[reserved_flags]]\nlist='axis'\ntelegrams=9", "is lost already"),
        ("[[overtaken]]\nlist='axis'\ntelegrams=1", "cannot come later"),
        ("[[overtaken]]\nlist='axis'\ntelegrams=200", "cannot come later"),
        ("[[duplicate]]\nlist='axis'\ntelegrams=9\ndelay='60ms'", "followed too soon"),
        ("[[restart]]\nnode='press'\nat='40ms'", "no observer can recognise"),
        ("[[unplugged]]\nnode='press'\nat='1s'\n[[restart]]\nnode='press'\nat='2s'", "is too near to another fault"),
        ("[[mirrored]]\ndelay = '60ms'", "before the next telegram of its stream"),
        ("[[unreachable]]\nlist='axis'\ntelegrams=9", "is no node that could refuse"),
        ("[[clock_step]]\nat='1s'\nby='-300d'\n" * 200, "before 1970"),
        ("[[traffic]]\nkind='ping'\nnode='hmi'\nto='press'\ninterval='1ns'", "frames, more than"),
        ("[[malformed]]\nlist='fast'\nkind='short'\n" + FAST, "streams and single frames"),
    ],
)
def test_faults_that_contradict_each_other_are_refused_before_anything_is_written(added: str, what: str) -> None:
    sink = Collected()
    with pytest.raises(ConfigurationError, match=what) as caught:
        simulate(read_scenario(PLANT + added, "plant.toml"), sink)
    assert caught.value.where.startswith("plant.toml")
    assert not sink.batches


def test_a_wild_scenario_lets_faults_meet() -> None:
    faults = "[[loss]]\nlist='axis'\ntelegrams=9\n[[overtaken]]\nlist='axis'\ntelegrams=10\n"
    truth = simulate(read_scenario("wild = true\n" + PLANT + faults), Collected())
    assert truth["exact"] is False


def test_a_node_that_nobody_could_understand_needs_wild() -> None:
    text = PLANT.replace('address = "10.0.0.1"', 'address = "10.0.0.1"\ncounter = "list"')
    text += "[[list]]\nname = 'belt'\nindex = 9\nsender = 'press'\nbytes = 4\ninterval = '50ms'\n"
    with pytest.raises(ConfigurationError, match="no observer can tell"):
        simulate(read_scenario(text), Collected())
    truth = simulate(read_scenario("wild = true\n" + text), Collected())
    assert [entry["counters"]["lost"] for entry in truth["lists"]] == [None, None]


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_scenario(tmp_path / "missing.toml")
    (tmp_path / "binary.toml").write_bytes(b"title = '\xff'")
    with pytest.raises(ConfigurationError, match="byte 9 is not UTF-8"):
        load_scenario(tmp_path / "binary.toml")
    (tmp_path / "large.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(ConfigurationError, match="larger than"):
        load_scenario(tmp_path / "large.toml")


def test_the_documentation_has_every_key() -> None:
    tables = {Scenario: "Scenario", ListPlan: "[[list]]", Duplicate: "[[duplicate]]", Page: "[[page]]"}
    for table, heading in tables.items():
        text, _, _ = document().partition(f"## {heading}\n")[2].partition("\n## ")
        for entry in fields(table):
            key = entry.metadata.get("name") or entry.name
            documented = f"`{key}`" in text or f"`[[{key}]]`" in text or f"`[{key}]`" in text
            assert documented == ("kind" in entry.metadata)
