"""Random plants with hosts that should not be there, some that only look so, and project files that say who may."""

from __future__ import annotations

import random

from tests.oracle.builders import MILLISECOND, SECOND, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import conversations
from tests.oracle.rules.telegram import ACKNOWLEDGEMENT, BOOT_UP_REQUEST

NODES = ("10.0.0.1", "10.0.0.2", "10.0.0.3", "192.168.1.10", "fd00::1", "fe80::1")
STRANGERS = ("8.8.4.4", "192.168.7.7", "10.0.0.99", "fd01::9", "1.1.1.1")
WRITERS = ("[]", '"10.0.0.1"', '["10.0.0.0/30", "fe80::/10"]')
HOURS = ('"00:00-24:00"', '["00:00-00:01", "12:00-12:01"]', '"wed-thu 22:00-06:00"', '["sat-mon 00:00-00:02"]')
SUBNETS = ('"10.0.0.0/8"', '["10.0.0.0/30", "fd00::/64"]', '["0.0.0.0/0"]')
STEP = 100 * MILLISECOND
READ, START = 1, 1_704_276_000 * SECOND


def security_traffic(seed: int, steps: int = 150) -> list[Frame]:
    """Return the frames of a plant, in the order of their times."""
    rng = random.Random(seed)
    frames = [*_lists(rng, steps), *_crowd(rng), *_scan(rng, steps)]
    if rng.random() < 0.5:
        frames += conversations(seed, requests=rng.randrange(30))
    if rng.random() < 0.2:
        frames += [one._replace(ts_ns=one.ts_ns + 2000) for one in frames if rng.random() < 0.9]
    frames.sort(key=lambda one: one.ts_ns)
    return frames


def _lists(rng: random.Random, steps: int) -> list[Frame]:
    """Return lists of nodes, each with somebody who counts along, or sends for itself, or with the other's address."""
    frames: list[Frame] = []
    for list_id in range(1, rng.randint(2, 4)):
        sender, other = rng.sample((*NODES, *STRANGERS), 2)
        if ":" in sender + other:
            sender, other = "fd00::1", rng.choice(("fd01::9", "fe80::1"))
        port, subindex = rng.choice((1202, 1202, 1300)), rng.randrange(2)
        everybody = "ff02::1" if ":" in sender else rng.choice(("255.255.255.255", "10.0.0.2"))
        along, alone = rng.choice((0, 0.02, 0.15)), rng.choice((0, 0, 0.01, 0.05))
        loss, turns = rng.choice((0, 0, 0.05, 0.15)), rng.choice((0, 0, 0.04, 0.3))
        counter, own = rng.choice((1, 65_500, 300)), rng.randrange(65_536)

        def send(at: int, source: str, value: int, place: tuple[int, int, str, int]) -> Frame:
            list_id, subindex, to, port = place
            data = telegram(list_id=list_id, subindex=subindex, counter=value % 65_536, data=bytes([value & 255, 1]))
            return data_frame(at, source, to, data, port=port)

        where = (list_id, subindex, everybody, port)
        for step in range(steps):
            at = START + step * STEP + list_id * MILLISECOND + rng.randrange(MILLISECOND)
            counter += 1
            if rng.random() >= loss:
                frames.append(send(at, other if rng.random() < turns else sender, counter, where))
            if rng.random() < along:
                frames.append(send(at + STEP // 2, other, counter + 1, where))
            if rng.random() < alone:
                own += 1
                frames.append(send(at + STEP // 3, other, own, where))
        if rng.random() < 0.3:
            reader = "fd00::2" if ":" in sender else "10.0.0.2"
            frames.append(data_frame(at, reader, sender, telegram(ACKNOWLEDGEMENT, list_id, subindex, data=b"")))
    return frames


def _crowd(rng: random.Random) -> list[Frame]:
    """Return one telegram each of some made-up senders."""
    return [
        data_frame(START + number * MILLISECOND, f"172.20.0.{number}", "10.0.0.1", telegram(counter=number))
        for number in range(rng.choice((0, 0, 0, 7, 8, 9, 20)))
    ]


def _scan(rng: random.Random, steps: int) -> list[Frame]:
    """Return what a host asks for: lists, some of which there are, or many addresses, or on many ports."""
    if rng.random() < 0.3:
        return []
    host, span = rng.choice(("10.0.0.99", "10.0.0.2", "8.8.4.4")), rng.choice((10, 55, 70, 300)) * SECOND
    if rng.random() < 0.4:
        return _asked(rng, host, span, START + steps * STEP + 400 * SECOND)
    of_lists = rng.random() < 0.5
    count = rng.choice((90, 100, 104, 130) if of_lists else (12, 20, 21, 30))
    frames = []
    for number in range(count):
        at = START + number * span // count + rng.randrange(MILLISECOND)
        list_id, port = (number, 1202) if of_lists else (7, rng.choice((1202, 2000)) + number)
        service = BOOT_UP_REQUEST if of_lists or rng.random() < 0.5 else READ
        asked = telegram(service, list_id, counter=number, data=b"")
        to = "10.0.0.1" if service == READ else "255.255.255.255"
        frames += [data_frame(at, host, to, asked, port=port)] * rng.choice((1, 1, 1, 2))
    return [*frames, data_frame(START + steps * STEP + 400 * SECOND, host, "10.0.0.1", b"the end")]


def _asked(rng: random.Random, host: str, span: int, end: int) -> list[Frame]:
    """Return what a host asks many addresses for parameters; some of them reply, some send a list."""
    many, replying = rng.choice((90, 99, 100, 104, 130)), rng.choice((0, 0, 4, 40))
    begin, port = rng.choice((1, 100)), rng.choice((1202, 1202, 1300))
    frames = [data_frame(end, host, "10.0.0.1", b"the end")]
    for number in range(many):
        at, partner = START + number * span // many, f"10.0.0.{begin + number}"
        asked = telegram(READ, 0x2000, counter=number, data=b"")
        frames += [data_frame(at, host, partner, asked, port=port, source_port=port)] * rng.choice((1, 1, 1, 2))
        if number < replying:
            reply = telegram(READ + 1, 0x2000, counter=number)
            frames.append(data_frame(at + MILLISECOND, partner, host, reply, port=port, source_port=port))
    return frames


def security_project(seed: int) -> str:
    """Return what a project file says of such a plant; sometimes nothing."""
    rng = random.Random(seed + 1)
    lines = []
    for node in rng.sample(NODES, rng.randrange(4)):
        lists = {name: rng.sample(range(1, 8), rng.randrange(3)) for name in ("reads", "writes")}
        said = [f"{name} = {[*map(str, numbers)]}" for name, numbers in lists.items() if numbers]
        lines.append(f'"{node}" = {{ {", ".join(said)} }}'.replace("'", "").replace("{  }", "{}"))
    text = "[nodes]\n" + "\n".join(lines) + "\n[security]\n"
    if rng.random() < 0.3:
        text += "only_nodes = true\n"
    if rng.random() < 0.4:
        text += f"writers = {rng.choice(WRITERS)}\n"
    if rng.random() < 0.4:
        text += f"hours = {rng.choice(HOURS)}\n"
    if rng.random() < 0.4:
        text += f"subnets = {rng.choice(SUBNETS)}\n"
    return text
