"""What a project says of web visualization: ports of web servers, and the names of variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dissectors.webvisu import Place as Where
from nvscope.errors import ConfigurationError
from nvscope.toml_table import TEXT, Place, array, integer, key

_U16_MAX = 0xFFFF


@dataclass(frozen=True, slots=True)
class WebVisuSettings:
    """What ``[webvisu]`` says."""

    ports: tuple[int, ...] = key(
        array(integer(1, _U16_MAX), single=True), "TCP ports of web servers beside 80 and 8080", default=()
    )
    variables: tuple[str, ...] = key(
        array(TEXT, single=True),
        "files with the names of variables, relative to this file: plc_visu.xml, visu_ini.xml, *.SYM_XML; lists within "
        "a capture go before them",
        default=(),
    )


@dataclass(frozen=True, slots=True)
class WebVisu:
    """The same, with the files read: ``names`` are those of variables by where they lie."""

    ports: tuple[int, ...] = ()
    names: Mapping[Where, str] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.ports or self.names)


def webvisu_of(told: WebVisuSettings, path: Path | None, place: Place) -> WebVisu:
    """Return what a project says; ConfigurationError, with the place, where a file cannot be read or lists nothing."""
    names: dict[Where, str] = {}
    for file in _files(told.variables, path, place):
        # Not before it is needed: few projects have any.
        from nvscope.definition.visu_variables import read_visu_variables  # noqa: PLC0415

        found = read_visu_variables(str(file))
        if not found.names:
            raise ConfigurationError(
                "the file lists no variables of a web visualization", where=str(file),
                next_step="Name the XML files that the controller has beside its pages: plc_visu.xml, visu_ini.xml.",
            )  # fmt: skip
        names |= found.names
    return WebVisu(told.ports, names)


def _files(patterns: Sequence[str], path: Path | None, place: Place) -> list[Path]:
    folder = path.parent if path else Path()
    found = []
    for number, pattern in enumerate(patterns):
        if any(sign in pattern for sign in "*?["):
            matches = sorted(folder.glob(pattern)) if not Path(pattern).is_absolute() else []
            if not matches:
                here = place.below("webvisu").below(f"variables[{number}]")
                raise here.error(f"no file is called '{pattern[:100]}'", f"The pattern is relative to {folder}.")
            found += matches
        else:
            found.append(folder / pattern)
    return found
