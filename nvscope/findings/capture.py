"""NV9xx: what the capture itself lacks."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.batch import LinkType
from nvscope.findings.finding import Facts, Finding, events_of
from nvscope.units import count, count_of, duration, percent


def judge_capture(facts: Facts) -> Iterator[Finding]:
    """Yield NV901 to NV905, each about the whole capture."""
    yield from _drops(facts)
    steps_back = facts.state.capture.steps_back.rows
    for events in (events_of(steps_back, row) for row in range(len(steps_back))):
        step = duration(facts.state.capture.longest_step_back_ns)
        message = f"{count_of(events.count, 'frame')} with a time before that of the frame in front, by up to {step}."
        yield Finding("NV902", message, events.count, events.first_ns, events.last_ns, events.frames)
    yield from _truncated(facts)
    yield from _unsupported(facts)
    yield from _mirrored(facts)


def _whole(facts: Facts, code: str, events: int, message: str) -> Finding:
    return Finding(code, message, events, facts.summary.start_ns, facts.summary.end_ns)


def _drops(facts: Facts) -> Iterator[Finding]:
    drops = sum(source.drops for source in facts.sources)
    if drops:
        seen = facts.state.capture.frames
        share = percent(drops, drops + seen)
        yield _whole(facts, "NV901", drops, f"The capture lost {count_of(drops, 'frame')} of its own ({share}).")


def _truncated(facts: Facts) -> Iterator[Finding]:
    cut = [source for source in facts.sources if source.truncation]
    if cut:
        where = "; ".join(f"{source.path}: {source.truncation.message}" for source in cut if source.truncation)
        yield _whole(facts, "NV903", len(cut), f"{count_of(len(cut), 'file')} could not be read whole: {where}.")


def _unsupported(facts: Facts) -> Iterator[Finding]:
    unsupported = facts.state.capture.unsupported
    if unsupported:
        frames = sum(unsupported.values())
        known = {link.value: link.name for link in LinkType}
        links = ", ".join(f"{link} ({known[link]})" if link in known else str(link) for link in sorted(unsupported))
        yield _whole(facts, "NV904", frames, f"{count_of(frames, 'frame')} of link type {links} were not looked into.")


def _mirrored(facts: Facts) -> Iterator[Finding]:
    """Compare the repeated telegrams with the others: of traffic that is mirrored twice, half are repeated."""
    repeated = facts.state.senders.repeated
    others = facts.state.senders.data_telegrams - repeated
    if 100 * repeated > facts.limits.mirrored_percent * others:
        message = (
            f"{count(repeated)} of {count_of(others, 'telegram')} came again, byte for byte: "
            "the capture seems to see each frame more than once."
        )
        yield _whole(facts, "NV905", repeated, message)
