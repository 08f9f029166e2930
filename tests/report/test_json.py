from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.report import json as json_face

from .examples import EXAMPLES, TROUBLED
from .test_text import poisoned


@pytest.mark.parametrize("example", EXAMPLES)
def test_a_report_is_read_back_as_it_was_in_the_order_given(example: str) -> None:
    text = json_face.render(EXAMPLES[example])
    again = json.loads(text)
    assert again == EXAMPLES[example]
    assert list(again) == ["schema", "tool", "capture", "totals", "causes", "lists", "findings"]
    assert json.dumps(again) == json.dumps(EXAMPLES[example])
    assert text.startswith('{\n  "schema": "nvscope.report/2",\n')
    assert text.endswith("}\n")


@given(st.text(st.characters(), max_size=30))
def test_no_text_brings_anything_but_printable_ascii(poison: str) -> None:
    report = poisoned(TROUBLED, poison)
    text = json_face.render(report)
    assert all(line.isascii() and line.isprintable() for line in text.split("\n"))
    assert json.loads(text) == report


def test_delete_is_escaped_like_the_other_control_characters() -> None:
    assert '"a\\u007fb"' in json_face.render({"name": "a\x7fb"})


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_numbers_that_json_does_not_know_are_refused(number: Any) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_face.render({"mean": number})
