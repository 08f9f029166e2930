"""Checks of requests and replies: how long replies take, and how many requests are refused or stay unanswered."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from nvscope.check.asked_while import AskedWhile, Came, Tallies, Tally, asks_beyond, pairs_of, watch_asked
from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.doubt import doubt_of_clock
from nvscope.check.kept_frames import first_of, frames_of
from nvscope.check.parameters import AMOUNT_OR_PERCENT, Parameter, Unfit
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.who_asks import SDO, WHO, Asking, Pair
from nvscope.list_key import ListKey
from nvscope.toml_table import SPAN, integer
from nvscope.units import count_of, duration

if TYPE_CHECKING:  # most plants have no Parameter Manager, and then nothing of it is imported
    from nvscope.tracker.parameter.transactions import Transactions

_SECOND_NS = 1_000_000_000
_WORST = (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.PASS)
_LIMITS = ("max_latency", "max_errors", "max_unanswered")

NO_PAIR = "no such requests were seen"
NONE_JUDGED = "none of its requests was asked when the rule is judged"
CUT = "none of its requests is whole in the capture"
NO_REPLY = "the reply to none of its requests is whole in the capture"
STILL_WAITING = "its requests were still waiting for a reply when the capture ended"
NOT_DUE = "the capture ended before a reply was due"
UNHEARD = "what nodes answer each other is not to be seen in this capture"
BEYOND = "more nodes ask more others, or wait for more replies at a time, than are told apart"
NO_REQUESTS = "its requests are not in the capture, only replies"
UNMEASURED = "came before the request was whole, or seems to: nobody knows how long it took"
DISORDER = (
    "it was captured in another order than that of the wire, as by two clocks (NV810): nobody knows how long replies "
    "took"
)


def _transaction(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watched: AskedWhile = told["watched"]
    asking = Asking(known, told)
    own = [one for one in watched.pairs(known) if one[0] in asking]
    if asking.unknown:
        reason = f"no node is called {', '.join(asking.unknown)}"
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, vacuous=True)
    elif not own:
        unheard = not all(info.hears_answers for info in known.infos)
        yield Judged(Verdict.INCONCLUSIVE, reason=UNHEARD if unheard else NO_PAIR, vacuous=not unheard)
    if watched.left_out or asks_beyond(known, "PAIR", "OPEN", "REPLY"):
        yield Judged(Verdict.INCONCLUSIVE, reason=BEYOND)
    senders, in_disorder = _senders(known), watched.in_disorder()
    for pair, number, tallies in sorted(own, key=lambda one: one[0].order):
        subject = Judged(
            Verdict.INCONCLUSIVE, node=pair.client, protocol=pair.protocol, partner=pair.server, port=pair.port
        )
        tally = tallies.of.get(number, Tally())
        why = _why_unknown(known, watched, pair, number, tally, senders)
        if why:
            yield replace(subject, reason=why)
        elif tally.requests:
            yield _worst(_judged(known, subject, number, tallies, told, is_in_order=pair not in in_disorder))
        elif asking.named or len(own) == 1:
            yield replace(subject, reason=NONE_JUDGED, vacuous=True)


def _why_unknown(
    known: Evidence, watched: AskedWhile, pair: Pair, number: int, tally: Tally, senders: Collection[str]
) -> str:  # fmt: skip
    """Return why nobody knows what came of the requests of a pair; "" where somebody does."""
    if not all(info.hears_answers for info in known.infos):
        return UNHEARD
    answers = tally.replies + tally.counts[Came.BUSY]
    if pair.protocol != SDO:
        if not tally.asked:
            return CUT if tally.cut else ""
        if not answers and not watched.sends(pair.server):
            return _nothing_of(pair)
        return "" if tally.requests else NO_REPLY if tally.cut else STILL_WAITING
    assert known.parameters is not None
    columns = known.parameters.columns
    requests, came = int(columns.requests[number]), _answers(known.parameters, number)
    if not requests:
        return NO_REQUESTS if came else ""
    over = sum(int(columns.column(name)[number]) for name in ("replies", "busy", "timeouts"))
    if not tally.requests and requests > over and watched.holds is None:
        return NOT_DUE
    return "" if came or pair.server in senders else _nothing_of(pair) if tally.requests else ""


def _nothing_of(pair: Pair) -> str:
    return f"nothing that {pair.server} sent is in the capture: nobody knows whether it answered"


def _answers(known: Transactions, number: int) -> int:
    """Return how much a pair's partner said of its requests, and others for it."""
    columns = known.columns
    names = ("replies", "busy", "unexpected", "undeliverable")
    return sum(int(columns.column(name)[number]) for name in names)


def _senders(known: Evidence) -> Collection[str]:
    """Return the nodes that sent telegrams, or asked others for something: what they send is captured."""
    lists = (stream.node for entry in known.summary.lists for stream in entry.streams if stream.telegrams)
    found = {node for one in lists if (node := known.node(one)) is not None}
    if known.parameters is not None:
        for number, pair in enumerate(pairs_of(known.parameters)):
            if known.parameters.columns.requests[number]:
                found.add(pair.client)
            if _answers(known.parameters, number):
                found.add(pair.server)
    return found


def _worst(judged: Sequence[Judged]) -> Judged:
    """Return the limit that is broken, or nearest to it; with what else is."""
    first, *others = sorted(judged, key=lambda one: (_WORST.index(one.verdict), _tightness(one)))
    broken = [one.reason for one in others if one.verdict is Verdict.FAIL]
    return replace(first, reason="; ".join([first.reason, *broken]))


def _tightness(judged: Judged) -> float:
    percent = judged.margin_percent
    return (0.0 if judged.margin is not None and judged.margin < 0 else 100.0) if percent is None else percent


def _judged(
    known: Evidence, subject: Judged, number: int, tallies: Tallies, told: Mapping[str, Any], *, is_in_order: bool
) -> list[Judged]:  # fmt: skip
    tally = tallies.of[number]
    refused, unanswered = tally.counts[Came.REFUSED], tally.counts[Came.UNANSWERED]
    found = []
    if told["max_latency"] is not None:
        judged = _latency(known, subject, tally, tallies.percentile_ns(number, told["percentile"]), told)
        if judged.verdict is not Verdict.INCONCLUSIVE and not is_in_order:
            judged = replace(judged, verdict=Verdict.INCONCLUSIVE, reason=DISORDER)
        found.append(judged)
    if told["max_errors"] is not None:
        words = f"{refused} refused, {unanswered} unanswered of {count_of(tally.requests, 'request')}"
        judged = replace(subject, reason=words)
        found.append(_bad(known, judged, tally, (Came.REFUSED, Came.UNANSWERED), told["max_errors"]))
    if told["max_unanswered"] is not None:
        words = f"{unanswered} unanswered of {count_of(tally.requests, 'request')}"
        judged = replace(subject, reason=words)
        found.append(_bad(known, judged, tally, (Came.UNANSWERED,), told["max_unanswered"]))
    return found


def _latency(
    known: Evidence, subject: Judged, tally: Tally, seen_ns: int | None, told: Mapping[str, Any]
) -> Judged:  # fmt: skip
    most_ns, percent = told["max_latency"], told["percentile"]
    limit = most_ns / _SECOND_NS
    unmeasured = f"{tally.unmeasured} of {count_of(tally.replies, 'reply', 'replies')} {UNMEASURED}"
    if seen_ns is None:
        reason = unmeasured if tally.unmeasured else "none of its requests has a reply"
        return replace(subject, reason=reason, limit=limit, unit="s")
    allowed = tally.replies - -(-percent * tally.replies // 100)
    is_broken = tally.slow > allowed
    # Percentiles are those of a histogram; how many are slower is exact.
    seen_ns = max(seen_ns, most_ns + 1) if is_broken else min(seen_ns, most_ns)
    what = "the slowest" if percent == 100 else f"p{percent}"
    reason = f"{what} of {count_of(tally.replies - tally.unmeasured, 'reply', 'replies')}"
    if tally.slow:
        reason += f", {tally.slow} slower than {duration(most_ns)}"
    kept, verdict = tally.slow_frames.kept, Verdict.FAIL if is_broken else Verdict.PASS
    doubts = [doubt_of_clock(known, time_ns) for _, time_ns in kept]
    if is_broken and tally.slow == len(doubts) and all(doubts):
        verdict, reason = Verdict.INCONCLUSIVE, doubts[0]
    if not is_broken and tally.slow + tally.unmeasured > allowed:
        verdict, reason = Verdict.INCONCLUSIVE, unmeasured
    return replace(
        subject, verdict=verdict, reason=reason, worst=seen_ns / _SECOND_NS, limit=limit, unit="s", count=tally.slow,
        first_ns=kept[0][1] if kept else None, frames=frames_of(kept),
    )  # fmt: skip


def _bad(
    known: Evidence, subject: Judged, tally: Tally, kinds: Sequence[Came], limit: float | int
) -> Judged:  # fmt: skip
    """Judge how many requests came to nothing good; ``limit`` is a share as a float, a number as an int."""
    bad, requests = sum(tally.counts[one] for one in kinds), tally.requests
    # What the capture lost itself may have been the replies.
    fewest = bad - min(tally.counts[Came.UNANSWERED], known.drops)
    is_share = isinstance(limit, float)
    worst, least = (bad / requests, fewest / requests) if is_share else (bad, fewest)
    verdict, reason = Verdict.PASS if worst <= limit else Verdict.FAIL, subject.reason
    if verdict is Verdict.FAIL and least <= limit:
        verdict = Verdict.INCONCLUSIVE
        reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been replies"
    kept = first_of(tally.frames[one].kept for one in kinds)
    return replace(
        subject, verdict=verdict, reason=reason, worst=worst, limit=limit, unit="ratio" if is_share else "requests",
        count=bad, first_ns=kept[0][1] if kept else None, frames=frames_of(kept),
    )  # fmt: skip


def _watch(setting: Setting, told: Mapping[str, Any]) -> AskedWhile:
    if all(told[one] is None for one in _LIMITS):
        raise Unfit("a transaction needs max_latency, max_errors or max_unanswered", next_step='max_errors = "0%"')
    return watch_asked(setting, told)


CHECKS = (
    Check(
        "transaction", "pair", "Requests of the Parameter Manager and of WebVisu have replies, in time.",
        "what replies take, or how many requests are refused or unanswered, whichever is nearest to its limit",
        "it is above its limit",
        'check = "transaction"\nprotocol = "visu"\npartner = "192.168.1.10"\nmax_latency = "200ms"\nmax_errors = "1%"',
        _transaction,
        (
            *WHO,
            Parameter("max_latency", SPAN, "so long replies may take, those that refuse too", None),
            Parameter("percentile", integer(1, 100), "of the replies, so many percent are that fast", 99),
            Parameter(
                "max_errors", AMOUNT_OR_PERCENT, "so many requests may be refused or unanswered; busy is neither", None
            ),
            Parameter("max_unanswered", AMOUNT_OR_PERCENT, "so many requests may have no reply", None),
        ),
        _watch, at_times=True, of_requests=True,
    ),
)  # fmt: skip
