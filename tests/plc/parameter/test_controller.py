"""What a controller answers: against the rules written once more, and whatever comes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.plc.parameter.controller import Controller, Result
from nvscope.plc.parameter.table import Entry, ServedTable, read_served
from tests.laws import examples
from tests.plc.parameter.wire import (
    ACCESS,
    BUSY,
    INDEX,
    ITEMS,
    LENGTH,
    READ,
    READ_REPLY,
    STOPPED,
    SUBINDEX,
    WRITE,
    WRITE_REPLY,
    heard,
    said,
)

TABLE = """
[parameters]
"0x2000:1" = { type = "UINT", value = 7 }
"0x2000:2" = { type = "UINT", value = [1, 2, 3] }
"0x2001:0" = { type = "STRING(3)", value = "abc", access = "ro" }
"0x2002:0" = { type = "BOOL", access = "wo" }
"0x2003:0" = { type = "UINT", fault = "ODErrorReplyCPUStopped" }
"0x2004:0" = { type = "UINT", silent = true }
"0x2005:0" = { type = "UINT", value = 1, busy = 2 }
"0x2006:0" = { type = "UINT", value = 1, duplicate = true, delay = "300ms" }
"0x2007:0" = { type = "UINT", value = 1, wrong_counter = true }
"0x2008:0" = { type = "UINT", value = 1, stuck = true }
"""


def table_of(folder: Path, text: str = TABLE) -> ServedTable:
    path = folder / "table.toml"
    path.write_text(text, encoding="utf-8")
    return read_served(path)


@pytest.fixture
def controller(tmp_path: Path) -> Controller:
    return Controller(table_of(tmp_path))


def answers(controller: Controller, payload: bytes) -> list[bytes]:
    handled = controller.received(payload)
    return [] if handled is None else list(handled.datagrams)


def answer(controller: Controller, payload: bytes) -> tuple[int, bytes]:
    """Return service and data of the one answer, which echoes all else."""
    (one,) = answers(controller, payload)
    found, asked = heard(one), heard(payload)
    assert found[1:5] == asked[1:5]
    return found.service, found.data


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        (said(READ), (READ_REPLY, b"\7\0")),
        (said(READ, counter=65535), (READ_REPLY, b"\7\0")),
        (said(READ, subindex=2, items=3), (READ_REPLY, b"\1\0\2\0\3\0")),
        (said(WRITE, data=b"\1\2"), (WRITE_REPLY, b"")),
        (said(WRITE, subindex=2, items=3, data=bytes(6)), (WRITE_REPLY, b"")),
        (said(WRITE, 0x2002, 0, data=b"\1"), (WRITE_REPLY, b"")),
        (said(READ, 0x3000), (INDEX, b"")),
        (said(WRITE, 0x3000, data=b"\1"), (INDEX, b"")),
        (said(READ, subindex=9), (INDEX, b"")),
        (said(READ, subindex=2), (ITEMS, b"")),
        (said(READ, items=0), (ITEMS, b"")),
        (said(WRITE, items=2, data=bytes(4)), (ITEMS, b"")),
        (said(WRITE, data=b"\1"), (LENGTH, b"")),
        (said(WRITE), (LENGTH, b"")),
        (said(WRITE, data=bytes(400)), (LENGTH, b"")),
        (said(WRITE, 0x2001, 0, data=b"xyz\0"), (ACCESS, b"")),
        (said(READ, 0x2002, 0), (ACCESS, b"")),
        (said(READ, 0x2003, 0), (STOPPED, b"")),
        (said(WRITE, 0x2003, 0, data=b"\1\2"), (STOPPED, b"")),
    ],
)
def test_each_request_has_its_answer(controller: Controller, asked: bytes, expected: tuple[int, bytes]) -> None:
    assert answer(controller, asked) == expected


def test_what_is_written_is_read(controller: Controller) -> None:
    answer(controller, said(WRITE, data=b"\x34\x12"))
    assert answer(controller, said(READ)) == (READ_REPLY, b"\x34\x12")


def test_what_is_refused_changes_nothing(controller: Controller) -> None:
    for data, items in ((b"\1", 1), (b"\1\2", 2), (b"\1\2\3", 1)):
        assert answer(controller, said(WRITE, items=items, data=data))[0] in (ITEMS, LENGTH)
    assert answer(controller, said(READ)) == (READ_REPLY, b"\7\0")


def test_what_is_to_go_wrong_does(controller: Controller) -> None:
    assert answers(controller, said(READ, 0x2004, 0)) == []
    assert [answer(controller, said(READ, 0x2005, 0))[0] for _ in range(4)] == [BUSY, BUSY, READ_REPLY, READ_REPLY]
    one, other = answers(controller, said(READ, 0x2006, 0))
    assert one == other == said(READ_REPLY, 0x2006, 0, data=b"\1\0")
    late = controller.received(said(READ, 0x2006, 0))
    assert late is not None
    assert late.delay_ns == 300_000_000
    assert answers(controller, said(READ, 0x2007, 0)) == [said(READ_REPLY, 0x2007, 0, counter=8, data=b"\1\0")]
    assert answer(controller, said(WRITE, 0x2008, 0, data=b"\2\0")) == (WRITE_REPLY, b"")
    assert answer(controller, said(READ, 0x2008, 0)) == (READ_REPLY, b"\1\0")
    assert {result: controller.results[result] for result in Result} == {
        Result.REPLIED: 7, Result.REFUSED: 0, Result.BUSY: 2, Result.SILENT: 1,
    }  # fmt: skip


@pytest.mark.parametrize("error", range(20, 29))
def test_every_error_can_be_asked_for(tmp_path: Path, error: int) -> None:
    from dissectors.netvar import Service  # noqa: PLC0415  # for its names alone

    text = f'[parameters]\n"1:2" = {{ type = "UINT", fault = "{Service(error).name}" }}\n'
    assert answer(Controller(table_of(tmp_path, text)), said(READ, 1, 2)) == (error, b"")


def test_an_unknown_subindex_may_have_the_error_that_is_called_unused(tmp_path: Path) -> None:
    one = Controller(table_of(tmp_path, 'unknown_subindex = "ODErrorReplySub"\n' + TABLE))
    assert answer(one, said(READ, subindex=9)) == (SUBINDEX, b"")
    assert answer(one, said(READ, 0x3000)) == (INDEX, b"")


def test_what_is_no_request_is_counted_and_not_answered(controller: Controller) -> None:
    came = [
        b"", b"garbage", bytes(1_500), said(READ)[:12], said(READ, length=99), said(0), said(6), said(READ_REPLY),
        said(INDEX), said(BUSY), said(77),
    ]  # fmt: skip
    assert [controller.received(one) for one in came] == [None] * len(came)
    assert dict(controller.ignored) == {"no telegram": 3, "malformed": 3, "about a list": 2, "no request": 3}
    assert not controller.results


class Rules:
    """The rules once more: what answers, and what is held then."""

    def __init__(self, held: dict[tuple[int, int], tuple[int, bytes, str]]) -> None:
        self.held = held

    def answer(self, payload: bytes) -> bytes | None:
        asked = heard(payload)
        if asked.service not in (READ, WRITE):
            return None
        place = asked.index, asked.subindex
        if place not in self.held:
            return said(INDEX, *asked[1:5])
        items, data, access = self.held[place]
        if ("r" if asked.service == READ else "w") not in access:
            return said(ACCESS, *asked[1:5])
        if asked.items != items:
            return said(ITEMS, *asked[1:5])
        if asked.service == READ:
            return said(READ_REPLY, *asked[1:5], data)
        if len(asked.data) != len(data):
            return said(LENGTH, *asked[1:5])
        self.held[place] = items, asked.data, access
        return said(WRITE_REPLY, *asked[1:5])


PLAIN = """
[parameters]
"1:0" = { type = "UINT", value = 7 }
"1:1" = { type = "UINT", value = [1, 2] }
"2:0" = { type = "UINT", access = "ro" }
"2:1" = { type = "UINT", access = "wo" }
"""
SMALL = st.integers(0, 3)
REQUESTS = st.builds(said, SMALL, SMALL, st.integers(0, 2), st.integers(0, 65535), SMALL, st.binary(max_size=4))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> ServedTable:
    return table_of(tmp_path_factory.mktemp("plain"), PLAIN)


@given(st.lists(REQUESTS, max_size=40))
@examples(200)
def test_it_answers_by_the_rules(plain: ServedTable, asked: Sequence[bytes]) -> None:
    rules = Rules(
        {
            (1, 0): (1, b"\7\0", "rw"), (1, 1): (2, b"\1\0\2\0", "rw"), (2, 0): (1, b"\0\0", "r"),
            (2, 1): (1, b"\0\0", "w"),
        }
    )  # fmt: skip
    one = Controller(plain)
    for payload in asked:
        expected = rules.answer(payload)
        assert answers(one, payload) == ([] if expected is None else [expected])


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> ServedTable:
    return table_of(tmp_path_factory.mktemp("odd"))


@given(st.lists(st.binary(max_size=60) | st.binary(max_size=60).map(lambda rest: b"\0-S3\1\0\0\0\0\x20" + rest)))
@examples(300)
def test_no_bytes_raise_and_nothing_is_answered_twice_unasked(odd: ServedTable, came: Sequence[bytes]) -> None:
    one = Controller(odd)
    for payload in came:
        handled = one.received(payload)
        entry: Entry | None = handled and handled.entry
        is_twice = entry is not None and entry.settings.duplicate
        assert handled is None or len(handled.datagrams) <= 1 + is_twice
    assert sum(one.results.values()) + sum(one.ignored.values()) == len(came)
