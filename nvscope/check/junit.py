"""Verdicts for build servers: JUnit's XML, a suite a file of rules, a case a rule."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Verdict
from nvscope.check.words import command, sentence, shown
from nvscope.view.escape import visible

_MOST_SUBJECTS = 50


def junit(
    found: Checked, *, inconclusive_fails: bool = False, failing: Sequence[str] = ("error",)
) -> bytes:  # fmt: skip
    """Return the document.

    Rules of the severities that are ``failing`` are failures where they are broken, with ``inconclusive_fails`` where
    they could not be decided, too; others are skipped then, with what broke them: a build server goes red for nothing
    that ``check`` does not exit with 1 for.
    """
    root = Element("testsuites", name="nvscope")
    for path, group in groupby(found.decided, key=lambda one: one.rule.path):
        rules = list(group)
        failed = [one for one in rules if _fails(one, inconclusive_fails, failing)]
        skipped = [one for one in rules if one.verdict is not Verdict.PASS and one not in failed]
        suite = SubElement(
            root, "testsuite", name=visible(path), tests=str(len(rules)), failures=str(len(failed)), errors="0",
            skipped=str(len(skipped)), time="0",
        )  # fmt: skip
        for decided in rules:
            rule = decided.rule
            case = SubElement(
                suite, "testcase", name=visible(rule.id), classname=f"nvscope.{rule.check.name}", time="0"
            )
            if decided in failed:
                text = _text(found, decided)
                SubElement(case, "failure", message=text[0], type=decided.verdict.value).text = "\n".join(text)
            elif decided in skipped:
                told = _text(found, decided)[0]
                is_broken = decided.verdict is Verdict.FAIL
                SubElement(case, "skipped", message=f"{decided.rule.severity}: {told}" if is_broken else told)
    indent(root)
    content: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def _fails(decided: Decided, inconclusive_fails: bool, failing: Sequence[str]) -> bool:
    is_bad = decided.verdict is Verdict.FAIL or (inconclusive_fails and decided.verdict is Verdict.INCONCLUSIVE)
    return is_bad and decided.rule.severity in failing


def _text(found: Checked, decided: Decided) -> list[str]:
    """Return what a person needs, first in a line; then where each subject broke the rule, and what shows it."""
    subjects = shown(decided)[:_MOST_SUBJECTS]
    lines = [sentence(found, subjects[0])]
    for judged in subjects:
        lines += [sentence(found, judged), *filter(None, [command(found, judged)])]
    if decided.rule.description:
        lines.append(visible(decided.rule.description))
    return list(dict.fromkeys(lines))
