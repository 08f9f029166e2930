"""Whether a configuration is that of the tables that are audited by it."""

from __future__ import annotations

from nvscope import units
from nvscope.datalogger.audit.audit import Audit
from nvscope.datalogger.audit.gaps import limit_ns
from nvscope.datalogger.configuration import Session
from nvscope.enumeration import first_few

_MOST_NAMED = 3


def compare(session: Session, audit: Audit) -> None:
    """Note in an audit what of a session none of the tables has, variables and interval, and whether that fits.

    Controllers leave out variables that they do not have, and sessions before it may have logged others: what tables
    have is another session's where they have none of its variables, or rows more often than it asks for.
    """
    tables = [table for table in audit.tables if table.audit.rows]
    if not tables:
        return
    stored = {name.casefold() for table in tables for name in table.audit.names}
    missing = [one.uri for one in session.variables if one.uri.casefold() not in stored]
    named = first_few(missing, _MOST_NAMED)
    variables = units.count_of(len(session.variables), "variable")
    if missing and len(missing) == len(session.variables):
        audit.unfit.append(f"the configuration does not fit: no table has any of its {variables} ({named})")
    elif missing:
        audit.notes.append(f"of the configuration's {variables}, no table has {named}")
    usual = [usual_ns for table in tables if (usual_ns := table.audit.usual_ns) is not None]
    # Rows that come less often than was asked for are missing, and found as that.
    if usual and not session.task and session.sampling_ns > limit_ns(max(usual)):
        audit.unfit.append(
            f"the configuration does not fit: it asks for values every {units.duration(session.sampling_ns)}, and rows "
            f"come every {units.duration(max(usual))}, so that missing ones may pass unseen"
        )
    audit.notes += audit.unfit
