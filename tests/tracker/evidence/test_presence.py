"""Who is there, against a count of one frame after the other."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import IP, UDP
from scapy.layers.l2 import ARP, Ether

from dissectors.addresses import addresses_of
from dissectors.batch import LinkType, PacketBatch
from dissectors.netvar import LIST_SERVICES, dissect
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.evidence.presence import BY_ARP, HARDWARE, NEVER, Presence
from nvscope.tracker.evidence.presence import IP as IP_KIND
from nvscope.tracker.evidence.signs import CLOSE_NS, SignsOfLife
from tests.laws import examples
from tests.oracle.builders import LINKS
from tests.oracle.traffic import generate, mutate
from tests.packets import Batches, batch_of, cut
from tests.records import replace

Key = tuple[int, int, int]


def present(batches: list[PacketBatch], most: int = 1 << 16, settled_every: int = 1 << 16) -> Presence:
    presence = Presence(most)
    for place, _ in enumerate(run(Batches(batches), Reading(), [presence]), 1):
        if place % settled_every == 0:
            presence.settle()
    presence.settle()
    return presence


def singly(batch: PacketBatch) -> tuple[dict[Key, Any], dict[tuple[int, ...], Any], list[Any]]:
    """Count who sent the frames of a batch, one after the other."""
    dissection = dissect(batch)
    telegrams = dissection.telegrams
    lists = set(telegrams.row[np.isin(telegrams.header["id"], LIST_SERVICES)].tolist())
    heard: dict[Key, list[tuple[int, bool]]] = defaultdict(list)
    pairs: dict[tuple[int, ...], list[int]] = defaultdict(list)
    alternations: Counter[tuple[int, ...]] = Counter()
    last: dict[tuple[int, int], int] = {}
    announced = []
    found = addresses_of(batch)
    columns = (found.row, found.hardware, found.vlan, found.high, found.low, found.ttl, found.announces, found.answers)
    for row, hardware, vlan, high, low, ttl, announces, answers in zip(*(one.tolist() for one in columns), strict=True):
        time_ns, other = int(batch.ts_ns[row]), row not in lists
        if hardware:
            heard[HARDWARE, 0, hardware].append((time_ns, other))
        if not (high or low):
            continue
        heard[IP_KIND, high, low].append((time_ns, other))
        if announces:
            announced.append((time_ns, row + 1, (IP_KIND, high, low), hardware))
        if hardware:
            pair = high, low, hardware | (vlan + 1) << 48, BY_ARP + answers if ttl < 0 else ttl
            pairs[pair].append(time_ns)
            alternations[pair] += last.get((high, low), hardware) != hardware
            last[high, low] = hardware
    addresses = {}
    for key, times in heard.items():
        others = [time_ns for time_ns, other in times if other]
        addresses[key] = len(times), times[0][0], len(others)
    told = {pair: (len(times), times[0], alternations[pair]) for pair, times in pairs.items()}
    return addresses, told, announced


def as_told(presence: Presence) -> tuple[dict[Key, Any], dict[tuple[int, ...], Any], list[Any]]:
    keys = list(zip(*(word.tolist() for word in presence.addresses.words), strict=True))
    columns, pairs = presence.columns, presence.pair_columns
    addresses = {
        key: tuple(int(columns.column(name)[row]) for name in ("count", "first_ns", "others"))
        for row, key in enumerate(keys)
    }
    told = {
        pair: tuple(int(pairs.column(name)[row]) for name in ("count", "first_ns", "alternations"))
        for row, pair in enumerate(zip(*(word.tolist() for word in presence.pairs.words), strict=True))
    }
    announced = [
        (time_ns, frame, keys[row], hardware)
        for time_ns, frame, row, hardware in zip(
            *(one.tolist() for one in presence.announcements.columns()), strict=True
        )
    ]
    return addresses, told, announced


@given(st.integers(0, 10_000), st.integers(1, 90), st.integers(1, 5))
@examples(60)
def test_it_is_what_is_counted_of_one_frame_after_the_other(seed: int, packets: int, settled_every: int) -> None:
    frames = generate(seed, frames=150, link=[*LINKS, None][seed % (len(LINKS) + 1)])
    whole = batch_of(mutate(seed, frames) if seed % 2 else frames)
    presence = present(cut(whole, packets), settled_every=settled_every)
    assert as_told(presence) == singly(whole)
    assert not presence.left_out


@given(st.integers(0, 10_000), st.integers(1, 90), st.sampled_from([1, 20, 1000]))
@examples(60)
def test_signs_of_life_are_spans_without_a_pause(seed: int, packets: int, slower: int) -> None:
    frames = generate(seed, frames=150, link=[*LINKS, None][seed % (len(LINKS) + 1)])
    whole = batch_of(frames)
    whole = replace(whole, ts_ns=whole.ts_ns[0] + (whole.ts_ns - whole.ts_ns[0]) * slower)
    presence = present(cut(whole, packets))
    expected: dict[Key, list[list[int]]] = defaultdict(list)
    dissection = dissect(whole)
    lists = set(dissection.telegrams.row[np.isin(dissection.telegrams.header["id"], LIST_SERVICES)].tolist())
    found = addresses_of(whole)
    columns = (found.row, found.hardware, found.high, found.low)
    for row, hardware, high, low in zip(*(one.tolist() for one in columns), strict=True):
        time_ns = int(whole.ts_ns[row])
        keys = [(HARDWARE, 0, hardware)] * (hardware > 0) + [(IP_KIND, high, low)] * bool(high or low)
        for spans in (expected[key] for key in keys if row not in lists):
            if spans and 0 <= time_ns - spans[-1][1] <= CLOSE_NS:
                spans[-1][1] = time_ns
            else:
                spans.append([time_ns, time_ns])
    told: dict[Key, list[list[int]]] = defaultdict(list)
    keys = list(zip(*(word.tolist() for word in presence.addresses.words), strict=True))
    spans = presence.signs.columns
    names = ("address", "since_ns", "until_ns")
    for number, since_ns, until_ns in zip(*(spans.column(name).tolist() for name in names), strict=True):
        told[keys[number]].append([since_ns, until_ns])
    assert told == {key: spans for key, spans in expected.items() if spans}
    for key, own in told.items():
        number = np.array([keys.index(key)])
        first, last = own[0], own[-1]
        assert presence.signs.seen_between(number, last[1], last[1] + 1)
        assert not presence.signs.seen_between(number, max(one[1] for one in own) + 1, last[1] + 10**18)
        assert not presence.signs.seen_between(number, 0, min(one[0] for one in own) - 1)
        assert presence.signs.seen_between(number, first[0], first[0])


FRAMES = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 400)), min_size=1, max_size=60)


def signs_of(frames: list[tuple[int, int]], size: int, most: int) -> SignsOfLife:
    """Return what is known of frames of addresses at times, in tenths of a tenth of a second, some at a time."""
    signs, before = SignsOfLife(most), dict[int, int]()
    for first in range(0, len(frames), size):
        batch = sorted(frames[first : first + size], key=lambda frame: frame[0])
        rows = []
        for address, tenth in batch:
            time_ns = tenth * CLOSE_NS // 10
            rows.append((address, time_ns, before.get(address, NEVER)))
            before[address] = time_ns
        signs.observe(*np.array(rows, np.int64).T, 4)
    signs.throw_away()
    return signs


def spans_of(signs: SignsOfLife) -> set[tuple[int, ...]]:
    return set(zip(*(signs.columns.column(name).tolist() for name in ("since_ns", "address", "until_ns")), strict=True))


@given(FRAMES, st.integers(1, 60), st.integers(1, 60), st.integers(2, 12))
def test_the_first_and_the_last_signs_are_kept(drawn: list[tuple[int, int]], size: int, other: int, most: int) -> None:
    frames = sorted(drawn, key=lambda frame: frame[1])
    every = sorted(spans_of(signs_of(frames, size, 1000)))
    kept = signs_of(frames, size, most)
    first = -(-most // 4)
    newest = {address: (since, address, until) for since, address, until in every}
    expected = set(every)
    if len(every) > most:
        expected = {*every[:first], *every[len(every) - most + first :], *newest.values()}
    assert spans_of(kept) == expected == spans_of(signs_of(frames, other, most))
    assert kept.left_out == len(every) - len(expected)


def exchange() -> PacketBatch:
    """Two devices of one address that answer in turn, another one beside them, and what ARP says of it."""
    frames = [
        Ether(src=f"02:00:00:00:00:0{device}", dst="ff:ff:ff:ff:ff:ff") / IP(src=address) / UDP() / b"hello"
        for device, address in ((1, "10.0.0.1"), (2, "10.0.0.1"), (3, "10.0.0.3"), (1, "10.0.0.1"), (2, "10.0.0.1"))
    ]
    asks = ARP(op=1, hwsrc="02:00:00:00:00:03", psrc="10.0.0.3", pdst="10.0.0.3")
    frames.append(Ether(src="02:00:00:00:00:03", dst="ff:ff:ff:ff:ff:ff") / asks)
    return PacketBatch.of([bytes(one) for one in frames], LinkType.ETHERNET, [10 * place for place in range(6)])


def test_two_devices_of_one_address_alternate() -> None:
    presence = present([exchange()])
    addresses, pairs, announced = as_told(presence)
    assert sorted(count for count, *_ in addresses.values()) == [2, 2, 2, 2, 4]
    assert sorted((pair[2] & 0xFF, count, alternations) for pair, (count, _, alternations) in pairs.items()) == [
        (1, 2, 1), (2, 2, 2), (3, 1, 0), (3, 1, 0),
    ]  # fmt: skip
    assert [(time_ns, frame, hardware & 0xFF) for time_ns, frame, _, hardware in announced] == [(50, 6, 3)]


def test_addresses_that_there_is_no_room_for_are_counted() -> None:
    presence = present(cut(exchange(), 1), most=2)
    assert len(presence.columns) == 2
    assert presence.columns.column("count").tolist() == [2, 2]
    # Twice the hardware address of the third device, and six times an IP address.
    assert presence.left_out == 8
