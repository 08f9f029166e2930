"""Lists that several files define, such as the sender's and the reader's: which of them is right."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import permutations
from typing import TYPE_CHECKING, NamedTuple

from nvscope.enumeration import MOST_NAMED, joined
from nvscope.findings.definition_names import how_to_compare, names_of_definitions
from nvscope.findings.finding import Events, events_of
from nvscope.findings.misfits import Mismatch, all_of, tell_misfits
from nvscope.units import since as told_since

if TYPE_CHECKING:  # a report without definitions starts without what reads them
    from nvscope.definition.byte_map import Run
    from nvscope.definition.model import ListDefinition
    from nvscope.definition.packing import TelegramLayout
    from nvscope.findings.facts import Facts
    from nvscope.tracker.stream_summary import StreamSummary
    from nvscope.tracker.summary import ListSummary
    from nvscope.tracker.variables.values import Shape, Values

    Telegrams = tuple[TelegramLayout, ...]

_MOST_TOLD = 3
_MOST_PAIRED = 8


def tell_several(
    facts: Facts, entry: ListSummary, streams: Sequence[StreamSummary], candidates: Sequence[Telegrams]
) -> Iterator[Mismatch]:
    """Yield what does not agree for one sender of a list with several definitions.

    Where some fit every telegram, it is said which others do not, and whether those that fit mean the same. Else one of
    them may fit up to some time, and another from then on. What is left fits none.
    """
    values = facts.state.values
    if values is None:
        return
    judged = _Sender(facts, streams, candidates, values)
    if judged.right:
        yield from judged.verdict()
    elif change := judged.change():
        yield change
    else:
        told = [candidates[place] for place in sorted({judged.best, *range(len(candidates))[: _MOST_TOLD - 1]})]
        yield from tell_misfits(facts, entry, streams, judged.misfits(judged.best), told)


class _Divergence(NamedTuple):
    """Where two definitions first say something else."""

    subindex: int
    run: Run


class _Sender:
    """One sender of a list, and which definitions fit what it sends; definitions by their place in ``candidates``."""

    def __init__(
        self, facts: Facts, streams: Sequence[StreamSummary], candidates: Sequence[Telegrams], values: Values
    ) -> None:
        self.facts, self.streams, self.candidates = facts, streams, candidates
        self._values = values
        self._fitted = {stream.stream: _fitted(values, stream.stream) for stream in streams}
        self.names = names_of_definitions([layouts[0].list for layouts in candidates])
        self.address = facts.address(streams[0].node)
        everyone = range(len(candidates))
        self.right = [place for place in everyone if not self.misfits(place)]
        self.wrong = [place for place in everyone if place not in self.right]
        self.best = max(everyone, key=lambda place: sum(events.count for _, events in self._fits(place)))

    def misfits(self, place: int) -> list[tuple[StreamSummary, Events]]:
        """Return the streams with telegrams that a definition does not fit, and these."""
        found = []
        for stream in self.streams:
            own = self._shape(place, stream)
            others = [events for shape, events in self._fitted[stream.stream].items() if shape is None or shape != own]
            if others:
                found.append((stream, all_of(others)))
        return found

    def _fits(self, place: int) -> list[tuple[StreamSummary, Events]]:
        """Return the streams with telegrams that a definition fits, and these."""
        told = ((stream, self._shape(place, stream)) for stream in self.streams)
        return [(stream, self._fitted[stream.stream][shape]) for stream, shape in told if self._has(stream, shape)]

    def _has(self, stream: StreamSummary, shape: Shape | None) -> bool:
        return shape is not None and shape in self._fitted[stream.stream]

    def _shape(self, place: int, stream: StreamSummary) -> Shape | None:
        """Return Items and Length of a stream by a definition."""
        layouts = self.candidates[place]
        if stream.subindex >= len(layouts):
            return None
        return layouts[stream.subindex].shape

    def verdict(self) -> Iterator[Mismatch]:
        """Yield, where a definition fits all telegrams, that others do not, or mean something else."""
        first, *others = self.right
        sent = sorted(stream.subindex for stream in self.streams)
        unlike = {place: found for place in others if (found := self._divergence(first, place, sent))}
        fit = " fit" if unlike else ""
        wrong = [f"{self.names[place]} does not{fit}{self._told_of_wrong(place)}" for place in self.wrong[:_MOST_TOLD]]
        if len(self.wrong) > _MOST_TOLD:
            wrong.append(f"neither do {len(self.wrong) - _MOST_TOLD} more")
        if unlike:
            message, subindex = self._told_of_unlike(unlike)
            message += "".join(f" {told}." for told in wrong)
            about = next(fits for fits in self._fits(first) if fits[0].subindex == subindex)
            shown = how_to_compare(self._list(first), self._list(next(iter(unlike))), "shows all that differs")
            hint = f"{shown}; keep the definition that is in the program of the sender."
        elif wrong:
            verb = "fit" if others else "fits"
            fitting = joined([self.names[place] for place in self.right], MOST_NAMED)
            message = f"{fitting} {verb} what {self.address} sends; {'; '.join(wrong)}."
            about = self.misfits(self.wrong[0])[0]
            shows = "shows what a reader of the latter gets"
            hint = f"{how_to_compare(self._list(first), self._list(self.wrong[0]), shows)}."
        else:
            return
        stream, events = about
        yield Mismatch(message, events, stream.subindex, hint)

    def change(self) -> Mismatch | None:
        """Return that one definition fits up to some time, and another from then on; None where it is not so."""
        fits = {
            place: {stream.stream: events for stream, events in told}
            for place in range(len(self.candidates))
            if (told := self._fits(place))
        }
        for old, new in permutations(list(fits)[:_MOST_PAIRED], 2):
            moment = self._moment(fits[old], fits[new])
            if moment is None:
                continue
            until_ns, since = moment
            start_ns = self.facts.summary.start_ns or 0
            until, begin = told_since(until_ns, start_ns), told_since(since.first_ns, start_ns)
            message = (
                f"{self.names[old]} fits what {self.address} sends up to {until}, "
                f"{self.names[new]} from {begin} on (frame {since.frames[0]}): a download?"
            )
            shown = how_to_compare(self._list(old), self._list(new), "shows what changed")
            hint = f"{shown}; from then on, readers need {self.names[new]}."
            misfits = self.misfits(old)
            subindex = misfits[0][0].subindex if len(misfits) == 1 else None
            return Mismatch(message, all_of([events for _, events in misfits]), subindex, hint)
        return None

    def _moment(self, old: dict[int, Events], new: dict[int, Events]) -> tuple[int, Events] | None:
        """Return when the last telegram was that only the old definition fits, and those that only the new one fits.

        Telegrams are given by stream. None where some fit neither, or both kinds are mixed.
        """
        before, after = [], []
        for stream in self.streams:
            own = [fits.get(stream.stream) for fits in (old, new)]
            counts = [events.count if events else 0 for events in own]
            if counts == [stream.telegrams, stream.telegrams]:
                continue
            if sum(counts) != stream.telegrams:
                return None
            before += [own[0].last_ns] if own[0] else []
            after += [own[1]] if own[1] else []
        since = min(after, key=lambda events: events.first_ns, default=None)
        if since is None or not before or max(before) >= since.first_ns:
            return None
        return max(before), since

    def _told_of_unlike(self, unlike: dict[int, _Divergence]) -> tuple[str, int]:
        """Return that definitions of one shape differ, and in which SubIndex they do first."""
        first = self.right[0]
        names = [self.names[place] for place in (first, *unlike)]
        subindex, run = min(unlike.values(), key=lambda found: (found.subindex, found.run.first_byte))
        both = "Both " if len(names) == 2 else ""
        said = " / ".join(f"{part.first} : {part.first_type}" if part else "nothing" for part in (run.a, run.b))
        of_telegram = f" of SubIndex {subindex}" if len(self.candidates[first]) > 1 else ""
        return (
            f"{both}{joined(names, MOST_NAMED)} fit what {self.address} sends, and differ from byte {run.first_byte}"
            f"{of_telegram} on ({said}): the telegrams cannot tell which is right; values are shown by "
            f"{self._shown(subindex)}."
        ), subindex

    def _shown(self, subindex: int) -> str:
        """Return the definition by which the values of a SubIndex are shown that all have in one shape."""
        stream = next(stream for stream in self.streams if stream.subindex == subindex)
        layout = self._values.fitted(stream.stream)[-1].layout
        return next(
            name
            for name, layouts in zip(self.names, self.candidates, strict=True)
            if subindex < len(layouts) and layouts[subindex] is layout
        )

    def _told_of_wrong(self, place: int) -> str:
        """Return where a definition first says something else than the right one, as the end of a sentence."""
        right = self.right[0]
        telegrams = max(len(self.candidates[right]), len(self.candidates[place]))
        found = self._divergence(right, place, range(telegrams))
        if found is None:
            return ""
        reads, has = (f"{part.first} : {part.first_type}" if part else "" for part in (found.run.b, found.run.a))
        of_telegram = f" of SubIndex {found.subindex}" if telegrams > 1 else ""
        return (
            f": it {f'reads {reads}' if reads else 'has nothing'} at byte {found.run.first_byte}{of_telegram}, "
            f"where {self.names[right]} has {has or 'nothing'}"
        )

    def _divergence(self, a: int, b: int, subindexes: Iterable[int]) -> _Divergence | None:
        """Return where definition B first says something else than A; other names for the same are none."""
        # Not before it is needed: a report without definitions does without them.
        from nvscope.definition.byte_map import Relation, names_of, runs_of

        names = names_of(self._list(a)), names_of(self._list(b))
        for subindex in subindexes:
            ours, theirs = (
                self.candidates[place][subindex] if subindex < len(self.candidates[place]) else None for place in (a, b)
            )
            for run in runs_of(ours, theirs, names):
                if run.relation not in {Relation.SAME, Relation.RENAMED}:
                    return _Divergence(subindex, run)
        return None

    def _list(self, place: int) -> ListDefinition:
        return self.candidates[place][0].list


def _fitted(values: Values, stream: int) -> dict[Shape | None, Events]:
    """Return the telegrams of a stream by the shape of a definition that they have, None for those that have none."""
    found: dict[Shape | None, Events] = {
        fitted.layout.shape: Events(fitted.telegrams, fitted.first_ns, fitted.last_ns, tuple(fitted.frames))
        for fitted in values.fitted(stream)
    }
    if stream < len(values.unfitting) and values.unfitting.count[stream]:
        found[None] = events_of(values.unfitting, stream)
    return found
