"""What is said of a verdict, in the same words wherever it is said."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Sequence

from nvscope import units
from nvscope.check.deciding import Decided
from nvscope.check.rules import SEVERITIES
from nvscope.check.run import Checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.view.escape import visible

_AROUND = 4
_MOST_PERCENT = 9_999
_MOST_PATHS = 4


def value_in_words(value: float | None, unit: str) -> str:
    """Return a value with its unit: ``199.8 ms``, ``0.3 %``, ``2 telegrams``."""
    if value is None:
        return "-"
    if unit == "s" and not value:
        return "0 s"
    if unit == "s":
        return units.duration(round(value * 1_000_000_000))
    if unit == "ratio":
        return units.load(100 * value)
    number = units.count(int(value)) if float(value).is_integer() else f"{value:g}".replace("-", "−")
    return f"{number} {unit.removesuffix('s') if value == 1 else unit}" if unit else number


def margin(judged: Judged) -> str:
    """Return how far the worst value is from the limit, in percent of that, or by how much where it is 0."""
    percent = judged.margin_percent
    if percent is None and judged.margin is not None and not math.isnan(judged.margin):
        return f"{'−' if judged.margin < 0 else ''}{value_in_words(abs(judged.margin), judged.unit)}"
    if percent is None or math.isnan(percent):
        return "-"
    if abs(percent) > _MOST_PERCENT:
        return f"{'below −' if percent < 0 else 'above '}{units.count(_MOST_PERCENT)} %"
    return f"{'−' if percent < 0 else ''}{units.count(round(abs(percent)))} %"


def subject(found: Checked, judged: Judged) -> str:
    """Return what it is about: ``list 7 axis, 192.168.1.10``; "" where that is the capture."""
    if judged.channel is not None:
        return f"channel {visible(judged.channel)}"
    if judged.protocol is not None and judged.node is not None:
        whom = "" if judged.partner is None else f" → {units.endpoint(judged.partner, judged.port or 0)}"
        return f"{judged.protocol} {judged.node}{whom}"
    if judged.list is None:
        return visible(judged.variable or "")
    name = found.names.get(judged.list)
    short = units.list_key(str(judged.list)).rpartition("/")[2]
    sender = "" if judged.node is None else f", {judged.node}"
    part = f", SubIndex {judged.subindex}" if judged.subindex else ""
    variable = f", {visible(judged.variable)}" if judged.variable else ""
    return f"list {short}{f' {visible(name)}' if name else ''}{sender}{part}{variable}"


def measures(judged: Judged) -> list[str]:
    """Return worst value, limit, margin and reason, as far as there are such."""
    parts = []
    if judged.worst is not None:
        parts.append(f"worst {value_in_words(judged.worst, judged.unit)}")
    if judged.limit is not None:
        parts.append(f"limit {value_in_words(judged.limit, judged.unit)}")
    if judged.margin is not None:
        parts.append(f"margin {margin(judged)}")
    if judged.reason:
        parts.append(visible(judged.reason))
    if judged.count > 1 and judged.worst != judged.count:
        parts.append(f"{units.count(judged.count)} times")
    return parts


def when(found: Checked, judged: Judged) -> str:
    """Return when it was broken first: ``first at 7.0 s, frame 278``; "" where nobody knows."""
    start_ns = found.scene.snapshot.summary.start_ns
    if judged.first_ns is None or start_ns is None or judged.verdict is Verdict.PASS:
        return ""
    at = f"first at {value_in_words((judged.first_ns - start_ns) / 1_000_000_000, 's')}"
    return at + (f", frame {units.count(judged.frames[0])}" if judged.frames else "")


def command(found: Checked, judged: Judged) -> str:
    """Return the command that shows where it was broken first; "" where nobody knows, or none can read it again."""
    inquiry = found.scene.inquiry
    paths, asked = inquiry.paths, inquiry.asked
    is_again = 0 < len(paths) <= _MOST_PATHS and "-" not in paths
    if not judged.frames or judged.verdict is Verdict.PASS or not is_again:
        return ""
    first = judged.frames[0]
    between = f"frame.number >= {max(first - _AROUND, 1)} && frame.number <= {first + _AROUND}"
    # Frames are numbered within the part of a capture that is read.
    options = () if asked is None else asked.options
    if options is None:
        return ""
    return visible(" ".join(["nvscope packets", *map(shlex.quote, (*paths, *options)), f"-Y '{between}'"]))


def sentence(found: Checked, judged: Judged) -> str:
    """Return all of it in a line."""
    return ", ".join(filter(None, [subject(found, judged), *measures(judged), when(found, judged)]))


def shown(decided: Decided) -> list[Judged]:
    """Return the subjects that have the verdict of their rule."""
    return [one for one in decided.subjects if one.verdict is decided.verdict]


def broken_first(found: Checked) -> Sequence[Decided]:
    """Return the rules that are broken, errors first, and then those that could not be decided."""
    broken = sorted(found.of(Verdict.FAIL), key=lambda one: SEVERITIES.index(one.rule.severity))
    return [*broken, *found.of(Verdict.INCONCLUSIVE)]


def counted(found: Checked) -> str:
    """Return how many rules failed, are warnings, and could not be decided; or that all passed."""
    broken = Counter(one.rule.severity for one in found.of(Verdict.FAIL))
    rules, open_ = units.count_of(len(found.decided), "rule"), len(found.of(Verdict.INCONCLUSIVE))
    parts = [f"{units.count(broken['error'])} of {rules} failed"] if broken["error"] else []
    for severity in SEVERITIES[1:]:
        if broken[severity]:
            parts.append(units.count_of(broken[severity], severity) + ("" if parts else f" of {rules}"))
    if open_:
        parts.append(f"{units.count(open_)} {'' if parts else f'of {rules} '}could not be decided")
    return ", ".join(parts) or f"{rules} passed"
