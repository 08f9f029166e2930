"""Who should not be there: unknown writers, writes, counters that two share, other subnets, scans; NV961 to NV966.

Readings, where the rules leave a choice:

- a list is sent by whoever sends data of it; who asks for it, or acknowledges, reads it
- a list that anybody sends, even telegrams that are malformed, or that the project names, is asked for by readers
- a sender counts along from the first telegram of a second sender of its (list, SubIndex) on; a telegram that repeats
  the Counter of its own stream is none. Half of its steps go on in the other one's Counter, and four of five of those
  that do not go on in its own
- two of which each counts along with the other are one program that sends from two addresses
- a node to which the project gives a list may count along
- a host whose write is confirmed has written, though its request was not captured, where none was by which it asked to
  write that parameter; when it asked is not known, and may have been in the minute before
- a partner that replies to nobody, sends no list and is not named by the project is asked for parameters in vain; what
  goes to everybody is for none, and so are all partners of a host of which it asked most for the same parameter three
  times and, the last time, behind the last one that it asked first
- of more than eight nodes, or hosts, of which the same is said, one finding tells

Two devices with one address (NV963) are not judged here: ``tests/findings/test_security.py`` has them one by one.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from ipaddress import ip_address, ip_network
from typing import Any

from tests.oracle.frame import Address, Datagram, Frame, peel
from tests.oracle.rules.keys import ListKey, node_order
from tests.oracle.rules.parameter import Parameters, observed
from tests.oracle.rules.telegram import ACKNOWLEDGEMENT, BOOT_UP_REQUEST, DATA, Telegram, telegram

APART, LISTS, PARTNERS, PORTS, ROUNDS, MINUTE_NS = 8, 100, 100, 20, 3, 60 * 10**9
EVENTS, STEPS_PERCENT, ODD_PERCENT, REGULAR_PERCENT, MERGED_PERCENT = 10, 50, 80, 90, 50

DAYS, DAY_MINUTES = ("mon", "tue", "wed", "thu", "fri", "sat", "sun"), 24 * 60

Row = tuple[str, str | None, str | None, int | None, int]
"""Code, list, node, SubIndex and count."""

Stream = tuple[Address, ListKey, int]


class Place:
    """The senders of one (list, SubIndex): who was there first, whether others are, and who moved last."""

    def __init__(self, first: Address) -> None:
        self.first = first
        self.shared = False
        self.last: tuple[Stream, int] | None = None


class Security:
    """All telegrams of a capture, one after the other, by what a project file says as plain tables."""

    def __init__(self, project: Mapping[str, Any], scope_of: Callable[[Address], str]) -> None:
        self.nodes: Mapping[str, Any] = project.get("nodes", {})
        self.said: Mapping[str, Any] = project.get("security", {})
        self.scope_of = scope_of
        self.data: Counter[tuple[ListKey, Address]] = Counter()
        self.senders: defaultdict[ListKey, set[Address]] = defaultdict(set)
        self.sent: Counter[Address] = Counter()
        self.to: set[Address] = set()
        self.there: set[Address] = set()
        self.asked: dict[Address, dict[ListKey, int]] = {}
        self.places: dict[tuple[ListKey, int], Place] = {}
        self.counters: dict[Stream, int] = {}
        self.steps: Counter[Stream] = Counter()
        self.regular: Counter[Stream] = Counter()
        self.along: Counter[tuple[Stream, Stream]] = Counter()

    def observe(self, number: int, frame: Frame) -> None:
        content = peel(frame)
        seen = telegram(number, frame.ts_ns, content) if isinstance(content, Datagram) else None
        if seen is not None:
            self.there |= {seen.source} if seen.broadcast else {seen.source, seen.destination}
        if seen is None or seen.header_cut or seen.list_key is None:
            return
        if seen.service == DATA:
            self.senders[seen.list_key].add(seen.source)
        if seen.fault or seen.service not in (DATA, ACKNOWLEDGEMENT, BOOT_UP_REQUEST):
            return
        self.sent[seen.source] += 1
        if seen.service == DATA:
            self.data[seen.list_key, seen.source] += 1
            if not seen.broadcast:
                self.to.add(seen.destination)
            self.count(seen.list_key, seen)
        elif seen.service == BOOT_UP_REQUEST:
            times = self.asked.setdefault(seen.source, {})
            times[seen.list_key] = min(times.get(seen.list_key, seen.time), seen.time)

    def count(self, key: ListKey, seen: Telegram) -> None:
        """Follow the Counter of a sender, and whose it goes on in."""
        stream = (seen.source, key, seen.subindex)
        place = self.places.setdefault((key, seen.subindex), Place(seen.source))
        place.shared |= seen.source != place.first
        before = self.counters.get(stream)
        self.counters[stream] = seen.counter
        if before == seen.counter:
            return
        if place.shared and before is not None:
            self.steps[stream] += 1
            if (seen.counter - before) % 65536 == 1:
                self.regular[stream] += 1
            elif place.last and place.last[0] != stream and (seen.counter - place.last[1]) % 65536 == 1:
                self.along[stream, place.last[0]] += 1
        place.last = stream, seen.counter

    def rows(self, known: Parameters) -> list[Row]:
        return [
            *self.unknown_writers(), *self.writes(known), *self.counting_along(), *self.outside(known),
            *self.scans(known),
        ]  # fmt: skip

    def unknown_writers(self) -> Iterable[Row]:
        for key in sorted(self.senders):
            own = {address for address, node in self.nodes.items() if is_of(key, node.get("writes", ()))}
            if not own and not self.said.get("only_nodes"):
                continue
            allowed = {ip_address(one) for one in own or self.nodes}
            strange = {node: count for (of, node), count in self.data.items() if of == key and node not in allowed}
            yield from apart("NV961", str(key), strange)

    def writes(self, known: Parameters) -> Iterable[Row]:
        names = {node["name"]: address for address, node in self.nodes.items() if "name" in node}
        writers, hours = ([one] if isinstance(one, str) else one for one in map(self.said.get, ("writers", "hours")))
        if writers is None and not hours:
            return
        found: defaultdict[tuple[str, bool], Counter[Address]] = defaultdict(Counter)
        nets = [ip_network(names.get(one, one)) for one in writers or ()]
        asked = {(one.requester, one.partner, one.index, one.subindex) for one in known.writes}
        seen = [(one.requester, one.partner, [one.time]) for one in known.writes]
        for ((requester, partner, _), index, subindex, _), time in known.unseen:
            if (str(requester), str(partner), index, subindex) not in asked:
                seen.append((str(requester), str(partner), [time, time - MINUTE_NS]))
        for writer, partner, times in seen:
            own = ip_address(writer)
            stranger = writers is not None and not any(own in net for net in nets if net.version == own.version)
            if stranger or (hours and not any(is_within(time, one) for time in times for one in hours)):
                found[partner, stranger][own] += 1
        for hosts in found.values():
            yield from apart("NV962", None, hosts)

    def counting_along(self) -> Iterable[Row]:
        streams = Counter(node for node, *_ in self.counters)
        for (own, other), count in self.along.items():
            node, key, subindex = own
            counts_beyond = streams[node] > 1 and self.scope_of(node) != "stream"
            if (
                count >= EVENTS and 100 * count >= STEPS_PERCENT * self.steps[own] and not counts_beyond
                and 100 * count >= ODD_PERCENT * (self.steps[own] - self.regular[own])
                and self.steps[other] and self.is_another(own, other, count)
                and not is_of(key, self.nodes.get(str(node), {}).get("writes", ()))
            ):  # fmt: skip
                yield "NV964", str(key), str(node), subindex, count

    def is_another(self, own: Stream, other: Stream, count: int) -> bool:
        """Tell whether the other stream counts for itself, and both are not one program's."""
        if 100 * self.along[other, own] >= MERGED_PERCENT * count:
            return False
        return 100 * self.regular[other] >= REGULAR_PERCENT * self.steps[other]

    def outside(self, known: Parameters) -> Iterable[Row]:
        sent = Counter(self.sent)
        for (requester, *_), row in known.rows.items():
            if row.requests:
                sent[requester] += row.requests
        subnets = self.said.get("subnets", ())
        nets = [ip_network(one) for one in ([subnets] if isinstance(subnets, str) else subnets)]
        if nets:
            strange = {
                node: count for node, count in sent.items()
                if any(net.version == node.version for net in nets) and not any(node in net for net in nets)
                and not (node.version == 6 and node.is_link_local)
            }  # fmt: skip
            yield from apart("NV965", None, strange)
            return
        there = {node for node in {*sent, *self.to} if node.version == 4}
        public = [node for node in there & {*sent} if node.is_global]
        private = [node for node in there if node.is_private and not node.is_loopback and not node.is_unspecified]
        if len(public) == 1 and len(private) == len(there) - 1 >= 2:
            yield "NV965", None, str(public[0]), None, sent[public[0]]

    def scans(self, known: Parameters) -> Iterable[Row]:
        named = [one for node in self.nodes.values() for name in ("reads", "writes") for one in node.get(name, ())]
        sent_on = {key.port for key, nodes in self.senders.items() if nodes}
        answered = {pair[2] for pair, row in known.rows.items() if row.replies + row.busy + row.unexpected}
        lists: defaultdict[Address, dict[Any, int]] = defaultdict(dict)
        ports: defaultdict[Address, dict[Any, int]] = defaultdict(dict)
        partners: defaultdict[Address, dict[Any, int]] = defaultdict(dict)
        replying = {pair[1] for pair, row in known.rows.items() if row.replies + row.busy + row.unexpected}
        replying |= {node for nodes in self.senders.values() for node in nodes} | {*map(ip_address, self.nodes)}
        for node, asked in self.asked.items():
            for key, time in asked.items():
                if not self.senders.get(key) and not is_of(key, named):
                    lists[node][key] = time
                if key.port not in sent_on:
                    ports[node][key.port] = min(ports[node].get(key.port, time), time)
        again: defaultdict[Address, dict[Any, tuple[int, int]]] = defaultdict(dict)
        for (code, node, partner, port, *_), by_service in known.findings.items():
            for times in by_service.values():
                if code == "NV701" and port not in answered:
                    ports[node][port] = min(ports[node].get(port, times[0][0]), times[0][0])
                if code == "NV701" and partner in self.there - replying:
                    partners[node][partner] = min(partners[node].get(partner, times[0][0]), times[0][0])
                    again[node][partner] = max(again[node].get(partner, (0, 0)), (len(times), times[-1][0]))
        for node, firsts in [*partners.items()]:
            begun = max(firsts.values())
            if 2 * sum(count >= ROUNDS and last > begun for count, last in again[node].values()) > len(firsts):
                del partners[node]
        for node in sorted({*lists, *partners, *ports}, key=node_order):
            ways = (lists[node], LISTS), (partners[node], PARTNERS), (ports[node], PORTS)
            count = sum(dense(times.values(), least) for times, least in ways)
            if count:
                yield "NV966", None, str(node), None, count


def is_of(key: ListKey, named: Iterable[int | str]) -> bool:
    return any(one in (key.list_id, f"udp/{key.port}/{key.list_id}") for one in named)


def is_within(time_ns: int, span: str) -> bool:
    """Tell whether a local time lies in a span of hours; what is behind midnight is of the day before."""
    days, _, hours = span.rpartition(" ")
    begin, end = (int(one[:2]) * 60 + int(one[3:]) for one in hours.split("-"))
    first, _, last = (days or "mon-sun").partition("-")
    from_day, to_day = DAYS.index(first), DAYS.index(last or first)
    local = datetime.fromtimestamp(time_ns // 10**9)
    minute = local.weekday() * DAY_MINUTES + local.hour * 60 + local.minute
    spans = (
        (day * DAY_MINUTES + begin, day * DAY_MINUTES + end + (DAY_MINUTES if end <= begin else 0))
        for day in range(from_day, to_day + 1 + 7 * (to_day < from_day))
    )
    return any(start <= minute + week * 7 * DAY_MINUTES < stop for start, stop in spans for week in (0, 1))


def apart(code: str, key: str | None, counts: Mapping[Address, int]) -> Iterable[Row]:
    if len(counts) > APART:
        yield code, key, None, None, sum(counts.values())
    else:
        for node, count in counts.items():
            yield code, key, str(node), None, count


def dense(times: Iterable[int], least: int) -> int:
    """Count the times that lie within a minute with as many others."""
    known = sorted(times)
    spans = [[one for one in known if begin <= one <= begin + MINUTE_NS] for begin in known]
    return sum(any(len(span) >= least and span[0] <= one <= span[-1] for span in spans) for one in known)


def security_rows(
    frames: Iterable[Frame], project: Mapping[str, Any] | None = None,
    scope_of: Callable[[Address], str] = lambda _: "stream",
) -> list[Row]:  # fmt: skip
    """Return the findings about security on a capture, those of one code and place as one."""
    frames = list(frames)
    rules = Security(project or {}, scope_of)
    for number, frame in enumerate(frames, 1):
        rules.observe(number, frame)
    counts: Counter[tuple[str, str | None, str | None, int | None]] = Counter()
    for *place, count in rules.rows(observed(frames)):
        counts[tuple(place)] += count  # type: ignore[index]
    return [(*place, count) for place, count in sorted(counts.items(), key=str)]
