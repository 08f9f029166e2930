"""What is found about security in drawn traffic, against the rules written a second time, however it is cut."""

from __future__ import annotations

import random
import tomllib
from collections import Counter
from functools import cache
from ipaddress import ip_address
from itertools import pairwise
from pathlib import Path

import pytest

from nvscope.definition.project_file import read_project
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.tracker.summary import summarize
from tests.findings.security_plants import OF_SECURITY
from tests.laws import some
from tests.oracle.frame import Address, Frame
from tests.oracle.reference import reference_report
from tests.oracle.rules.security import Row, security_rows
from tests.oracle.security_traffic import security_project, security_traffic
from tests.packets import batch_of, tracked

SEEDS = some(range(60))


@cache
def traffic(seed: int) -> tuple[Frame, ...]:
    return tuple(security_traffic(seed))


@cache
def rows(seed: int) -> list[Row]:
    frames, project = traffic(seed), tomllib.loads(security_project(seed))
    scopes = {
        stream["node"]: stream["counter_scope"]
        for entry in reference_report(frames)["lists"]
        for stream in entry["streams"]
        if stream["counter_scope"] not in ("stream", "unused")
    }

    def scope_of(node: Address) -> str:
        return scopes.get(str(node), "stream")

    return security_rows(frames, project, scope_of)


def found(seed: int, cuts: list[int], directory: Path) -> list[Row]:
    file = directory / "nvscope.toml"
    file.write_text(security_project(seed), "utf-8")
    project, whole = read_project(file), batch_of(traffic(seed))
    edges = [0, *sorted(cuts), len(whole)]
    state = tracked([whole[begin:end] for begin, end in pairwise(edges)])
    summary = summarize(state, readers=project.readers)
    counts: Counter[tuple[str, str | None, str | None, int | None]] = Counter()

    def place(one: Finding) -> tuple[str, str | None, str | None, int | None]:
        keys = {entry.number: str(entry.key) for entry in summary.lists}
        key = None if one.list_number is None else keys[one.list_number]
        return one.code, key, None if one.node is None else summary.addresses[one.node], one.subindex

    for one in judge(state, summary=summary, nodes=project.nodes, security=project.security):
        if one.code in OF_SECURITY:
            counts[place(one)] += one.count
    return [(*one, count) for one, count in sorted(counts.items(), key=str)]


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_found_is_what_the_rules_say_however_it_is_cut(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    frames = len(traffic(seed))
    cuts = [chance.randrange(frames) for _ in range(chance.choice((0, 1, 5, 40)))]
    assert found(seed, cuts, tmp_path) == rows(seed)


def test_drawn_traffic_shows_what_it_is_drawn_for() -> None:
    drawn = [rows(seed) for seed in range(7)]
    assert {code for found in drawn for code, *_ in found} == OF_SECURITY - {"NV803", "NV963"}
    assert [] in drawn


def test_addresses_of_rows_are_those_of_reports() -> None:
    assert all(ip_address(node) for seed in SEEDS for _, _, node, *_ in rows(seed) if node is not None)
