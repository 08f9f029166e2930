"""The program: verbs, exit codes, and what a person sees when something goes wrong."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

import typer

from nvscope import __version__
from nvscope.cli.explain import explain
from nvscope.cli.packets import packets
from nvscope.cli.report import report
from nvscope.cli.simulate import simulate
from nvscope.errors import ExitCode, NvscopeError

app = typer.Typer(
    name="nvscope",
    help="Analyze CODESYS network variables: who sends what, what is lost, who does not answer, and what to check.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (report, packets, explain, simulate):
    app.command()(verb)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"nvscope {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Show the version."),
) -> None:
    """Analyze CODESYS network variables: who sends what, what is lost, who does not answer, and what to check."""


def main() -> NoReturn:
    """Run the program and exit with what its exit codes promise (``nvscope.errors.ExitCode``)."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]  # both are text streams here
    try:
        app()
    except NvscopeError as error:
        from nvscope.view.escape import visible

        where = f"{visible(error.where)}: " if error.where else ""
        print(f"nvscope: {where}{visible(error.what)}", file=sys.stderr)
        if error.next_step:
            print(f"  {visible(error.next_step)}", file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(ExitCode.INTERRUPTED)
    except BrokenPipeError:
        # Whoever read this has read enough. Python would complain once more when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(ExitCode.GOOD)
    except Exception:
        import traceback

        traceback.print_exc()
        print("nvscope: this is a bug of nvscope; please report it with the lines above.", file=sys.stderr)
        sys.exit(ExitCode.BUG)
    sys.exit(ExitCode.GOOD)
