"""The nodes: who sends to whom, as a matrix; below, what its marks say, or what is known of the chosen cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from textual.app import ComposeResult

from nvscope.list_key import ListKey
from nvscope.tui.bars import Bar
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.views.view import View
from nvscope.view.lines.plant import buses
from nvscope.view.lines.plant.matrix import Matrix
from nvscope.view.lines.plant.matrix_details import left_out_words, list_lines, node_lines
from nvscope.view.lines.plant.roles import Facts
from nvscope.view.lines.plant.tables import Measure, cells
from nvscope.view.lines.table import Cell, Line, Tone, align, wrap

_NARROWEST = 20
_ON_CAN = "On CAN nobody knows who sends to whom: a frame names neither sender nor reader. "


class NodesView(View):
    """A matrix of lists and nodes, with a cursor over rows and one over columns."""

    title = "Nodes"
    action = "view.nodes"
    DEFAULT_CSS = """
    NodesView #nodes-rows { height: 1fr; }
    NodesView #nodes-told { height: auto; max-height: 60%; border-top: solid $foreground 20%; }
    NodesView.-open #nodes-rows { min-height: 3; }
    """

    def __init__(self) -> None:
        super().__init__(id="nodes")
        self._look: Look | None = None
        self._matrix: Matrix | None = None
        self._order: Sequence[int] = ()  # of rows: places of lists
        self._key: str | None = None
        self._node: str | None = None  # the address of the chosen one
        self._first = 0
        self._opened = False
        self._alone = False

    def compose(self) -> ComposeResult:
        self._names, self._lights = Bar(id="nodes-names"), Bar(id="nodes-lights")
        self._rows, self._told = LinesView(id="nodes-rows"), LinesView(id="nodes-told")
        yield self._names
        yield self._lights
        yield self._rows
        yield self._told

    def show(self, look: Look) -> None:
        if self._look is None or look.scene is not self._look.scene or look.choice is not self._look.choice:
            self._matrix = _matrix(look)
        self._look = look
        assert self._matrix is not None
        self._draw(look, self._matrix)

    def _draw(self, look: Look, matrix: Matrix) -> None:
        width = max(self.size.width - 1, _NARROWEST)
        has = bool(matrix.lists)
        self._names.display = self._lights.display = has
        if not has:
            self._order = ()
            self._rows.show(_without_lists(look, width))
            self._told.display = False
            return
        chosen = self._column(matrix)
        self._first = matrix.first_for(width, self._first, chosen)
        span = matrix.span(width, self._first)
        names, lights = matrix.heading(span, chosen)
        self._names.tell(names)
        self._lights.tell(lights)
        plain = self.app.console.options.ascii_only
        order = [place for group in matrix.groups for place in group.lists]
        keys = [str(matrix.lists[place].key) for place in order]
        self._order = order
        row = keys.index(self._key) if self._key in keys else min(max(self._rows.entry, 0), len(order) - 1)
        self._key = keys[row]
        lines = _Rows(matrix, lambda place: matrix.row_line(
            place, span, chosen if place == order[row] else None, plain=plain
        ))  # fmt: skip
        self._rows.show(lines, lines.starts, row)
        self._tell(look, matrix, width)

    def _tell(self, look: Look, matrix: Matrix, width: int) -> None:
        """Show the legend, and above it what is known of the chosen cell."""
        lines: list[Line] = []
        place, node = self._place(), self._column(matrix)
        if self._opened and place is not None and matrix.nodes:
            lines += list_lines(matrix, place, look.clock, width)
            lines += [[], *node_lines(matrix, matrix.nodes[node], look.clock, look.now_ns, width), []]
        legend = matrix.legend({*matrix.marks()}, plain=self.app.console.options.ascii_only)
        lines += wrap(legend, width)
        if not all(info.hears_answers for info in look.scene.snapshot.infos):
            told = "What nodes answer to each other is not heard here: only who sends, and who is sent something."
            lines += wrap([Cell(told, Tone.WARNING)], width)
        lines += [one for told in left_out_words(matrix) for one in wrap([Cell(told, Tone.WARNING)], width)]
        if look.report.get("buses"):
            lines += wrap([Cell(f"{_ON_CAN}View 6 shows identifiers and CANopen nodes.", Tone.FAINT)], width)
        self._told.display = not self._alone
        self._told.show(lines)

    def _place(self) -> int | None:
        return self._order[self._rows.entry] if 0 <= self._rows.entry < len(self._order) else None

    def _column(self, matrix: Matrix) -> int:
        """Return which of the nodes is chosen."""
        addresses = matrix.facts.summary.addresses
        return next((at for at, node in enumerate(matrix.nodes) if addresses[node] == self._node), 0)

    def on_resize(self) -> None:
        self._again()

    def _again(self) -> None:
        if self._look is not None and self._matrix is not None:
            self._draw(self._look, self._matrix)

    def act(self, action: str, told: str = "") -> bool:
        matrix = self._matrix
        if matrix is None:
            return False
        if self._rows.move(action):
            place = self._place()
            self._key = None if place is None else str(matrix.lists[place].key)
        elif action in ("move.left", "move.right"):
            if matrix.nodes:
                at = self._column(matrix) + (1 if action == "move.right" else -1)
                self._node = matrix.facts.summary.addresses[matrix.nodes[min(max(at, 0), len(matrix.nodes) - 1)]]
        elif action == "view.open":
            self._opened, self._alone = not self._opened, False
        elif action == "program.back" and self._opened:
            self._opened = False
        elif action == "view.maximise":
            self._alone = not self._alone
        else:
            return False
        self._again()
        return True

    def hints(self) -> Sequence[str]:
        return ("view.open", "move.left", "move.right", "find.filter")

    def copied(self) -> str:
        matrix, place = self._matrix, self._place()
        if matrix is None or place is None:
            return ""
        told = [f"List {matrix.names[place]} to {matrix.to(place)}"]
        for node in matrix.nodes:
            if (mark := matrix.mark(place, node)) is not None:
                told.append(f"- {matrix.name_of(node)}: {mark.words}")
        return "\n".join(told)

    def place(self) -> Any:
        return (self._key, self._node) if self._key is not None else None

    def go_to(self, place: Any) -> bool:
        key, node = place
        if self._matrix is None or key not in {str(entry.key) for entry in self._matrix.lists}:
            return False
        self._key, self._node = key, node
        self._again()
        return True

    def restrict(self, key: str | None) -> None:
        """Put the cursor on a list: the others stay, since a matrix of one row says little."""
        self._key = key
        self._again()


class _Rows(Sequence[Line]):
    """The lines of a matrix, which are made when they are drawn; ``starts`` are those of lists."""

    def __init__(self, matrix: Matrix, row: Any) -> None:
        self._matrix, self._row = matrix, row
        self._lines: list[tuple[bool, int]] = []
        self.starts: list[int] = []
        for number, group in enumerate(matrix.groups):
            self._lines.append((True, number))
            for place in group.lists:
                self.starts.append(len(self._lines))
                self._lines.append((False, place))

    def __len__(self) -> int:
        return len(self._lines)

    def __getitem__(self, at: Any) -> Any:
        is_group, number = self._lines[at]
        line: Line = self._matrix.group_line(self._matrix.groups[number]) if is_group else self._row(number)
        return line


def _matrix(look: Look) -> Matrix:
    scene = look.scene
    project = scene.inquiry.project
    names = project.node_names if scene.node_names is None else scene.node_names
    lists: Mapping[ListKey, str] = {key: one.name for key, one in project.definition.by_key().items() if one.name}
    facts = Facts(scene.snapshot.summary, scene.contacts, look.causes, names, lists, project.readers)
    choice = look.choice
    chosen = None if choice is None or choice.suspended else choice.lists
    return Matrix(facts, chosen)


def _without_lists(look: Look, width: int) -> list[Line]:
    """Return what is told where there is no list on UDP: of CAN, its CANopen nodes."""
    known: Sequence[Mapping[str, Any]] = look.report.get("buses", ())
    if look.scene.at_ns is None:
        return [[Cell("Nothing was read yet.", Tone.FAINT)]]
    if not known:
        return list(wrap([Cell("No list was seen on UDP: nobody sends to anybody.", Tone.FAINT)], width))
    lines: list[Line] = [*wrap([Cell(_ON_CAN, Tone.FAINT)], width)]
    for bus in known:
        measures: list[Measure]
        measures, rows = buses.nodes(bus, look.clock)
        lines += [[], [Cell(f"Bus {bus['channel']}", Tone.STRONG)]]
        if not rows:
            lines.append([Cell("  no CANopen node was heard", Tone.FAINT)])
        else:
            columns = [measure.column for measure in measures]
            lines += align(columns, [cells(measures, row) for row in rows], width, 2)[: len(rows) + 1]
    return lines
