"""All views of the screen, in the order of their numbers."""

from __future__ import annotations

from nvscope.tui.views.can import CanView
from nvscope.tui.views.causes import CausesView
from nvscope.tui.views.lists import ListsView
from nvscope.tui.views.nodes import NodesView
from nvscope.tui.views.packets import PacketsView
from nvscope.tui.views.source import SourceView
from nvscope.tui.views.transactions import TransactionsView
from nvscope.tui.views.variables import VariablesView
from nvscope.tui.views.view import View


def make_views() -> list[View]:
    """Return the views, new."""
    return [
        ListsView(), CausesView(), VariablesView(), PacketsView(), NodesView(), CanView(), SourceView(),
        TransactionsView(),
    ]  # fmt: skip
