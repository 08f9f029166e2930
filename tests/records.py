"""Records with other values: those of the product are Structs, those of tests dataclasses."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

from msgspec import Struct, structs

T = TypeVar("T")


def replace(record: T, **changes: Any) -> T:
    """Return a record some of whose fields are others."""
    made: Any = structs.replace if isinstance(record, Struct) else dataclasses.replace
    changed: T = made(record, **changes)
    return changed
