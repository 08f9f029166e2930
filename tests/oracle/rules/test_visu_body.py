"""What WebVisu says, with the vectors of the documents and public clients (spec/webvisu.md)."""

from __future__ import annotations

import pytest

from tests.oracle.rules.visu_body import (
    Answered,
    Asked,
    Entry,
    Listed,
    answered,
    asked,
    contradict,
    is_page,
    is_password,
    listed_in,
    may_be_asked,
)

OFF_BY_ONE = b"|0|100" + b"".join(b"|%d|2|%d|1|2" % (n, n) for n in range(99)) + b"|"


def posted(body: bytes) -> Asked:
    found = asked(b"POST", b"/plc/webvisu.htm", body)
    assert found is not None
    return found


def addresses(body: bytes) -> list[str]:
    return [",".join(map(str, entry.address)) for entry in posted(body).entries]


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (b"|0|5|0|0|0|1|0|1|4|0|6|8|2|4|6|1|2|3|4|7|2|3|4|2|0|0|0|",
         ["0,0,1,0", "4,0,6,8", "4,6,1,2", "4,7,2,3", "2,0,0,0"]),
        (b"|0|1|0|4|0|6|8|", ["4,0,6,8"]),
        (b"|0|2|0|2|48|0|0|1|2|29|0|0|", ["2,48,0,0", "2,29,0,0"]),
        (b"|0|2|\r\n0|2|48|0|0|\r\n1|2|29|0|0|\r\n", ["2,48,0,0", "2,29,0,0"]),
        (b"|0|1|0|4|572|4|5|", ["4,572,4,5"]),
        (b"|0|3|0|4|146|1|0|1|4|156|4|5|5|4|160|4|6|", ["4,146,1,0", "4,156,4,5", "4,160,4,6"]),
        (b"|0|1|0|4|0|6|8", ["4,0,6,8"]),
        (b"|0|1|0|04|00|6|8|", ["4,0,6,8"]),
    ],
)  # fmt: skip
def test_reads(body: bytes, expected: list[str]) -> None:
    found = posted(body)
    assert (found.write, found.miscounted, addresses(body)) == (False, False, expected)


@pytest.mark.parametrize(
    ("body", "values"),
    [
        (b"|1|1|0|0|6|1|2|7|", [b"7"]),
        (b"|1|1|0|4|572|4|5|0|", [b"0"]),
        (b"|1|1|0|2|112|1|0|1|", [b"1"]),
        (b"|1|2|0|4|0|6|8|ab|1|4|7|2|3|5|", [b"ab", b"5"]),
        (b"|1|1|0|4|0|6|8||", [b""]),
        (b"|1|1|0|4|0|6|8|a|b|", [b"a|b"]),
        (b"|1|01|0|4|0|6|8|a|b||", [b"a|b|"]),
        (b"|1|1|0|4|0|6|2|a|b|", [b"a"]),
        (b"|1|2|0|4|0|6|8|a|b|1|4|0|6|8|c|", [b"a|b", b"c"]),
        (b"|1|2|0|4|0|6|8|a|b|1|4|7|4|6|80.0|", [b"a|b", b"80.0"]),
        (b"|1|3|1|4|7|4|6|1.5|2|4|0|6|8||||3|4|7|4|6|2|", [b"1.5", b"||", b"2"]),
        (b"|1|2|0|4|0|6|8|a|b|0|4|7|4|6|80.0|", [b"a|b", b"80.0"]),
        (b"|1|2|0|4|0|6|8|a|1|4|7|4|6|80.0", [b"a", b"80.0"]),
    ],
)
def test_writes(body: bytes, values: list[bytes]) -> None:
    found = posted(body)
    assert (found.write, found.miscounted, [entry.value for entry in found.entries]) == (True, False, values)


@pytest.mark.parametrize(
    ("body", "entries"),
    [
        (OFF_BY_ONE, 99),
        (b"|0|2|0|4|0|6|8|", 1),
        (b"|0|1|0|4|0|6|8|1|4|0|6|8|", 2),
        (b"|0|1|0|4|0|6|", 0),
        (b"|0|2|0|4|0|6|8|x|4|0|6|8|", 1),
        (b"|0|1|0|4|0|12345678901|8|", 0),
        (b"|1|1|0|4|0|6|8|", 0),
        (b"|0|99999999999999999999999|", 0),
        (b"|0|20000|" + b"1|2|3|4|5|" * 20_000, 10_000),
    ],
)
def test_what_is_miscounted(body: bytes, entries: int) -> None:
    found = posted(body)
    assert (found.miscounted, len(found.entries)) == (True, entries)


@pytest.mark.parametrize(
    ("body", "values"),
    [
        (b"|1|1|0|4|0|6|8|a|1|4|7|4|6|80.0|", [None]),  # a text, or two entries
        (b"|1|2|0|4|0|6|8|a|1|4|0|6|8|b|1|4|7|4|6|80.0|", [None]),  # which entry is the second one?
        (b"|1|2|0|4|0|6|8|a|1|4|0|6|8|b|1|4|0|6|8|c|", [None, None]),
        (b"|1|2|0|4|0|6|8|a|1|4|7|4|6|8|1|4|0|6|8|c|", [None]),  # by position, a REAL is written
        (b"|1|3|0|4|7|4|6|7|1|4|0|6|8|a|b|x|4|7|4|6|80.0|", [b"7", None]),
        (b"|1|3|0|4|0|6|8|a|b|5|4|0|6|8|c|d|6|4|7|4|6|1|", [None]),  # two texts, and no numbers that run
    ],
)
def test_what_may_be_divided_in_several_ways(body: bytes, values: list[bytes | None]) -> None:
    found = posted(body)
    assert (found.ambiguous, found.miscounted, [entry.value for entry in found.entries]) == (True, False, values)


@pytest.mark.parametrize("body", [b"", b"|2|1|", b"|0|1", b"|0||", b"0|1|", b" |0|1|", b"|0|x|", b"<soap>"])
def test_other_bodies_are_none(body: bytes) -> None:
    assert asked(b"POST", b"/webvisu.htm", body) is None
    assert asked(b"PUT", b"/webvisu.htm", b"|0|1|0|4|0|6|8|") is None


@pytest.mark.parametrize(
    ("seen", "may_be"),
    [(b"", False), (b"\r\n", False), (b"|", True), (b"|0", True), (b"|0|", True), (b"|\r\n1|\n12", True),
     (b"|0|12|x", True), (b"|2", False), (b"|0|x", False), (b"|00", False), (b"<", False), (b"|0|1\r\n2", False)],
)  # fmt: skip
def test_what_may_become_a_request(seen: bytes, may_be: bool) -> None:
    assert may_be_asked(seen, b"/a.htm", had_request=False) is may_be


def test_what_nothing_is_seen_of_is_told_by_its_page_or_by_what_went_before_it() -> None:
    for target in (b"/webvisu.htm", b"/PLC/WebVisu.htm?x=/y", b"webvisu.htm"):
        assert may_be_asked(b"\r\n", target, had_request=False)
    for target in (b"", b"/webvisu.html", b"/a?/webvisu.htm", b"/xwebvisu.htm"):
        assert not may_be_asked(b"", target, had_request=False)
        assert may_be_asked(b"", target, had_request=True)
    assert not may_be_asked(b"<", b"/webvisu.htm", had_request=True)


def test_queries() -> None:
    found = asked(b"GET", b"/x?readpi?ADR=MW1%2B&FORMAT=%d&adr2=MB3&ADR2=MB4", b"")
    assert found == Asked(False, True, None, (Entry("MW1+", None), Entry("MB3", None), Entry("MB4", None)))
    found = asked(b"GET", b"/WRITEPI?ADR1=MW230&VALUE1=12&FORMAT1=%d&ADR2=MW231&VALUE2=a%7Cb&ADR3=X", b"")
    assert found == Asked(True, True, None, (Entry("MW230", b"12"), Entry("MW231", b"a|b"), Entry("X", None)))
    assert asked(b"GET", b"/READPI", b"") is None
    assert asked(b"POST", b"/READPI?ADR=MW1", b"") is None


BOOL_STRING_BYTE = b"|0|3|0|4|0|1|0|1|4|6|9|8|2|4|7|1|2|"


@pytest.mark.parametrize(
    ("request_body", "reply", "expected"),
    [
        (b"|0|1|0|4|572|4|5|", b"|123|", Answered((b"123",))),
        (b"|0|2|0|2|48|0|0|1|2|29|0|0|", b"|0|0|", Answered((b"0", b"0"))),
        (b"|0|3|0|4|146|1|0|1|4|156|4|5|5|4|160|4|6|", b"|1|42|3.500000|", Answered((b"1", b"42", b"3.500000"))),
        (b"|0|3|0|4|0|6|8|1|4|6|1|2|2|4|7|2|3|", b"|a|b|5|1000|", Answered((b"a|b", b"5", b"1000"))),
        (b"|0|2|0|4|0|1|0|1|9|0|1|0|", b"|1|???|", Answered((b"1", None))),
        (BOOL_STRING_BYTE, b"|1|a|b||7|", Answered((b"1", b"a|b|", b"7"))),
        (BOOL_STRING_BYTE, b"\r\n|1|a|7\r\n", Answered((b"1", b"a", b"7"))),
        (BOOL_STRING_BYTE, b"|1|a|", Answered((b"1", b"a"), miscounted=True)),
        (BOOL_STRING_BYTE, b"1|a|7|", Answered(miscounted=True)),
        (BOOL_STRING_BYTE, b"", Answered(miscounted=True)),
        (b"|0|1|0|4|0|1|0|", b"|1|2|", Answered((b"1",), miscounted=True)),
        (b"|0|1|0|4|0|1|8|", b"||", Answered((b"",))),
        (b"|0|1|0|4|0|1|8|", b"|", Answered(miscounted=True)),
        (b"|0|2|0|4|0|9|8|1|4|9|9|8|", b"|a|b|c|", Answered(ambiguous=True)),
        (b"|0|2|0|4|0|9|8|1|4|9|9|8|", b"|a|", Answered((b"a",), miscounted=True)),
        (b"|0|5|0|4|0|9|8|", b"|a|", Answered((b"a",))),
        (b"|0|0|", b"", Answered()),
    ],
)
def test_replies_to_reads(request_body: bytes, reply: bytes, expected: Answered) -> None:
    said = answered(posted(request_body), 200, reply)
    assert said._replace(seen=()) == expected
    assert len(said.seen) == len(posted(request_body).entries if said.ambiguous else said.values)
    assert answered(posted(request_body), 404, reply) == Answered()


@pytest.mark.parametrize(
    ("reply", "status", "refused"),
    [(b"|0|", 200, False), (b" \t|0|\r\n", 200, False), (b"|1|", 200, True), (b"|0", 200, True), (b"", 200, True),
     (b"|0|", 404, True), (b"", 204, True)],
)  # fmt: skip
def test_replies_to_writes(reply: bytes, status: int, refused: bool) -> None:
    assert answered(posted(b"|1|1|0|0|6|1|2|7|"), status, reply) == Answered(refused=refused)


def test_replies_to_queries_are_not_read() -> None:
    read, write = asked(b"GET", b"/READPI?ADR=MW1", b""), asked(b"GET", b"/WRITEPI?ADR=MW1&VALUE=1", b"")
    assert read is not None
    assert write is not None
    assert [answered(one, status, b"x").refused for one in (read, write) for status in (200, 500)] == [
        False, False, False, True,
    ]  # fmt: skip


def test_names() -> None:
    page = b"""<?xml version="1.0" encoding="ISO-8859-1"?>
        <visualisation><variable name="outside">4,1,1,0</variable><x><variablelist>
        <variable name=".CurrentPassword">4,481,41,8</variable><variable name="PLC_PRG.\xe4"> 4,144,1,0\n</variable>
        <variable>4,1,2,3</variable><variable name="short">4,1</variable><variable name="empty"/>
        </variablelist></x></visualisation>"""
    assert listed_in(page) == [(".CurrentPassword", (4, 481, 41, 8)), ("PLC_PRG.ä", (4, 144, 1, 0))]
    assert listed_in(page[:-3]) == listed_in(b"") == listed_in(b"|0|1|") is None


def test_lists_contradict_each_other_where_a_variable_begins_nowhere_that_both_say() -> None:
    before: Listed = [("a", (4, 1, 2, 3)), ("b", (4, 9, 1, 0)), ("B", (4, 8, 1, 0))]
    for now, different in (
        ([("A", (4, 1, 4, 5))], False), ([("a", (4, 2, 2, 3))], True), ([("a", (4, 1, 0, 0))], True),
        ([("b", (4, 8, 1, 0))], False), ([("b", (4, 7, 1, 0)), ("b", (4, 9, 1, 0))], False),
        ([("c", (4, 1, 2, 3))], False),
    ):  # fmt: skip
        assert contradict(before, list(now)) == different


@pytest.mark.parametrize(
    ("target", "page"),
    [(b"/plc/visu_ini.xml", True), (b"/A.XML?x=/b.htm", True), (b"/a.xml.zip", False), (b"/a?.xml", False)],
)
def test_pages(target: bytes, page: bool) -> None:
    assert is_page(b"GET", target) is page
    assert not is_page(b"HEAD", target)


@pytest.mark.parametrize(
    ("name", "password"),
    [(".CurrentPassword", True), ("CurrentPasswords[7]", True), ("currentPASSWORD", True),
     ("a.b.CurrentPasswords[10]", True), (" .CurrentPasswords [0, 1] ", True), ("CurrentPasswords", True),
     ("CurrentPassword[0]", True), ("CurrentPasswords[0].x", False),
     ("MyCurrentPassword", False), ("CurrentPassword.x", False), (None, False)],
)  # fmt: skip
def test_passwords(name: str | None, password: bool) -> None:
    assert is_password(name) is password
