"""``nvscope simulate``: a capture with faults from a scenario, and the truth about it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nvscope.errors import UsageError


def simulate(
    scenario: Annotated[str | None, typer.Argument(metavar="SCENARIO.toml", show_default=False)] = None,
    write: Annotated[
        str | None, typer.Option("-w", "--write", metavar="FILE", help="The .pcap or .pcapng file to write.")
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            "--truth", metavar="FILE", help="Where the truth goes as JSON; - is stdout. Default: FILE.truth.json."
        ),
    ] = None,
    keys: Annotated[bool, typer.Option("--keys", help="List all keys of a scenario and their meaning.")] = False,
) -> None:
    """Write the traffic of a scenario to a capture file, and beside it what was put into it.

    Nothing is sent. The same scenario gives the same bytes.
    """
    from nvscope.plc.scenario import document, load_scenario

    if keys:
        typer.echo(document())
        return
    if scenario is None or write is None:
        raise UsageError(
            "a scenario and -w FILE are needed",
            next_step="nvscope simulate SCENARIO.toml -w FILE.pcap; --keys lists what a scenario can say",
        )
    plan = load_scenario(scenario)

    import json

    from nvscope.capture.open import open_sink
    from nvscope.plc.simulator import simulate as run
    from nvscope.plc.timeline import LINKS

    sink = open_sink(write, LINKS[plan.link])
    try:
        told = run(plan, sink)
    finally:
        sink.close()
    text = json.dumps(told, indent=2) + "\n"
    if truth == "-":
        typer.echo(text, nl=False)
        return
    path = Path(truth or f"{write}.truth.json")
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(
            error.strerror or str(error), where=str(path), next_step="name another file with --truth"
        ) from error
    typer.echo(f"{write}: {told['capture']['frames']} frames; the truth about them: {path}", err=True)
