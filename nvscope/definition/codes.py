"""Codes of what definitions alone tell, and reports tell too: the same fact has one code."""

from __future__ import annotations

COB_ID_OVERLAP = "NV601"
CANOPEN_COLLISION = "NV602"
