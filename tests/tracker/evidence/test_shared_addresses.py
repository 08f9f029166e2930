"""What is kept of an IP address that several hardware addresses have, against a count of one frame after the other."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.evidence.shared_addresses import SharedAddresses
from tests.causes.plants import from_hardware
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, cut, observed

ALL, DATA, WRITE = "255.255.255.255", 0, 3


class Sent(NamedTuple):
    """A telegram by one of the devices, or one of the others; ``value`` is its data.

    ``asks`` is the partner that a request to write goes to, 0 of a telegram of a list.
    """

    device: int
    address: int
    asks: int
    subindex: int
    counter: int
    value: int


sent = st.lists(
    st.builds(
        Sent, st.sampled_from([1, 1, 2, 3]), st.sampled_from([1, 1, 2]), st.sampled_from([0, 0, 7, 8]),
        st.integers(0, 1), st.sampled_from([1, 2, 3, 255, 0]), st.integers(0, 1),
    ),
    max_size=40,
)  # fmt: skip


def frame(number: int, one: Sent) -> Frame:
    service = WRITE if one.asks else DATA
    payload = telegram(service, subindex=one.subindex, counter=one.counter, data=bytes([one.value, 0]))
    plain = data_frame(number * 1000, f"10.0.0.{one.address}", f"10.0.9.{one.asks}" if one.asks else ALL, payload)
    return from_hardware(plain, f"02:00:00:00:00:{one.device:02x}")


def is_counted(telegrams: list[Sent], number: int) -> bool:
    """Tell whether a telegram is of an address that several devices have had so far."""
    own = telegrams[number].address
    return len({one.device for one in telegrams[: number + 1] if one.address == own}) > 1


def counted(telegrams: list[Sent]) -> tuple[dict[Any, list[int]], dict[Any, list[int]]]:
    """Return steps and regular steps by (address, device, place), and telegrams and repeated ones of lists by device.

    A place is a SubIndex of a list, or of a partner; of all lists, and of all partners, it is None and whose it is.
    """
    first: dict[int, int] = {}
    shared: set[int] = set()
    last: dict[Any, int] = {}
    before: dict[Any, Sent] = {}
    steps: dict[Any, list[int]] = defaultdict(lambda: [0, 0])
    devices: dict[Any, list[int]] = defaultdict(lambda: [0, 0])
    for one in telegrams:
        if one.device != first.setdefault(one.address, one.device):
            shared.add(one.address)
        if one.address not in shared:
            continue
        known, place, every = (one.address, one.device), (one.asks, one.subindex), (bool(one.asks), None)
        again = (one.address, place) in before and before[one.address, place][4:] == one[4:]
        before[one.address, place] = one
        if not one.asks:
            devices[known][0] += 1
            devices[known][1] += again
        for key in ((*known, place), (*known, every), (one.address, 0, place), (one.address, 0, every)):
            if again:
                continue
            if key in last:
                steps[key][0] += 1
                steps[key][1] += one.counter == last[key] + 1 or (last[key], one.counter) == (255, 0)
            last[key] = one.counter
    return {key: value for key, value in steps.items() if value[0]}, dict(devices)


@given(sent, st.integers(1, 20))
@examples(120)
def test_it_is_what_is_counted_of_one_telegram_after_the_other(telegrams: list[Sent], packets: int) -> None:
    frames = [frame(number, one) for number, one in enumerate(telegrams)]
    shared = observed(SharedAddresses(), cut(batch_of(frames), packets) if frames else [])

    def address(number: int) -> int:
        return int(shared.addresses.low[number]) & 0xFF

    # Whoever is asked is told apart by the order in which it was asked first.
    from_shared = [one for number, one in enumerate(telegrams) if is_counted(telegrams, number)]
    partners = list(dict.fromkeys(one.asks for one in from_shared if one.asks))

    def place_of(word: int) -> tuple[int, int | None]:
        asks = word >> 62 & 1
        if word >> 63:
            return asks, None
        return partners[word >> 32 & 0xFFFF] if asks else 0, word & 0xFFFF

    steps = {}
    for row, (number, hardware, place) in enumerate(
        zip(*(one.tolist() for one in shared.sequences.words), strict=True)
    ):
        if shared.columns.steps[row]:
            key = address(number), hardware & 0xFF, place_of(place)
            steps[key] = [int(shared.columns.steps[row]), int(shared.columns.regular[row])]
    columns = shared.device_columns
    devices = {
        (address(number), hardware & 0xFF): [int(columns.telegrams[row]), int(columns.repeated[row])]
        for row, (number, hardware) in enumerate(zip(*(one.tolist() for one in shared.devices.words), strict=True))
    }
    assert (steps, devices) == counted(telegrams)
    assert not shared.left_out
