"""What a project says of web visualization: ports of web servers, and the names of variables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from nvscope.definition.project_nodes import by_address
from nvscope.errors import ConfigurationError
from nvscope.toml_table import TEXT, Place, ValueKind, array, integer, key

if TYPE_CHECKING:
    from nvscope.definition.visu_encoding import Encoding
    from nvscope.definition.visu_variables import VisuVariables

_U16_MAX = 0xFFFF
_FILES = array(TEXT, single=True)


def _encoding(value: Any, place: Place) -> Encoding:
    from nvscope.definition.visu_encoding import encoding_of  # noqa: PLC0415

    try:
        return encoding_of(str(TEXT.read(value, place)))
    except ValueError as error:
        raise place.error(str(error), "For example UTF-8, or windows-1251.") from None


ENCODING = ValueKind("encoding", _encoding)
"""How texts of pages are encoded, by the name of a charset."""


def _encodings(value: Any, place: Place) -> tuple[tuple[str, Encoding], ...]:
    return tuple(by_address(value, place, ENCODING.read, "controller", '"192.168.1.3" = "UTF-8"').items())


def _controllers(value: Any, place: Place) -> tuple[tuple[str, tuple[str, ...]], ...]:
    example = '"192.168.1.3" = ["press/plc_visu.xml"]'
    return tuple(by_address(value, place, _FILES.read, "controller", example).items())


@dataclass(frozen=True, slots=True)
class WebVisuSettings:
    """What ``[webvisu]`` says."""

    ports: tuple[int, ...] = key(
        array(integer(1, _U16_MAX), single=True), "TCP ports of web servers beside 80 and 8080", default=()
    )
    variables: tuple[str, ...] = key(
        _FILES,
        "files with the names of variables, relative to this file: plc_visu.xml, visu_ini.xml, *.SYM_XML; lists within "
        "a capture go before them",
        default=(),
    )
    controllers: tuple[tuple[str, tuple[str, ...]], ...] = key(
        ValueKind("table of arrays of text", _controllers),
        'the same of one controller alone, by its address: "192.168.1.3" = ["press/plc_visu.xml"]',
        default=(),
    )
    encoding: Encoding | None = key(  # noqa: RUF009  # a field, not a default
        ENCODING, 'how texts (STRING) are encoded, whatever pages say: "UTF-8", "windows-1251"; without it, as the '
        "page within a capture says (ENCODINGSTRING), else ISO-8859-1", default=None,
    )  # fmt: skip
    encodings: tuple[tuple[str, Encoding], ...] = key(
        ValueKind("table of encodings", _encodings),
        'the same of one controller alone, by its address: "192.168.1.3" = "UTF-8"', default=(),
    )  # fmt: skip


class GivenList(Struct, frozen=True):
    """A file with names of variables; ``controller`` is the address of whose they are, '' where it may be any."""

    file: str
    variables: VisuVariables
    controller: str = ""


class WebVisu(Struct, frozen=True):
    """The same, with the files read; ``encodings`` are those of texts by address, '' for all."""

    ports: tuple[int, ...] = ()
    lists: tuple[GivenList, ...] = ()
    encodings: Mapping[str, Encoding] = MappingProxyType({})

    def __bool__(self) -> bool:
        return bool(self.ports or self.lists or self.encodings)

    def encoding_of(self, controller: str) -> Encoding | None:
        """Return what is said of the texts of the controller at an address, None for nothing."""
        return self.encodings.get(controller, self.encodings.get(""))


def webvisu_of(told: WebVisuSettings, path: Path | None, place: Place) -> WebVisu:
    """Return what a project says; ConfigurationError, with the place, where a file cannot be read or lists nothing."""
    here = place.below("webvisu")
    named = [("", told.variables, here.below("variables"))]
    below = here.below("controllers")
    named += [(controller, files, below.below(f'"{controller}"')) for controller, files in told.controllers]
    lists = [one for controller, files, where in named for one in _lists(controller, files, path, where)]
    encodings = dict(told.encodings) if told.encoding is None else {"": told.encoding, **dict(told.encodings)}
    return WebVisu(told.ports, tuple(lists), encodings)


def _lists(controller: str, patterns: Sequence[str], path: Path | None, place: Place) -> Iterator[GivenList]:
    for file in _files(patterns, path, place):
        # Not before it is needed: few projects have any.
        from nvscope.definition.visu_variables import read_visu_variables  # noqa: PLC0415

        found = read_visu_variables(str(file))
        if not found.names:
            raise ConfigurationError(
                "the file lists no variables of a web visualization", where=str(file),
                next_step="Name the XML files that the controller has beside its pages: plc_visu.xml, visu_ini.xml.",
            )  # fmt: skip
        yield GivenList(str(file), found, controller)


def _files(patterns: Sequence[str], path: Path | None, place: Place) -> list[Path]:
    folder = path.parent if path else Path()
    found = []
    for number, pattern in enumerate(patterns):
        if any(sign in pattern for sign in "*?["):
            matches = sorted(folder.glob(pattern)) if not Path(pattern).is_absolute() else []
            if not matches:
                what = f"no file is called '{pattern[:100]}'"
                raise place.below(number).error(what, f"The pattern is relative to {folder}.")
            found += matches
        else:
            found.append(folder / pattern)
    return found
