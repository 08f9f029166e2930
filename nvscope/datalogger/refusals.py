"""Refusals: why a run would not begin to log, said before anybody begins one."""

from __future__ import annotations

import os
from collections.abc import Callable

from nvscope.datalogger.database import table_of
from nvscope.datalogger.existing import told_beforehand
from nvscope.datalogger.plan import Planned, check_leave, check_names
from nvscope.errors import UsageError


def refusal(planned: Planned, is_input: Callable[[str], bool], *, append: bool, force: bool) -> str:
    """Return why a session would be refused, and what to do, '' where nothing is known against it; no file changes."""
    try:
        check_names([planned], is_input)
        check_leave([planned], append=append, force=force)
    except UsageError as error:
        return f"{error.where}: {error.what}: {error.next_step}"
    if not append or not planned.path or not os.path.exists(planned.path):
        return ""
    told = told_beforehand(planned.path, table_of(planned.session, planned.logged))
    return "" if told is None else f"{planned.path}: {told[0]}: {told[1]}"
