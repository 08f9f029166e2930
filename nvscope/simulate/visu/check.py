"""What a page of a scenario may not be: what contradicts itself, or the rest of the scenario."""

from __future__ import annotations

import ipaddress
import re

from nvscope.simulate.scenario import Scenario
from nvscope.simulate.visu.messages import spoken
from nvscope.simulate.visu.tables import LONGEST, Page
from nvscope.toml_table import Place

_WITH_REPLY = "late", "refused", "shortened", "lacking", "resent", "overtaken"
_MOST_VARIABLES = 1_000
_NAME = re.compile(r"[!#-%(-;=?-~]{1,40}", re.ASCII)
_LONGEST_HOLE_NS = 5_000_000_000


def check_page(scenario: Scenario, page: Page, place: Place) -> None:
    """Raise ConfigurationError where a page makes no sense. Its nodes are known to be there."""
    versions = {
        ipaddress.ip_address(scenario.node[scenario.node_numbers[name]].address).version
        for name in (page.node, page.to)
    }
    if page.node == page.to:
        raise place.below("to").error("a page asks another node")
    if len(versions) > 1:
        raise place.error("its nodes need the same version of IP")
    if not 0 < len(page.variables) <= _MOST_VARIABLES:
        raise place.below("variables").error(f"a page has 1 to {_MOST_VARIABLES} variables")
    for name in page.variables:
        if not 0 < len(name) <= LONGEST or not name.isprintable():
            raise place.below("variables").error(f"a variable has a name of 1 to {LONGEST} printable characters")
    _check_texts(page, place)
    if page.write and page.shortened:
        raise place.below("shortened").error("replies to writes have no values")
    for name in _WITH_REPLY:
        both = set(getattr(page, name)) & set(page.unanswered)
        if both:
            raise place.below(name).error(f"request {min(both)} has no reply: it stands in unanswered, too")
    if page.overtaken and page.resent_after_ns > _LONGEST_HOLE_NS:
        raise place.below("resent_after").error("who waits so long for a segment takes it for one that is missing")
    if not scenario.wild and (what := _meddling(scenario, page)):
        raise place.error(f"{what} takes parts of what a page says, or shows them twice", "Set wild = true.")


def _check_texts(page: Page, place: Place) -> None:
    """Raise ConfigurationError where a value cannot be said in the encoding of the page, or is parted by it."""
    for number, value in enumerate(page.values):
        own = place.below("values").below(number)
        try:
            is_parted = b"|" in spoken(page).encoded(value)
        except ValueError as error:
            raise own.error(str(error), "Say an encoding that has it: UTF-8.") from None
        if is_parted:
            raise own.error(f"in {page.encoding}, '{value}' has the byte of |, which parts values")
    if page.encoding is not None and not _NAME.fullmatch(page.encoding):
        raise place.below("encoding").error("a name has up to 40 printable characters of ASCII, and no quotes or < >")


def _meddling(scenario: Scenario, page: Page) -> str:
    """Return what else of the scenario changes what can be seen of a page; '' where nothing does."""
    away = {one.node for one in scenario.power_off} | {one.node for one in scenario.unplugged}
    if away & {page.node, page.to}:
        return "a node that is away"
    if scenario.snap_length:
        return "snap_length"
    if scenario.mirrored:
        return "a mirror port"
    return "a step of the clock" if page.overtaken and scenario.clock_step else ""
