"""``python -m tests.schemas``: write the schemas anew, and add what is new in them to what is promised.

What was promised and is no more stays promised, and the tests say so.
"""

from __future__ import annotations

from tests.schemas.documents import BINARY, PROMISED, SCHEMAS, file_text, path_of, promised, promised_with

if __name__ == "__main__":
    schemas = {name: make() for name, make in SCHEMAS.items()}
    for name, schema in (schemas | {name: make() for name, make in BINARY.items()}).items():
        path_of(name).write_text(file_text(schema), encoding="utf-8")
    PROMISED.write_text(promised_with(promised(), schemas), encoding="utf-8")
    print(f"{len(schemas)} schemas; what is promised: {PROMISED.name}")
