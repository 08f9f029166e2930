"""What reports tell of the capture where a file cannot: what is watched live, and losses of several sources."""

from __future__ import annotations

from itertools import permutations

import pytest

from nvscope.capture.source import SourceInfo
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.packets import batch_of, observed
from tests.records import replace
from tests.schemas.validation import mistakes_in


def info(path: str, drops: int | None = 0, start_ns: int | None = None, **parts: int) -> SourceInfo:
    return SourceInfo(path, "pcapng", 100, 0, drops, parts, start_ns=start_ns, end_ns=start_ns)


def capture_of(*sources: SourceInfo, until_ns: int | None = None) -> dict[str, object]:
    state = observed(TrackerState(), [replace(batch_of([]), until_ns=until_ns)])
    document = report_document(summarize(state), [], sources)
    assert mistakes_in(document) == []
    return dict(document["capture"])


@pytest.mark.parametrize(("until_ns", "told"), [(None, None), (1 << 62, str(1 << 62)), (-1, "-1")])
def test_until_when_a_source_was_watched_is_told_where_it_says_so(until_ns: int | None, told: str | None) -> None:
    capture = capture_of(until_ns=until_ns)
    assert (capture["until_ns"], capture["start_ns"], capture["end_ns"]) == (told, None, None)


def test_losses_are_added_up_part_by_part_and_none_that_was_not() -> None:
    sources = info("a", 9, kernel=4, ring=2), info("b", 5, kernel=1, queue=3), info("c", 7), info("d", 0, interface=0)
    capture = capture_of(*sources)
    assert (capture["drops"], capture["drops_by"]) == (21, {"kernel": 5, "queue": 3, "ring": 2})


def test_losses_are_unknown_where_one_source_cannot_know_them() -> None:
    capture = capture_of(info("a", 9, kernel=4), info("b", None))
    assert (capture["drops"], capture["drops_by"]) == (None, None)


def test_sources_are_sorted_by_their_begin_whatever_order_they_are_given_in() -> None:
    sources = info("z", start_ns=-5), info("b", start_ns=0), info("a", start_ns=7), info("c", start_ns=7), info("0")
    for given in permutations(sources):
        told = capture_of(*given)["sources"]
        assert isinstance(told, list)
        assert [source["path"] for source in told] == ["z", "b", "a", "c", "0"]
