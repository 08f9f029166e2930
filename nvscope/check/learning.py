"""Learns rules from good captures: what was so, and limits with some room around what was seen.

Each limit is learnt by the check that will judge it: first with a limit that nothing breaks, to know its worst value.
What somebody learns from is taken for good; how sure a limit is follows from how much there was to learn it from.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec import Struct, field

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.source import SourceInfo
from nvscope.check.deciding import Decided
from nvscope.check.learnt_limits import (
    THIN,
    how_sure,
    percent_with_room,
    share_with_room,
    time_with_room,
)
from nvscope.check.learnt_lists import LearntList, learnt_lists
from nvscope.check.learnt_transactions import learnt_pairs, loosest_transactions
from nvscope.check.rules import rules_of
from nvscope.check.run import Checked, checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.duration import format_duration
from nvscope.errors import UsageError
from nvscope.findings.kind import Severity
from nvscope.list_key import ListKey
from nvscope.units import count, count_of, duration, load

MOST_LISTS = 1_000
"""Of more, nobody would read the file."""

_ANY = "100000000%"
_EVER = "366d"
_NOTHING_BREAKS = 10**15
_LEAST_INTERVALS = 5
_ROOM, _ROOM_OF_FEW = 2.0, 3.0
_LEAST_TOLERANCE = 0.05
_SILENCE_ROOM = 3
_TOLERANCES = (20, 50, 100)
_MOST_OUTSIDE = 0.01

Value = str | int | float | bool | Sequence[str | int]


class Learnt(Struct, frozen=True):
    """A rule that captures taught: its keys but for the id and the check, and what people should know of it.

    ``told`` is what was seen, and how sure that makes it; ``thin``: too little was seen to break a build by it.
    """

    id: str
    check: str
    keys: Mapping[str, Value]
    told: str
    thin: bool = False


class Lesson(Struct):
    """All that captures taught, by what it is about; and what they could not teach, and why."""

    sections: dict[str, list[Learnt]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    lists: int = 0
    telegrams: int = 0
    since_ns: int | None = None
    until_ns: int | None = None
    infos: Sequence[SourceInfo] = ()

    @property
    def rules(self) -> Sequence[Learnt]:
        """All rules, in their order."""
        return [one for section in self.sections.values() for one in section]

    def add(self, section: str, rules: Iterable[Learnt]) -> None:
        """Add rules of a section; those that are there have the ids that are asked for, others another one."""
        known = {one.id for one in self.rules}
        for one in rules:
            name, number = one.id, 2
            while name in known:
                name, number = f"{one.id}-{number}", number + 1
            known.add(name)
            self.sections.setdefault(section, []).append(
                one if name == one.id else Learnt(name, one.check, one.keys, one.told, one.thin)
            )


def learn(inquiry: Inquiry, warmup_ns: int = 0) -> Lesson:
    """Return what captures teach; they are read twice. Raises what reading them raises."""
    plain = [{"id": "malformed", "check": "malformed", "max": _NOTHING_BREAKS}]
    first = checked(inquiry, rules_of(plain, "", warmup_ns))
    if first.known.ends_early:
        raise UsageError("the captures end before the warm-up is over", next_step="give a shorter --warmup")
    lists = learnt_lists(first)
    left_out, lists = lists[MOST_LISTS:], lists[:MOST_LISTS]
    tables = list(_loosest(lists, bool(inquiry.project.definition.by_key())))
    rules = rules_of(tables, "", warmup_ns)
    lesson = _Teacher(checked(inquiry, rules), lists, inquiry).lesson()
    if left_out:
        lesson.left_out.append(f"{count_of(len(left_out), 'list')} behind the first {count(MOST_LISTS)}")
    return lesson


def _loosest(lists: Sequence[LearntList], defined: bool) -> Iterator[dict[str, Any]]:
    """Yield rules that nothing breaks, whose worst values teach limits."""
    limits: dict[str, dict[str, Any]] = {
        "silence": {"max": _EVER}, "loss": {"max": _ANY}, "coherence": {"max": _ANY}, "bus_load": {"max": _ANY},
        "boot_up": {}, "acknowledged": {"min": "0%"}, "capture_quality": {},
        **{name: {"max": _NOTHING_BREAKS} for name in _COUNTERS},
    }  # fmt: skip
    for name, limit in limits.items():
        yield {"id": name, "check": name, **limit}
    yield from loosest_transactions()
    if defined:
        yield {"id": "definition", "check": "definition"}
    for one in lists:
        for tolerance in _TOLERANCES if one.interval_ns else ():
            yield {
                "id": f"cycle {tolerance} {one.key}", "check": "cycle", "list": str(one.key),
                "interval": format_duration(one.interval_ns or 0), "tolerance": f"{tolerance}%", "exceptions": "100%",
            }  # fmt: skip


_COUNTERS = ("malformed", "restarts", "duplicates", "overtaken")


def _room(seen: int) -> float:
    """Return how much room there is above what was seen so often."""
    return _ROOM if seen >= THIN else _ROOM_OF_FEW


class _Teacher:
    """Makes rules of the worst values."""

    def __init__(self, found: Checked, lists: Sequence[LearntList], inquiry: Inquiry) -> None:
        self._found, self._lists, self._inquiry = found, lists, inquiry
        self._decided: Mapping[str, Decided] = {one.rule.id: one for one in found.decided}
        self._summary = found.known.summary
        self._lesson = Lesson(lists=len(lists), telegrams=sum(one.measured.telegrams for one in lists))
        # What answers later than that is no answer.
        self._patience_ns = inquiry.timeout_ns or inquiry.project.limits.acknowledgement_ns
        known = found.known
        self._span_ns = (known.until_ns or 0) - (known.since_ns or 0)

    def lesson(self) -> Lesson:
        """Return all of it, in the order of sections."""
        lesson = self._lesson
        lesson.infos = self._found.infos
        lesson.since_ns, lesson.until_ns = self._summary.start_ns, self._summary.end_ns
        plant = (
            self._quality, self._present, self._senders, self._nodes, self._loss, self._counters, self._coherence,
            self._boot_up, self._definition, self._buses, self._transactions, self._causes,
        )  # fmt: skip
        for make in plant:
            lesson.add("the plant", make())
        for one in self._lists:
            for learn_of in (self._cycle, self._silence, self._acknowledged):
                lesson.add(one.title, learn_of(one))
        return lesson

    def _judged(self, rule: str) -> Mapping[ListKey, Judged]:
        """Return of each list the worst that was judged by a rule."""
        found: dict[ListKey, Judged] = {}
        for one in self._decided[rule].subjects:
            if one.list is not None and one.worst is not None:
                known = found.get(one.list)
                if known is None or known.worst is None or (one.worst - known.worst) * (1 if one.above else -1) > 0:
                    found[one.list] = one
        return found

    def _words(self, keys: Iterable[ListKey]) -> list[str | int]:
        wanted = set(keys)
        return [one.word for one in self._lists if one.key in wanted]

    def _quality(self) -> Iterator[Learnt]:
        (judged,) = self._decided["capture_quality"].subjects
        if judged.verdict is Verdict.FAIL:
            self._lesson.left_out.append(f"how good a recording has to be: {judged.reason}")
            return
        yield Learnt("recorded-well", "capture_quality", {}, "so that nothing is judged of a bad recording")

    def _present(self) -> Iterator[Learnt]:
        if self._lists:
            told = f"{count_of(len(self._lists), 'list')} came"
            yield Learnt("all-there", "present", {"list": [one.word for one in self._lists]}, told)

    def _senders(self) -> Iterator[Learnt]:
        """One rule for all lists of each sender: another one that sends them is a second sender, or a wrong one."""
        of: dict[str, list[LearntList]] = {}
        for one in self._lists:
            if len(one.senders) == 1:
                of.setdefault(one.senders[0], []).append(one)
            elif one.senders:
                self._lesson.left_out.append(f"{one.title} is sent by {', '.join(one.senders)}")
        for node, lists in of.items():
            sent = sum(one.measured.telegrams for one in lists)
            yield Learnt(
                f"sent-by-{node}", "single_sender", {"list": [one.word for one in lists], "senders": [node]},
                f"it alone sent {count_of(sent, 'telegram')} of {count_of(len(lists), 'list')}",
            )  # fmt: skip

    def _nodes(self) -> Iterator[Learnt]:
        addresses = self._summary.addresses
        nodes = list(dict.fromkeys(addresses[node] for one in self._summary.lists for node in one.senders))
        if nodes:
            yield Learnt("known-nodes", "known_nodes", {"nodes": nodes}, f"{count_of(len(nodes), 'node')} sent")

    def _loss(self) -> Iterator[Learnt]:
        judged = self._judged("loss")
        whole = [one for one in self._lists if one.key in judged and not judged[one.key].worst]
        yield from self._none_of(whole, "nothing-lost", "loss", "lost", every=len(whole) == len(self._lists))
        for one in self._lists:
            share = judged[one.key].worst if one.key in judged else None
            if share and share > 0:
                telegrams = one.measured.telegrams
                lost = round(share * telegrams / (1 - share)) if share < 1 else telegrams
                told = f"{lost} of {count_of(telegrams + lost, 'telegram')} were lost"
                keys = {"list": one.word, "max": f"{share_with_room(lost, telegrams + lost):g}%"}
                yield Learnt(one.id("loss"), "loss", keys, told, thin=telegrams < THIN)

    def _counters(self) -> Iterator[Learnt]:
        for name in _COUNTERS:
            judged = self._judged(name)
            none = [one for one in self._lists if one.key in judged and not judged[one.key].worst]
            every = not any(one.worst for one in judged.values())
            yield from self._none_of(none, f"no-{name}", name, name, every=every)
            words = {one.key: one.word for one in self._lists}
            for key, one in judged.items():
                if seen := int(one.worst or 0):
                    told = f"{seen} in {duration(self._span_ns)}: look whether that should be, and in how long"
                    word = words.get(key, str(key))
                    yield Learnt(f"{name}-of-{word}", name, {"list": word, "max": 2 * seen}, told, thin=True)

    def _none_of(
        self, lists: Sequence[LearntList], name: str, check: str, told: str, *, every: bool
    ) -> Iterator[Learnt]:  # fmt: skip
        """One rule for all lists of which there was none of something, for whatever comes if that is ``every`` one."""
        if not lists:
            return
        telegrams = sum(one.measured.telegrams for one in lists)
        keys: dict[str, Value] = {} if every else {"list": [one.word for one in lists]}
        sure = how_sure(telegrams, "telegram")
        yield Learnt(name, check, keys, f"{told}: {sure}", thin=telegrams < THIN)

    def _coherence(self) -> Iterator[Learnt]:
        judged = self._judged("coherence")
        whole = [one for one in self._lists if one.key in judged and not judged[one.key].worst]
        if whole:
            cycles = sum(one.measured.telegrams // max(one.parts, 1) for one in whole)
            told = f"torn: {how_sure(cycles, 'cycle')}"
            keys: dict[str, Value] = {"list": self._words(one.key for one in whole)}
            yield Learnt("whole-cycles", "coherence", keys, told, cycles < THIN)
        for one in self._lists:
            share = judged[one.key].worst if one.key in judged else None
            if share:
                torn = max(judged[one.key].count, 1)
                cycles = round(torn / share)
                keys = {"list": one.word, "max": f"{share_with_room(torn, cycles):g}%"}
                told = f"{torn} of {count_of(cycles, 'cycle')} were torn"
                yield Learnt(one.id("coherence"), "coherence", keys, told, thin=cycles < THIN)

    def _boot_up(self) -> Iterator[Learnt]:
        decided = self._decided["boot_up"].subjects
        answered = [one for one in decided if one.verdict is Verdict.PASS and one.worst is not None]
        for one in answered:
            assert one.worst is not None
            known = next(each for each in self._lists if each.key == one.list)
            within_ns = min(time_with_room(round(one.worst * 1e9), _SILENCE_ROOM), self._patience_ns)
            told = f"slowest: {duration(round(one.worst * 1e9))}, which makes it hardly more than a guess"
            keys = {"list": known.word, "within": format_duration(within_ns), "optional": True}
            yield Learnt(known.id("boot-up"), "boot_up", keys, told, thin=True)

    def _definition(self) -> Iterator[Learnt]:
        decided = self._decided.get("definition")
        if decided is None:
            return
        fit = [one.list for one in decided.subjects if one.verdict is Verdict.PASS and one.list is not None]
        for one in decided.subjects:
            if one.verdict is Verdict.FAIL and one.list is not None:
                self._lesson.left_out.append(f"list {one.list} is not as it is defined: {one.reason}")
        if fit:
            told = f"{count_of(len(fit), 'list')} {'is' if len(fit) == 1 else 'are'} as defined"
            yield Learnt("as-defined", "definition", {"list": self._words(fit)}, told)

    def _buses(self) -> Iterator[Learnt]:
        for one in self._decided["bus_load"].subjects:
            if one.channel is None:
                continue
            if one.worst is None:
                self._lesson.left_out.append(f"how busy {one.channel} is: {one.reason}")
                continue
            most = percent_with_room(one.worst, _room(self._span_ns // 10**9))
            if most is not None:
                keys = {"channel": one.channel, "max": f"{most:g}%"}
                told = f"the busiest second of {duration(self._span_ns)}: {load(100 * one.worst)}"
                yield Learnt(f"load-of-{one.channel}", "bus_load", keys, told, thin=self._span_ns < 60 * 10**9)

    def _transactions(self) -> Iterator[Learnt]:
        for one in learnt_pairs(self._decided, self._summary):
            yield Learnt(one.id, "transaction", one.keys, one.told, one.is_thin)

    def _causes(self) -> Iterator[Learnt]:
        causes = [one for one in self._found.known.causes if one.severity >= Severity.WARNING]
        kinds = sorted({one.kind.name for one in causes})
        told = "these were in the captures: look whether they should be" if kinds else "nothing is to be told of them"
        keys: dict[str, Value] = {"allow": kinds} if kinds else {}
        yield Learnt("nothing-happened", "causes", keys, told)

    def _cycle(self, one: LearntList) -> Iterator[Learnt]:
        if not one.interval_ns:
            return
        own = [self._decided[f"cycle {tolerance} {one.key}"].subjects for tolerance in _TOLERANCES]
        intervals, interval_ns = one.intervals, one.interval_ns
        worst_s = [each.worst for each in own[0] if each.worst is not None]
        if not worst_s or intervals < _LEAST_INTERVALS:
            return
        apart = max(abs(each * 1e9 - interval_ns) / interval_ns for each in worst_s)
        keys: dict[str, Value] = {"list": one.word, "interval": format_duration(interval_ns)}
        tolerance = percent_with_room(max(apart, _LEAST_TOLERANCE), _room(intervals))
        farthest = max(worst_s, key=lambda each: abs(each * 1e9 - interval_ns))
        told = f"farthest off: {duration(round(farthest * 1e9))}"
        if tolerance is not None:
            keys["tolerance"] = f"{tolerance:g}%"
            yield Learnt(
                one.id("cycle"), "cycle", keys, f"{told}; farther: {how_sure(intervals, 'interval')}",
                thin=intervals < THIN,
            )  # fmt: skip
            return
        for wide, judged in zip(_TOLERANCES, own, strict=True):
            outside = max(each.count for each in judged)
            # The rule is judged stream by stream: the share is that of the worst one.
            each_of = max(intervals // max(one.parts, 1), 1)
            if outside <= _MOST_OUTSIDE * each_of:
                keys |= {"tolerance": f"{wide}%", "exceptions": f"{share_with_room(outside, each_of):g}%"}
                told += f"; {outside} of {count_of(each_of, 'interval')} lay outside"
                yield Learnt(one.id("cycle"), "cycle", keys, told, thin=intervals < THIN)
                return
        self._lesson.left_out.append(f"the cycle of {one.title}: its intervals differ too much")

    def _silence(self, one: LearntList) -> Iterator[Learnt]:
        judged = self._judged("silence").get(one.key)
        if judged is None or judged.worst is None:
            return
        seen_ns = round(judged.worst * 1e9)
        most_ns = time_with_room(max(seen_ns, one.interval_ns or 0), _SILENCE_ROOM)
        if most_ns > self._span_ns:
            return
        keys = {"list": one.word, "max": format_duration(most_ns)}
        told = f"longest: {duration(seen_ns)}; longer: {how_sure(one.measured.telegrams, 'telegram')}"
        yield Learnt(one.id("silence"), "silence", keys, told, thin=one.measured.telegrams < THIN)

    def _acknowledged(self, one: LearntList) -> Iterator[Learnt]:
        share = self._judged("acknowledged").get(one.key)
        latency = one.measured.latency
        if share is None or share.worst is None or latency is None or not latency.count or latency.maximum is None:
            return
        asked = latency.count + share.count
        within_ns = min(time_with_room(latency.maximum, _SILENCE_ROOM), self._patience_ns)
        keys: dict[str, Value] = {"list": one.word, "within": format_duration(within_ns)}
        told = f"slowest: {duration(latency.maximum)}; missing: {how_sure(asked, 'telegram')}"
        if share.count:
            missing = share_with_room(share.count, asked)
            keys["min"] = f"{100 - missing:g}%"
            told = f"{share.count} of {asked} were missing, slowest: {duration(latency.maximum)}"
        yield Learnt(one.id("acknowledged"), "acknowledged", keys, told, thin=asked < THIN)
