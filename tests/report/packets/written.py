"""What the faces of ``nvscope packets`` write of captures, and of frames made for a test."""

from __future__ import annotations

import random
from pathlib import Path

from nvscope.capture.open import open_source
from nvscope.capture.source import Source
from nvscope.report.packets.records import Face
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines.netvar_line import Moment
from tests.oracle.builders import LINKS
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate, mutate
from tests.packets import Shown

ROOT = Path(__file__).parents[3]
CAPTURES = ROOT / "captures"
PEERS, INTERFACES, PUBLIC = (
    CAPTURES / "peers" / "peers.pcap",
    CAPTURES / "interfaces.pcapng",
    CAPTURES / "telegrams.pcap",
)
SENDER, READER = "192.168.1.10", "192.168.1.20"
MOMENTS: tuple[Moment, ...] = ("a", "ad", "d", "e", "r", "u", "ud")


def written(face: Face, source: Source) -> str:
    text = face.begin()
    for rows in Shown(source):
        text += "".join(face.render(rows))
    return text + face.end()


def written_of(face: Face, path: Path) -> str:
    return written(face, open_source([str(path)]))


def fields(*names: str) -> list[TelegramField]:
    return [FIELDS[name] for name in names]


def traffic(seed: int) -> list[Frame]:
    choice = random.Random(seed)
    frames = generate(seed, frames=150, link=choice.choice([*LINKS, None]))
    return mutate(seed, frames) if choice.random() < 0.5 else frames
