"""Documents held against the schemas that stand in the package."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator, ValidationError

from nvscope.schemas.schema_files import schema_text


def mistakes_in(document: Mapping[str, Any]) -> list[str]:
    """Return what is wrong with a document, by the schema that it says it is of."""
    return [_told(error) for error in validator(str(document["schema"])).iter_errors(document)]


def is_valid(document: Mapping[str, Any], schema: str) -> bool:
    """Return whether a document is of a schema, whatever it says itself."""
    return bool(validator(schema).is_valid(document))


@cache
def validator(schema: str) -> Draft202012Validator:
    """Return what validates documents of a schema, by its name."""
    return Draft202012Validator(json.loads(schema_text(schema)))


def _told(error: ValidationError) -> str:
    while error.context:  # of several forms, the one that went furthest
        error = max(error.context, key=lambda below: len(below.absolute_path))
    return f"{error.json_path}: {error.message}"[:400]
