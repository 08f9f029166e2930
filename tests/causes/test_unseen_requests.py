"""Replies of the Parameter Manager whose requests the capture does not have."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.findings.kind import Severity
from tests.causes.test_parameters import ASKED, ASKING, all_causes_of, cause_of, served
from tests.oracle.builders import MILLISECOND, data_frame, telegram
from tests.oracle.frame import Frame


def polled(first_ms: int) -> list[Frame]:
    """Return a capture of a parameter that is read each second, which begins at a time behind a request."""
    frames = []
    for number in range(10):
        frames += [served(1, number * 1000, number, 1202), served(2, number * 1000 + 50, number, 1202)]
    return [one for one in frames if one.ts_ns >= first_ms * MILLISECOND]


def test_a_capture_that_begins_between_request_and_reply_shows_no_fault(tmp_path: Path) -> None:
    cause = cause_of(polled(20), tmp_path)
    assert (cause.kind.name, cause.severity) == ("capture-incomplete", Severity.NOTE)
    assert cause.title == "The capture begins between a request of the Parameter Manager and its reply"


@pytest.mark.parametrize("first_ms", [0, 60, 1000])
def test_a_capture_that_begins_elsewhere_says_nothing(first_ms: int, tmp_path: Path) -> None:
    assert not all_causes_of(polled(first_ms), tmp_path)


def test_who_answers_twice_does_so_from_the_beginning(tmp_path: Path) -> None:
    again = [served(2, number * 1000 + 90, number, 1202) for number in range(10)]
    frames = sorted([*polled(0), *again], key=lambda one: one.ts_ns)
    assert cause_of(frames, tmp_path).kind.name == "other"
    # Behind the timeout, nothing asked for before the capture is answered any more.
    there = data_frame(0, ASKED, "255.255.255.255", telegram(0, 2))
    late = cause_of([there, served(2, 501, 7, 1202), *polled(1000)], tmp_path)
    assert late.kind.name == "other"


@pytest.mark.parametrize("service", [2, 4])
def test_replies_without_one_request_are_those_of_a_capture_of_one_direction(service: int, tmp_path: Path) -> None:
    frames = [served(service, number * 1000, number, 1202) for number in range(10)]
    cause = cause_of(frames, tmp_path)
    assert (cause.kind.name, cause.severity) == ("capture-incomplete", Severity.WARNING)
    assert cause.title == f"The capture has 10 replies of {ASKED} to {ASKING}, and no whole request to them"
    assert cause.next.startswith("Capture what goes to a controller, too")
