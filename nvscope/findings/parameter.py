"""NV7xx: the Parameter Manager's requests and replies. Nothing judges them yet."""

from __future__ import annotations

from nvscope.findings.kind import FindingKind, Severity

SDO_TIMEOUT = FindingKind(
    "NV701",
    "sdo-timeout",
    Severity.ERROR,
    meaning="A Parameter Manager request was not answered within the timeout (500 ms unless the caller chose another).",
    causes=(
        "the partner is off, stopped, or has no network variables support in its target settings",
        "a wrong partner address or port in the call",
        "a firewall, or a capture point that sees only one direction",
    ),
    next_steps=(
        "Check whether the partner sends anything at all in this capture.",
        "Check the address given to the function block, and that both sides use the same port.",
    ),
    judged=False,
)
SDO_ERROR_REPLY = FindingKind(
    "NV702",
    "sdo-error-reply",
    Severity.ERROR,
    meaning="The partner answered a Parameter Manager request with an error; the service of the reply says which.",
    causes=(
        "ODErrorReplyIdx: the partner has no such index",
        "ODErrorReplyLen or ODErrorReplyItems: size or number of elements differ from the partner's entry",
        "ODErrorReplyAccess: the entry cannot be read, or not be written",
        "ODErrorReplyCPUStopped: the partner's program does not run",
    ),
    next_steps=("Compare index, subindex, length and items of the request with the partner's parameter list.",),
    judged=False,
)
SDO_UNEXPECTED_REPLY = FindingKind(
    "NV703",
    "sdo-unexpected-reply",
    Severity.WARNING,
    meaning="A Parameter Manager reply was seen that belongs to no open request.",
    causes=(
        "the request is missing in the capture",
        "a reply that came after the timeout: the caller has given up, and may have asked again",
        "two callers that use the same address",
    ),
    next_steps=("Look for late replies (NV704), and check that the capture holds both directions.",),
    judged=False,
)
SDO_SLOW = FindingKind(
    "NV704",
    "sdo-slow",
    Severity.NOTE,
    meaning="Parameter Manager replies took a large part of the timeout.",
    causes=(
        "a long task cycle in the partner: requests are answered once per cycle",
        "many requests at the same time",
    ),
    next_steps=("Compare with the partner's task cycle; lengthen the timeout, or ask less often.",),
    judged=False,
)
