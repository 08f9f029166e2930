"""What is found about security in frames that are written down, or simulated, with what a project file says."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from nvscope.analysis.inquiry import Analysis, Inquiry
from nvscope.definition.project_file import read_project
from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.finding import Finding
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap

OF_SECURITY = {code for code, kind in CATALOGUE.items() if kind.of_security}


def analysed(frames: Sequence[Frame], directory: Path, project: str = "") -> Analysis:
    """Return what is known of frames, which are written to a directory in the order of time, by a project file."""
    capture, file = directory / "frames.pcap", directory / "nvscope.toml"
    write_pcap(sorted(frames, key=lambda one: one.ts_ns), capture)
    file.write_text(project, "utf-8")
    return Inquiry([str(capture)], read_project(file)).analyze()


def found_in(frames: Sequence[Frame], directory: Path, project: str = "") -> list[Finding]:
    """Return the findings about security."""
    return [one for one in analysed(frames, directory, project).findings if one.code in OF_SECURITY]


def told_in(frames: Sequence[Frame], directory: Path, project: str = "") -> list[tuple[str, str, int]]:
    """Return codes, messages and counts of the findings about security."""
    return [(one.code, one.message, one.count) for one in found_in(frames, directory, project)]
