"""Many lists of one node to which the same happens: one cause tells of them, where few have a cause each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from nvscope.causes.kind import MOST_APART
from tests.causes.plants import causes_in
from tests.oracle.builders import ACKNOWLEDGEMENT, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import SECOND, A, B, C

ALL, WANTED, REJECTED = "255.255.255.255", 1, 4
Sent = Callable[[int, int], list[Frame]]


def sent(place: int, number: int, *, to: str = ALL, flags: int = WANTED) -> Frame:
    data = telegram(list_id=number, counter=place + 1, flags=flags)
    return data_frame(place * SECOND + number * 1000, A, to, data)


def unacknowledged(place: int, number: int) -> list[Frame]:
    return [sent(place, number)]


def to_nobody(place: int, number: int) -> list[Frame]:
    return [sent(place, number, to=B)]


def rejected(place: int, number: int) -> list[Frame]:
    answer = telegram(ACKNOWLEDGEMENT, number, counter=place + 1, flags=REJECTED, data=b"")
    return [sent(place, number), data_frame(place * SECOND + number * 1000 + SECOND // 2, C, A, answer)]


def titles(each: Sent, lists: int, directory: Path) -> list[str]:
    numbers = range(10, 10 + lists)
    causes = causes_in([frame for place in range(30) for number in numbers for frame in each(place, number)], directory)
    assert {str(key) for cause in causes for key in cause.lists} == {f"udp/1202/{number}" for number in numbers}
    return [cause.title for cause in causes]


@pytest.mark.parametrize(
    ("each", "of_one", "of_many"),
    [
        (unacknowledged, "List {} asks for acknowledgements that nobody sends",
         f"{MOST_APART + 1} lists of node {A} ask for acknowledgements that nobody sends"),
        (to_nobody, "List {} asks for acknowledgements that nobody sends",
         f"{MOST_APART + 1} lists of node {A} ask for acknowledgements that nobody sends"),
        (rejected, f"Node {C} rejects list {{}} since 0.0 s", f"Node {C} rejects {MOST_APART + 1} lists since 0.0 s"),
    ],
)  # fmt: skip
def test_of_more_than_a_few_one_cause_tells(each: Sent, of_one: str, of_many: str, tmp_path: Path) -> None:
    few = [of_one.format(number) for number in range(10, 10 + MOST_APART)]
    told = titles(each, MOST_APART, tmp_path)
    assert [one.replace("0.5 s", "0.0 s") for one in told] == few
    assert [one.replace("0.5 s", "0.0 s") for one in titles(each, MOST_APART + 1, tmp_path)] == [of_many]


def test_lists_that_go_to_others_are_another_matter(tmp_path: Path) -> None:
    def each(place: int, number: int) -> list[Frame]:
        return unacknowledged(place, number) if number < 19 else to_nobody(place, number)

    assert titles(each, 10, tmp_path) == [
        f"9 lists of node {A} ask for acknowledgements that nobody sends",
        "List 19 asks for acknowledgements that nobody sends",
    ]


def test_a_list_that_stopped_with_others_does_not_go_on_with_them(tmp_path: Path) -> None:
    """Each stops for itself; of those that stop with it, it is not said that they go on."""
    frames = [
        sent(place, number, flags=0) for place in range(60) for number in range(10, 16) if place < 30 or number < 12
    ]
    causes = causes_in(frames, tmp_path)
    assert [cause.kind.name for cause in causes] == ["list-stopped"] * 4
    assert [cause.checked[0] for cause in causes] == ["it goes on with lists 10 and 11"] * 4


def foreign(place: int, number: int) -> list[Frame]:
    data = bytes([place % 7, 0])
    payload = telegram(list_id=number, counter=place + 1, data=data, length=len(data))
    return [data_frame(place * SECOND + number * 1000, A, ALL, payload)]


def test_a_sender_whose_headers_no_controller_reads_is_one_for_many_lists(tmp_path: Path) -> None:
    what = "with headers that no controller can read"
    assert titles(foreign, MOST_APART + 1, tmp_path) == [f"Node {A} sends {MOST_APART + 1} lists {what}"]
    assert titles(foreign, 2, tmp_path) == [f"Node {A} sends list {number} {what}" for number in (10, 11)]
