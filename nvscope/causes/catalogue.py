"""Every cause there can be: the rows of all families, by name, in the order in which they are judged."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from nvscope.causes.addresses import DUPLICATE_ADDRESS
from nvscope.causes.buses import BUS_ERRORS, BUS_OFF, BUS_OVERLOADED, INCOMPLETE_CYCLES
from nvscope.causes.counters import COUNTER_FOREIGN
from nvscope.causes.definitions import DEFINITION_DIFFERS
from nvscope.causes.elsewhere import DEFINITION_ELSEWHERE
from nvscope.causes.headers import HEADER_FOREIGN
from nvscope.causes.identifiers import IDENTIFIER_COLLISION
from nvscope.causes.impossible import ACKNOWLEDGEMENT_IMPOSSIBLE
from nvscope.causes.incomplete import CAPTURE_INCOMPLETE
from nvscope.causes.kind import CauseKind
from nvscope.causes.lateness import SENDER_BURSTS, SENDER_LATE
from nvscope.causes.losses import LOSS_AT_SENDER, LOSS_OF_LIST
from nvscope.causes.not_found import READER_NOT_FOUND
from nvscope.causes.other import OTHER
from nvscope.causes.parameters import PARAMETERS_REFUSED, PARAMETERS_UNANSWERED
from nvscope.causes.paths import TWO_PATHS
from nvscope.causes.readers import READER_REJECTS, READER_SILENT, READER_WITHOUT_PROGRAM, REQUEST_UNANSWERED
from nvscope.causes.recording import CLOCK, SEEN_TWICE
from nvscope.causes.restarts import LIST_RESTARTED, NODE_RESTART
from nvscope.causes.senders import SECOND_SENDER
from nvscope.causes.silences import LIST_STOPPED, NODE_SILENT, PROGRAM_STOPPED

KINDS: tuple[CauseKind, ...] = (
    CAPTURE_INCOMPLETE,
    SEEN_TWICE,
    CLOCK,
    BUS_OFF,
    BUS_ERRORS,
    BUS_OVERLOADED,
    DUPLICATE_ADDRESS,
    SECOND_SENDER,
    IDENTIFIER_COLLISION,
    HEADER_FOREIGN,
    COUNTER_FOREIGN,
    TWO_PATHS,
    NODE_RESTART,
    NODE_SILENT,
    PROGRAM_STOPPED,
    LIST_RESTARTED,
    LIST_STOPPED,
    DEFINITION_ELSEWHERE,
    DEFINITION_DIFFERS,
    READER_REJECTS,
    READER_WITHOUT_PROGRAM,
    ACKNOWLEDGEMENT_IMPOSSIBLE,
    READER_SILENT,
    READER_NOT_FOUND,
    REQUEST_UNANSWERED,
    PARAMETERS_UNANSWERED,
    PARAMETERS_REFUSED,
    LOSS_AT_SENDER,
    LOSS_OF_LIST,
    SENDER_LATE,
    SENDER_BURSTS,
    INCOMPLETE_CYCLES,
    OTHER,
)
"""In the order of causes.md, section 2."""

BY_NAME: Mapping[str, CauseKind] = MappingProxyType({kind.name: kind for kind in KINDS})
