"""Faults of capturing itself: frames that the mirror port lost, showed twice, or a clock that was set."""

from __future__ import annotations

from collections import Counter, defaultdict

from tests.causes.drawn.loss_faults import losses_of
from tests.causes.drawn.places import claim, end_or_not, moment
from tests.causes.drawn.plant import START_NS, Plant
from tests.causes.drawn.traffic import Seen, UnclearError
from tests.causes.drawn.truth import MILLISECOND, SECOND, Fault


def mirror_overloaded(plant: Plant) -> Fault | None:
    """In some moments the mirror port shows nothing of anybody."""
    chance = plant.chance
    senders = [node for node in plant.senders if node.cyclic and node.scope != "constant" and not node.born_ns]
    if len(senders) < 2 or any(node.scope.startswith("wrap") for node in senders):
        return None
    if len(plant.senders) != len(senders):
        return None
    moments = chance.randint(3, 10)
    since = moment(plant, SECOND // 2, 10 * SECOND)
    if since is None or not claim(plant, since, plant.end_ns, "capture"):
        return None
    ends = chance.random() < 0.5
    last = plant.end_ns - SECOND if ends else since + (plant.end_ns - since) // 3
    apart = (last - since) // moments
    starts = [since + number * apart + int(chance.uniform(0, 0.3) * apart) for number in range(moments)]
    length = int(chance.uniform(20, 90) * MILLISECOND)
    fault = Fault("capture-incomplete", starts[0], ends, SECOND, note=f"{moments} moments of {length / 1e6:.0f} ms")

    def overloaded(plant: Plant, seen: list[Seen]) -> list[Seen]:
        kept = []
        hit: dict[int, Counter[str]] = defaultdict(Counter)
        for one in seen:
            inside = next((start for start in starts if start <= one.ts_ns < start + length), None)
            if inside is None:
                kept.append(one)
            elif one.sent is not None and one.node is not None:
                hit[inside][one.node.ip] += 1
                one.sent.unseen = True
        least = min(3, len(senders))
        if sum(len(hit[start]) >= least for start in starts) < max(3, len(starts)):
            raise UnclearError
        return kept

    plant.captured.append(overloaded)
    return fault


def mirror_thins(plant: Plant) -> Fault | None:
    """The mirror port loses a share of all frames, alike."""
    return _thinned(plant, told=False)


def drops_told(plant: Plant) -> Fault | None:
    """The capturing host loses frames, and says how many."""
    return _thinned(plant, told=True)


def _thinned(plant: Plant, *, told: bool) -> Fault | None:
    chance = plant.chance
    lists = [one for one in plant.lists if one.cyclic and one.node.scope in ("stream", "list") and not one.node.born_ns]
    if any(node.scope.startswith("wrap") for node in plant.nodes):
        return None  # where the 0 is lost, a counter that wraps early seems to begin anew
    if any(node.scope == "send" and any(len(one.sizes) > 1 for one in node.lists) for node in plant.nodes):
        return None  # what such a node loses within one sending, no counter misses
    share = chance.uniform(0.005, 0.06)
    sure = [one for one in lists if plant.seconds * SECOND / one.interval_ns * len(one.sizes) * share > 20]
    if not told and (len(sure) < 3 or len({one.node.ip for one in sure}) < 2):
        return None
    if not sure or not claim(plant, START_NS, plant.end_ns, "capture"):
        return None
    longest = max(one.interval_ns for one in plant.lists)
    fault = Fault("capture-incomplete", START_NS, True, longest, note=f"share {share:.3f} told {told}")

    def thin(plant: Plant, seen: list[Seen]) -> list[Seen]:
        rows: Counter[tuple[int, int]] = Counter()
        kept, times = [], []
        for one in seen:
            key = (
                (id(one.sent.list), one.sent.subindex) if one.sent else (id(one.node), int.from_bytes(one.data[-12:-8]))
            )
            if one.sent and one.sent.list.node.scope in ("telegram", "send"):
                key = (id(one.node), -1)
            takes = plant.chance.random() < share and rows[key] < 2
            rows[key] = rows[key] + 1 if takes else 0
            if takes:
                if one.sent:
                    one.sent.unseen = True
                times.append(one.ts_ns)
            else:
                kept.append(one)
        if told:
            plant.drops = len(times)
        shown = losses_of([one.sent for one in seen if one.sent])
        if len(shown) < 4 or lost_acknowledgement(seen, kept) < shown[0] - fault.slack_ns // 2:
            raise UnclearError
        fault.since_ns = shown[0]
        usual = (shown[-1] - shown[0]) // (len(shown) - 1)
        if plant.end_ns - shown[-1] > usual:
            raise UnclearError
        return kept

    plant.captured.append(thin)
    return fault


def lost_acknowledgement(seen: list[Seen], kept: list[Seen]) -> int:
    """Return when the first frame that is no telegram of a list was lost."""
    there = {id(one) for one in kept}
    return next((one.ts_ns for one in seen if one.sent is None and id(one) not in there), 1 << 62)


def mirrored_twice(plant: Plant) -> Fault | None:
    chance = plant.chance
    since = START_NS if chance.random() < 0.5 else moment(plant, SECOND, 8 * SECOND)
    if since is None:
        return None
    until, ongoing = end_or_not(plant, since, 6 * SECOND)
    if not claim(plant, since, min(until, plant.end_ns), "capture"):
        return None
    if any(node.scope == "constant" for node in plant.nodes):
        return None  # of what does not count, nobody knows that it is repeated
    other = chance.choice(["same", "mac", "vlan"])
    fault = Fault("mirrored-twice", since, ongoing, max(one.interval_ns for one in plant.lists), note=other)

    def twice(plant: Plant, seen: list[Seen]) -> list[Seen]:
        rows = list(seen)
        repeated = [one for one in seen if since <= one.ts_ns < until]
        if sum(one.sent is not None for one in repeated) < 40:
            raise UnclearError
        for one in repeated:
            data = one.data
            if other == "mac" and one.sent:
                data = data[:6] + b"\x02\x55\x55\x55\x55\x55" + data[12:]
            elif other == "vlan" and one.sent and data[12:14] != b"\x81\x00":
                data = data[:12] + b"\x81\x00\x00\x63" + data[12:]
            rows.append(one._replace(ts_ns=one.ts_ns + int(plant.chance.uniform(5, 30) * 1000), data=data))
        rows.sort(key=lambda one: one.ts_ns)
        return rows

    plant.captured.insert(0, twice)
    return fault


def clock_back(plant: Plant) -> Fault | None:
    return _clock(plant, back=True)


def clock_forward(plant: Plant) -> Fault | None:
    return _clock(plant, back=False)


def _clock(plant: Plant, *, back: bool) -> Fault | None:
    chance = plant.chance
    cyclic = [node for node in plant.senders if node.cyclic and not node.born_ns]
    if not cyclic or (not back and len(cyclic) < 2):
        return None
    longest = max(node.longest_ns for node in cyclic)
    step = -int(chance.choice([0.005, 0.05, 0.4, 1.2]) * SECOND) if back else int(longest * chance.uniform(3, 6))
    since = moment(plant, longest, 5 * longest + 3 * SECOND)
    if since is None or not claim(plant, since - 3 * longest, since + abs(step) + 3 * longest, "capture"):
        return None

    def stepped(plant: Plant, seen: list[Seen]) -> list[Seen]:
        before = [one.ts_ns for one in seen if one.ts_ns < since]
        after = [one.ts_ns + step for one in seen if one.ts_ns >= since]
        if back and (not before or not after or before[-1] - after[0] <= 2 * MILLISECOND):
            raise UnclearError
        for fault in plant.faults:
            if fault.since_ns > since + longest:
                fault.since_ns += step
        return [one if one.ts_ns < since else one._replace(ts_ns=one.ts_ns + step) for one in seen]

    # Times behind the last step move first.
    plant.clocks.append((since, stepped))
    # The clock is that of the capture, whatever else befell it.
    return Fault("clock", since, False, longest, note=f"{step / 1e9:.3f}")
