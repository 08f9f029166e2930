"""Which causes are new from one look to the next, and which are over."""

from __future__ import annotations

from nvscope.analysis.news import News
from nvscope.causes.cause import Cause
from nvscope.causes.incomplete import CAPTURE_INCOMPLETE
from nvscope.causes.losses import LOSS_OF_LIST
from nvscope.causes.silences import NODE_SILENT
from nvscope.findings.finding import Finding
from nvscope.findings.kind import Severity
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.list_key import ListKey
from tests.records import replace


def silent(node: int, since_ns: int, until_ns: int | None = None, title: str = "silent") -> Cause:
    return Cause(NODE_SILENT, Severity.ERROR, title, "go", nodes=(node,), since_ns=since_ns, until_ns=until_ns)


def test_a_cause_is_new_once_and_ends_once() -> None:
    news = News()
    open_, over = silent(1, 5), silent(1, 5, 9)
    assert news.of([open_]).new == (open_,)
    assert not news.of([open_])
    told = news.of([over])
    assert (told.new, told.ended) == ((), (over,))
    assert not news.of([over])


def test_other_words_and_figures_make_no_other_cause() -> None:
    news = News()
    news.of([silent(1, 5)])
    assert not news.of([silent(1, 5, title="silent for longer")])


def test_one_that_is_over_at_once_is_told_as_both() -> None:
    over = silent(1, 5, 9)
    told = News().of([over])
    assert (told.new, told.ended) == ((over,), (over,))


def test_one_that_goes_on_again_is_new_again() -> None:
    news = News()
    news.of([silent(1, 5, 9)])
    again = silent(1, 5)
    assert news.of([again]).new == (again,)


def test_one_that_is_told_no_more_is_over() -> None:
    news = News()
    first = silent(1, 5)
    news.of([first])
    other = Cause(LOSS_OF_LIST, Severity.ERROR, "lost", "look", nodes=(1,), since_ns=5)
    told = news.of([other])
    assert (told.new, told.ended, told.instead) == ((other,), (first,), (other,))


def test_what_is_over_is_told_once_whatever_turns_out_to_be_concerned_later() -> None:
    news = News()
    assert news.of([nothing(9, 1, 2)]).new
    assert not news.of([nothing(9, 1, 2, 3)])
    assert not news.of([])
    assert not news.of([nothing(9, 2, 3)])  # it was another cause's for a while
    assert news.of([nothing(9, 2, 3), nothing(9, 7)]).new == (nothing(9, 7),)


def test_what_is_over_and_begins_at_another_time_is_another_one() -> None:
    news = News()
    news.of([silent(1, 5, 9)])
    assert news.of([silent(1, 5, 9), silent(1, 12, 14)]).new == (silent(1, 12, 14),)


def test_what_explains_its_findings_now_is_told_beside_it() -> None:
    news = News()
    gap = Finding(TELEGRAM_GAP, "lost", 3, 5, 6, list_number=1, node=1)
    known = Cause(LOSS_OF_LIST, Severity.ERROR, "all along", "look", nodes=(9,), since_ns=1)
    gone = Cause(LOSS_OF_LIST, Severity.ERROR, "lost", "look", nodes=(1,), since_ns=5, findings=(gap,))
    news.of([known, gone])
    grown = replace(known, findings=(gap,))
    told = news.of([grown, Cause(CAPTURE_INCOMPLETE, Severity.NOTE, "cut", "plug", nodes=(1,), since_ns=7)])
    assert (told.ended, told.instead) == ((gone,), (grown,))


def test_what_is_over_by_itself_has_become_nothing_else() -> None:
    news = News()
    news.of([silent(1, 5)])
    told = news.of([silent(1, 5, 9), silent(1, 20)])
    assert (len(told.ended), told.instead) == (1, (None,))


def test_what_nothing_explains_any_more_has_no_heir() -> None:
    news = News()
    news.of([silent(1, 5)])
    assert news.of([silent(2, 6)]).instead == (None,)


def nothing(until_ns: int | None, *lists: int) -> Cause:
    keys = tuple(ListKey.udp(1202, number) for number in lists)
    return Cause(
        CAPTURE_INCOMPLETE,
        Severity.NOTE,
        "nothing could be captured",
        "plug",
        lists=keys,
        since_ns=5,
        until_ns=until_ns,
    )


def test_one_that_is_seen_to_concern_more_lists_is_the_same() -> None:
    news = News()
    assert len(news.of([nothing(None)]).new) == 1
    for more in ((3,), (3, 7), (7,)):
        assert not news.of([nothing(None, *more)])
    told = news.of([nothing(9, 7, 12)])
    assert (told.new, [one.until_ns for one in told.ended]) == ((), [9])


def test_one_of_other_lists_is_another_one() -> None:
    news = News()
    news.of([nothing(None, 3)])
    told = news.of([nothing(None, 7)])
    assert (len(told.new), len(told.ended)) == (1, 1)


def test_two_nodes_are_two_causes() -> None:
    news = News()
    both = [silent(1, 5), silent(2, 5)]
    assert news.of(both).new == tuple(both)


def test_one_that_goes_on_is_the_same_wherever_it_is_seen_to_begin() -> None:
    """Of what began long ago, the first events may not be kept."""
    news = News()
    news.of([silent(1, 5), silent(2, 5)])
    assert not news.of([silent(1, 7), silent(2, 5)])
    ended = news.of([silent(1, 7, 9), silent(2, 5)]).ended
    assert ended == (silent(1, 7, 9),)
    again = silent(1, 20)
    assert news.of([silent(1, 7, 9), again, silent(2, 5)]).new == (again,)
