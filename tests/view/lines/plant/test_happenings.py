"""What a row of a list says of what happened to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.findings.kind import Severity
from nvscope.view.lines.plant.happenings import concerns, headline
from tests.causes.drawn.by_hand import list_of, node_of, plant_of
from tests.causes.drawn.packets import write_pcap
from tests.causes.drawn.plant import START_NS, Away
from tests.causes.drawn.traffic import play
from tests.causes.drawn.truth import SECOND
from tests.tui.screen import Screen, on_screen


def test_a_list_that_its_reader_did_not_answer_while_it_started_anew_says_so(tmp_path: Path) -> None:
    plant = plant_of(60)
    press, reader = node_of(plant, 1), node_of(plant, 2)
    list_of(press, 1, 100, readers=(reader,))
    list_of(reader, 2, 100)
    reader.away.append(Away(START_NS + 30 * SECOND, START_NS + 34 * SECOND, "off"))
    path = tmp_path / "plant.pcap"
    write_pcap(play(plant), path)

    async def look(screen: Screen) -> None:
        assert screen.app.scene is not None
        report = screen.app.scene.document
        (cause,) = report["causes"]
        assert (cause["kind"], cause["lists"]) == ("node-restart", ["udp/1202/2"])
        told = concerns(report)
        assert told["udp/1202/1"].severity is Severity.ERROR
        assert told["udp/1202/1"].words.endswith(" unanswered")
        assert told["udp/1202/2"].words == "node restarted"
        assert headline(report)[1].endswith("2 lists, all affected")

    on_screen(Inquiry([str(path)]), look)


@pytest.mark.parametrize(("unanswered", "told"), [(0, "all is well"), (9, "9 requests unanswered")])
def test_where_requests_of_pages_stay_unanswered_not_all_is_well(unanswered: int, told: str) -> None:
    capture = {"start_ns": None, "end_ns": None, "until_ns": None, "telegrams": 0}
    report = {"causes": [], "lists": [], "capture": capture, "visu": [{"server": "a", "unanswered": unanswered}]}
    assert headline(report)[1] == f"no list, 1 node asked by web visualization, {told}"
