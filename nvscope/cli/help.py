"""Verbs: help in groups, with examples and no sentence cut; and numbers as who reads them wants them."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from typer.core import TyperCommand, TyperGroup

from nvscope.cli.terminal import numbers

READ, LIVE, SHOWN, SENT, DEFINED, WRITTEN, HELP = (
    "What is read", "Live sources", "What is shown", "What is sent", "Definitions and names", "How it is told", "Help",
)  # fmt: skip

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        READ: ("-r", "--config", "--from-time", "--to-time", "-d", "--bitrate", "--ack-timeout"),
        LIVE: ("-i", "--count", "-D", "--for", "-a", "--follow", "-f", "-B", "-p"),
        SENT: (
            "--to", "--map", "--port", "--timeout", "--retries", "--yes", "--bind", "--every",
            "--allow-network",
        ),
        DEFINED: (
            "--gvl", "--project", "-n", "--type", "--items", "--types", "--a-types", "--b-types",
            "--variables", "--page", "--encoding", "--partly",
        ),
        WRITTEN: (
            "--json", "--md", "-w", "--folder", "--append", "--force", "--document-style", "--dry-run", "-T", "-E",
            "-t", "-x", "-V", "--utc", "-q", "--wide", "--color", "--truth",
        ),
        HELP: ("--help",),
    }
)  # fmt: skip
"""The groups of options by one of their names; those that stand in none choose what is shown (``SHOWN``)."""

ORDER = (SHOWN, READ, LIVE, SENT, DEFINED, WRITTEN, HELP)

EXAMPLES: Mapping[str, tuple[tuple[str, str], ...]] = MappingProxyType(
    {
        "report": (
            ("nvscope plant.pcapng", "what is wrong, errors first"),
            ("nvscope report plant.pcapng plc", "with the definitions in the folder plc"),
            ("nvscope report -D", "what can be named in place of a file: interfaces, CAN channels"),
            ("nvscope report plant.pcapng --from-time 5s --to-time -2s", "a part of the capture"),
            ("nvscope report plant.pcapng --follow --for 1s", "a capture that is still written; - is one from stdin"),
            ("nvscope report plant.pcapng -Y 'cause.kind == \"second-sender\"'", "one cause, and what it explains"),
            ("nvscope report plant.pcapng -Y 'list.lost > 0' --json", "lists that lost something, for programs"),
        ),
        "vars": (
            ("nvscope vars plant.pcapng plc", "the last value of every variable"),
            ("nvscope vars plant.pcapng plc --history 'stAxis.*'", "every change"),
            ("nvscope vars plant.pcapng plc --at 5s", "what they were five seconds after the start"),
            ("nvscope vars plant.pcapng --infer -w draft.gvl", "propose the layout of lists nobody defined"),
        ),
        "packets": (
            ("nvscope packets plant.pcapng -c 20", "the first telegrams"),
            ("nvscope packets plant.pcapng -V -c 1 --gvl plc", "one of them as a tree, with its variables"),
            ("nvscope packets plant.pcapng -Y 'finding.code == \"NV201\"'", "those around lost telegrams"),
            ("nvscope packets plant.pcapng -T csv -e frame.time -e nv.counter", "fields for other programs"),
        ),
        "export": (
            ("nvscope export plant.pcapng plc -w values.parquet", "every value, a file a list"),
            ("nvscope export plant.pcapng plc -w flags.csv --list axis --rows cycle", "a row for each cycle"),
            ("nvscope export plant.pcapng -w telegrams.csv", "without definitions: the telegrams"),
        ),
        "record": (
            ("nvscope record plant.pcapng plc -w plant.mcap", "a capture with its variables, figures and causes"),
            ("nvscope record plant.pcapng -w events/ --trigger 'cause.kind == \"node-restart\"'", "a file an event"),
        ),
        "convert": (
            ("nvscope convert plant.pcapng -w whole.pcap", "in another format"),
            ("nvscope convert plant.pcapng -Y 'nv.index == 7' -w list7.pcapng", "the telegrams of a list alone"),
        ),
        "recover": (("nvscope recover cut.mcap -w whole.mcap", "all that is whole of a recording that was cut off"),),
        "replay": (
            ("nvscope replay plant.pcapng --rate 10", "on the screen, ten times as fast as it was"),
            ("nvscope replay plant.pcapng --to udp://127.0.0.1", "to the programs of this machine"),
        ),
        "check": (
            ("nvscope check plant.pcapng --rules plant.rules.toml", "whether it keeps the rules of the file"),
            ("nvscope check plant.pcapng --rules plant.rules.toml --json", "the verdicts for programs"),
            (
                "nvscope check plant.pcapng plant.rules.toml --junit junit.xml --evidence evidence",
                "for a build server, with what was on the wire around each broken rule",
            ),
        ),
        "baseline": (
            ("nvscope baseline plant.pcapng -w plant.rules.toml", "rules that a good capture teaches, to be edited"),
        ),
        "diff": (("nvscope diff good.pcapng plant.pcapng", "what is otherwise than it was, and not by chance"),),
        "gvl layout": (("nvscope gvl layout plc", "what lies where in each telegram"),),
        "gvl lint": (("nvscope gvl lint plc", "what will not work, before it is sent"),),
        "gvl diff": (("nvscope gvl diff sender.gvl reader.gvl", "whether both sides mean the same"),),
        "sdo read": (
            ("nvscope sdo read 192.168.1.20 0x2000 1 --type REAL", "a parameter by Index and SubIndex"),
            ("nvscope sdo read press rSetpoint", "by the names of the project file"),
        ),
        "sdo write": (
            ("nvscope sdo write 192.168.1.20 0x2000 1 12.5 --type REAL", "read, asked, written, and read back"),
            ("nvscope sdo write press aLimits 1 2 3 --yes", "an array, without being asked"),
        ),
        "sdo serve": (
            ("nvscope sdo serve table.toml", "a controller on this machine"),
            ("nvscope sdo serve --keys", "what a table can say"),
        ),
        "visu list": (
            ("nvscope visu list 192.168.1.3", "what its visualizations show, and where that lies"),
            ("nvscope visu list 192.168.1.3 'PLC_PRG.*' .OUT0", "some of it"),
            ("nvscope visu list http://192.168.1.3:8080/plc/webvisu.htm --json", "the same for programs"),
        ),
        "visu read": (
            ("nvscope visu read 192.168.1.3 PLC_PRG.rSpeed .OUT0", "by the names of the controller's own lists"),
            ("nvscope visu read http://192.168.1.3/plc/webvisu.htm 4,146,81,8", "by where it lies"),
            ("nvscope visu read 192.168.1.3 PLC_PRG.rSpeed --every 1s --count 10", "again and again"),
        ),
        "visu write": (
            ("nvscope visu write 192.168.1.3 PLC_PRG.rSpeed 12.5", "read, asked, written, and read back"),
            ("nvscope visu write 192.168.1.3 PLC_PRG.xRun TRUE --yes", "without being asked"),
        ),
        "visu serve": (
            ("nvscope visu serve table.toml --port 8080", "a controller on this machine"),
            ("nvscope visu serve eth0 --gvl plc --port 8080", "the lists that come there, with their last values"),
            ("nvscope visu serve --keys", "what a table can say"),
        ),
        "datalog": (
            ("nvscope datalog plant.pcapng plc --config axis.xml -w axis.db", "a database as a controller writes it"),
            ("nvscope datalog plant.pcapng plc --config axis.xml -w axis.db --append", "go on with one that is there"),
            ("nvscope datalog plant.pcapng plc --config axis.xml --dry-run", "what it would log, and how much a day"),
        ),
        "datalog config": (
            ("nvscope datalog config axis --gvl plc -w axis.xml", "a session for the variables of a list"),
            (
                "nvscope datalog config 'stAxis.*' --gvl plc --set storeChangesOnly=true",
                "some variables, with a setting",
            ),
        ),
        "audit": (
            ("nvscope audit log.db", "whether it can be trusted, with its closed files log.db.0, log.db.1 …"),
            ("nvscope audit log.db --config log.xml", "by the interval that was asked for"),
            ("nvscope audit log.db --json", "for a script"),
        ),
        "simulate": (
            ("nvscope simulate plant.toml -w plant.pcapng", "a capture with faults, and the truth"),
            ("nvscope simulate plant.toml --to udp://127.0.0.1", "a plant on a desk"),
        ),
        "explain": (
            ("nvscope explain node-silent", "a cause: what happened, by what it is told, and what to do"),
            ("nvscope explain NV301", "a finding: what it means and what to do"),
            ("nvscope explain jitter", "a figure: what it tells, and where"),
        ),
        "doctor": (
            ("nvscope doctor", "listen everywhere for some seconds, and tell what keeps telegrams away"),
            ("nvscope doctor --gvl plc", "with the ports, lists and addresses of the definitions"),
            ("nvscope doctor udp://0.0.0.0:1300,239.0.0.1 --for 1s", "what keeps a port and a group silent"),
            ("nvscope doctor plant.pcapng", "what of it a capture shows"),
        ),
        "keys": (("nvscope keys --gvl plc", "all fields, those of the variables too"),),
        "schema": (
            ("nvscope schema", "all documents for programs, and what writes them"),
            ("nvscope schema report", "what `nvscope report --json` prints, as JSON Schema"),
        ),
    }
)
"""Command lines by verb, each with what it shows."""

_GAP = "   "
_WORD = re.compile(r"(?:'[^']*'|\S)+")
_MARGIN = 2
_NARROW = 50
_NARROWEST = 20
_BELOW = 4
"""Columns by which what an option means is further in than the option, where it stands below that."""

_OPTION = re.compile(r"(?<![\w-])--?[a-z]+(?:-[a-z]+)*")
_HYPHEN = "\ue000"


def _whole(text: str) -> str:
    """Return a text in which no line ends within an option: between its hyphens stands what is none yet."""
    return _OPTION.sub(lambda option: option[0].replace("-", _HYPHEN), text)


class Command(TyperCommand):
    """A verb whose help has groups of options, and ends with examples.

    While it runs, all numbers are told as its output wants them (``nvscope.cli.terminal.numbers``).
    """

    def invoke(self, ctx: Any) -> Any:
        asked = ctx.params
        with numbers(as_json=bool(asked.get("as_json")), as_markdown=bool(asked.get("as_markdown"))):
            return super().invoke(ctx)

    def get_usage(self, ctx: Any) -> str:
        _fit(ctx)
        return super().get_usage(ctx)

    def get_help(self, ctx: Any) -> str:
        _fit(ctx)
        told, self.help = self.help, _whole(self.help or "")
        try:
            return super().get_help(ctx).replace(_HYPHEN, "-")
        finally:
            self.help = told

    def format_options(self, ctx: Any, formatter: Any) -> None:
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in ORDER}
        arguments: list[tuple[str, str]] = []
        for parameter in self.get_params(ctx):
            described = parameter.get_help_record(ctx)
            if described is None:
                continue
            record = (described[0], _whole(described[1]))
            if parameter.param_type_name == "argument":
                arguments.append(record)
            else:
                groups[group_of(parameter.opts)].append(record)
        for title, records in (("Arguments", arguments), *groups.items()):
            if records:
                with formatter.section(title):
                    _write_rows(formatter, records)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        examples = EXAMPLES.get(verb_of(ctx.command_path), ())
        if examples:
            with formatter.section("Examples"):
                for line, what in examples:
                    formatter.write(_example(line, what, formatter.width))


class Group(TyperGroup):
    """Verbs whose descriptions are not cut."""

    def get_usage(self, ctx: Any) -> str:
        _fit(ctx)
        return super().get_usage(ctx)

    def get_help(self, ctx: Any) -> str:
        _fit(ctx)
        return super().get_help(ctx)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        records = [told for parameter in self.get_params(ctx) if (told := parameter.get_help_record(ctx)) is not None]
        with formatter.section("Options"):
            _write_rows(formatter, records)
        self.format_commands(ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        rows = []
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            if command is not None and not command.hidden:
                rows.append((name, " ".join((command.help or "").split("\n\n")[0].split())))
        with formatter.section("Verbs"):
            _write_rows(formatter, rows)


def _fit(ctx: Any) -> None:
    """Make help as narrow as the terminal, where that is narrower than what it is made for otherwise."""
    columns = shutil.get_terminal_size().columns
    if columns - _MARGIN < _NARROW:
        ctx.terminal_width = max(columns - _MARGIN, _NARROWEST)


def _write_rows(formatter: Any, rows: Sequence[tuple[str, str]]) -> None:
    """Write names with what they mean: beside them, or where there is no room for that, below them."""
    longest = max(len(name) for name, _ in rows)
    if formatter.width >= _NARROW:
        formatter.write_dl(rows)
    elif longest <= formatter.width // 3:
        formatter.write_dl(rows, col_max=longest)
    else:
        # A name with all that may stand behind it may be wider than a line.
        behind = f"\n{'':{formatter.current_indent + _BELOW}}<"
        fitting = [(name if len(name) <= formatter.width else name.replace(" <", behind), what) for name, what in rows]
        formatter.write_dl(fitting, col_max=_BELOW)


def _example(line: str, what: str, width: int) -> str:
    """Return a command line and what it shows; on a narrow terminal as lines that a shell takes for one."""
    if width >= _NARROW:
        return f"  {line}\n{_GAP * 2}{what}\n"
    rows = [""]
    for word in _WORD.findall(line):
        # Two columns go for the mark that the command line goes on.
        if rows[-1] and len(rows[-1]) + len(word) + 2 * _MARGIN > width:
            rows.append(_GAP[:-1])
        rows[-1] += f" {word}" if rows[-1] else f"  {word}"
    told = textwrap.wrap(what, width, initial_indent=_GAP * 2, subsequent_indent=_GAP * 2)
    return " \\\n".join(rows) + "\n" + "\n".join(told) + "\n"


def group_of(names: list[str]) -> str:
    """Return the title of the group of an option, known by its names."""
    return next((title for title, told in GROUPS.items() if set(told) & set(names)), SHOWN)


def verb_of(command_path: str) -> str:
    """Return the verb of a command path such as ``nvscope gvl lint``."""
    return " ".join(command_path.split()[1:])
