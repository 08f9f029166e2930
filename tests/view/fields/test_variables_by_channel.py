"""Variables of lists that are defined for a CAN channel, or for any: what each frame has of them."""

from __future__ import annotations

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.view.fields.variables import VariableFields
from tests.can_frames import rows_of_log
from tests.definition.lists import INT, list_of
from tests.records import replace
from tests.view.fields.test_variables import seen

LOG = "(1.000000) can0 181#0100\n(2.000000) can1 181#0200\n(3.000000) can2 181#0300\n"


def on(channel: str, name: str) -> ListDefinition:
    return replace(list_of([INT], list_id=0x181), protocol="CAN", channel=channel, name=name)


def test_the_definition_of_a_channel_goes_before_that_of_any() -> None:
    for lists in ((on("can1", "own"), on("", "any")), (on("", "any"), on("can1", "own"))):
        definition = Definition(lists)
        fields = VariableFields(Layouts(definition))
        rows = rows_of_log(LOG.replace("(", "(000000000"), definition)
        assert seen(fields["var.any.v0"], rows) == [1, None, 3]
        assert seen(fields["var.own.v0"], rows) == [None, 2, None]
        assert seen(fields["var.v0"], rows) == [1, 2, 3]


def test_of_channels_that_are_named_no_other_has_the_list() -> None:
    definition = Definition((on("can2", "left"), on("can0", "right")))
    rows = rows_of_log(LOG.replace("(", "(000000000"), definition)
    assert seen(VariableFields(Layouts(definition))["var.v0"], rows) == [1, None, 3]
