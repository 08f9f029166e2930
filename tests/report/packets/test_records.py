"""Separated fields, CSV and JSON: one record a telegram, the same in every form."""

from __future__ import annotations

import csv
import io
import json
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.errors import UsageError
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.report.packets.records import Csv, JsonArray, JsonLines, SeparatedFields, separation
from nvscope.report.packets.text import Text
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import DEFAULT_FIELDS, FIELDS
from tests.oracle.builders import data_frame, telegram
from tests.oracle.traffic import generate, mutate
from tests.packets import Batches, batch_of
from tests.report.packets.written import PUBLIC, READER, SENDER, fields, written, written_of


def test_json_values_have_the_types_of_their_fields() -> None:
    frames = mutate(10, generate(10, frames=300))
    every = [entry for entry in FIELDS.values() if not entry.name.startswith("can") and not entry.of_others]
    records = json.loads(written(JsonArray(every), Batches([batch_of(frames)])))
    types = {
        FieldType.UNSIGNED: int,
        FieldType.TIME: str,
        FieldType.DURATION: int,
        FieldType.ADDRESS: str,
        FieldType.BYTES: str,
        FieldType.BOOL: bool,
        FieldType.TEXT: str,
    }
    assert len(records) > 100
    names = [f"{entry.name}_ns" if entry.name.startswith("frame.time_") else entry.name for entry in every]
    assert all(list(record) == names for record in records)
    for entry, name in zip(every, names, strict=True):
        there = [record[name] for record in records if record[name] is not None]
        assert there
        assert {type(value) for value in there} == {types[entry.type]}
    lines = written(JsonLines(every), Batches([batch_of(frames)])).splitlines()
    assert [json.loads(line) for line in lines] == records


def test_records_say_the_same_in_every_form() -> None:
    frames = mutate(9, generate(9, frames=300, link=None))
    every = list(FIELDS.values())
    tabbed = [
        line.split("\t")
        for line in written(SeparatedFields(every, separation(["header=y"])), Batches([batch_of(frames)])).splitlines()
    ]
    separated = list(csv.reader(io.StringIO(written(Csv(every), Batches([batch_of(frames)])), newline="")))
    timed = [place for place, entry in enumerate(every) if entry.name.startswith("frame.time_")]
    assert len(timed) == 4
    several = [place for place, entry in enumerate(every) if entry.further]
    people_read = [place for place, entry in enumerate(every) if entry.hex_digits]
    assert {every[place].name for place in people_read} >= {"nv.checksum", "nv.flags", "eth.type"}
    for line, row in zip(tabbed[1:], separated[1:], strict=True):
        assert all(line[place][:2] in ("", "0x") and row[place][:2] != "0x" for place in people_read)
        told = [str(int(cell, 16)) if cell and place in people_read else cell for place, cell in enumerate(line)]
        for place in several:
            told[place] = told[place].split(",")[0]
        for place in timed:
            told[place] = str(int(Decimal(told[place]).scaleb(9)))
        assert told == row
    named = [f"{name}_ns" if place in timed else name for place, name in enumerate(tabbed[0])]
    assert separated[0] == named
    records = json.loads(written(JsonArray(every), Batches([batch_of(frames)])))
    assert len(records) == len(tabbed) - 1
    for line, record in zip(tabbed[1:], records, strict=True):
        assert list(record) == named
        for entry, cells, value in zip(every, line, record.values(), strict=True):
            cell = cells.split(",")[0] if entry.further else cells
            if value is None:
                assert cell == ""
            elif entry.type in (FieldType.UNSIGNED, FieldType.BOOL):
                assert int(cell, 0) == value
            elif entry.type is FieldType.DURATION or entry.name == "frame.time_epoch":
                assert int(cell.replace(".", "")) == int(value)
            else:
                assert cell == value


def test_no_two_fields_of_a_record_have_one_name() -> None:
    def entry(name: str, kind: FieldType) -> TelegramField:
        return TelegramField(name, kind, "", "", lambda rows: np.full(len(rows), 7))

    kinds = {"var.t": FieldType.DURATION, "var.t_ns": FieldType.SIGNED, "var.d": FieldType.TIME}
    every = [entry(name, kind) for name, kind in kinds.items()]
    records = written_of(JsonLines(every), PUBLIC).splitlines()
    assert json.loads(records[0]) == {"var.var.t_ns": 7, "var.t_ns": 7, "var.d_ns": "7"}
    assert written_of(Csv([*every, every[0]]), PUBLIC).splitlines()[:2] == [
        "var.var.t_ns,var.t_ns,var.d_ns,var.var.t_ns", "7,7,7,7",
    ]  # fmt: skip


def test_settings_of_separated_fields() -> None:
    chosen = fields("frame.number", "nv.index", "nv.fault")
    text = written_of(SeparatedFields(chosen, separation(["header=y", "separator=;", "quote=d"])), PUBLIC).splitlines()
    assert text[0] == "frame.number;nv.index;nv.fault"
    assert text[1] == '"1";"1";""'
    assert written_of(SeparatedFields(chosen, separation(["separator=/s", "quote=s"])), PUBLIC).startswith(
        "'1' '1' ''\n"
    )
    for wrong in ("header", "header=x", "separator=", "separator=ab", "separator=\x1b", "quote=x", "bom=y", "=", ""):
        with pytest.raises(UsageError):
            separation([wrong])


def test_no_telegrams_are_still_a_document() -> None:
    nothing = Batches([])
    assert written(JsonArray(DEFAULT_FIELDS), nothing) == "[]\n"
    assert written(JsonLines(DEFAULT_FIELDS), nothing) == ""
    assert written(Csv(DEFAULT_FIELDS), nothing).count("\n") == 1
    assert written(Text(), nothing) == ""


@given(st.text(st.sampled_from("=+-@',\"\r\n\t ab\x1b\u202e"), max_size=8))
def test_text_in_csv_is_quoted_and_no_formula(text: str) -> None:
    entry = TelegramField(
        "a.text", FieldType.TEXT, "", "", lambda rows: TextColumn(np.zeros(len(rows), np.int64), (text,))
    )
    out = written(
        Csv([entry, FIELDS["nv.index"]]), Batches([batch_of([data_frame(0, SENDER, READER, telegram(list_id=7))])])
    )
    heading, record = csv.reader(io.StringIO(out, newline=""))
    assert heading == ["a.text", "nv.index"]
    assert record[1] == "7"
    assert record[0].isprintable()
    assert not record[0].lstrip(" ").startswith(("=", "+", "-", "@"))
