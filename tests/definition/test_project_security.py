"""What a project file says of security: who may write, when, from which networks telegrams come."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition.project_file import document, read_project
from nvscope.definition.project_security import Security
from nvscope.errors import ConfigurationError
from tests.laws import examples

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")


def security(directory: Path, text: str) -> Security:
    path = directory / "nvscope.toml"
    path.write_text(text, "utf-8")
    told = read_project(path).security
    assert told is not None
    return told


def test_writers_are_addresses_names_and_networks(tmp_path: Path) -> None:
    told = security(
        tmp_path,
        '[security]\nwriters = ["192.168.1.10", "panel", "10.0.0.0/24", "fd00::/64"]\n'
        '[nodes]\n"192.168.1.77" = { name = "panel" }\n',
    )
    assert all(told.lets_write(one) for one in ("192.168.1.10", "192.168.1.77", "10.0.0.200", "fd00::9"))
    assert not any(told.lets_write(one) for one in ("192.168.1.11", "10.0.1.1", "fd01::9", "::ffff"))
    assert told.judges_writes
    assert told.lets_write_at(0)


def test_one_writer_needs_no_brackets_and_none_at_all_forbids_every_write(tmp_path: Path) -> None:
    assert security(tmp_path, '[security]\nwriters = "10.0.0.1"').lets_write("10.0.0.1")
    nobody = security(tmp_path, "[security]\nwriters = []")
    assert nobody.judges_writes
    assert not nobody.lets_write("10.0.0.1")


def test_without_the_table_or_what_it_is_about_nothing_is_said(tmp_path: Path) -> None:
    for text in ("", "[security]\n", "[security]\nonly_nodes = false\n"):
        (tmp_path / "nvscope.toml").write_text(text, "utf-8")
        assert read_project(tmp_path / "nvscope.toml").security is None
    told = security(tmp_path, '[security]\nsubnets = "10.0.0.0/8"')
    assert not told.judges_writes
    assert told.lets_write("1.2.3.4")


def test_of_addresses_only_those_of_a_kind_that_is_named_are_outside(tmp_path: Path) -> None:
    told = security(tmp_path, '[security]\nsubnets = ["10.0.0.0/8", "192.168.1.0/24"]')
    assert [told.is_outside(one) for one in ("10.1.2.3", "192.168.1.9", "192.168.2.9", "8.8.8.8", "fe80::1")] == [
        False, False, True, True, False,
    ]  # fmt: skip


MINUTES = st.integers(0, 24 * 60 - 1)


def text_of(minute: int) -> str:
    return f"{minute // 60:02}:{minute % 60:02}"


@examples(200)
@given(
    first=MINUTES, end=st.integers(1, 24 * 60), days=st.none() | st.tuples(st.integers(0, 6), st.integers(0, 6)),
    at=st.integers(0, 2_000_000_000),
)  # fmt: skip
def test_hours_are_local_and_of_the_day_on_which_they_begin(
    first: int, end: int, days: tuple[int, int] | None, at: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if first == end:
        end = first + 1
    span = f"{text_of(first)}-{text_of(end)}"
    chosen = set(range(7))
    if days is not None:
        span = f"{DAYS[days[0]]}-{DAYS[days[1]]} {span}"
        chosen, day = {days[0]}, days[0]
        while day != days[1]:
            day = (day + 1) % 7
            chosen.add(day)
    told = security(tmp_path_factory.mktemp("hours"), f'[security]\nhours = "{span}"')
    # Minute by minute from the beginning of each span of this day and of the one before.
    local = datetime.fromtimestamp(at)
    minute = 60 * local.hour + local.minute
    length = (end - first) if end > first else end - first + 24 * 60
    allowed = any(
        day % 7 in chosen and first <= minute + behind < first + length
        for day, behind in ((local.weekday(), 0), (local.weekday() - 1, 24 * 60))
    )
    assert told.lets_write_at(at * 1_000_000_000 + 999_999_999) == allowed


def test_of_several_spans_one_is_enough(tmp_path: Path) -> None:
    told = security(tmp_path, '[security]\nhours = ["mon-fri 06:00-18:00", "sat 8:00-12:00"]')
    monday = int(datetime(2024, 1, 1, 6, 0).timestamp())
    hours = [(0, True), (11, True), (12, False), (5 * 24 + 2, True), (5 * 24 + 1, False), (6 * 24 + 3, False)]
    assert [told.lets_write_at((monday + 3600 * one) * 10**9) for one, _ in hours] == [wanted for _, wanted in hours]


@pytest.mark.parametrize(
    ("text", "where", "what", "next_step"),
    [
        ('[security]\nwriter = "x"', "line 2, column 1: security.writer", "unknown key 'writer'", "is 'writers'"),
        ('[security]\nwriters = ["press"]', "line 2, column 1: security.writers[0]", "no node is called", "[nodes]"),
        ('[nodes]\n"1.2.3.4" = { name = "hm1" }\n[security]\nwriters = "hm"', "security.writers", "no node", "hm1"),
        ('[security]\nwriters = ["10.0.0.1/8"]', "security.writers[0]", "bits behind its mask", "10.0.0.0/8"),
        ('[security]\nwriters = ["10.0.0.0/33"]', "security.writers[0]", "'10.0.0.0/33' is no network", "/24"),
        (
            "[security]\nwriters = [7]",
            "security.writers[0]",
            "a text is expected, found a whole number ('7')",
            'quotes: "7".',
        ),
        ('[security]\nwriters = [""]', "security.writers[0]", "is an address, a network, or the name", "192.168.1.20"),
        ('[security]\n\n  hours = "6-18"', "line 3, column 3: security.hours", "'6-18' is no span", "06:00-18:00"),
        ('[security]\nhours = "06:60-18:00"', "security.hours", "is no span of hours", ""),
        ('[security]\nhours = "06:00-24:01"', "security.hours", "is no span of hours", ""),
        ('[security]\nhours = "24:00-06:00"', "security.hours", "is no span of hours", ""),
        ('[security]\nhours = "06:00-06:00"', "security.hours", "is no span of hours", ""),
        ('[security]\nhours = ["06:00-18:00", "mo 06:00-18:00"]', "security.hours[1]", "is no span of hours", ""),
        ('[security]\nsubnets = ["press"]', "security.subnets[0]", "'press' is no network", "192.168.1.0/24"),
        ('[security]\nonly_nodes = "yes"', "security.only_nodes", "true or false is expected", "without quotes"),
        (
            "security = true",
            "security",
            "found true or false ('true')",
            "known are: hours, only_nodes, subnets, writers.",
        ),
        ("[webvisu]\nports = ['8080']", "webvisu.ports[0]", "a whole number is expected", "without quotes: 8080."),
        ("[webvisu]\nports = ['all']", "webvisu.ports[0]", "found a text ('all')", "a whole number from 1 to 65535."),
        ('[nodes]\n"1.2.3.4" = { writes = ["x"] }', 'nodes."1.2.3.4".writes[0]', "'x' is no list", "udp/1300/7"),
    ],
)
def test_a_mistake_is_named_with_its_place(
    text: str, where: str, what: str, next_step: str, tmp_path: Path
) -> None:  # fmt: skip
    path = tmp_path / "nvscope.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_project(path)
    assert str(path) in caught.value.where
    assert where in caught.value.where
    assert "line " in caught.value.where
    assert what in caught.value.what
    assert next_step in caught.value.next_step


def test_all_keys_are_documented() -> None:
    text = document()
    assert "## [security]" in text
    for key in ("writers", "hours", "subnets", "only_nodes", "writes"):
        assert f"- `{key}` (" in text
