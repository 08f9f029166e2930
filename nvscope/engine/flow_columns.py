"""FlowColumns: what each flow is, by its number in ``nvscope.engine.keys``."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.engine.keyed_columns import KeyedColumns


class FlowColumns(KeyedColumns):
    """One row a flow; ``stream`` is -1 for flows that are no well-formed data.

    ``destination`` is ``NOBODY`` for broadcasts, ``ELSEWHERE`` for all receivers of a stream that are beyond the limit.
    """

    kind: I64
    list: I64
    place: I64
    stream: I64
    source: I64
    destination: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1) for name in ("kind", "list", "place", "stream", "source", "destination")
    }
