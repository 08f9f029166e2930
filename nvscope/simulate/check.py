"""What a scenario may not contain: tables that contradict themselves or each other."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence

from nvscope.simulate.can.check import check_can
from nvscope.simulate.incidents import PowerOff, Unplugged
from nvscope.simulate.plan import MAX_TELEGRAMS_PER_LIST, SLOWEST_NS, U16_MAX, ListPlan
from nvscope.simulate.scenario import ON_CAN, ParameterRequests, Scenario, Traffic
from nvscope.simulate.telegram_faults import Late, Malformed, Selection, Shape, WrongChecksum, WrongDlc
from nvscope.simulate.visu.check import check_page
from nvscope.simulate.visu.tables import Page
from nvscope.toml_table import Place, nearest

MAX_SHORT_HEADER_BYTES = 200
_WITH_ARP = frozenset({"ethernet", "sll", "sll2"})


def check_scenario(scenario: Scenario, place: Place) -> None:
    """Raise ConfigurationError where tables contradict themselves or each other."""
    if not scenario.node and not scenario.channels:
        raise place.below("node").error("a scenario needs a node, or a list on CAN")
    if not 0 < scenario.duration_ns <= SLOWEST_NS:
        raise place.below("duration").error("the duration must be more than 0 and at most 31 days")
    _check_nodes(scenario, place)
    for position, entry in enumerate(scenario.list):
        _check_list(scenario, entry, place.below("list").below(position))
    _check_told_apart(scenario, place)
    _check_names(scenario, place)
    check_can(scenario, place)
    for where, fault in scenario.selections():
        _check_choice(fault, place.below(where))
        if fault.list in scenario.list_numbers:
            _check_selection(scenario, fault, place.below(where))
    for position, traffic in enumerate(scenario.traffic):
        below = place.below("traffic").below(position)
        if not traffic.interval_ns:
            raise below.below("interval").error("the interval must be more than 0")
        if traffic.kind == "arp" and (scenario.link not in _WITH_ARP or _has_ipv6(scenario, traffic)):
            raise below.below("kind").error("ARP needs IPv4 addresses and a link layer")
    for position, sender in enumerate(scenario.second_sender):
        below = place.below("second_sender").below(position)
        owner = scenario.list[scenario.list_numbers[sender.list]]
        if sender.node in owner.sender:
            raise below.below("node").error(f"'{sender.node}' sends this list already")
        if sender.interval_ns == 0:
            raise below.below("interval").error("the interval must be more than 0")
        for name, given in (("bytes", sender.data_bytes), ("items", sender.items)):
            if given and len(given) != len(owner.shapes):
                raise below.below(name).error(f"the list has {len(owner.shapes)} telegrams, not {len(given)}")
        if sender.checksum and len(sender.checksum) not in {1, len(owner.shapes)}:
            raise below.below("checksum").error("one value, or one for each telegram of the list")
        if sender.counts_along and not scenario.wild:
            raise below.below("counts_along").error("what two count together is not exact", "Set wild = true.")
    for position, scan in enumerate(scenario.scan):
        if scan.index + scan.count - 1 > U16_MAX:
            raise place.below("scan").below(position).below("count").error("identifiers end at 65535")
    for position, stop in enumerate(scenario.stop):
        if not stop.node and not stop.list:
            raise place.below("stop").below(position).error("a stop needs a node or a list")
    _check_absences(scenario, place)
    for position, burst in enumerate(scenario.burst):
        if burst.list not in scenario.list_numbers:
            continue
        owner = scenario.list[scenario.list_numbers[burst.list]]
        if burst.gap_ns < owner.spacing_ns * len(owner.shapes):
            raise place.below("burst").below(position).below("gap").error("the telegrams of one sending take longer")


def _check_absences(scenario: Scenario, place: Place) -> None:
    """Raise ConfigurationError for nodes that are away, pauses, restarts and lacking frames that make no sense."""
    for position, pause in enumerate(scenario.pause):
        if not pause.node and not pause.list:
            raise place.below("pause").below(position).error("a pause needs a node or a list")
    for position, entry in enumerate(scenario.list):
        short = any(scenario.node[scenario.node_numbers[name]].short_header for name in entry.sender)
        if short and max(size for _, size in entry.shapes) > MAX_SHORT_HEADER_BYTES:
            raise (
                place.below("list")
                .below(position)
                .below("bytes")
                .error(f"a telegram with a short header has at most {MAX_SHORT_HEADER_BYTES} bytes of data")
            )
    for position, restart in enumerate(scenario.restart):
        counter = scenario.node[scenario.node_numbers[restart.node]].counter
        if restart.list and counter != "stream":
            raise (
                place.below("restart")
                .below(position)
                .below("list")
                .error(f"'{restart.node}' counts beyond its lists: one of them cannot begin anew alone")
            )
    tables: dict[str, Sequence[PowerOff | Unplugged]] = {
        "power_off": scenario.power_off, "unplugged": scenario.unplugged,
    }  # fmt: skip
    for name, absences in tables.items():
        for position, absence in enumerate(absences):
            below = place.below(name).below(position)
            own = ipaddress.ip_address(scenario.node[scenario.node_numbers[absence.node]].address)
            if sum(ipaddress.ip_address(node.address) == own for node in scenario.node) > 1:
                raise below.below("node").error(f"another node has the address of '{absence.node}'")
            if absence.until_ns is not None and absence.until_ns <= absence.at_ns:
                raise below.below("until").error("a node is back after it is gone, not before")
    for position, held_back in enumerate(scenario.held_back):
        below = place.below("held_back").below(position)
        entry = scenario.list[scenario.list_numbers[held_back.list]]
        nodes = [scenario.node[scenario.node_numbers[name]].address for name in entry.sender]
        to = next((node.address for node in scenario.node if node.name == entry.destination), entry.destination)
        if scenario.link not in _WITH_ARP or any(":" in address for address in (*nodes, to)):
            raise below.error("ARP needs IPv4 addresses and a link layer")
        if entry.destination in {"broadcast", "255.255.255.255"} or ipaddress.ip_address(to).is_multicast:
            raise below.below("list").error(f"'{held_back.list}' goes to more than one node")
    for position, loss in enumerate(scenario.capture_loss):
        below = place.below("capture_loss").below(position)
        if bool(loss.at) == bool(loss.probability):
            raise below.error("one of at and probability is needed")
        if not scenario.wild:
            raise below.error("what a capture lacks may be near other faults", "Set wild = true.")


def _check_nodes(scenario: Scenario, place: Place) -> None:
    names: set[str] = set()
    addresses: set[str] = set()
    for position, node in enumerate(scenario.node):
        below = place.below("node").below(position)
        try:
            address = ipaddress.ip_address(node.address)
        except ValueError:
            raise below.below("address").error(f"'{node.address[:60]}' is no IP address") from None
        if address.is_multicast or address.is_unspecified or node.address == "255.255.255.255":
            raise below.below("address").error("a node's address is that of one host")
        if address.version == 6 and address.scope_id:
            raise below.below("address").error("an address without a scope is expected")
        if node.name in names or node.name == "broadcast" or not node.name:
            raise below.below("name").error(f"the name '{node.name}' is taken or empty")
        if str(address) in addresses and not scenario.wild:
            raise below.below("address").error(
                f"{node.address} belongs to another node already",
                "Set wild = true for two nodes with one address: the truth about counters is then not exact.",
            )
        names.add(node.name)
        addresses.add(str(address))
        if node.mac and (len(node.mac.split(":")) != 6 or not _is_hex(node.mac.replace(":", ""), 12)):
            raise below.below("mac").error(f"'{node.mac[:60]}' is no hardware address such as 02:00:00:00:00:01")
        if node.first_value > node.last_value:
            raise below.below("first_value").error("the first value is above last_value")
        if node.carry_into_flags and node.last_value != U16_MAX:
            raise below.below("carry_into_flags").error("a 32-bit counter does not wrap at last_value")
        if len(node.vlan) > 2:
            raise below.below("vlan").error("more than two tags")


def _check_told_apart(scenario: Scenario, place: Place) -> None:
    """Raise ConfigurationError for lists that have the name of another one, or its index, port and sender."""
    named: dict[str, int] = {}
    sent: dict[tuple[int, int, str], int] = {}
    for position, entry in enumerate(scenario.list):
        below = place.below("list").below(position)
        first = named.setdefault(entry.name, position)
        same = [sent.setdefault((entry.port, entry.index, sender), position) for sender in entry.sender]
        if first != position:
            raise below.below("name").error(f"list[{first}] is called '{entry.name}' already")
        if (other := min(same, default=position)) != position:
            raise below.below("index").error(f"list[{other}] has the same index, port and sender")


def _check_list(scenario: Scenario, entry: ListPlan, place: Place) -> None:
    if bool(entry.data_bytes) == bool(entry.total_bytes):
        raise place.error("one of bytes and total_bytes is needed")
    if entry.items and len(entry.items) != len(entry.data_bytes):
        raise place.below("items").error(f"bytes has {len(entry.data_bytes)} telegrams, items {len(entry.items)}")
    if len(entry.checksum) not in {0, 1, len(entry.shapes)}:
        raise place.below("checksum").error("one value, or one for each telegram of the list")
    if len(entry.shapes) > MAX_TELEGRAMS_PER_LIST:
        raise place.error(f"the list has {len(entry.shapes)} telegrams, more than {MAX_TELEGRAMS_PER_LIST}")
    if not entry.interval_ns:
        raise place.below("interval").error("the interval must be more than 0")
    if entry.jitter_ns * 2 > entry.interval_ns:
        raise place.below("jitter").error("the jitter is more than half the interval")
    if entry.spacing_ns * (len(entry.shapes) - 1) * 2 > entry.interval_ns:
        raise place.below("spacing").error("the telegrams of one sending take more than half the interval")
    if not entry.sender or len(set(entry.sender)) != len(entry.sender):
        raise place.below("sender").error("no sender, or the same one twice")
    if entry.destination != "broadcast" and entry.destination not in scenario.node_numbers:
        try:
            ipaddress.ip_address(entry.destination)
        except ValueError:
            raise place.below("destination").error(
                f"'{entry.destination[:60]}' is neither an address nor a node",
                nearest(entry.destination, scenario.node_numbers),
            ) from None


def _check_names(scenario: Scenario, place: Place) -> None:
    """Raise ConfigurationError where a node or list is named that does not exist."""
    known: dict[str, dict[str, int]] = {"node": scenario.node_numbers, "list": scenario.list_numbers}
    known |= {"reader": known["node"], "host": known["node"]}
    for table, position, entry in scenario.rows():
        below = place.below(table).below(position)
        named = [(attribute, getattr(entry, attribute, "")) for attribute in known]
        if isinstance(entry, ListPlan):
            named += [("sender", name) for name in entry.sender]
        if isinstance(entry, Traffic | ParameterRequests | Page):
            named.append(("to", entry.to))
        for attribute, name in named:
            names = known.get(attribute, known["node"])
            if attribute == "list" and isinstance(entry, ON_CAN):
                names = scenario.can_numbers if isinstance(entry, WrongDlc) else names | scenario.can_numbers
            if attribute == "list" and name in scenario.can_numbers and name not in names:
                raise below.below(attribute).error(f"'{name}' is sent over CAN, where there is no such thing")
            if not isinstance(name, str):
                continue
            if name and name not in names:
                kind = "list" if attribute == "list" else "node"
                raise below.below(attribute).error(f"there is no {kind} '{name}'", nearest(name, names))
    versions = {node.name: ipaddress.ip_address(node.address).version for node in scenario.node}
    for position, one in enumerate(scenario.parameter):
        if len({versions[name] for name in (one.node, one.to, one.host) if name}) > 1:
            raise place.below("parameter").below(position).error("its nodes need the same version of IP")
    for position, page in enumerate(scenario.page):
        check_page(scenario, page, place.below("page").below(position))
    for position, plan in enumerate(scenario.list):
        below = place.below("list").below(position)
        target = (
            versions.get(plan.destination)
            if plan.destination in versions or plan.destination == "broadcast"
            else ipaddress.ip_address(plan.destination).version
        )
        people = [*plan.sender, *(s.node for s in scenario.second_sender if s.list == plan.name)]
        people += [reader.node for reader in scenario.reader if reader.list == plan.name]
        if len({versions[name] for name in people} | ({target} if target else set())) > 1:
            raise below.error("senders, readers and destination of a list need the same version of IP")


def _check_choice(fault: Selection, place: Place) -> None:
    if (len(fault.telegrams) > 0) + (fault.every > 0) + (fault.probability > 0) > 1:
        raise place.error("telegrams, every and probability exclude each other")
    if fault.telegrams and (fault.from_ns or fault.until_ns is not None):
        raise place.error("numbered telegrams need no times")


def _check_selection(scenario: Scenario, fault: Selection, place: Place) -> None:
    if isinstance(fault, Late) and fault.subindex is not None:
        raise place.below("subindex").error("a sending is late with all its telegrams")
    if isinstance(fault, Shape) and fault.items is None and fault.data_bytes is None:
        raise place.error("a changed shape needs items or bytes")
    owner = scenario.list[scenario.list_numbers[fault.list]]
    if fault.subindex is not None and fault.subindex >= len(owner.shapes):
        raise place.below("subindex").error(f"the list has {len(owner.shapes)} telegrams, 0 to {len(owner.shapes) - 1}")
    senders = {*owner.sender, *(entry.node for entry in scenario.second_sender if entry.list == owner.name)}
    if fault.node and fault.node not in senders:
        raise place.below("node").error(f"'{fault.node}' does not send this list", nearest(fault.node, sorted(senders)))
    if isinstance(fault, Late) and fault.by_ns >= owner.interval_ns:
        raise place.below("by").error("a sending cannot be late by an interval or more", "Use [[pause]] for that.")
    if isinstance(fault, WrongChecksum) and not owner.checksum:
        raise place.error("the list has no checksum that could be wrong")
    if isinstance(fault, Malformed) and fault.service not in {0, 5, 6}:
        raise place.below("service").error("telegrams of the Parameter Manager belong to no list", "Use 0, 5 or 6.")
    if isinstance(fault, Malformed) and fault.kind == "byte_swapped_length":
        for _, size in owner.shapes:
            if (20 + size) % 256 == (20 + size) // 256:
                raise place.below("kind").error(f"the Length {20 + size} stays the same when its bytes are swapped")


def _is_hex(text: str, length: int) -> bool:
    return len(text) == length and all(digit in "0123456789abcdefABCDEF" for digit in text)


def _has_ipv6(scenario: Scenario, traffic: Traffic) -> bool:
    numbers = scenario.node_numbers
    return any(":" in scenario.node[numbers[name]].address for name in (traffic.node, traffic.to))
