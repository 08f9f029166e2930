from __future__ import annotations

import pytest

from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.kind import Severity

# Codes, names and severities are promised to scripts and baselines: this table may only grow.
PROMISED = """
NV101 short-telegram error
NV102 length-mismatch error
NV103 unknown-service warning
NV104 reserved-flags note
NV105 big-endian-header warning
NV106 ascii-identity warning
NV107 truncated-by-capture note
NV201 telegram-gap error
NV202 duplicate-telegram warning
NV203 overtaken-telegram warning
NV204 sender-restart warning
NV205 counter-unused note
NV206 counter-scope note
NV207 counter-erratic warning
NV301 no-acknowledgement error
NV302 negative-acknowledgement error
NV303 unexpected-acknowledgement note
NV304 boot-up-unanswered error
NV305 send-rejected error
NV401 several-senders error
NV402 shape-changed error
NV403 checksum-changed error
NV404 checksum-flag warning
NV405 definition-mismatch error
NV406 unknown-list note
NV407 silent-list warning
NV501 late warning
NV502 jitter warning
NV503 burst note
NV504 stopped error
NV505 torn-cycle warning
NV601 cob-id-overlap error
NV602 canopen-collision error
NV603 dlc-mismatch error
NV604 incomplete-cycle warning
NV605 bus-load warning
NV606 error-frames warning
NV701 sdo-timeout error
NV702 sdo-error-reply error
NV703 sdo-unexpected-reply warning
NV704 sdo-slow note
NV801 visu-write note
NV802 visu-error error
NV803 visu-password-in-clear warning
NV804 visu-count-mismatch warning
NV805 visu-slow note
NV806 visu-other-names warning
NV807 visu-unread-list warning
NV808 visu-not-captured warning
NV809 visu-unknown-encoding note
NV810 visu-disorder note
NV901 capture-drops warning
NV902 clock-step warning
NV903 truncated-file warning
NV904 unsupported-link-type warning
NV905 mirrored-twice warning
NV906 limit-reached warning
NV907 carrier-lost note
NV951 loss-told note
NV952 loss-not-told error
NV953 changes-missed error
NV954 counter-corrupt error
NV955 clock-set warning
NV956 mixed-time warning
NV957 document-style note
NV958 change-without-change note
NV959 series-broken error
NV961 unknown-writer error
NV962 write-not-allowed error
NV963 two-hardware-addresses error
NV964 counter-shared error
NV965 outside-subnet warning
NV966 scan warning
"""


def test_codes_names_and_severities_are_as_promised() -> None:
    assert [f"{kind.code} {kind.name} {kind.severity.word}" for kind in CATALOGUE.values()] == PROMISED.split("\n")[
        1:-1
    ]


def test_no_code_is_in_the_table_twice_under_another_name() -> None:
    assert all(code == kind.code for code, kind in CATALOGUE.items())
    assert len({kind.name for kind in CATALOGUE.values()}) == len(CATALOGUE)


@pytest.mark.parametrize("code", CATALOGUE)
def test_every_kind_says_what_it_means_why_it_happens_and_what_to_do(code: str) -> None:
    kind = CATALOGUE[code]
    assert kind.meaning.endswith(".")
    assert kind.causes
    assert all(not cause.endswith(".") for cause in kind.causes)
    assert kind.next_steps
    assert all(step[0].isupper() and step[-1] in ".?" for step in kind.next_steps)
    texts = (kind.meaning, *kind.causes, *kind.next_steps)
    assert all(text == " ".join(text.split()) and text.isprintable() for text in texts)
    assert len(set(texts)) == len(texts)


@pytest.mark.parametrize("code", CATALOGUE)
def test_kinds_refer_only_to_codes_that_exist(code: str) -> None:
    kind = CATALOGUE[code]
    words = " ".join((kind.meaning, *kind.causes, *kind.next_steps)).replace("(", " ").replace(")", " ").split()
    named = {word.strip(".,:;") for word in words if word.startswith("NV") and word[2:3].isdigit()}
    assert named <= CATALOGUE.keys()
    assert code not in named


def test_the_table_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        CATALOGUE["NV999"] = CATALOGUE["NV101"]  # type: ignore[index]
    with pytest.raises(AttributeError):
        CATALOGUE["NV101"].name = "other"  # type: ignore[misc]


def test_severities_are_ordered_and_have_words() -> None:
    assert Severity.ERROR > Severity.WARNING > Severity.NOTE
    assert [Severity.of(severity.word) for severity in Severity] == list(Severity)
    with pytest.raises(ValueError, match="'fatal'"):
        Severity.of("fatal")


@pytest.mark.parametrize("code", ["NV407", "NV501", "NV502", "NV503", "NV504", "NV601", "NV603", "NV604", "NV605"])
def test_what_may_come_on_can_does_not_speak_of_udp_alone(code: str) -> None:
    """There is neither Counter nor SubIndex there: what says something of these says what is so on CAN."""
    meaning = CATALOGUE[code].meaning
    if any(word in meaning for word in ("Counter", "SubIndex", "UDP", "broadcast", "header")):
        assert "CAN" in meaning
