"""Documents of every schema: what the program writes about the captures and the scenarios of the repository."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

from nvscope.errors import ExitCode
from nvscope.view.documents.drawn import plain
from tests import once
from tests.program_here import run
from tests.schemas.asking import make_asking
from tests.schemas.odd_database import make_odd_database
from tests.schemas.odd_logs import make_odd_logs
from tests.schemas.odd_plant import make_odd_plant
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]
SCENARIOS = sorted((ROOT / "tests" / "scenarios").glob("*.toml"))

_READ = {ExitCode.GOOD, ExitCode.DATA_LOSS, ExitCode.ASSERTION_FAILED}
_PEERS = "captures/peers/peers.pcap --gvl captures/peers"
_PLANT = "captures/plant.pcapng.gz"
_PRESS = "captures/can/press.log --gvl captures/can"

COMMANDS = (
    f"report {_PEERS}",
    f"report {_PLANT}",
    f"report {_PLANT} -Y 'list.lost > 0'",
    f"report {_PLANT} --max-streams 3",
    f"report {_PEERS} --list 7",
    f"report {_PRESS}",
    "report captures/can/press.log captures/peers/peers.pcap --gvl captures/peers --gvl captures/can --compare",
    "report captures/can/press.log --bitrate 250k",
    "report captures/telegrams.pcap",
    "report captures/visu/panel.pcap",
    "report captures/interfaces.pcapng",
    "report captures/datalogger/genuine-5min.db",
    "report captures/truncated.pcap",
    f"report {_PLANT} --from-time 5s --to-time -2s",
    "report captures/peers/peers.pcap --from-time 1h",
    "audit captures/datalogger/genuine-5min.db --config captures/datalogger/genuine-5min.config.xml",
    f"vars {_PEERS}",
    f"vars {_PEERS} -Y 'nv.index == 1'",
    "vars captures/visu/panel.pcap",
    "vars captures/visu/panel.pcap --show-secrets",
    "vars captures/visu/panel.pcap --history 'visu/*/*'",
    "vars captures/visu/panel.pcap --history '*' --all --show-secrets",
    "vars captures/visu/panel.pcap --at 2s",
    f"vars {_PRESS}",
    f"vars {_PEERS} --history 'stAxis.*'",
    f"vars {_PEERS} --history 'stAxis.*' --all -Y 'nv.counter < 100'",
    f"vars {_PRESS} --history v0",
    f"vars {_PEERS} --at 5s",
    f"vars {_PEERS} --at -1h",
    f"vars {_PEERS} --at 5s -Y 'nv.index == 1'",
    f"vars {_PEERS} --at 1s -Y 'frame.number > 800'",
    f"vars {_PRESS} --at 5s",
    "vars captures/telegrams.pcap --gvl captures/peers --at 5s",
    "vars captures/peers/peers.pcap --infer",
    f"vars {_PLANT} --infer",
    "vars captures/telegrams.pcap --infer",
    "vars captures/can/press.log --infer",
    "gvl layout captures/peers",
    "gvl layout captures/can",
    "gvl layout tests/definition/samples",
    "gvl layout tests/definition/samples/axis.gvl",
    "gvl lint captures/peers captures/can tests/definition/samples",
    "gvl lint tests/definition/samples/axis.gvl",
    "gvl lint --rules",
    "gvl diff captures/peers/axis.gvl captures/peers/batch.gvl",
    "gvl diff captures/peers/batch.gvl captures/peers/axis.gvl --types captures/peers/axis_types.st",
    "gvl diff captures/peers/axis.gvl captures/peers/axis.gvl --types captures/peers/axis_types.st",
    "gvl diff captures/can/press.gvl captures/can/level.gvl",
    "gvl diff captures/can captures/peers",
    "gvl diff captures/peers captures/can",
    "gvl diff captures/peers/batch.gvl captures/peers/recipe.gvl",
    "gvl diff tests/definition/samples/axis.gvl captures/peers/axis.gvl --types captures/peers/axis_types.st",
    "gvl diff tests/definition/samples/plant.exp captures/peers/batch.gvl",
    "gvl diff captures/peers/batch.gvl tests/definition/samples/plant.exp",
    "doctor captures/peers/peers.pcap --gvl captures/peers",
    "doctor captures/telegrams.pcap",
    "doctor --for 1ms udp://0.0.0.0:1202,239.1.2.3",
    f"check {_PLANT} --rules captures/plant.rules.toml",
    "check captures/truncated.pcap --rules captures/plant.rules.toml",
    "check captures/interfaces.pcapng --rules captures/plant.rules.toml",
    "check captures/peers/peers.pcap --from-time 1h --rules captures/plant.rules.toml",
    "check captures/can/press.log captures/peers/peers.pcap --rules captures/plant.rules.toml",
    f"diff {_PEERS} captures/truncated.pcap",
    "diff captures/can/press.log captures/interfaces.pcapng",
    f"diff {_PLANT} captures/peers/peers.pcap",
    "diff captures/telegrams.pcap captures/telegrams.pcap",
    "explain",
    "explain lost",
    "explain status",
    "explain NV301",
    "keys --fields",
    "keys --fields --gvl captures/peers/batch.gvl",
)


ODD_COMMANDS = (
    "report eth.pcap can.log --gvl eth.gvl --gvl can.gvl --compare",
    "report eth.pcap can.log --gvl eth.gvl --gvl can.gvl --gvl other_type.gvl --compare -Y 'nv.index == 9'",
    "report can.log --gvl can.gvl --gvl overlapping.gvl --bitrate 250k,2M",
    "report eth.pcap can.log --gvl eth.gvl --gvl can.gvl --compare --to-time 50ms",
    "report one.pcap one.log --gvl eth.gvl --gvl can.gvl --compare",
    "report one.pcap",
    "report cut.pcap",
    "report two_readers.pcap --max-streams 1",
    "report refusing.pcap --project named.toml",
    "report pages.pcap --project named.toml",
    "report shown.pcap --gvl shown.gvl --compare",
    "report shown.pcap --gvl shown.gvl --compare --show-secrets",
    "report shown.pcap shown.db --gvl shown.gvl --compare",
    "report shown_once.pcap shown.db --gvl shown.gvl --compare",
    "report shown_once.pcap --gvl shown.gvl --compare",
    "report timed_pages.pcap --project named.toml",
    "vars timed_pages.pcap",
    "vars timed_pages.pcap --history 'visu/*/*'",
    "vars timed_pages.pcap --at 40ms",
    "report odd.db",
    "vars odd.db",
    "vars odd.db --history '*' --all",
    "vars odd.db --at 100ms",
    "report one.log",
    "report bus_off.log",
    "report dropped.log",
    "report alike.log",
    "report alike.log --list can/can0/0x303",
    "report alike.log -Y 'can.id == 0x303'",
    "report one.pcap --project named.toml",
    "check dropped.log --rules odd.rules.toml",
    "check refusing.pcap --project named.toml --rules requests.rules.toml",
    "check eth.pcap can.log --gvl eth.gvl --gvl can.gvl --bitrate 250k,2M --rules variables.rules.toml",
    "vars eth.pcap --gvl eth.gvl --gvl before.gvl --gvl after.gvl",
    "vars eth.pcap --gvl elsewhere.gvl",
    "vars eth.pcap --gvl eth.gvl --history '*'",
    "vars one.pcap --gvl eth.gvl --history '*' --all",
    "vars eth.pcap --gvl eth.gvl --gvl nameless.gvl --at 50ms",
    "vars cut.pcap --gvl eth.gvl --at 2026-01-01T00:00:00",
    "vars eth.pcap --infer",
    "diff eth.pcap split.pcap",
    "gvl layout long.gvl nameless.gvl",
    "gvl lint eth.gvl can.log",
    "gvl diff nameless.gvl eth.gvl",
    "gvl diff eth.gvl nameless.gvl",
    "gvl diff nameless.gvl can.gvl",
    "gvl diff eth.gvl unknown.gvl",
    "gvl diff unknown.gvl eth.gvl",
    "audit spoiled.db values.db broken.db.0 broken.db.2 cut.db nothing.db missing.db",
    "audit empty.db",
)
"""Commands on the files of ``make_odd_plant``, and of ``make_odd_logs``."""


_ASKING = "watch asking.pcap --project asking.toml"
WATCHED = (f"watch {_PLANT}", f"watch {_PRESS}", "watch captures/telegrams.pcap", _ASKING)


def watched(command: str) -> list[dict[str, Any]]:
    """Return the lines that a command prints, each of which is a document."""
    folder = odd_plant() if command == _ASKING else ROOT
    return [json.loads(line) for line in _printed(command, folder).splitlines()]


def asked(command: str, folder: Path = ROOT) -> dict[str, Any]:
    """Return what a command prints as JSON; whoever changes it changes a copy."""
    return dict(json.loads(_printed(command, folder)))


@once.made_once
def _printed(command: str, folder: Path) -> bytes:
    verb, *words = shlex.split(command)
    done = run(verb, *words, "--json", cwd=folder)
    assert done.returncode in _READ, done.stderr.decode()
    return done.stdout


@once.made_once
def odd_plant() -> Path:
    """Return the folder of an odd plant, which is there as long as the tests are."""
    folder = Path(mkdtemp(dir=once.folder()))
    make_odd_plant(folder)
    make_odd_logs(folder)
    make_asking(folder)
    make_odd_database(folder)
    return folder


def of_nothing() -> dict[str, Any]:
    """Return the truth about a scenario in which nobody sends."""
    done = run("simulate", "empty.toml", "-w", "empty.pcap", "--force", cwd=odd_plant())
    assert done.returncode == ExitCode.GOOD, done.stderr.decode()
    return dict(json.loads((odd_plant() / "empty.pcap.truth.json").read_bytes()))


def of_scenario(path: Path) -> Iterator[dict[str, Any]]:
    """Yield what is told of a scenario, and of its traffic."""
    simulation = simulated(path)
    yield simulation.truth
    with TemporaryDirectory() as folder:
        directory = Path(folder)
        yield dict(plain(simulation.report(directory)))
