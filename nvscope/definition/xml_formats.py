"""Which of the XML formats a file is: its root element tells."""

from __future__ import annotations

import re
from collections.abc import Callable

from nvscope.definition.gvl import read_gvl
from nvscope.definition.plcopen import read_plcopen
from nvscope.definition.source import DefinitionError, NoDefinition, Source
from nvscope.definition.syntax import FileSyntax
from nvscope.definition.twincat import read_twincat
from nvscope.definition.xml_tree import Element, read_xml

_FORMATS: dict[str, Callable[[Element], FileSyntax]] = {
    "GVL": read_gvl,
    "TcPlcObject": read_twincat,
    "project": read_plcopen,
}
_FIRST_ELEMENT = re.compile(r"<(?:\w+:)?([^\W\d][\w.-]*+)")


def read_xml_format(source: Source) -> FileSyntax:
    """Return what an XML file declares; NoDefinition where it is of no known format."""
    try:
        root = read_xml(source)
    except DefinitionError as error:
        first = _FIRST_ELEMENT.search(source.text)
        if first is None or first[1] not in _FORMATS:
            raise NoDefinition(error.what, error.position, error.next_step) from None
        raise
    read = _FORMATS.get(root.tag)
    if read is None:
        next_step = "Known are GVL (.gvl), TcPlcObject (.TcGVL, .TcDUT) and project (PLCopen XML)."
        what = f"no format of definitions has the root element '{root.tag[:60]}'"
        raise NoDefinition(what, source.position(root.start), next_step)
    return read(root)
