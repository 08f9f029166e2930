"""Verdicts for a pull request, as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope import units
from nvscope.check.run import Checked
from nvscope.check.verdict import Verdict
from nvscope.check.words import command, margin, sentence, shown, value_in_words
from nvscope.view.escape import markdown_code, markdown_safe

_MARKS = {Verdict.FAIL: "✗", Verdict.INCONCLUSIVE: "?", Verdict.PASS: "●"}


def markdown(found: Checked, paths: Sequence[str]) -> Iterator[str]:
    """Yield lines: the verdict, what is broken and where, and all rules as a table."""
    failed, open_ = len(found.of(Verdict.FAIL)), len(found.of(Verdict.INCONCLUSIVE))
    told = f"{failed} of {units.count_of(len(found.decided), 'rule')} failed"
    yield f"**{told}{f', {open_} could not be decided' if open_ else ''}** · {', '.join(map(markdown_code, paths[:3]))}"
    broken = [*found.of(Verdict.FAIL), *found.of(Verdict.INCONCLUSIVE)]
    for decided in broken:
        yield ""
        why = f": {markdown_safe(decided.rule.description)}" if decided.rule.description else ""
        yield f"- {_MARKS[decided.verdict]} **{markdown_safe(decided.rule.id)}**{why}"
        for judged in shown(decided)[:5]:
            yield f"  - {markdown_safe(sentence(found, judged))}"
            if shows := command(judged, paths):
                yield f"    {markdown_code(shows)}"
    yield ""
    yield "| | rule | check | worst | limit | margin |"
    yield "|---|---|---|---:|---:|---:|"
    for decided in found.decided:
        first = min(shown(decided), key=lambda one: float("inf") if one.margin_percent is None else one.margin_percent)
        cells = (
            _MARKS[decided.verdict], markdown_safe(decided.rule.id), decided.rule.check.name,
            value_in_words(first.worst, first.unit), value_in_words(first.limit, first.unit), margin(first),
        )  # fmt: skip
        yield f"| {' | '.join(cells)} |"
