"""Runs of a recording that go on with one database, drawn: lists that come, come late or never, and losses of them.

Between two runs somebody may have changed the configuration: how often rows come, in which tasks, when files are full,
and which variables there are; these are another table then.
"""

from __future__ import annotations

from hypothesis import strategies as st

from tests.datalogger.drawn_plants import START_NS, Plant
from tests.datalogger.oracle import SECOND_NS, DefinedList, Session
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.records import replace

LONGEST_NS = 5 * SECOND_NS
EDGE = 8
"""Telegrams at the beginning and the end of a run of which none is lost: so all that are lost are missed."""

KINDS = {"DINT": "<i", "INT": "<h"}
VALUES = {"counting": 1, "slow": 7, "constant": 1 << 30}
"""How many telegrams of a list have the same value."""


class Runs:
    """What a law is about: plants of one definition, the times of which follow each other.

    ``session`` is the first configuration; ``changed`` tells whether others have another rhythm. ``lossy`` tells
    whether telegrams were taken out; ``how`` says of each run when lists come.
    """

    def __init__(self, plants: list[Plant], session: Session, lossy: bool, how: list[str]) -> None:
        self.plants, self.session, self.lossy, self.how = plants, session, lossy, how

    def __repr__(self) -> str:
        sessions = "\n".join(str(one.session) for one in self.plants)
        return f"{sessions}, lossy={self.lossy}, {'; '.join(self.how)}"

    @property
    def changed(self) -> bool:
        rhythms = {(one.session.sampling_ns, one.session.task, tuple(one.session.tasks)) for one in self.plants}
        return len(rhythms) > 1

    def run_of(self, time_ns: int) -> int:
        """Return the number of the run that a row is of."""
        return max(number for number, one in enumerate(self.plants) if one.packets[0].time_ns // MS * MS <= time_ns)


@st.composite
def runs(draw: st.DrawFn, *, tables: bool = False) -> Runs:
    """Draw two or three runs, and how they are recorded; with ``tables``, each may have other variables."""
    lists = [_list(number, draw(st.sampled_from([50, 100])) * MS) for number in range(draw(st.integers(1, 3)))]
    values = {name: draw(st.sampled_from(sorted(VALUES))) for one in lists for name, _ in one.fields}
    session, task = draw(_sessions(lists))
    lossy, changing = draw(st.booleans()), draw(st.booleans())
    plants, how, begin_ns = [], [], START_NS + draw(st.integers(0, 999)) * MS
    for _ in range(draw(st.integers(2, 3))):
        packets: list[Packet] = []
        length_ns = draw(st.integers(2, 4)) * SECOND_NS
        comes = [draw(st.sampled_from(["at once", "at once", "late", "never"])) for _ in lists]
        if set(comes) == {"never"}:
            comes[0] = "at once"
        for one, when in zip(lists, comes, strict=True):
            if when == "never":
                continue
            first_ns = begin_ns + draw(st.integers(0, 40)) * MS + (length_ns // 2 if when == "late" else 0)
            own = _telegrams(one, first_ns, begin_ns + length_ns, values)
            if lossy and len(own) > 3 * EDGE and draw(st.booleans()):
                at = draw(st.integers(EDGE, len(own) - EDGE - 3))
                del own[at : at + draw(st.integers(1, 3))]
            packets += own
        packets.sort(key=lambda packet: packet.time_ns)
        asked, context = session, task
        if plants and (changing or tables):
            asked, context = draw(_changed(session, lists))
        if tables and draw(st.booleans()):
            asked = _of_others(asked, draw(st.booleans()))
        plants.append(Plant(lists, packets, asked, context))
        how.append(f"{begin_ns - START_NS} {length_ns}: {', '.join(comes)}, {len(packets)} packets")
        begin_ns += LONGEST_NS + draw(st.sampled_from([1, 60, 7_200])) * SECOND_NS
    return Runs(plants, session, lossy, how)


def _list(number: int, interval_ns: int) -> DefinedList:
    fields = tuple((f"nL{number}v{place}", kind) for place, kind in enumerate(KINDS))
    return DefinedList(("axis", "press", "oven")[number], number + 1, fields, interval_ns)


def _telegrams(one: DefinedList, first_ns: int, stop_ns: int, values: dict[str, str]) -> list[Packet]:
    assert one.interval_ns
    found = []
    for number, time_ns in enumerate(range(first_ns, stop_ns, one.interval_ns)):
        data = b"".join(
            (number // VALUES[values[name]]).to_bytes(4 if kind == "DINT" else 2, "little") for name, kind in one.fields
        )
        node = f"10.0.0.{one.index}"
        found.append(Packet(time_ns, node, one.index, 0, len(one.fields), number + 1, data))
    return found


@st.composite
def _changed(draw: st.DrawFn, session: Session, lists: list[DefinedList]) -> tuple[Session, str]:
    """Draw another configuration for the same table, and the taskContext in it."""
    tasks = session.tasks if draw(st.booleans()) else {}
    context = None if tasks else draw(st.sampled_from([None, *lists]))
    sampling_ns = draw(st.sampled_from([50, 100, 200])) * MS
    changed = replace(
        session, sampling_ns=sampling_ns, publish_ns=sampling_ns * draw(st.sampled_from([1, 2, 5])),
        capacity=draw(st.sampled_from([1, 2, 3, 10])), task=context.index if context else None, tasks=tasks,
        write_interval=draw(st.sampled_from([1, 7, 1000])), delete_ratio=draw(st.sampled_from([5, 30, 100])),
        max_file_size=draw(st.sampled_from([None, None, 1, 9_000, 13_000, 25_000])), rollover=draw(st.booleans()),
    )  # fmt: skip
    return changed, context.name if context else ""


def _of_others(session: Session, changes_only: bool) -> Session:
    """Return a configuration with the first variable of each list alone, or of the other kind: of another table."""
    if changes_only != session.changes_only:
        return replace(session, changes_only=changes_only)
    firsts = {index: name for name, (index, _) in reversed(list(session.variables.items()))}
    return replace(
        session, variables={name: session.variables[name] for name in firsts.values()},
        tasks={name: task for name, task in session.tasks.items() if name in firsts.values()},
    )  # fmt: skip


@st.composite
def _sessions(draw: st.DrawFn, lists: list[DefinedList]) -> tuple[Session, str]:
    """Draw a configuration of all variables, and the taskContext in it."""
    mode = draw(st.sampled_from(["interval", "context", "tasks"]))
    in_tasks = {one.index for one in lists if mode == "tasks" and draw(st.booleans())}
    variables = {
        (f"Plc/Task{one.index}/{name}" if one.index in in_tasks else f"Plc/{name}"): (one.index, name)
        for one in lists for name, _ in one.fields
    }  # fmt: skip
    tasks = {name: index for name, (index, _) in variables.items() if index in in_tasks}
    context = draw(st.sampled_from(lists)) if mode == "context" else None
    sampling_ns = draw(st.sampled_from([50, 100, 200])) * MS
    session = Session(
        variables, sampling_ns, sampling_ns * draw(st.sampled_from([1, 2, 5])), draw(st.sampled_from([1, 2, 3, 10])),
        context.index if context else None, tasks, rollover=draw(st.booleans()),
        max_files=draw(st.sampled_from([-1, 1, 2, 4])), write_interval=draw(st.sampled_from([1, 7, 1000])),
        max_file_size=draw(st.sampled_from([None, None, 1, 9_000, 13_000])),
        delete_ratio=draw(st.sampled_from([5, 30, 100])), changes_only=draw(st.booleans()), iso=draw(st.booleans()),
    )  # fmt: skip
    return session, context.name if context else ""
