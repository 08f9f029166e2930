"""``nvscope explain``: what a cause or a finding means, what a figure or a column tells, what a rule checks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.completion import codes
from nvscope.cli.encodings import as_data
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width

if TYPE_CHECKING:
    from nvscope.check.check import Check


def explain(
    code: Annotated[
        str | None,
        typer.Argument(
            help="A cause, a finding, a figure, a column or a check of rules: second-sender, NV301, "
            "no-acknowledgement, list.jitter, status, cycle.",
            autocompletion=codes,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The same as JSON (nvscope.explain/1).")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Tell what a cause is, by what it is told, and what to do; what a finding means, and its usual causes; what a
    figure or a column of reports tells; or what a check of rules is for, with its parameters. Without CODE, list all
    causes and findings."""
    from nvscope.report import explain as face

    checks, near = _checks(code) if code is not None or as_json else ((), ())
    if as_json:
        from nvscope.report import json

        data = []
        if checks:
            from nvscope.check.explained import check_data

            data = [check_data(one) for one in checks]
        as_data()
        echo(json.render(face.document(code, data, near)), nl=False)
        return
    shown = colour_wanted(colour)
    if code is None:
        echo(face.overview(colour=shown, width=width()), nl=False, color=shown)
        return
    further = []
    if checks:
        from nvscope.check.explained import check_lines

        further = [check_lines(one, face.told_width(width())) for one in checks]
    echo(face.render(code, colour=shown, width=width(), further=further, near=near), nl=False, color=shown)


def _checks(code: str | None) -> tuple[Sequence[Check], Sequence[str]]:
    """Return the checks that a code stands for, all of them for none, and those that are called nearly so."""
    from nvscope.report.explain import is_code

    if code is not None and is_code(code):
        return (), ()
    from nvscope.check.catalogue import CATALOGUE
    from nvscope.check.explained import check_called, near

    if code is None:
        return list(CATALOGUE.values()), ()
    found = check_called(code)
    return ((), near(code)) if found is None else ((found,), ())
