"""Where a page is, as people write it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.errors import UsageError
from nvscope.plc.visu.url import VisuUrl, beside, visu_url
from tests.laws import examples


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("192.168.1.3", VisuUrl("192.168.1.3", 80)),
        ("192.168.1.3:8080", VisuUrl("192.168.1.3", 8080)),
        ("http://192.168.1.3/", VisuUrl("192.168.1.3", 80)),
        ("HTTP://192.168.1.3/PLC/webvisu.htm", VisuUrl("192.168.1.3", 80, "/PLC/webvisu.htm")),
        ("192.168.1.3/webvisu/", VisuUrl("192.168.1.3", 80, "/webvisu/webvisu.htm")),
        ("press", VisuUrl("press", 80)),
        ("::1", VisuUrl("::1", 80)),
        ("[::1]:8080", VisuUrl("::1", 8080)),
        ("http://press/ä.htm", VisuUrl("press", 80, "/%C3%A4.htm")),
    ],
)
def test_what_is_meant(text: str, url: VisuUrl) -> None:
    assert visu_url(text) == url


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("https://192.168.1.3/", "this is TLS"), ("192.168.1.3:443", "this is TLS"),
        ("ftp://192.168.1.3", "expected http"),
        ("", "no address and port"), ("http://", "no address and port"), ("http://x:99999/", "no address and port"),
        ("http://x:0/", "no address and port"), ("http://[::1", "no address and port"), ("http://u:p@x/", "a user"),
        ("http://x/a?b=c", "a query"), ("http://x/a b", "no URL"), ("http://x/\r\nEvil: 1", "no URL"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_told(text: str, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        visu_url(text)


@given(st.text(max_size=40) | st.text("htps:/[]@?#.1%", max_size=30))
@examples(300)
def test_every_text_is_a_url_or_a_mistake(text: str) -> None:
    try:
        found = visu_url(text)
    except UsageError:
        return
    assert found.text().isascii() or not found.host.isascii()
    assert not any(one.isspace() for one in found.path)


def test_lists_lie_beside_the_page() -> None:
    assert beside("/plc/webvisu.htm", "plc_visu.xml") == "/plc/plc_visu.xml"
    assert beside("/webvisu.htm", "a b.xml") == "/a%20b.xml"


@pytest.mark.parametrize(
    "text", ["http://u:geheim@x/", "u:geheim@x", "https://u:geheim@x/", "ftp://u:geheim@x/", "http://u:geheim@x:0/",
             "http://u:geheim@x/a b", "http://u@geheim@x/?q=1"],
)  # fmt: skip
def test_no_message_repeats_a_password(text: str) -> None:
    with pytest.raises(UsageError) as raised:
        visu_url(text)
    assert "geheim" not in str(raised.value)
    assert "(hidden)@x" in str(raised.value)
