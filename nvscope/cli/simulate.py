"""``nvscope simulate``: a capture with faults from a scenario, and the truth about it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.capture.formats import suffixes_that
from nvscope.cli.sending import MapOption, NetworkOption, PortOption, Stop, Target, ToOption, target_of, tell_of_sent
from nvscope.cli.sources import ForceOption
from nvscope.cli.streams import refuse_streams_onto
from nvscope.cli.terminal import echo
from nvscope.errors import CaptureError, NvscopeError, UsageError

if TYPE_CHECKING:
    from nvscope.simulate.scenario import Scenario


def simulate(
    scenario: Annotated[str | None, typer.Argument(metavar="SCENARIO.toml", show_default=False)] = None,
    write: Annotated[
        str | None,
        typer.Option("-w", "--write", metavar="FILE", help=f"The {suffixes_that(lambda _: True)} file to write."),
    ] = None,
    to: ToOption = None,
    mapped: MapOption = None,
    port: PortOption = None,
    allow_network: NetworkOption = False,
    truth: Annotated[
        str | None,
        typer.Option(
            "--truth", metavar="FILE", help="Where the truth goes as JSON; - is stdout. Default: FILE.truth.json."
        ),
    ] = None,
    gvl: Annotated[
        str | None,
        typer.Option(
            "--gvl",
            metavar="DIRECTORY",
            help="Where .gvl files go, for each list on CAN and each [[definition]].",
        ),
    ] = None,
    force: ForceOption = False,
    keys: Annotated[bool, typer.Option("--keys", help="List all keys of a scenario and their meaning.")] = False,
) -> None:
    """Write the traffic of a scenario to a capture file, and beside it what was put into it.

    The same scenario gives the same bytes; files that exist and hold others are replaced with --force only. Nothing is
    sent, but with --to: then a plant on a desk sends what the scenario says, at its pace, to this machine alone unless
    --allow-network is given.
    """
    from nvscope.simulate.scenario_file import document, load_scenario

    if keys:
        echo(document())
        return
    if scenario is not None and to:
        if write or truth or gvl:
            raise UsageError("--to sends, and writes nothing", next_step="leave -w, --truth and --gvl out")
        _send(load_scenario(scenario), target_of(to, mapped or (), port or (), allow_network=allow_network))
        return
    if scenario is None or write is None:
        raise UsageError(
            "a scenario and -w FILE are needed",
            next_step="nvscope simulate SCENARIO.toml -w FILE.pcap; --keys lists what a scenario can say",
        )
    if "" in (write, truth, gvl):
        raise UsageError("the name of a file to write is empty", next_step="name one, or leave the option out")
    told_to = None if truth == "-" else truth or f"{write}.truth.json"
    plan = load_scenario(scenario)

    import json

    from nvscope.simulate.definition import definitions as definitions_of
    from nvscope.simulate.simulator import open_capture
    from nvscope.simulate.simulator import simulate as run
    from nvscope.view.escape import json_ascii, visible
    from nvscope.whole_files import Existing, WholeFiles

    texts = definitions_of(plan)
    definitions = _definition_files(plan, gvl, texts) if gvl is not None else {}
    # The same scenario gives the same files again. All others that have these names may be somebody's recordings.
    refuse_streams_onto([scenario])
    files = WholeFiles([scenario], force=force)
    try:
        capture = files.reserve(write, Existing.SAME)
        told_file = None if told_to is None else files.open(told_to, Existing.SAME)
        for path, content in definitions.items():
            path.parent.mkdir(exist_ok=True)
            files.write(str(path), content.encode())
        with named(capture.unfinished, write):
            sink = open_capture(plan, capture.unfinished, write)
            try:
                told = run(plan, sink)
            finally:
                sink.close()
        text = json_ascii(json.dumps(told, indent=2)) + "\n"
        if told_file is None:
            echo(text, nl=False)
        else:
            told_file.file.write(text.encode())
        files.publish()
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        where = error.filename or write
        raise CaptureError(error.strerror or str(error), where=str(where), next_step="name another file") from error
    finally:
        files.discard()
    if told_to is not None:
        frames = told["capture"]["frames"]
        echo(f"{visible(write)}: {frames} frames; the truth about them: {visible(told_to)}", err=True)


def _send(plan: Scenario, target: Target) -> None:
    """Send what a scenario says, each when it is due; what cannot go there is told."""
    from nvscope.cli.live import LiveRun
    from nvscope.plc.pace import Pace
    from nvscope.simulate.simulator import traffic

    if plan.channels and plan.has_network:
        other = "telegrams over UDP" if target.is_can else "frames of CAN"
        echo(f"nvscope: the scenario has {other}, too, which are not sent there.", err=True)
    pace, stop = Pace(), Stop()
    with LiveRun(stop, quiet=True), target.sender(pace, None, lambda: stop.asked) as sender:
        for batch in traffic(plan):
            sender.send(batch, plan.channels)
            if stop.asked:
                break
    if code := tell_of_sent(target, pace.timing, sender):
        raise typer.Exit(code)


@contextmanager
def named(unfinished: str, name: str) -> Iterator[None]:
    """Let errors about a file that has another name as yet tell the one that was asked for."""
    try:
        yield
    except NvscopeError as error:
        error.where = name if error.where == unfinished else error.where
        raise


def _definition_files(plan: Scenario, directory: str, definitions: dict[str, str]) -> dict[Path, str]:
    """Return the files of definitions; a list is called as its file is."""
    for name in definitions:
        if Path(name).name != name or name.startswith("."):
            raise plan.error("can_list", f"'{name}' is no name that a file can have", "Give the list another name.")
    folder = Path(directory)
    if folder.exists() and not folder.is_dir():
        raise UsageError("definitions need a directory", where=directory, next_step="name another one with --gvl")
    if not folder.parent.is_dir():
        raise CaptureError("no such directory", where=str(folder.parent), next_step="make it, or name another one")
    return {folder / f"{name}.gvl": text for name, text in definitions.items()}
