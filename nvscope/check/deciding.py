"""Decides rules by what is known of captures: each by itself, and each of its subjects by itself."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from nvscope.check.check import Evidence
from nvscope.check.lists import CalledLists
from nvscope.check.read_variables import are_all_read
from nvscope.check.rules import Mistakes, Rule
from nvscope.check.stage import StageKey
from nvscope.check.verdict import Judged, Verdict, worst_of
from nvscope.check.while_so import NEVER_SO, WhileSo
from nvscope.check.who_asks import NODES, NODES_OR_NONE, is_address, is_name
from nvscope.engine.run import Observer
from nvscope.errors import ConfigurationError, UsageError
from nvscope.list_key import ListKey
from nvscope.toml_table import nearest
from nvscope.tracker.figures import Of

_ON_THE_WIRE = re.compile(r"(?:udp/\d+/|can/[^/]+/)?(?:\d+x?|0x[0-9a-fA-F]+)")


class Decided(Struct, frozen=True):
    """A rule, its verdict, that of each of its subjects, in the order of lists and streams, and its lists."""

    rule: Rule
    verdict: Verdict
    subjects: Sequence[Judged]
    lists: Sequence[ListKey] = ()


class WatchedRule(Struct):
    """A rule, what watches for it, and why it cannot be judged, "" where it can; the rules of the file it names.

    ``stage`` is where it is judged.
    """

    rule: Rule
    stage: StageKey
    watcher: Observer | None = None
    reason: str = ""
    inner: Sequence[WatchedRule] = ()

    def each(self) -> Iterator[WatchedRule]:
        """Yield it, and those of the file that it stands for."""
        yield self
        yield from self.inner


def decided(watched: WatchedRule, evidence: Mapping[StageKey, Evidence], called: CalledLists) -> Decided:
    """Return the verdict on a rule, by all that is known where it is judged."""
    rule, known = watched.rule, evidence[watched.stage]
    if watched.reason:
        return Decided(rule, Verdict.INCONCLUSIVE, [Judged(Verdict.INCONCLUSIVE, reason=watched.reason)])
    if known.ends_early:
        reason = "the capture ends before the warm-up is over"
        return Decided(rule, Verdict.INCONCLUSIVE, [Judged(Verdict.INCONCLUSIVE, reason=reason)])
    holds = getattr(watched.watcher, "holds", None)
    if isinstance(holds, WhileSo) and not holds.ever:
        never = Judged(Verdict.INCONCLUSIVE, reason=NEVER_SO, vacuous=True)
        return Decided(rule, Verdict.PASS if rule.optional else Verdict.INCONCLUSIVE, [_optional(rule, never)])
    lists, unknown = called.chosen(rule.lists)
    told = {**rule.parameters, "watched": watched.watcher, "list_named": bool(rule.lists)}
    told["inner"] = [decided(one, evidence, called) for one in watched.inner]
    judged = list(rule.check.judge(known, lists, told)) if lists or not rule.lists else []
    for name in unknown:
        # What has to be absent is, as long as it is told by what is on the wire and not by a name.
        on_the_wire = _ON_THE_WIRE.fullmatch(name) is not None
        verdict = Verdict.PASS if rule.check.name == "absent" and on_the_wire else Verdict.INCONCLUSIVE
        judged.append(Judged(verdict, reason=f"no list is called {name}", vacuous=on_the_wire))
    if rule.lists and rule.check.subject in ("list", "stream"):
        # A rule that names several lists is not kept because one of them is there.
        came = (known.keys[one.list] for one in known.of(Of.LIST, lists) if one.list is not None)
        told_of = {one.list for one in judged}.union(came)
        judged += [_never_came(key) for key in lists if key not in told_of]
    needs_no_list = rule.check.of_requests or (rule.check.of_all and not rule.lists) or are_all_read(rule.parameters)
    is_heard = known.heard and needs_no_list
    if not is_heard and not any(one.measured.telegrams for one in known.of(Of.LIST, known.keys.values())):
        # What must not be there never is where nothing was recorded: that keeps no rule.
        nothing = Judged(Verdict.INCONCLUSIVE, reason="no telegram was recorded", vacuous=True)
        judged = [nothing if one.verdict is Verdict.PASS else one for one in judged]
    if not judged:
        judged = [Judged(Verdict.INCONCLUSIVE, reason="nothing was there to be judged", vacuous=True)]
    judged = [_optional(rule, one) for one in judged]
    return Decided(rule, worst_of(judged), judged, sorted(lists))


def _optional(rule: Rule, judged: Judged) -> Judged:
    return replace(judged, verdict=Verdict.PASS) if rule.optional and judged.vacuous else judged


def _never_came(key: ListKey) -> Judged:
    return Judged(Verdict.INCONCLUSIVE, key, reason="it never came", vacuous=True)


def called_lists(known: Evidence) -> CalledLists:
    """Return the lists that came, and those that are defined for one place."""
    keys = dict.fromkeys((*known.keys.values(), *(key for key in known.names if key.port)))
    return CalledLists(keys, known.names)


def tell_of_unknown(rules: Sequence[WatchedRule], known: Evidence, called: CalledLists) -> None:
    """Raise Mistakes where rules name lists that neither definitions nor captures know, if definitions are given."""
    if not known.project.definition.by_key():
        return
    every = [inner.rule for rule in rules for inner in rule.each()]
    mistakes = [*unknown_lists(every, called, known.names), *unknown_nodes(every, known)]
    if mistakes:
        raise Mistakes(mistakes)


def unknown_nodes(rules: Sequence[Rule], known: Evidence) -> Iterator[ConfigurationError]:
    """Yield a mistake for each name of a node that a rule asks about and that the project does not know.

    Whether an address is there tells the capture alone.
    """
    if not known.project.node_names:
        return
    words = known.node_words
    lower = {word.lower() for word in words}
    for rule in rules:
        for one in rule.check.parameters:
            told = rule.parameters.get(one.name) or ()
            names: Sequence[str] = ()
            if one.kind in (NODES, NODES_OR_NONE):
                names = [name for name in told if is_name(name) and name.lower() not in lower]
            elif one.name == "node":
                names = [name for name in known.unknown_nodes(told) if not is_address(name)]
            for name in names:
                error = UsageError(
                    f"no node is called '{name}', neither by the project nor in the capture",
                    next_step=nearest(name, sorted(words)),
                )
                yield rule.mistake(error, one.name)


def unknown_lists(
    rules: Sequence[Rule], called: CalledLists, names: Mapping[ListKey, str]
) -> Iterator[ConfigurationError]:
    """Yield a mistake for each list that a rule names and that there is not; ``names`` are those of definitions."""
    for rule in rules:
        _, unknown = called.chosen(rule.lists)
        for name in unknown:
            if (rule.check.name == "absent" or rule.optional) and _ON_THE_WIRE.fullmatch(name):
                continue
            error = UsageError(
                f"no list is called '{name}', neither by definitions nor in the capture",
                next_step=f"there are {', '.join(sorted(set(names.values()))[:6])}" if names else "",
            )
            yield rule.mistake(error, "list")
