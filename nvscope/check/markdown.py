"""Verdicts for a pull request, as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Verdict
from nvscope.check.words import broken_first, command, counted, margin, sentence, shown, value_in_words
from nvscope.view.escape import markdown_code, markdown_safe

_MARKS = {Verdict.FAIL: "✗", Verdict.INCONCLUSIVE: "?", Verdict.PASS: "●"}


def markdown(found: Checked, paths: Sequence[str]) -> Iterator[str]:
    """Yield lines: the verdict, what is broken and where, and all rules as a table."""
    yield f"**{counted(found)}** · {', '.join(map(markdown_code, paths[:3]))}"
    for decided in broken_first(found):
        yield ""
        why = f": {markdown_safe(decided.rule.description)}" if decided.rule.description else ""
        yield f"- {_mark(decided)} **{markdown_safe(decided.rule.id)}**{why}"
        for judged in shown(decided)[:5]:
            yield f"  - {markdown_safe(sentence(found, judged))}"
            if shows := command(found, judged):
                yield f"    {markdown_code(shows)}"
    yield ""
    yield "| | rule | check | worst | limit | margin |"
    yield "|---|---|---|---:|---:|---:|"
    for decided in found.decided:
        first = min(shown(decided), key=lambda one: float("inf") if one.margin_percent is None else one.margin_percent)
        cells = (
            _mark(decided), markdown_safe(decided.rule.id), decided.rule.check.name,
            value_in_words(first.worst, first.unit), value_in_words(first.limit, first.unit), margin(first),
        )  # fmt: skip
        yield f"| {' | '.join(cells)} |"


def _mark(decided: Decided) -> str:
    is_warning = decided.verdict is Verdict.FAIL and decided.rule.severity != "error"
    return "!" if is_warning else _MARKS[decided.verdict]
