r"""Whatever stands in files and on the wire is escaped once, in all that any verb writes: never not, never twice.

Names and values hold a backslash, an ANSI escape, C1 controls, a mark that turns the direction of text, a line feed
and what means something in HTML and Markdown. Between them stands q: every backslash behind a q tells how often
what was there is escaped.
"""

from __future__ import annotations

import json
import re
import shutil
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import pytest

from nvscope import open as nvscope_open
from nvscope.errors import NvscopeError
from tests.capture import build
from tests.cli.test_export import nvscope
from tests.export.given import defined, numbered, written
from tests.laws import some

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="names of files that Windows does not allow")

ONE_LINE = "q\\q\x1b]q\x85q\x9bq<b>|`q\u202eq\u200bq"
EVIL = f"{ONE_LINE}\nq"
SHOWN = "q\\\\q\\x1b]q\\x85q\\x9bq<b>|`q\\u202eq\\u200bq"
NARROW = EVIL.encode("latin-1", "ignore")


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with captures, definitions, a project and a scenario, in all of whose names and texts is EVIL."""
    folder = tmp_path_factory.mktemp("evil") / f"d{EVIL}"
    folder.mkdir()
    defined(
        folder, "axis", "s : STRING(40);\n\tw : WSTRING(40);\n\tn : INT; // " + escape(ONE_LINE.replace("\x1b", ""))
    )  # which no XML holds
    (folder / "axis.gvl").rename(folder / f"axis{EVIL}.gvl")
    defined(folder, "other", "n : INT; // " + escape(ONE_LINE.replace("\x1b", "")))
    wide = EVIL.encode("utf-16-le").ljust(82, b"\0")
    rows = [NARROW.ljust(41, b"\0") + wide + struct.pack("<h", number) for number in range(9)]
    written(folder, numbered(rows, 3))
    (folder / "in.pcap").rename(folder / f"in{EVIL}.pcap")
    raw = (folder / f"in{EVIL}.pcap").read_bytes()
    packets = build.section("<", build.option("<", 1, EVIL.encode())) + build.interface(
        "<", options=build.option("<", 2, f"can{EVIL}".encode())
    )
    comment = build.option("<", 1, EVIL.encode())
    (folder / "notes.pcapng").write_bytes(packets + build.enhanced("<", 10**15, raw[40:140], options=comment))
    (folder / "broken.gvl").write_text(
        f"<GVL><Declarations>VAR_GLOBAL {escape(EVIL)} : INT; END_VAR</Declarations></GVL>"
    )
    (folder / "can.log").write_text(f"(1.0) can{ONE_LINE} 123#0102\n(2.0) can{ONE_LINE} {ONE_LINE}\n(3.0) can0 124#\n")
    name = json.dumps(EVIL)
    (folder / "nvscope.toml").write_text(
        f'definitions = ["a*.gvl"]\n[nodes]\n"192.168.1.10" = {{ name = {name} }}\n[lists.7]\nname = {name}\n'
    )
    (folder / "bad.toml").write_text(f"[lists.7]\n{name} = 3\n")
    shutil.copy(Path(__file__).parents[1] / "scenarios" / "loss.toml", folder / f"s{EVIL}.toml")
    return folder


CAPTURE, GVL = f"in{EVIL}.pcap", f"axis{EVIL}.gvl"
TEXTS: list[tuple[str, ...]] = [
    ("report", CAPTURE),
    ("report", CAPTURE, "--md"),
    ("report", CAPTURE, "-v"),
    ("report", "notes.pcapng"),
    ("report", "can.log"),
    ("report", "can.log", "--md"),
    ("report", f"no{EVIL}.pcap"),
    ("report", CAPTURE, "--project", "bad.toml"),
    ("report", CAPTURE, "--project", f"no{EVIL}.toml"),
    ("report", CAPTURE, "--list", EVIL),
    ("report", CAPTURE, "--channel-map", f"{EVIL}={EVIL}"),
    ("report", CAPTURE, "-d", EVIL),
    ("report", CAPTURE, "--from-time", EVIL),
    ("report", CAPTURE, f"--{EVIL}"),
    ("packets", CAPTURE),
    ("packets", CAPTURE, "-V"),
    ("packets", CAPTURE, "-x"),
    ("packets", CAPTURE, "-Y", f'var.s == "{EVIL}'),
    ("packets", CAPTURE, "-Y", EVIL),
    ("packets", CAPTURE, "-Y", 'var.s == "nothing"'),
    ("packets", CAPTURE, "-e", "var.s", "-e", "var.w", "-e", "frame.number"),
    ("packets", CAPTURE, "-e", EVIL),
    ("packets", CAPTURE, "-e", "var.s", "-T", "csv"),
    ("packets", CAPTURE, "-e", "var.s", "-T", "fields", "-E", f"separator={EVIL}"),
    ("packets", "can.log", "-V"),
    ("packets", "notes.pcapng", "-V"),
    ("vars", CAPTURE),
    ("vars", CAPTURE, "--at", "2s"),
    ("vars", CAPTURE, "--at", EVIL),
    ("vars", CAPTURE, "--history", "*"),
    ("vars", CAPTURE, "--history", EVIL),
    ("vars", CAPTURE, "--infer"),
    ("vars", CAPTURE, "--list", EVIL),
    ("export", CAPTURE, "-w", "-"),
    ("export", CAPTURE, "--form", "long", "-w", "-"),
    ("export", CAPTURE, "-w", f"o{EVIL}.{EVIL}"),
    ("export", CAPTURE, "-w", f"o{EVIL}/x.csv"),
    ("export", CAPTURE, "--list", EVIL, "-w", "-"),
    ("export", CAPTURE, "-e", "var.s", "-e", "var.w", "-w", "-"),
    ("gvl", "layout", GVL),
    ("gvl", "lint", GVL),
    ("gvl", "lint", "broken.gvl"),
    ("gvl", "diff", GVL, "broken.gvl"),
    ("gvl", "diff", GVL, "other.gvl"),
    ("gvl", "layout", f"no{EVIL}.gvl"),
    ("explain", EVIL),
    ("keys", EVIL),
    ("keys", "--fields", "--gvl", GVL),
    ("schema", EVIL),
    (EVIL,),
    (EVIL, EVIL),
    ("help", EVIL),
    ("simulate", f"s{EVIL}.toml", "-w", f"made{EVIL}.pcap", "--force"),
    ("simulate", f"s{EVIL}.toml", "-w", f"made.{EVIL}"),
    ("simulate", "bad.toml", "-w", "made.pcap"),
]  # fmt: skip
JSONS: list[tuple[str, ...]] = [
    ("report", CAPTURE, "--json"),
    ("report", "can.log", "--json"),
    ("report", "notes.pcapng", "--json"),
    ("packets", CAPTURE, "-T", "json", "-e", "var.s", "-e", "var.w"),
    ("packets", "can.log", "-T", "json", "-e", "can.channel"),
    ("export", "can.log", "-e", "can.channel", "-w", "-.ndjson"),
    ("packets", CAPTURE, "-T", "ndjson", "-e", "var.s", "-e", "var.w"),
    ("vars", CAPTURE, "--json"),
    ("vars", CAPTURE, "--at", "2s", "--json"),
    ("vars", CAPTURE, "--history", "*", "--json"),
    ("vars", CAPTURE, "--infer", "--json"),
    ("export", CAPTURE, "-w", "-.ndjson"),
    ("export", CAPTURE, "--form", "long", "-w", "-.ndjson"),
    ("export", CAPTURE, "-e", "var.s", "-e", "var.w", "-w", "-.ndjson"),
    ("gvl", "layout", GVL, "--json"),
    ("gvl", "lint", GVL, "--json"),
    ("gvl", "diff", GVL, "other.gvl", "--json"),
    ("keys", "--fields", "--gvl", GVL, "--json"),
    ("simulate", f"s{EVIL}.toml", "-w", "made.pcap", "--truth", "-", "--force"),
]


def named(words: tuple[str, ...]) -> str:
    return ascii(" ".join(words).replace(EVIL, "!"))


def raw_in(text: str) -> list[str]:
    return [character for character in text if not character.isprintable() and character not in "\n\t"]


def wrongly_escaped(text: str, *, is_markdown: bool) -> list[str]:
    """Return what of EVIL is not escaped, or more than once; Markdown has a backslash of its own before each.

    Dumps and what carets point at have one character for one: of them, that nothing is raw is all.
    """
    text = re.sub(r"^ +[0-9a-f]{4}  (?:[0-9a-f]{2} )+.*$|^.*\n +\^+$", "", text, flags=re.MULTILINE)
    if is_markdown:
        plain = re.sub(r"``.*?``|`[^`\n]*`", "", text)  # code needs no escape
        return re.findall(r"(?<!\\)(?:\\\\)*<b>", plain) + re.findall(r"q\\{5,}.{0,4}", text)
    once = r"\\\\(?=q|…|$)|\\(?=n|x(?:0a|1b|85|9b)|u20|$)"
    return [found[0] for found in re.finditer(rf"q(?!{once})\\.{{0,5}}", text, re.MULTILINE)]


@pytest.mark.parametrize("words", some(TEXTS), ids=named)
def test_text_is_escaped_once(plant: Path, words: tuple[str, ...]) -> None:
    done = nvscope(*words, cwd=plant)
    assert done.returncode not in (1, 70) or words[0] == "gvl", done.stderr
    for text, is_markdown in ((done.stdout, "--md" in words), (done.stderr, False)):
        assert not raw_in(text), ascii(text)
        assert not (wrong := wrongly_escaped(text, is_markdown=is_markdown)), f"{wrong}\n{text}"


@pytest.mark.parametrize(
    "words",
    [
        ("packets", CAPTURE, "-e", "var.s"),
        ("packets", CAPTURE, "-e", "var.s", "-T", "csv"),
        ("packets", "can.log", "-e", "can.channel"),
        ("packets", "can.log", "-e", "can.channel", "-T", "csv"),
        ("export", CAPTURE, "-w", "-"),
        ("vars", CAPTURE, "--list", EVIL),
        ("report", f"no{EVIL}.pcap"),
        ("keys", EVIL),
        ("explain", EVIL),
    ],
    ids=named,
)
def test_what_is_escaped_is_there(plant: Path, words: tuple[str, ...]) -> None:
    done = nvscope(*words, cwd=plant)
    narrow = SHOWN.replace("\\u202e", "").replace("\\u200b", "")
    shown = done.stdout + done.stderr
    assert SHOWN in shown or narrow.removesuffix("q") in shown or SHOWN.replace("\\\\", "\\") in shown, shown


def test_warnings_and_errors_of_notebooks_are_escaped_once(plant: Path) -> None:
    cut = plant / f"cut{EVIL}.pcap"
    cut.write_bytes((plant / CAPTURE).read_bytes()[:-7])
    with pytest.warns(UserWarning, match="q") as warned:
        len(nvscope_open(cut, definitions=[plant / "broken.gvl", plant / GVL]).lists)
    with pytest.raises(NvscopeError) as refused:
        nvscope_open(plant / f"no{EVIL}.pcap")
    told = [str(one.message) for one in warned]
    assert len(told) > 1
    for text in (*told, str(refused.value)):
        assert "q\\x1b]q" in text
        assert not raw_in(text), ascii(text)
    assert not [wrong for text in told if (wrong := wrongly_escaped(text, is_markdown=False))]


@pytest.mark.parametrize("words", JSONS, ids=named)
def test_json_is_printable_ascii_and_its_texts_are_as_they_were(plant: Path, words: tuple[str, ...]) -> None:
    done = nvscope(*words, cwd=plant)
    assert done.returncode in (0, 3) or words[0] == "gvl", done.stderr
    assert done.stdout
    assert done.stdout.replace("\n", "").isprintable()
    assert done.stdout.isascii()
    assert not raw_in(done.stderr), ascii(done.stderr)
    try:
        documents = [json.loads(done.stdout)]
    except ValueError:
        documents = [json.loads(line) for line in done.stdout.splitlines()]
    for text in texts_of(documents):
        assert "q\\\\" not in text, ascii(text)
        assert "\\x1b" not in text, ascii(text)


def texts_of(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from texts_of(list(value.items()))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from texts_of(item)
