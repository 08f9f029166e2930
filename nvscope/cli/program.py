"""The verbs of the program, and the options that stand in front of them."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import Any

import typer

from nvscope.cli.help import Command, Group
from nvscope.version import __version__

VERBS = {
    "report": "nvscope.cli.report:report",
    "vars": "nvscope.cli.vars:variables",
    "packets": "nvscope.cli.packets:packets",
    "export": "nvscope.cli.export:export",
    "watch": "nvscope.cli.watch:watch",
    "record": "nvscope.cli.record:record",
    "convert": "nvscope.cli.convert:convert",
    "recover": "nvscope.cli.recover:recover",
    "replay": "nvscope.cli.replay:replay",
    "check": "nvscope.cli.check:check",
    "baseline": "nvscope.cli.baseline:baseline",
    "diff": "nvscope.cli.diff:diff",
    "gvl": "nvscope.cli.gvl:app",
    "sdo": "nvscope.cli.sdo:app",
    "visu": "nvscope.cli.visu:app",
    "datalog": "nvscope.cli.datalog:app",
    "audit": "nvscope.cli.audit:audit",
    "simulate": "nvscope.cli.simulate:simulate",
    "explain": "nvscope.cli.explain:explain",
    "doctor": "nvscope.cli.doctor:doctor",
    "keys": "nvscope.cli.keys:keys",
    "schema": "nvscope.cli.schema:schema",
}
"""Verbs in the order of ``--help``, and where each is: a function, or a program of verbs of its own."""

_VERSION = "--version"

_HELP = """Analyze CODESYS network variables: who sends what, what is lost, who does not answer, and what to check.

`nvscope FILE` is `nvscope report FILE`; `nvscope help VERB` tells more about a verb. Options may stand in front of the
verb or behind it."""


def program(wanted: str | None = None) -> typer.Typer:
    """Return the program with all its verbs; with that one alone if a verb is ``wanted``, with none for the version.

    To import and to describe the others takes as long as a small report.
    """
    app = typer.Typer(
        name="nvscope",
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        cls=_Program,
    )
    app.callback(help=_HELP)(_options)
    verbs: Iterable[str] = (wanted,) if wanted in VERBS else () if wanted == _VERSION else VERBS
    for name in verbs:
        module, _, attribute = VERBS[name].partition(":")
        verb = getattr(import_module(module), attribute)
        if isinstance(verb, typer.Typer):
            app.add_typer(verb, name=name)
        else:
            app.command(name, cls=Command)(verb)
    return app


class _Program(Group):
    """The verbs in the order of the table, whatever each of them is."""

    def list_commands(self, ctx: Any) -> list[str]:
        return [name for name in VERBS if name in self.commands]


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"nvscope {__version__}")
        raise typer.Exit


def _options(
    version: bool = typer.Option(False, _VERSION, callback=_show_version, is_eager=True, help="Show the version."),
) -> None:
    """Take the options in front of the verb; what they do is done when they are read."""
