"""The values of the peers' traffic: what the decoder shows is what the senders logged, every one."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.open import open_source
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.value import value_of
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Recogniser
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values

PEERS = Path(__file__).parent.parent / "captures" / "peers"
FILES = [str(PEERS / name) for name in ("axis.gvl", "axis_types.st", "batch.gvl", "recipe.gvl", "counters.gvl")]


def flattened(name: str, value: Any) -> dict[str, Any]:
    """Return a logged value as the elements it is sent as; arrays of the peers begin at 0."""
    if isinstance(value, dict):
        return {key: part for member in value for key, part in flattened(f"{name}.{member}", value[member]).items()}
    if isinstance(value, list):
        return {key: part for at, item in enumerate(value) for key, part in flattened(f"{name}[{at}]", item).items()}
    return {name: value}


@pytest.fixture(scope="module")
def shown() -> dict[int, dict[str, list[Any]]]:
    """What was decoded of each telegram, by list and element."""
    values = Values(Layouts(load_definitions(FILES)))
    state, recogniser = TrackerState(values=values), Recogniser(Reading())
    found: dict[int, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for batch in open_source([str(PEERS / "peers.pcap")]):
        for row in range(len(batch)):
            before = {stream: known.telegrams for stream, known in values.streams.items()}
            for told in recogniser.tell(batch[row : row + 1]):
                state.observe(told)
            for stream, known in values.streams.items():
                if known.telegrams != before.get(stream, 0):
                    list_id = known.layout.list.list_id or 0
                    for offset, element in known.layout.spans():
                        raw = known.data[offset : offset + element.type.size_bytes].tobytes()
                        found[list_id][element.name].append(value_of(element.type, raw))
    assert not values.unfitting.column("count").any()
    return found


@pytest.mark.parametrize("log", ["sent-codesys-client.json", "sent-node-red.json"])
def test_every_value_is_the_one_that_was_sent(shown: dict[int, dict[str, list[Any]]], log: str) -> None:
    sent: dict[int, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for entry in json.loads((PEERS / log).read_text()):
        for variable, value in entry["v"].items():
            for name, part in flattened(variable, value).items():
                sent[entry["list"]][name].append(part)
    for list_id, elements in sent.items():
        assert shown[list_id].keys() == elements.keys()
        for name, logged in elements.items():
            decoded = shown[list_id][name]
            # The recording may have begun after the first send, or ended before the last.
            assert 0.9 * len(logged) <= len(decoded) <= len(logged)
            starts = [at for at in range(len(logged) - len(decoded) + 1) if logged[at : at + len(decoded)] == decoded]
            assert starts, (list_id, name, logged[:3], decoded[:3])
