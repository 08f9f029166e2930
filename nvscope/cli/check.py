"""``nvscope check``: whether captures keep the rules that a team has written down."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from msgspec.structs import replace

from nvscope.cli.check_files import Wanted
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption, flaws_told_first, project_of
from nvscope.cli.encodings import as_data
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import (
    NOTHING_BETWEEN,
    BitRateOption,
    ChannelMapOption,
    ForceOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    duration_ns,
    tell_of_bit_rates,
    tell_of_channels,
    tell_of_losses,
)
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, guard_workflow, width, workflow_command
from nvscope.errors import ExitCode, NvscopeError, UsageError

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.check.rules import Rules
    from nvscope.check.run import Checked, Judging
    from nvscope.definition.project import Project
    from nvscope.view.asked_time import AskedRange
    from nvscope.view.lines.table import Line

_SUFFIX = ".rules.toml"


@with_live_options
def check(
    live: LiveOptions,
    sources: SourcesArgument = None,
    read: ReadOption = None,
    rules: Annotated[
        list[str] | None,
        typer.Option(
            "--rules", metavar="FILE", show_default=False,
            help="Rules; also several, and *.rules.toml need no option. Without any: every *.rules.toml beside the "
            "project file, or here.",
        ),
    ] = None,
    fail_on: Annotated[
        Literal["error", "warning", "inconclusive", "never"],
        typer.Option(
            "--fail-on",
            help="What fails a build: broken rules of severity error, of warning too, also rules that could not be "
            "decided, or nothing.",
        ),
    ] = "error",
    as_json: Annotated[bool, typer.Option("--json", help="For programs (nvscope.check/1).")] = False,
    as_markdown: Annotated[bool, typer.Option("--md", help="As Markdown, for a pull request.")] = False,
    as_annotations: Annotated[
        bool, typer.Option("--github", help="As annotations of a GitHub workflow, beside what people read.")
    ] = False,
    junit: Annotated[
        str | None,
        typer.Option("--junit", metavar="FILE", help="Write JUnit's XML for build servers, too.", show_default=False),
    ] = None,
    sarif: Annotated[
        str | None,
        typer.Option("--sarif", metavar="FILE", help="Write SARIF 2.1.0 for code scanning, too.", show_default=False),
    ] = None,
    evidence: Annotated[
        str | None,
        typer.Option(
            "--evidence", metavar="DIR", show_default=False,
            help="Write a small pcapng for each broken rule: what was on the wire around it, with comments at frames.",
        ),
    ] = None,
    around: Annotated[
        str, typer.Option("--around", metavar="DURATION", help="How much evidence has before and behind.")
    ] = "2s",
    fast: Annotated[
        bool, typer.Option("--fast", help="End a live source as soon as a rule of severity error is broken.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show which lists each rule is for, and what can never be decided.")
    ] = False,
    self_test: Annotated[
        bool, typer.Option("--self-test", help="Run the rules' own tests, [[test]], instead; no capture is needed.")
    ] = False,
    force: ForceOption = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    bit_rates: BitRateOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Take --from-time and --to-time as UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:  # fmt: skip
    """Judge rules on captures: each is kept, broken, or could not be decided, with the worst value and its margin.

    Exits with 1 where a rule of severity error is broken, else with 3 where one could not be decided, as when nothing
    was there to be judged: a build is never green because nothing was recorded. All mistakes in rules are told at once.
    """
    if as_json and (as_markdown or as_annotations or dry_run or self_test):
        told_twice = "--json is for programs; --md, --github, --dry-run and --self-test are for people"
        raise UsageError(told_twice, next_step="leave one of them out")
    named = [path for path in sources or () if path.endswith(_SUFFIX)]
    sources = [path for path in sources or () if not path.endswith(_SUFFIX)]
    rules = [*(rules or ()), *named]
    if as_annotations:
        guard_workflow()
    if self_test or (dry_run and not (sources or read or live.interfaces)):
        plant = project_of(project, gvl, ())
        told = _read(rules or _found(plant), plant)
        if self_test:
            _self_test(told, plant, colour)
        else:
            _tell_of_rules(told, plant)
        return
    wanted = Wanted(junit, sarif, evidence, duration_ns("--around", around))
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    asked = asked_range(from_time, to_time, utc=utc)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)
    plant = replace(plant, buses=plant.buses.overridden(bit_rates or ()))
    files = rules or _found(plant)
    told = _read(files, plant, paths, ports, asked)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.check.run import checked
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.cli.progress import watching

    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, watch=watching(quiet=quiet), asked=asked)
    if inquiry.paths:
        keep_freed_memory()
    with flaws_told_first(plant.definition), _each_mistake_told():
        found = checked(inquiry, told, _judging(inquiry, wanted, fast=fast))
    if dry_run:
        from nvscope.check import matched

        _show(matched.lines(found, width()), colour)
        return
    if as_annotations:
        from nvscope.check.github import annotation_lines

        for line in annotation_lines(found):
            workflow_command(line)
    if as_markdown:
        from nvscope.check.markdown import markdown

        echo("\n".join(markdown(found, inquiry.paths)))
    elif as_json:
        from nvscope.check.document import document
        from nvscope.report import json

        as_data()
        echo(json.render(document(found)), nl=False)
    else:
        from nvscope.check.lines import lines

        _show(lines(found, files, inquiry.paths, width()), colour)
    if wanted:
        from nvscope.cli.check_files import write_files

        write_files(inquiry, found, wanted, told.paths, fail_on=fail_on, force=force)
    buses = [bus.channel for bus in found.scene.snapshot.summary.can.buses]
    tell_of_channels(channel_map, buses)
    tell_of_bit_rates(bit_rates, buses)
    if asked and not found.scene.snapshot.summary.capture.frames:
        echo(NOTHING_BETWEEN, err=True)
    unread = tell_of_losses(found.infos)
    if code := exit_code(found, fail_on) or unread:
        raise typer.Exit(code)


def _judging(inquiry: Inquiry, wanted: Wanted, *, fast: bool) -> Judging:
    """Return how rules are judged: of what cannot be read again, enough is kept for evidence."""
    from nvscope.check.run import Judging
    from nvscope.cli.scenes import are_read_whole
    from nvscope.engine.ring import RING_BYTES

    if fast and are_read_whole(inquiry):
        raise UsageError("--fast ends what is live, and files have an end", next_step="leave it out")
    if wanted.evidence and not are_read_whole(inquiry):
        return Judging(RING_BYTES, fast=fast)
    return Judging(fast=fast)


def _show(lines: Iterable[Line], colour: ColourOption) -> None:
    from nvscope.report.ansi import paint

    shown = colour_wanted(colour)
    echo(paint(lines, colour=shown), nl=False, color=shown)


def _tell_of_rules(told: Rules, plant: Project) -> None:
    """Tell that rules are without mistakes, as far as that can be known without a capture."""
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.check.run import watching
    from nvscope.units import count_of

    with _each_mistake_told():
        watching(Inquiry((), plant), told, None)
    echo(f"{count_of(len(told.rules), 'rule')} without a mistake; a capture shows which lists they are for")


def _self_test(told: Rules, plant: Project, colour: ColourOption) -> None:
    """Run the tests that rules have, and tell what came of them."""
    from nvscope.check.self_test import tested
    from nvscope.check.tested_lines import lines

    if not told.tests:
        raise UsageError("no rule has a test", where=told.paths[0], next_step="a test begins with [[test]]")
    found, mistakes = tested(told.tests, plant)
    if mistakes:
        _tell(mistakes)
        raise typer.Exit(ExitCode.USAGE)
    _show(lines(found, width()), colour)
    if any(one.wrong for one in found):
        raise typer.Exit(ExitCode.ASSERTION_FAILED)


def exit_code(found: Checked, fail_on: str) -> ExitCode:
    """Return what a build is told: 1 for a broken rule that counts, else 3 for one that could not be decided."""
    from nvscope.check.verdict import Verdict

    if fail_on == "never":
        return ExitCode.GOOD
    counted = {"error", "warning"} if fail_on == "warning" else {"error"}
    rules = [one for one in found.decided if one.rule.severity in counted]
    if any(one.verdict is Verdict.FAIL for one in rules):
        return ExitCode.ASSERTION_FAILED
    if any(one.verdict is Verdict.INCONCLUSIVE for one in rules):
        return ExitCode.ASSERTION_FAILED if fail_on == "inconclusive" else ExitCode.DATA_LOSS
    return ExitCode.GOOD


def _found(plant: Project) -> list[str]:
    folder = Path(plant.path).parent if plant.path else Path()
    found = sorted(str(one) for one in folder.glob(f"*{_SUFFIX}"))
    if not found:
        raise UsageError("no rules are named, and none are beside the project", next_step="add --rules FILE.rules.toml")
    return found


def _read(
    files: Sequence[str], plant: Project, paths: Sequence[str] = (), ports: PortRules | None = None,
    asked: AskedRange | None = None,
) -> Rules:  # fmt: skip
    """Return the rules of files; each mistake in them is told, then it ends.

    Also those in expressions, and lists that no capture has, if these are files.
    """
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.check.rules import Mistakes, read_rules
    from nvscope.check.run import further_mistakes

    try:
        return read_rules(files)
    except Mistakes as error:
        mistakes = list(error.mistakes)
        captures = [path for path in paths if Path(path).is_file()]
        inquiry = Inquiry(captures if len(captures) == len(paths) else (), plant, ports, asked=asked)
        # What cannot be read is told when there is nothing else to be told.
        with suppress(NvscopeError):
            mistakes += further_mistakes(inquiry, error.readable)
    _tell(sorted(mistakes, key=_place))
    raise typer.Exit(ExitCode.USAGE)


def _place(mistake: NvscopeError) -> tuple[str, int]:
    path, _, rest = mistake.where.partition(", line ")
    line = rest.partition(",")[0]
    return path, int(line) if line.isdigit() else 0


@contextmanager
def _each_mistake_told() -> Iterator[None]:
    """Tell all mistakes in rules that come up, and end with them."""
    from nvscope.check.rules import Mistakes

    try:
        yield
    except Mistakes as error:
        _tell(error.mistakes)
        raise typer.Exit(ExitCode.USAGE) from None


def _tell(mistakes: Iterable[NvscopeError]) -> None:
    for one in mistakes:
        echo(f"nvscope: {one}", err=True)
