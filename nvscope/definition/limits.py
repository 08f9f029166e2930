"""Limits: from where on something is worth a finding, as the table [limits] of the project file sets them."""

from __future__ import annotations

from dataclasses import dataclass

from nvscope.duration import UNITS_NS
from nvscope.toml_table import SPAN, integer, key

_PERCENT = integer(1, 1_000_000)


@dataclass(frozen=True, slots=True)
class Limits:
    """From where on something is worth a finding."""

    late_percent: int = key(
        _PERCENT, "NV501: an interval longer than this share of the nominal one is late", default=250
    )
    jitter_percent: int = key(_PERCENT, "NV502: more jitter than this share of the nominal interval", default=50)
    burst_percent: int = key(_PERCENT, "NV503: an interval shorter than this share of the nominal one", default=10)
    stopped_percent: int = key(
        _PERCENT, "NV504: silence at the end for longer than this share of the nominal interval", default=1000
    )
    bus_load_percent: int = key(
        integer(1, 1_000), "NV605: more load of a CAN bus in a second, of its bit rate", default=70
    )
    mirrored_percent: int = key(
        _PERCENT, "NV905: more telegrams that repeat the one before than this share of the others", default=80
    )
    max_streams: int = key(
        integer(1, 100_000_000),
        "NV906: more streams than this, or more identifiers on CAN, are not told apart; --max-streams wins",
        default=50_000,
    )
    acknowledgement_ns: int = key(
        SPAN,
        "how long an answer may take before it is missing (NV301, NV303, NV304); --ack-timeout wins",
        default=UNITS_NS["s"],
        name="acknowledgement",
    )
    parameter_ns: int = key(
        SPAN, "how long a reply of the Parameter Manager may take before it is missing (NV701, NV703, NV704)",
        default=UNITS_NS["s"] // 2, name="parameter",
    )  # fmt: skip
