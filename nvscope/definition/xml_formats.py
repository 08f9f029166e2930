"""Which of the XML formats a file is: its root element tells."""

from __future__ import annotations

from collections.abc import Callable

from nvscope.definition.gvl import read_gvl
from nvscope.definition.plcopen import read_plcopen
from nvscope.definition.source import Source
from nvscope.definition.syntax import FileSyntax
from nvscope.definition.twincat import read_twincat
from nvscope.definition.xml_tree import Element, read_xml

_FORMATS: dict[str, Callable[[Element], FileSyntax]] = {
    "GVL": read_gvl,
    "TcPlcObject": read_twincat,
    "project": read_plcopen,
}


def read_xml_format(source: Source) -> FileSyntax:
    """Return what an XML file declares; ConfigurationError where it is of no known format."""
    root = read_xml(source)
    read = _FORMATS.get(root.tag)
    if read is None:
        next_step = "Known are GVL (.gvl), TcPlcObject (.TcGVL, .TcDUT) and project (PLCopen XML)."
        raise root.error(f"no format of definitions has the root element {root.tag[:60]!r}", next_step)
    return read(root)
