"""What ``visu serve`` answers for: the variables of a table, or those of lists that are listened to meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from msgspec import Struct
from msgspec.structs import replace

from nvscope.cli.definitions import flaws_told_first, tell_of_lists
from nvscope.cli.live import LiveOptions, captured
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import tell_of_losses
from nvscope.cli.terminal import echo
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.engine.session import Session
    from nvscope.plc.visu.controller import Controller
    from nvscope.plc.visu.lists import ServedLists
    from nvscope.plc.visu.table import ServedTable

_TABLE = ".toml"


class Asked(Struct, frozen=True):
    """What was named to be served, and how lists are read."""

    sources: Sequence[str]
    live: LiveOptions
    gvl: Sequence[str]
    project: str | None
    decode: Sequence[str]
    channel_map: Sequence[str]

    @property
    def table(self) -> str | None:
        """The file of a table, None where lists are to be listened to."""
        tables = [one for one in self.sources if one.lower().endswith(_TABLE)]
        if not tables:
            return None
        others = [*(one for one in self.sources if one not in tables[:1]), *self.live.interfaces]
        if others:
            raise UsageError(
                f"{tables[0]} is a table, and {others[0]} would be listened to",
                next_step="serve one or the other; a project file is named with --project",
            )
        told = {
            "--gvl": self.gvl, "--project": self.project, "-d": self.decode, "--channel-map": self.channel_map,
            "-a": self.live.autostop, "--follow": self.live.follow,
        }  # fmt: skip
        without_meaning = [*(name for name, value in told.items() if value), *self.live.of_interfaces]
        if without_meaning:
            raise UsageError(
                f"{', '.join(without_meaning)}: for lists that are listened to, and {tables[0]} is a table",
                next_step="leave it out, or name a source such as udp://0.0.0.0:1202 in place of the table",
            )
        return tables[0]


class Listening(Struct, frozen=True):
    """A source that is listened to while its lists are served."""

    source: Source
    session: Session[Sequence[SourceInfo]]
    is_live: bool

    @property
    def is_over(self) -> bool:
        """Whether nothing can come any more, and nobody is to believe the last values; those of a capture stay."""
        return self.session.ended and self.is_live

    def stop(self) -> ExitCode:
        """Stop to listen, and say what was lost. Raises what ended the source."""
        return tell_of_losses(self.session.stop())


class Served(Struct, frozen=True):
    """What is answered for: ``name`` and ``what`` tell people. ``listen`` begins to listen, where there is a source."""

    name: str
    what: str
    table: ServedTable
    controller: Controller
    listen: Callable[[], Listening | None]


def served_of(asked: Asked) -> Served:
    """Return what was named; nothing is opened yet but files. UsageError and ConfigurationError as they say."""
    from nvscope.plc.visu.controller import Controller
    from nvscope.units import count_of

    if (path := asked.table) is not None:
        from nvscope.plc.visu.table import read_served

        table = read_served(path)
        return Served(path, count_of(len(table.entries), "variable"), table, Controller(table), lambda: None)
    if not asked.sources and not asked.live.interfaces:
        raise UsageError(
            "a table is needed, or a source of lists", next_step="`nvscope visu serve --keys` lists what a table can "
            "say; an interface and --gvl FILE serve the lists that come there",
        )  # fmt: skip
    return _of_lists(asked)


def _of_lists(asked: Asked) -> Served:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.plc.visu.controller import Controller
    from nvscope.plc.visu.lists import ServedLists
    from nvscope.plc.visu.table import MOST_VARIABLES
    from nvscope.units import count_of

    named = named_files(asked.sources, (), asked.gvl, asked.live.interfaces)
    plant, ports = plant_of(asked.project, named.definitions, named.captures, asked.channel_map, asked.decode)
    if not plant.files:
        raise UsageError(
            "no definition is given",
            next_step="name the exported list and its types with --gvl FILE or in nvscope.toml: they say which "
            "variables there are",
        )
    inquiry = Inquiry(named.captures, plant, ports, protocols=())
    with flaws_told_first(plant.definition):
        lists = ServedLists(inquiry.defined_layouts())
        if not lists.table.entries:
            raise UsageError(
                "of no variable of the defined lists is known where it is sent",
                next_step="`nvscope gvl layout` tells what is known",
            )
    tell_of_lists(inquiry)
    if lists.left_out:
        echo(
            f"nvscope: {count_of(lists.left_out, 'variable')} left out: no more than {MOST_VARIABLES} are served.",
            err=True,
        )  # fmt: skip
    what = f"{count_of(len(lists.table.entries), 'variable')} of {count_of(lists.lists, 'list')}"
    name = ", ".join([*asked.live.interfaces, *named.captures])
    return Served(
        name, what, lists.table, Controller(lists.table, lists.now), lambda: _listening(asked, inquiry, lists)
    )  # fmt: skip


def _listening(asked: Asked, inquiry: Inquiry, lists: ServedLists) -> Listening:
    """Open the source and begin to listen to it; a capture is played as it happened."""
    from nvscope.capture.source import any_live
    from nvscope.capture.streams import is_stream
    from nvscope.engine.session import Session

    # --for is of what is served, the source included.
    live = replace(asked.live, duration=None)
    if len(inquiry.paths) == 1 and not live.interfaces and is_stream(inquiry.paths[0]):
        live = replace(live, follow=True)
    opened = replace(inquiry, captures=captured(inquiry.paths, live, inquiry.project, inquiry.ports))
    source = opened.open()
    is_live = any_live(source.infos)
    if not is_live:
        from nvscope.capture.played import Played
        from nvscope.capture.player import Player

        source = Played(source, Player())
    session = Session(source, opened.reading(), [lists], lambda: source.infos)
    session.start()
    return Listening(source, session, is_live)
